//! What is true of a belief that is compared with many measurements and updated by a choice of them.

use nalgebra::{Matrix2, vector};

use super::*;
use crate::motion::{ConstantVelocity, CoordinatedTurn, Turn};
use crate::sensor::{ConvertedPolar, Measurement, Position, RangeBearing};

/// A belief that was born at the first of the places, moved on, and was updated by the second.
fn followed<const N: usize, F>(filter: &F, [first, second]: [[f64; 2]; 2]) -> F::Belief
where
    F: Filter<N, Measurement = Measurement<2>>,
{
    let mut belief = filter.birth(&first.into()).unwrap();
    filter.predict(&mut belief, 1.0);
    filter.update(&mut belief, &second.into()).unwrap();
    filter.predict(&mut belief, 1.0);
    belief
}

/// Compares what the filter does at once with one measurement after the other.
fn at_once_is_one_by_one<const N: usize, F>(filter: &F, before: [[f64; 2]; 2], seen: &[Measurement<2>])
where
    F: Filter<N, Measurement = Measurement<2>>,
{
    let belief = followed::<N, F>(filter, before);
    let measurements: Vec<&Measurement<2>> = seen.iter().collect();
    let mut found = Vec::new();
    filter.innovations(&belief, &measurements, &mut found);
    assert_eq!(found.len(), seen.len());
    for (innovation, measurement) in found.iter().zip(seen) {
        match (innovation, filter.innovation(&belief, measurement)) {
            (Ok(one), Ok(other)) => {
                assert!((one.log_likelihood - other.log_likelihood).abs() < 1e-9);
                assert!((one.nis - other.nis).abs() < 1e-9 * other.nis.max(1.0));
                assert_eq!(one.residual(), other.residual());
            }
            (one, other) => assert_eq!(*one, other),
        }
    }
    for none in [0.0, 0.3, 20.0] {
        let weights = [0.4, 0.0, 0.15, 1.1];
        let parts: Vec<(f64, &Measurement<2>)> = weights.into_iter().zip(seen).collect();
        let (mut together, mut single) = (belief.clone(), belief.clone());
        let weight = filter.associate(&mut together, &parts, none);
        assert!((weight - one_by_one(filter, &mut single, &parts, none)).abs() < 1e-12);
        let (together, single) = (filter.estimate(&together), filter.estimate(&single));
        let scale = single.covariance.diagonal().map(f64::sqrt);
        let apart = (together.mean - single.mean).component_div(&scale).amax();
        assert!(apart < 1e-9, "means differ by {apart} deviations, none {none}");
        let apart =
            (together.covariance - single.covariance).component_div(&(scale * scale.transpose())).amax();
        assert!(apart < 1e-9, "covariances differ by {apart}, none {none}");
        for (one, other) in together.modes.iter().zip(&single.modes) {
            assert!((one - other).abs() < 1e-9, "modes {:?} {:?}", together.modes, single.modes);
        }
    }
}

const SEEN: [[f64; 2]; 4] = [[1012.0, 503.0], [1031.0, 480.0], [995.0, 517.0], [1019.0, 498.0]];

#[test]
fn a_choice_of_measurements_gives_the_merger_of_the_updates() {
    let radar = Position::new(5.0).unwrap();
    let seen = SEEN.map(Measurement::from);
    let before = [[1000.0, 500.0], [1008.0, 501.0]];
    at_once_is_one_by_one::<4, _>(
        &Kalman::new(ConstantVelocity::new(0.5).with_speed(10.0), radar),
        before,
        &seen,
    );
    let modes = [(0.0, 0.1), (0.1, 0.5), (-0.1, 3.0)].map(|(rate, q)| Kalman::new(Turn::new(rate, q), radar));
    let imm = Imm::new(modes, Transition::sticky(0.9)).unwrap();
    at_once_is_one_by_one::<4, _>(&imm, before, &seen);
    let boxed: Box<dyn Filter<4, Belief = _, Measurement = _>> = Box::new(imm);
    at_once_is_one_by_one::<4, _>(&boxed, before, &seen);
    let turning = Extended::new(CoordinatedTurn::new(0.5, 1e-3), radar);
    at_once_is_one_by_one::<5, _>(&turning, before, &seen);
}

#[test]
fn measurements_of_their_own_noise_and_across_the_cut_are_no_special_case() {
    let before = [[800.0, 3.13], [801.0, 3.135]];
    let seen = [[803.0, 3.138], [800.0, -3.139], [799.0, 3.135], [806.0, -3.13]].map(Measurement::from);
    let motion = ConstantVelocity::new(0.5).with_speed(10.0);
    at_once_is_one_by_one::<4, _>(
        &Extended::new(motion, RangeBearing::new(5.0, 0.01).unwrap()),
        before,
        &seen,
    );
    // The noise of a converted place depends on the place.
    at_once_is_one_by_one::<4, _>(
        &Kalman::new(motion, ConvertedPolar::new(5.0, 0.01).unwrap()),
        before,
        &seen,
    );
    let mut own = SEEN.map(Measurement::from);
    own[2] = own[2].with_noise(Matrix2::new(9.0, 1.0, 1.0, 100.0));
    let filter = Kalman::new(motion, Position::new(5.0).unwrap());
    at_once_is_one_by_one::<4, _>(&filter, [[1000.0, 500.0], [1008.0, 501.0]], &own);
}

#[test]
fn measurements_that_cannot_update_are_left_out() {
    let filter = Kalman::new(ConstantVelocity::new(0.5), Position::new(5.0).unwrap());
    let mut belief = followed::<4, _>(&filter, [[0.0, 0.0], [1.0, 0.0]]);
    let before = belief;
    let (bad, good) = (Measurement::from([f64::NAN, 0.0]), Measurement::from([3.0, 1.0]));
    assert_eq!(filter.associate(&mut belief, &[(0.7, &bad)], 0.3), 0.0);
    assert_eq!(filter.associate(&mut belief, &[], 0.3), 0.0);
    assert_eq!(belief, before);
    assert_eq!(filter.associate(&mut belief, &[(0.7, &bad), (0.2, &good)], 0.0), 0.2);
    let mut updated = before;
    filter.update(&mut updated, &good).unwrap();
    assert!((belief.mean - updated.mean).norm() < 1e-12);
    assert!(belief.mean != before.mean && belief.mean != vector![0.0, 0.0, 0.0, 0.0]);
}
