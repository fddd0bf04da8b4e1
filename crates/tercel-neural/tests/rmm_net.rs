//! RMMNet: what its networks see and say, alone and in trackers, and what no sensor should give.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Matrix2, Rotation2, Vector2, vector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tercel_core::extended::{
    Ellipse, Evolution, Freedom, GaussianInverseWishart, InverseWishart, Points, RandomMatrix, Rule,
    Scattering, eigen,
};
use tercel_core::filter::Filter;
use tercel_core::motion::{AccelerationNoise, ConstantVelocity};
use tercel_neural::filter::rmm_net::{Aligned, Blocks, Form, Identification, Published, Transition};
use tercel_neural::filter::{RmmNet, RmmNetBelief, RmmNetHyper, RmmNetwork};
use tercel_neural::{Model, ModelError, Tensor};
use untrained::{rmm_net, small_rmm_net};

/// Round noise, so that no direction differs from another.
fn scattering() -> Scattering {
    Scattering::uniform(Matrix2::identity() * 0.5).unwrap()
}

fn filter(size: f32) -> RmmNet {
    RmmNet::new(rmm_net(&small_rmm_net(), size), scattering())
}

/// The points of a vehicle that turns, at a step; every seventh scan is empty.
fn scan(step: u32) -> Vec<Vector2<f64>> {
    let phase = 0.1 * f64::from(step);
    let centre = vector![40.0 * phase.sin(), 40.0 - 40.0 * phase.cos()];
    let mut random = ChaCha8Rng::seed_from_u64(u64::from(step));
    let count = if step % 7 == 6 { 0 } else { 5 + step as usize % 13 };
    let mut point = || {
        let (radius, angle) = (random.random::<f64>().sqrt(), std::f64::consts::TAU * random.random::<f64>());
        let noise = vector![random.random::<f64>() - 0.5, random.random::<f64>() - 0.5] * 6.0_f64.sqrt();
        centre
            + Rotation2::new(phase) * vector![6.0 * radius * angle.cos(), 1.25 * radius * angle.sin()]
            + noise
    };
    (0..count).map(|_| point()).collect()
}

/// The belief after some steps of that vehicle, moved.
fn tracked(filter: &RmmNet, steps: u32, moved: impl Fn(Vector2<f64>) -> Vector2<f64>) -> RmmNetBelief {
    let points = |step| scan(step).into_iter().map(&moved).collect::<Points>();
    let mut belief = filter.birth(&points(0)).unwrap();
    // It is known where the vehicle goes: one that stands has no front.
    let velocity = moved(vector![4.0, 0.0]) - moved(vector![0.0, 0.0]);
    let mut state = filter.state(&belief);
    (state.mean.z, state.mean.w) = (velocity.x, velocity.y);
    filter.set_state(&mut belief, &state);
    for step in 1..=steps {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &points(step)).unwrap();
    }
    belief
}

#[test]
fn the_order_of_points_does_not_matter() {
    let filter = filter(1.0);
    let belief = tracked(&filter, 12, |point| point);
    let points = scan(15);
    let updated = |points: Vec<Vector2<f64>>| {
        let mut belief = belief.clone();
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &Points::from(points)).unwrap();
        filter.estimate(&belief)
    };
    let one = updated(points.clone());
    for seed in 0..10 {
        let mut shuffled = points.clone();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        for place in (1..shuffled.len()).rev() {
            shuffled.swap(place, random.random_range(0..=place));
        }
        let other = updated(shuffled);
        assert!((one.mean - other.mean).norm() < 1e-4, "{} {}", one.mean, other.mean);
        assert!((one.extent.unwrap() - other.extent.unwrap()).norm() < 1e-3);
    }
}

#[test]
fn an_object_elsewhere_that_goes_elsewhere_is_followed_alike() {
    let filter = filter(0.5);
    let here = filter.estimate(&tracked(&filter, 40, |point| point));
    for (angle, origin) in [(0.0, vector![3e5, -2e5]), (1.1, vector![0.0, 0.0]), (-2.6, vector![500.0, 80.0])]
    {
        let turn = Rotation2::new(angle);
        let there = filter.estimate(&tracked(&filter, 40, |point| origin + turn * point));
        let place = turn.inverse() * (there.mean.xy() - origin);
        let velocity = turn.inverse() * vector![there.mean.z, there.mean.w];
        assert!((place - here.mean.xy()).norm() < 1e-3, "{angle}: {place}");
        assert!((velocity - vector![here.mean.z, here.mean.w]).norm() < 1e-3, "{angle}: {velocity}");
        let extent = turn.inverse().matrix() * there.extent.unwrap() * turn.matrix();
        assert!((extent - here.extent.unwrap()).norm() < 0.01, "{angle}: {extent}");
    }
}

