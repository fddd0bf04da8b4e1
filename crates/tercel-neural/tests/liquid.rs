//! Liquid Kalman filters: what their networks see and say, alone and together.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Matrix4, Vector2, Vector4};
use tercel_core::belief::Gaussian;
use tercel_core::filter::{Extended, Filter, Particle};
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{Clutter, Detection, Phd, PhdConfig, Scan, Status, Tracker};
use tercel_core::sensor::{Measurement, Position};
use tercel_neural::filter::{
    Absolute, Derivative, Form, LiquidBelief, LiquidHyper, LiquidKalman, LiquidMotion, LiquidNetwork,
    Residual, surprise, widths,
};
use tercel_neural::layer::CellShape;
use tercel_neural::{Model, ModelError, Tensor};
use untrained::{CELLS, liquid, paper_liquid, small_liquid};

fn filter(hyper: &LiquidHyper, size: f32) -> LiquidKalman<Position<2>> {
    LiquidKalman::new(liquid(hyper, size), Position::new(5.0).unwrap())
}

/// An object that turns, turned and moved itself, with errors that turn with it; every fifth measurement is missing.
fn seen(step: u32, angle: f64, origin: Vector2<f64>) -> Option<Measurement<2>> {
    let phase = 0.08 * f64::from(step);
    let error = f64::from(step * 7 % 11) - 5.0;
    let place = Vector2::new(150.0 * phase.sin() + error, 150.0 - 150.0 * phase.cos() - 0.5 * error);
    let place = origin + nalgebra::Rotation2::new(angle) * place;
    (step % 5 != 4).then(|| [place.x, place.y].into())
}

/// The belief after some steps.
fn tracked<F: Filter<4, Measurement = Measurement<2>>>(filter: &F, steps: u32, angle: f64) -> F::Belief {
    let mut belief = filter.birth(&seen(0, angle, Vector2::zeros()).unwrap()).unwrap();
    for step in 1..=steps {
        filter.predict(&mut belief, 1.0);
        seen(step, angle, Vector2::zeros()).map(|seen| filter.update(&mut belief, &seen).unwrap());
    }
    belief
}

fn forms() -> Vec<LiquidHyper> {
    let plain = |cell| {
        let form = Residual { heading: false, learned_noise: false, ..Residual::default() };
        LiquidHyper { form: Form::Residual(form), ..small_liquid(cell) }
    };
    CELLS.into_iter().flat_map(|cell| [small_liquid(cell), plain(cell)]).collect()
}

#[test]
fn a_network_that_gives_zero_is_the_kalman_filter_at_all_times() {
    for hyper in forms() {
        let Form::Residual(form) = hyper.form else { continue };
        let ours = filter(&hyper, 0.0);
        let motion = ConstantVelocity::new(form.noise * form.noise / hyper.interval).with_speed(hyper.speed);
        let theirs = Extended::new(motion, Position::new(5.0).unwrap());
        let first = seen(0, 0.0, Vector2::zeros()).unwrap();
        let (mut belief, mut state): (_, Gaussian<4>) =
            (ours.birth(&first).unwrap(), theirs.birth(&first).unwrap());
        for step in 1..60 {
            let dt = [1.0, 0.25, 3.0, 0.0][step as usize % 4];
            ours.predict(&mut belief, dt);
            theirs.predict(&mut state, dt);
            if let Some(seen) = seen(step, 0.0, Vector2::zeros()) {
                ours.update(&mut belief, &seen).unwrap();
                theirs.update(&mut state, &seen).unwrap();
            }
            let found = ours.state(&belief);
            assert!((found.mean - state.mean).norm() < 1e-6, "{hyper:?}, step {step}");
            assert!((found.covariance - state.covariance).norm() < 1e-6 * state.covariance.norm());
        }
    }
}

/// The slope of the predicted mean, by central differences of predictions.
fn slope(filter: &LiquidKalman<Position<2>>, belief: &LiquidBelief, by: f64) -> Matrix4<f64> {
    let state = filter.state(belief);
    let mut jacobian = Matrix4::zeros();
    for component in 0..4 {
        let moved = |by: f64| {
            let mut belief = belief.clone();
            let mut mean = state.mean;
            mean[component] += by;
            filter.set_state(&mut belief, &Gaussian { mean, ..state });
            filter.predict(&mut belief, 1.0);
            filter.state(&belief).mean
        };
        jacobian.set_column(component, &((moved(by) - moved(-by)) / (2.0 * by)));
    }
    jacobian
}

