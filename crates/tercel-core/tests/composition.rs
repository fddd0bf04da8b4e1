//! Any filter inside any tracker.

#![allow(clippy::unwrap_used)] // in the functions that the tests share

use nalgebra::vector;
use tercel_core::belief::Gaussian;
use tercel_core::filter::{
    Extended, Filter, Imm, ImmBelief, Kalman, Particle, Particles, Transition, Unscented,
};
use tercel_core::motion::{ConstantVelocity, Motion, Turn};
use tercel_core::multi::{
    Clutter, Detection, NearestNeighbour, NearestNeighbourConfig, Phd, PhdConfig, Scan, Status, Tracker,
};
use tercel_core::sensor::{ConvertedPolar, Measurement, RangeBearing, Sensor};

/// Two aircraft, one of which turns; each scan as ranges and bearings with small fixed errors.
fn scans() -> Vec<(f64, Vec<Measurement<2>>)> {
    let radar = RangeBearing::new(10.0, 0.002).unwrap();
    let turn = Turn::new(0.05, 0.0);
    let mut states = [vector![4000.0, 3000.0, -60.0, 20.0], vector![-3000.0, 5000.0, 50.0, -10.0]];
    (0..40u16)
        .map(|step| {
            if step > 0 {
                states[0] = turn.transition(&states[0], 1.0);
                states[1] = ConstantVelocity::new(0.0).transition(&states[1], 1.0);
            }
            // A fixed pattern of errors of about a deviation keeps the test free of random numbers.
            let error = |k: u16| f64::from((step * 7 + k * 5) % 11) / 5.0 - 1.0;
            let plot = |(k, state): (u16, &nalgebra::Vector4<f64>)| {
                let seen = Sensor::<4, 2>::expected(&radar, state);
                Measurement::from([seen[0] + 10.0 * error(k), seen[1] + 0.002 * error(k + 3)])
            };
            (f64::from(step), (0u16..).zip(&states).map(plot).collect())
        })
        .collect()
}

/// Number of confirmed tracks at the end, and the numbers that confirmed tracks ever had.
fn track<const N: usize, F, T>(filter: &F, mut tracker: T) -> (usize, usize)
where
    F: Filter<N, Measurement = Measurement<2>>,
    T: Tracker<Belief = F::Belief>,
{
    let (detection, clutter) = (Detection::uniform(0.95).unwrap(), Clutter::Uniform(1e-8));
    let mut ever = std::collections::BTreeSet::new();
    let mut last = 0;
    for (time, plots) in scans() {
        tracker
            .step(filter, &Scan { time, measurements: &plots, detection: &detection, clutter: &clutter })
            .unwrap();
        let confirmed = tracker.tracks().iter().filter(|track| track.status == Status::Confirmed);
        let numbers: Vec<u64> = confirmed.map(|track| track.id).collect();
        last = numbers.len();
        ever.extend(numbers);
    }
    (last, ever.len())
}

fn nearest<B: Clone>() -> NearestNeighbour<B> {
    NearestNeighbour::new(NearestNeighbourConfig::default()).unwrap()
}

fn phd<B: Clone>() -> Phd<B> {
    Phd::new(PhdConfig::default()).unwrap()
}

#[test]
fn an_imm_of_turns_follows_a_turn_inside_both_trackers() {
    let radar = ConvertedPolar::new(10.0, 0.002).unwrap();
    let modes = [0.0, 0.05, -0.05].map(|rate| Kalman::new(Turn::new(rate, 0.5).with_speed(60.0), radar));
    let imm = Imm::new(modes, Transition::sticky(0.95).per(1.0)).unwrap();
    assert_eq!(track(&imm, nearest::<ImmBelief<Gaussian<4>, 4>>()), (2, 2));
    assert_eq!(track(&imm, phd::<ImmBelief<Gaussian<4>, 4>>()), (2, 2));
}

#[test]
fn unscented_and_extended_filters_take_polar_plots_inside_both_trackers() {
    let radar = RangeBearing::new(10.0, 0.002).unwrap();
    let motion = ConstantVelocity::new(10.0).with_speed(60.0);
    let unscented = Unscented::<_, _, 2>::new(motion, radar);
    let extended = Extended::<_, _, 2>::new(motion, radar);
    assert_eq!(track(&unscented, nearest::<Gaussian<4>>()), (2, 2));
    assert_eq!(track(&unscented, phd::<Gaussian<4>>()), (2, 2));
    assert_eq!(track(&extended, nearest::<Gaussian<4>>()), (2, 2));
    assert_eq!(track(&extended, phd::<Gaussian<4>>()), (2, 2));
}

#[test]
fn an_imm_of_unscented_filters_is_one_type_away() {
    let radar = RangeBearing::new(10.0, 0.002).unwrap();
    let modes =
        [0.0, 0.05].map(|rate| Unscented::<_, _, 2>::new(Turn::new(rate, 1.0).with_speed(60.0), radar));
    let imm = Imm::new(modes, Transition::sticky(0.9)).unwrap();
    assert_eq!(track(&imm, phd::<ImmBelief<Gaussian<4>, 4>>()), (2, 2));
}

#[test]
fn particles_serve_inside_a_tracker() {
    let radar = RangeBearing::new(10.0, 0.002).unwrap();
    let motion = ConstantVelocity::new(10.0).with_speed(60.0);
    let filter = Particle::<_, _, 2>::new(motion, radar, 3_000, 1).unwrap().with_smoothing(0.35).unwrap();
    assert_eq!(track(&filter, nearest::<Particles<4>>()), (2, 2));
}