#[test]
fn a_network_that_says_nothing_follows_a_vehicle_and_its_shape() {
    let filter = filter(0.0);
    let belief = tracked(&filter, 40, |point| point);
    let estimate = filter.estimate(&belief);
    let phase: f64 = 4.0;
    let centre = vector![40.0 * phase.sin(), 40.0 - 40.0 * phase.cos()];
    assert!((estimate.mean.xy() - centre).norm() < 3.0, "{}", estimate.mean);
    let found = Ellipse::from_matrix(estimate.mean.xy(), &estimate.extent.unwrap()).unwrap();
    assert!((found.axes.x - 6.0).abs() < 1.5 && (found.axes.y - 1.25).abs() < 0.6, "{found:?}");
    assert!((found.angle - phase).sin().abs() < 0.3, "{found:?}");
}

#[test]
fn what_the_points_say_beyond_their_moments_counts() {
    // Same count, mean and scatter, other points.
    let filter = filter(1.0);
    let belief = tracked(&filter, 12, |point| point);
    let origin = filter.state(&belief).mean.xy();
    let cross = [[3.0, 0.0], [-3.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    let box_ = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]]
        .map(|[x, y]: [f64; 2]| [x * 4.5_f64.sqrt(), y * 0.5_f64.sqrt()]);
    let [one, other] = [cross, box_].map(|points| {
        let points: Points = points.into_iter().map(|point| origin + Vector2::from(point)).collect();
        let mut belief = belief.clone();
        filter.update(&mut belief, &points).unwrap();
        filter.state(&belief).mean
    });
    assert!((one - other).norm() > 1e-3, "{one} {other}");
}

#[test]
fn a_hundred_thousand_steps_stay_finite_with_and_without_points() {
    let networks = [rmm_net(&small_rmm_net(), 3.0), shipped("rmmnet-vehicle")];
    for network in networks {
        let filter = RmmNet::new(network, scattering());
        let mut belief = tracked(&filter, 30, |point| point);
        for step in 0..100_000_u32 {
            filter.predict(&mut belief, if step % 3 == 0 { 0.5 } else { 1.0 });
            if step < 30_000 || step % 1000 == 0 {
                let centre = filter.state(&belief).mean.xy();
                let points = scan(step % 40).into_iter();
                let centre = if step < 30_000 { centre } else { vector![0.0, 0.0] };
                let _ = filter.update(&mut belief, &points.map(|point| point * 0.2 + centre).collect());
            }
            let estimate = filter.estimate(&belief);
            assert!(estimate.mean.iter().all(|x| x.is_finite()), "step {step}");
            assert!(estimate.covariance.cholesky().is_some(), "step {step}: {}", estimate.covariance);
            assert!(eigen(&estimate.extent.unwrap()).0.y > 0.0, "step {step}");
        }
        assert!(belief.memory().iter().all(|x| x.is_finite()));
    }
}

fn shipped(name: &str) -> Arc<RmmNetwork> {
    Arc::new(RmmNetwork::from_model(&tercel_neural::shipped::model(name).unwrap()).unwrap())
}