/// The Jacobian with which the covariance was predicted, from that of a belief without and with doubt in one component.
fn used(filter: &LiquidKalman<Position<2>>, belief: &LiquidBelief) -> Matrix4<f64> {
    let mean = filter.state(belief).mean;
    let predicted = |covariance: Matrix4<f64>| {
        let mut belief = belief.clone();
        filter.set_state(&mut belief, &Gaussian { mean, covariance });
        filter.predict(&mut belief, 1.0);
        filter.state(&belief).covariance
    };
    // (J e)(J f)ᵀ + (J f)(J e)ᵀ is linear in the covariance; with f = x, of which J is known, J e can be read off.
    let none = predicted(Matrix4::identity());
    let x = Vector4::x();
    let mut jacobian = Matrix4::zeros();
    for component in 0..4 {
        let e = Vector4::ith(component, 1.0);
        let more = predicted(Matrix4::identity() + 0.4 * (e * x.transpose() + x * e.transpose())) - none;
        let mut column = more.column(0) / 0.4;
        column[0] /= 2.0;
        jacobian.set_column(component, &column);
    }
    jacobian
}

#[test]
fn the_covariance_is_predicted_with_the_slope_of_the_mean() {
    let different = forms().into_iter().map(|hyper| {
        let jacobian = Derivative::Difference { step: 0.02 };
        (LiquidHyper { jacobian, ..hyper }, 2e-2)
    });
    for (hyper, tolerance) in forms().into_iter().map(|hyper| (hyper, 5e-3)).chain(different) {
        let belief = tracked(&filter(&hyper, 2.5), 13, 0.7);
        // The same network with a louder voice.
        let mut louder = hyper.clone();
        if let Form::Residual(form) = &mut louder.form {
            form.acceleration = 200.0;
        }
        let filter = filter(&louder, 2.5);
        let (slope, used) = (slope(&filter, &belief, 0.05), used(&filter, &belief));
        let straight = Matrix4::from_fn(|i, j| f64::from(u8::from(i == j || j == i + 2)));
        assert!((slope - straight).norm() > 1e-2, "{hyper:?}: the network has a say");
        let off = (slope - used).norm();
        assert!(off < tolerance * (1.0 + (slope - straight).norm()), "{hyper:?}: {slope} {used}");
    }
}

#[test]
fn predictions_are_the_same_everywhere_and_in_all_directions() {
    for hyper in forms() {
        let Form::Residual(form) = hyper.form else { continue };
        let filter = filter(&hyper, 2.0);
        let run = |angle: f64, origin: Vector2<f64>| {
            let mut belief = filter.birth(&seen(0, angle, origin).unwrap()).unwrap();
            for step in 1..40 {
                filter.predict(&mut belief, 1.0);
                seen(step, angle, origin).map(|seen| filter.update(&mut belief, &seen).unwrap());
            }
            filter.state(&belief)
        };
        let here = run(0.0, Vector2::zeros());
        let far = Vector2::new(8e3, -6e3);
        let there = run(0.0, far);
        assert!((there.mean.xy() - far - here.mean.xy()).norm() < 1e-2, "{hyper:?}");
        assert!((there.covariance - here.covariance).norm() < 1e-3 * here.covariance.norm());
        let turn = nalgebra::Rotation2::new(1.1);
        let turned = (run(1.1, Vector2::zeros()).mean.xy() - turn * here.mean.xy()).norm();
        assert_eq!(turned < 1e-2, form.heading, "{hyper:?}: {turned}");
    }
}

#[test]
fn together_objects_are_predicted_as_alone() {
    for hyper in forms().into_iter().chain([paper_liquid()]) {
        let filter = filter(&hyper, 2.0);
        // Old and young ones.
        let mut alone: Vec<_> =
            [9, 0, 20, 1, 2, 14].iter().map(|steps| tracked(&filter, *steps, f64::from(*steps))).collect();
        let mut together = alone.clone();
        for _ in 0..4 {
            alone.iter_mut().for_each(|belief| filter.predict(belief, 0.8));
            filter.predict_all(&mut together.iter_mut().collect::<Vec<_>>(), 0.8);
            assert_eq!(alone, together, "{hyper:?}");
        }
        filter.predict_all(&mut [], 1.0);
    }
}

