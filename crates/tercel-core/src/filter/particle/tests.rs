use super::*;
use crate::filter::Kalman;
use crate::motion::{AccelerationNoise, ConstantVelocity, Motion};
use crate::sensor::{BearingOnly, Position};
use nalgebra::vector;

fn filter(count: usize) -> Particle<ConstantVelocity, Position<2>> {
    Particle::new(ConstantVelocity::new(0.5), Position::new(5.0).unwrap(), count, 1).unwrap()
}

#[test]
fn the_same_seed_gives_the_same_particles_and_another_one_does_not() {
    let born = |filter: Particle<ConstantVelocity, Position<2>>| -> Particles<4> {
        let mut belief = filter.birth(&[1.0, 2.0].into()).unwrap();
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &[2.0, 2.0].into()).unwrap();
        belief
    };
    assert_eq!(born(filter(100)).states(), born(filter(100)).states());
    let other = Particle { seed: 2, ..filter(100) };
    assert_ne!(born(filter(100)).states(), born(other).states());
    let elsewhere: Particles<4> = filter(100).birth(&[1.0, 2.1].into()).unwrap();
    let here: Particles<4> = filter(100).birth(&[1.0, 2.0].into()).unwrap();
    assert_ne!(elsewhere.states()[0][2], here.states()[0][2]);
}

#[test]
fn weights_add_up_to_one_and_resampling_makes_them_equal() {
    let filter = filter(500).with_threshold(0.0).unwrap();
    let mut belief: Particles<4> = filter.birth(&[0.0, 0.0].into()).unwrap();
    filter.update(&mut belief, &[3.0, -4.0].into()).unwrap();
    assert!((belief.ln_weights().iter().map(|w| w.exp()).sum::<f64>() - 1.0).abs() < 1e-12);
    assert!(belief.effective() < 500.0);
    let before = belief.moments();
    belief.resample(500, None);
    assert!((belief.effective() - 500.0).abs() < 1e-6);
    assert!(before.mahalanobis(&belief.moments().mean).unwrap() < 0.1);
}

#[test]
fn noise_of_lower_rank_moves_particles_along_its_directions_only() {
    let piecewise = ConstantVelocity::with_noise(AccelerationNoise::Piecewise(2.0));
    let filter: Particle<_, _> = Particle::new(piecewise, Position::<2>::new(5.0).unwrap(), 50, 3).unwrap();
    let mut belief: Particles<4> = filter.birth(&[0.0, 0.0].into()).unwrap();
    let before: Vec<_> = belief.states().to_vec();
    filter.predict(&mut belief, 2.0);
    for (old, new) in before.iter().zip(belief.states()) {
        let moved = new - filter.motion.transition(old, 2.0);
        // An acceleration a over dt shifts the position by a dt²/2 and the velocity by a dt.
        assert!((moved[0] - moved[2]).abs() < 1e-9 && moved[2] != 0.0);
    }
}

#[test]
fn a_measurement_far_from_all_particles_still_weighs_them() {
    let filter = filter(200);
    let mut belief: Particles<4> = filter.birth(&[0.0, 0.0].into()).unwrap();
    let innovation = filter.update(&mut belief, &[1e5, 0.0].into()).unwrap();
    assert!(innovation.log_likelihood < -1e6 && innovation.log_likelihood.is_finite());
    assert!(filter.state(&belief).mean.iter().all(|x| x.is_finite()));
    assert!(filter.update(&mut belief, &[1e200, 0.0].into()).is_err());
}

#[test]
fn bearings_alone_narrow_a_cloud_of_any_shape() {
    let filter: Particle<_, _, 1> =
        Particle::new(ConstantVelocity::new(1e-6), BearingOnly::new(0.01).unwrap(), 4000, 5).unwrap();
    let prior = Particle::new(filter.motion, Position::<2>::new(100.0).unwrap(), 4000, 5).unwrap();
    let mut belief: Particles<4> = prior.birth(&[1000.0, 0.0].into()).unwrap();
    let before = filter.state(&belief).deviations();
    filter.update(&mut belief, &[0.0].into()).unwrap();
    let after = filter.state(&belief).deviations();
    assert!(after[1] < 0.15 * before[1] && after[0] > 0.8 * before[0], "{before} {after}");
}