#[test]
fn scans_that_no_sensor_gives_end_in_a_sound_belief_or_leave_it_as_it_was() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut cloud = |count: usize, axes: [f64; 2]| -> Points {
        let mut coordinate = |axis: f64| axis * (random.random::<f64>() - 0.5);
        (0..count).map(|_| vector![coordinate(axes[0]), coordinate(axes[1])]).collect()
    };
    let scans = [
        Points::default(),
        Points::from_iter([[0.5, -0.5]]),
        Points::from(vec![vector![3.0, 1.0]; 20]),
        (0..20).map(|i| vector![f64::from(i), 2.0 * f64::from(i)]).collect(),
        cloud(1000, [8.0, 2.0]),
        cloud(20, [2.0, 8.0]),
        cloud(20, [1e-12, 30.0]),
        Points::from_iter([[1e7, -1e7], [1e7, 1e7]]),
        Points::from_iter([[1e150, 0.0], [-1e150, 1e150]]),
        Points::from_iter([[1e-300, 0.0], [0.0, -1e-300]]),
        cloud(20, [8.0, 2.0]),
    ];
    for network in [rmm_net(&small_rmm_net(), 3.0), shipped("rmmnet-vehicle"), shipped("rmmnet-aircraft")] {
        let filter = RmmNet::new(network, scattering());
        assert!(filter.birth(&Points::default()).is_err());
        let mut belief = filter.birth(&Points::from_iter([[0.0, 0.0]])).unwrap();
        for (number, scan) in scans.iter().cycle().take(200).enumerate() {
            filter.predict(&mut belief, if number % 7 == 0 { 0.0 } else { 1.0 });
            let before = belief.clone();
            match filter.update(&mut belief, scan) {
                Ok(innovation) => assert!(!innovation.log_likelihood.is_nan(), "scan {number}"),
                Err(_) => assert_eq!(belief, before, "scan {number}"),
            }
            let estimate = filter.estimate(&belief);
            assert!(estimate.mean.iter().all(|x| x.is_finite()), "scan {number}");
            assert!(estimate.covariance.cholesky().is_some(), "scan {number}: {}", estimate.covariance);
            assert!(eigen(&estimate.extent.unwrap()).0.y > 0.0, "scan {number}");
        }
        let before = belief.clone();
        for bad in [f64::NAN, f64::INFINITY] {
            let scan = Points::from_iter([[0.0, 0.0], [bad, 1.0], [2.0, 0.0]]);
            assert!(filter.update(&mut belief, &scan).is_err());
            assert_eq!(belief, before);
        }
    }
}

#[test]
fn a_network_that_overflows_says_nothing() {
    let hyper = small_rmm_net();
    let mut loud = untrained::tensors(hyper.tensors());
    for (name, tensor) in &mut loud {
        if name.contains("output") {
            tensor.values.fill(f32::MAX);
        }
    }
    let network = |tensors| Arc::new(RmmNetwork::from_model(&model(&hyper, tensors)).unwrap());
    let loud = RmmNet::new(network(loud), scattering());
    let found = tracked(&loud, 20, |point| point);
    let quiet = filter(0.0);
    assert_eq!(loud.state(&found), quiet.state(&tracked(&quiet, 20, |point| point)));
    assert!(found.memory().iter().all(|value| *value == 0.0));
}

#[test]
fn merging_takes_the_mean_of_memories_and_setting_the_state_or_extent_keeps_them() {
    let filter = filter(1.0);
    let (mut one, other) =
        (tracked(&filter, 12, |point| point), tracked(&filter, 15, |point| vector![point.y, -point.x]));
    let means: Vec<f32> = one.memory().iter().zip(other.memory()).map(|(a, b)| 0.25 * a + 0.75 * b).collect();
    let mut moved = other.clone();
    filter.set_state(&mut moved, &filter.state(&one));
    let extent = filter.extent(&one).unwrap();
    filter.set_extent(&mut moved, &extent);
    assert_eq!(moved.memory(), other.memory());
    let found = filter.extent(&moved).unwrap();
    assert!((found.mean() - extent.mean()).norm() < 1e-9 && (found.weight() - extent.weight()).abs() < 1e-9);
    filter.merge(&mut one, 0.5, &other, 1.5);
    for (found, mean) in one.memory().iter().zip(means) {
        assert!((found - mean).abs() < 1e-6);
    }
    let mut same = other.clone();
    filter.merge(&mut same, 1.0, &other, 0.0);
    assert_eq!(same, other);
}

fn model(hyper: &RmmNetHyper, tensors: BTreeMap<String, Tensor>) -> Model {
    untrained::of_tensors("rmmnet", hyper.to_table(), tensors)
}

fn refusal(model: &Model) -> String {
    RmmNetwork::from_model(model).unwrap_err().to_string()
}

#[test]
fn models_that_do_not_fit_are_refused_by_name() {
    let hyper = small_rmm_net();
    untrained::refuses_other_tensors(&hyper.tensors(), |tensors| {
        RmmNetwork::from_model(&model(&hyper, tensors))
    });
}

/// As published, in all its variants.
fn published() -> Vec<RmmNetHyper> {
    let hyper = |form| RmmNetHyper { interval: 1.0, memory: 6, form: Form::Published(form) };
    let blocks =
        [[true; 3], [true, false, true], [false, true, true], [false, false, true], [false, true, false]];
    let blocks = blocks.map(|[memory, prediction, update]| Blocks { memory, prediction, update });
    let cut = blocks.map(|blocks| Published { blocks, ..Published::default() });
    let ours = [Transition::Keeping, Transition::Turning].map(|transition| Published {
        transition,
        printed: false,
        distorted: true,
        ..Published::default()
    });
    cut.into_iter().chain(ours).map(hyper).collect()
}