#[test]
fn the_first_steps_are_straight_and_leave_no_memory() {
    let hyper = LiquidHyper { warm_up: 3, ..small_liquid(CELLS[0]) };
    let (filter, zero) = (filter(&hyper, 3.0), filter(&hyper, 0.0));
    for steps in 0..=3 {
        assert_eq!(filter.state(&tracked(&filter, steps, 0.3)), zero.state(&tracked(&zero, steps, 0.3)));
        assert!(tracked(&filter, steps, 0.3).memory().iter().all(|value| *value == 0.0));
    }
    assert_ne!(filter.state(&tracked(&filter, 4, 0.3)), zero.state(&tracked(&zero, 4, 0.3)));
    assert!(tracked(&filter, 4, 0.3).memory().iter().any(|value| *value != 0.0));
}

#[test]
fn a_correction_is_seen_and_its_absence_too() {
    let filter = filter(&small_liquid(CELLS[4]), 2.0);
    let belief = tracked(&filter, 10, 0.0);
    let state = filter.state(&belief);
    let predicted = |change: &dyn Fn(&mut LiquidBelief)| {
        let mut belief = belief.clone();
        filter.predict(&mut belief, 1.0);
        change(&mut belief);
        filter.set_state(&mut belief, &state);
        filter.predict(&mut belief, 1.0);
        filter.state(&belief).mean
    };
    let update = |place: [f64; 2]| {
        let filter = &filter;
        move |belief: &mut LiquidBelief| assert!(filter.update(belief, &place.into()).is_ok())
    };
    let missing = predicted(&|_| ());
    let one = predicted(&update([state.mean[0], state.mean[1]]));
    let other = predicted(&update([state.mean[0] + 30.0, state.mean[1]]));
    assert!((missing - one).norm() > 1e-4 && (one - other).norm() > 1e-4);
}

#[test]
fn merging_takes_the_mean_of_memories_and_setting_the_state_keeps_them() {
    let filter = filter(&small_liquid(CELLS[0]), 2.0);
    let (mut one, other) = (tracked(&filter, 12, 0.0), tracked(&filter, 15, 1.0));
    let means: Vec<f32> = one.memory().iter().zip(other.memory()).map(|(a, b)| 0.25 * a + 0.75 * b).collect();
    assert_ne!(one.memory(), other.memory());
    let mut moved = other.clone();
    filter.set_state(&mut moved, &filter.state(&one));
    assert_eq!(moved.memory(), other.memory());
    filter.merge(&mut one, 0.5, &other, 1.5);
    for (found, mean) in one.memory().iter().zip(means) {
        assert!((found - mean).abs() < 1e-6);
    }
}

#[test]
fn what_stands_or_stops_is_predicted() {
    for hyper in forms() {
        let filter = filter(&hyper, 2.0);
        let mut belief = tracked(&filter, 10, 0.0);
        for speed in [0.0, 1e-9, 0.999, 1.0, 1.001] {
            let mut state = filter.state(&belief);
            (state.mean[2], state.mean[3]) = (0.6 * speed, -0.8 * speed);
            filter.set_state(&mut belief, &state);
            filter.predict(&mut belief, 1.0);
            let state = filter.state(&belief);
            assert!(state.mean.iter().all(|x| x.is_finite()) && state.covariance.cholesky().is_some());
            assert!((state.mean[2]).hypot(state.mean[3]) < 20.0);
        }
    }
}

#[test]
fn a_network_that_overflows_predicts_straight_and_forgets_nothing() {
    let hyper = small_liquid(CELLS[0]);
    let mut tensors = untrained::tensors(hyper.tensors());
    tensors.get_mut("output.weight").unwrap().values.fill(f32::MAX);
    tensors.get_mut("output.bias").unwrap().values.fill(f32::MAX);
    let network = Arc::new(LiquidNetwork::from_model(&model(&hyper, tensors)).unwrap());
    let ours = LiquidKalman::new(network, Position::new(5.0).unwrap());
    let straight = filter(&LiquidHyper { warm_up: 1000, ..hyper }, 1.0);
    let found = tracked(&ours, 20, 0.4);
    assert_eq!(ours.state(&found), straight.state(&tracked(&straight, 20, 0.4)));
    assert!(found.memory().iter().all(|value| *value == 0.0));
}