#[test]
fn a_cloud_without_extent_is_drawn_anew_when_it_is_reshaped() {
    let filter = filter(100);
    let mut belief: Particles<4> = filter.birth(&[0.0, 0.0].into()).unwrap();
    belief.states.fill(vector![1.0, 2.0, 3.0, 4.0]);
    let target = Gaussian { mean: vector![5.0, 5.0, 0.0, 0.0], covariance: SMatrix::identity() };
    filter.set_state(&mut belief, &target);
    assert!((filter.state(&belief).mean - target.mean).norm() < 1.0);
    assert!(filter.state(&belief).covariance.determinant() > 0.1);
}

#[test]
fn particles_do_not_run_out_when_the_process_noise_is_small() {
    let filter =
        Particle::new(ConstantVelocity::new(0.01), Position::<2>::new(0.1).unwrap(), 1000, 1).unwrap();
    let follow = |filter: &Particle<ConstantVelocity, Position<2>>| -> (f64, f64) {
        let mut belief: Particles<4> = filter.birth(&[0.0, 0.0].into()).unwrap();
        for second in 1..60 {
            filter.predict(&mut belief, 1.0);
            filter.update(&mut belief, &[3.0 * f64::from(second), 0.0].into()).unwrap();
        }
        let state = filter.state(&belief);
        ((state.mean[0] - 177.0).abs(), state.deviations()[0])
    };
    let (error, deviation) = follow(&filter);
    assert!(deviation > 0.03 && deviation < 0.2 && error < 4.0 * deviation, "{error} {deviation}");
    let plain = follow(&filter.with_smoothing(0.0).unwrap());
    assert!(plain.1 < 0.01 * deviation, "{plain:?}");
}

#[test]
fn too_few_particles_are_refused() {
    let radar = Position::<2>::new(5.0).unwrap();
    assert!(Particle::<_, _, 2>::new(ConstantVelocity::new(1.0), radar, 3, 0).is_err());
    assert!(filter(10).with_threshold(1.5).is_err());
}

#[test]
fn a_tentative_cloud_is_small_and_answers_as_a_kalman_filter() {
    let plain = filter(2_000);
    let tentative = plain.with_tentative(40).unwrap();
    let kalman = Kalman::new(plain.motion, plain.sensor);
    let first = Measurement::from([10.0, 20.0]);
    let (mut few, mut exact) = (tentative.birth(&first).unwrap(), kalman.birth(&first).unwrap());
    assert_eq!(few.states().len(), 40);
    let near = |a: Gaussian<4>, b: Gaussian<4>, share: f64| {
        (a.mean - b.mean).norm() < share * b.covariance.trace().sqrt()
            && (a.covariance - b.covariance).norm() < share * b.covariance.norm()
    };
    assert!(near(tentative.state(&few), exact, 1e-9));
    // A copy that is merged with another stays as small.
    let mut merged = few.clone();
    tentative.merge(&mut merged, 1.0, &few, 1.0);
    assert_eq!(merged.states().len(), 40);
    // Nothing moves by chance over no time, so the moments stay exact.
    let second = Measurement::from([13.0, 18.0]);
    let expected = kalman.innovation(&exact, &second).unwrap();
    let found = tentative.innovation(&few, &second).unwrap();
    assert!((found.log_likelihood - expected.log_likelihood).abs() < 1e-9);
    tentative.update(&mut few, &second).unwrap();
    kalman.update(&mut exact, &second).unwrap();
    assert_eq!(few.states().len(), 2_000);
    assert!(near(tentative.state(&few), exact, 0.1));
    assert!(plain.with_tentative(5).is_err() && plain.with_tentative(2_001).is_err());
}