#[test]
fn as_published_vehicles_are_followed_whatever_blocks_there_are() {
    for hyper in published() {
        for size in [0.0, 0.1] {
            let filter = RmmNet::new(rmm_net(&hyper, size), scattering());
            let belief = tracked(&filter, 40, |point| point);
            let estimate = filter.estimate(&belief);
            let centre = vector![40.0 * 4.0_f64.sin(), 40.0 - 40.0 * 4.0_f64.cos()];
            assert!((estimate.mean.xy() - centre).norm() < 3.0, "{hyper:?} {size}: {}", estimate.mean);
            assert!(estimate.covariance.cholesky().is_some(), "{hyper:?}");
        }
    }
}

#[test]
fn as_published_without_compensations_it_is_the_filter_of_lan_and_li() {
    let blocks = Blocks { memory: false, prediction: false, update: false };
    for (distorted, rule) in [(true, Rule::Distorted), (false, Rule::Direct)] {
        let form = Published { blocks, distorted, transition: Transition::Keeping, ..Published::default() };
        let hyper = RmmNetHyper { interval: 1.0, memory: 1, form: Form::Published(form.clone()) };
        let ours = RmmNet::new(rmm_net(&hyper, 0.0), scattering());
        let prior = InverseWishart::gupta_nagar(7.0, Matrix2::new(100.0, 0.0, 0.0, 9.0)).unwrap();
        let motion = ConstantVelocity::with_noise(AccelerationNoise::Piecewise(1.0)).with_speed(5.0);
        let evolution = Evolution::wishart(5.0, Freedom::Printed).unwrap();
        let theirs = RandomMatrix::new(motion, scattering(), prior, evolution, rule);
        let points = |step| scan(step).into_iter().collect::<Points>();
        let mut one = ours.birth(&points(0)).unwrap();
        let mut other: GaussianInverseWishart<4> = theirs.birth(&points(0)).unwrap();
        theirs.set_state(&mut other, &ours.state(&one));
        other.extent = ours.extent(&one).unwrap();
        for step in 1..40 {
            ours.predict(&mut one, 1.0);
            theirs.predict(&mut other, 1.0);
            ours.update(&mut one, &points(step)).unwrap();
            theirs.update(&mut other, &points(step)).unwrap();
            let (one, other) = (ours.estimate(&one), (theirs.state(&other), other.extent.mean()));
            assert!((one.mean - other.0.mean).norm() < 1e-9, "{rule:?}, step {step}");
            assert!((one.covariance - other.0.covariance).norm() < 1e-9, "{rule:?}, step {step}");
            assert!((one.extent.unwrap() - other.1).norm() < 1e-8, "{rule:?}, step {step}");
        }
    }
}

#[test]
fn impossible_options_are_refused_by_name() {
    let with = |change: &dyn Fn(&mut RmmNetHyper, &mut Aligned)| {
        let mut hyper = small_rmm_net();
        let Form::Aligned(mut form) = hyper.form.clone() else { panic!("another form") };
        change(&mut hyper, &mut form);
        hyper.form = Form::Aligned(form);
        refusal(&model(&hyper, BTreeMap::new()))
    };
    assert!(with(&|h, _| h.interval = 0.0).contains("`interval` is 0"));
    assert!(with(&|h, _| h.memory = 0).contains("`memory` is 0"));
    assert!(with(&|_, f| f.hidden = 1 << 20).contains("`form.hidden` is"));
    assert!(with(&|_, f| f.change = f64::NAN).contains("`form.change` is NaN"));
    assert!(with(&|_, f| f.axes[1] = -1.0).contains("`form.axes[1]` is -1"));
    assert!(with(&|_, f| f.identification.kept = 1.5).contains("`form.identification.kept` is 1.5"));
    assert!(
        with(&|_, f| f.identification = Identification { order: 65, ..f.identification }).contains("is 65")
    );
    let mut unknown = model(&small_rmm_net(), BTreeMap::new()).card().clone();
    unknown.hyper["form"].as_table_mut().unwrap().insert("colour".into(), "red".into());
    assert!(refusal(&Model::new(unknown, BTreeMap::new()).unwrap()).contains("colour"));
    let mut kind = model(&small_rmm_net(), BTreeMap::new()).card().clone();
    kind.kind = "mnemonic".into();
    let kind = Model::new(kind, BTreeMap::new()).unwrap();
    assert!(matches!(RmmNetwork::from_model(&kind), Err(ModelError::Kind { .. })));
}