#[test]
fn as_published_there_is_no_memory_and_the_next_state_is_said_within_limits() {
    let hyper = paper_liquid();
    let Form::Absolute(Absolute { minimum, noise, .. }) = hyper.form else { panic!("not as published") };
    let (filter, zero) = (filter(&hyper, 1.0), filter(&hyper, 0.0));
    let (one, other) = (tracked(&filter, 7, 0.0), tracked(&filter, 20, 2.0));
    assert!(one.memory().is_empty());
    let run = |filter: &LiquidKalman<Position<2>>, belief: &LiquidBelief| {
        let (mut belief, state) = (belief.clone(), filter.state(&tracked(filter, 3, 0.0)));
        filter.set_state(&mut belief, &state);
        filter.predict(&mut belief, 1.0);
        filter.state(&belief)
    };
    // Only the state counts.
    assert_eq!(run(&filter, &one), run(&filter, &other));
    // Zero is the lower limit, whatever the state, which leaves nothing of its covariance.
    let state = run(&zero, &one);
    assert_eq!(state.mean, Vector4::from(minimum));
    assert!((state.covariance - Matrix4::from_diagonal(&Vector4::from(noise))).norm() < 1e-9);
}

#[test]
fn a_mixture_of_objects_is_followed() {
    let filter = filter(&small_liquid(CELLS[0]), 0.3);
    let (detection, clutter) = (Detection::uniform(0.95).unwrap(), Clutter::per_scan(10.0, 1e6).unwrap());
    let mut phd = Phd::<LiquidBelief>::new(PhdConfig::default()).unwrap();
    for second in 0..20 {
        let time = f64::from(second);
        let measurements =
            [[10.0 * time, 0.0], [500.0 - 8.0 * time, 300.0], [-400.0, 12.0 * time]].map(Measurement::from);
        phd.step(
            &filter,
            &Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter },
        )
        .unwrap();
    }
    let confirmed = phd.tracks().iter().filter(|track| track.status == Status::Confirmed);
    let mut places: Vec<_> = confirmed.map(|track| filter.state(&track.belief).mean.xy()).collect();
    places.sort_by(|a, b| a.x.total_cmp(&b.x));
    for (place, (x, y)) in places.iter().zip([(-400.0, 228.0), (190.0, 0.0), (348.0, 300.0)]) {
        assert!((place - Vector2::new(x, y)).norm() < 10.0, "{places:?}");
    }
    assert_eq!(places.len(), 3);
}

fn model(hyper: &LiquidHyper, tensors: BTreeMap<String, Tensor>) -> Model {
    untrained::of_tensors("liquid", hyper.to_table(), tensors)
}

fn refusal(model: &Model) -> String {
    LiquidNetwork::from_model(model).unwrap_err().to_string()
}

#[test]
fn models_that_do_not_fit_are_refused_by_name() {
    for cell in CELLS {
        let hyper = small_liquid(cell);
        untrained::refuses_other_tensors(&hyper.tensors(), |tensors| {
            LiquidNetwork::from_model(&model(&hyper, tensors))
        });
    }
}

#[test]
fn impossible_options_are_refused_by_name() {
    let with = |change: &dyn Fn(&mut LiquidHyper)| {
        let mut hyper = small_liquid(CELLS[0]);
        change(&mut hyper);
        refusal(&model(&hyper, BTreeMap::new()))
    };
    let ltc = |size, unfolds| CellShape::Ltc { size, unfolds, solver: Default::default() };
    let absolute = |minimum, noise| Form::Absolute(Absolute { minimum, maximum: [9.0; 4], noise });
    assert!(with(&|h| h.cell = ltc(0, 6)).contains("`size` is 0"));
    assert!(with(&|h| h.cell = ltc(8, 0)).contains("`unfolds` is 0"));
    assert!(with(&|h| h.interval = 0.0).contains("`interval` is 0"));
    assert!(with(&|h| h.speed = f64::NAN).contains("`speed` is NaN"));
    assert!(with(&|h| h.jacobian = Derivative::Difference { step: -1.0 }).contains("`jacobian.step` is -1"));
    assert!(with(&|h| h.form = absolute([0.0, 9.0, 0.0, 0.0], [1.0; 4])).contains("`form.minimum[1]` is 9"));
    assert!(with(&|h| h.form = absolute([0.0; 4], [1.0, 1.0, 0.0, 1.0])).contains("`form.noise[2]` is 0"));
    let unit = Residual { correction: [5.0, 0.0], ..Residual::default() };
    assert!(with(&|h| h.form = Form::Residual(unit)).contains("`form.correction[1]` is 0"));
    let mut unknown = model(&small_liquid(CELLS[0]), BTreeMap::new()).card().clone();
    unknown.hyper["form"].as_table_mut().unwrap().insert("colour".into(), "red".into());
    let unknown = Model::new(unknown, BTreeMap::new()).unwrap();
    assert!(refusal(&unknown).contains("colour"));
    let mut kind = model(&small_liquid(CELLS[0]), BTreeMap::new()).card().clone();
    kind.kind = "mnemonic".into();
    let kind = Model::new(kind, BTreeMap::new()).unwrap();
    assert!(matches!(LiquidNetwork::from_model(&kind), Err(ModelError::Kind { .. })));
}

#[test]
fn the_surprise_is_the_normalised_innovation_whatever_turns() {
    let filter = Extended::new(ConstantVelocity::new(0.5), Position::<2>::new(5.0).unwrap());
    let mut belief: Gaussian<4> = filter.birth(&[0.0, 0.0].into()).unwrap();
    for step in 1..20 {
        filter.predict(&mut belief, 1.0);
        let before = belief;
        let place = [10.0 * f64::from(step) + f64::from(step * 7 % 11), f64::from(step * 5 % 7)];
        let innovation = filter.update(&mut belief, &place.into()).unwrap();
        let nis = surprise(&before, &belief).norm_squared();
        assert!((nis - innovation.nis).abs() < 1e-6 * (1.0 + nis), "{nis} {}", innovation.nis);
        assert!(widths(&belief)[0] < widths(&before)[0]);
    }
    assert_eq!(surprise(&belief, &belief), Vector2::zeros());
}

#[test]
fn particles_move_as_the_network_says() {
    for hyper in forms().into_iter().chain([paper_liquid()]) {
        let network = liquid(&hyper, 1.0);
        let radar = Position::new(5.0).unwrap();
        let (gaussian, count) = (LiquidKalman::new(network.clone(), radar), 400);
        let cloud = Particle::new(LiquidMotion::new(network), radar, count, 3).unwrap();
        let start = seen(0, 0.3, Vector2::zeros()).unwrap();
        let mut particles = cloud.birth(&start).unwrap();
        let mut belief = gaussian.birth(&start).unwrap();
        // While the motion is straight the mean of the cloud is that of the Gaussian, but for chance.
        cloud.predict(&mut particles, 1.0);
        gaussian.predict(&mut belief, 1.0);
        let (ours, theirs) = (cloud.state(&particles), gaussian.state(&belief));
        let off = ours.mean - theirs.mean;
        if hyper.warm_up > 0 {
            let chance = 5.0 * theirs.covariance.diagonal().max().sqrt() / f64::from(count as u32).sqrt();
            assert!(off.amax() < chance, "{hyper:?}: {off} {chance}");
        }
        for step in 1..25 {
            cloud.predict(&mut particles, if step == 20 { 0.0 } else { 1.0 });
            if let Some(seen) = seen(step, 0.3, Vector2::zeros()) {
                // A cloud that has lost the object is told so, and stays finite.
                let _ = cloud.update(&mut particles, &seen);
            }
            assert!(cloud.state(&particles).mean.iter().all(|value| value.is_finite()), "{hyper:?}");
        }
    }
}

#[test]
fn the_speed_of_new_objects_is_the_users() {
    let filter = filter(&small_liquid(CELLS[0]), 1.0).with_speed(7.0).unwrap();
    let belief = filter.birth(&[0.0, 0.0].into()).unwrap();
    assert!((filter.state(&belief).covariance[(2, 2)] - 49.0).abs() < 1e-9);
    assert!(filter.with_speed(-1.0).is_err());
}

#[test]
fn a_long_gap_is_as_many_empty_scans() {
    for name in ["liquid", "liquid-cfc", "liquid-paper"] {
        let network =
            Arc::new(LiquidNetwork::from_model(&tercel_neural::shipped::model(name).unwrap()).unwrap());
        let filter = LiquidKalman::new(network, Position::<2>::new(5.0).unwrap());
        let mut belief = filter.birth(&[0.0, 2.0].into()).unwrap();
        for second in 1..20 {
            filter.predict(&mut belief, 1.0);
            filter.update(&mut belief, &[10.0 * f64::from(second), 2.0].into()).unwrap();
        }
        let (mut once, mut often) = (belief.clone(), belief.clone());
        filter.predict(&mut once, 30.0);
        (0..30).for_each(|_| filter.predict(&mut often, 1.0));
        assert_eq!(once, often, "{name}");
        // No time is too long.
        filter.predict(&mut belief, 1e6);
        assert!(filter.state(&belief).mean.iter().all(|x| x.is_finite()), "{name}");
    }
}
