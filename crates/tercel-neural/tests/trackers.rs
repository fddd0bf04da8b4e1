//! Learned filters in trackers of many objects.

#![allow(clippy::unwrap_used)] // in the functions that the tests share

use std::sync::Arc;

use nalgebra::Vector2;
use tercel_core::filter::{Filter, Particle};
use tercel_core::multi::{
    Clutter, Detection, Jpda, JpdaConfig, MultiBernoulli, MultiBernoulliConfig, Phd, PhdConfig, Pmbm,
    PmbmConfig, Scan, Status, Tracker,
};
use tercel_core::sensor::{Measurement, Position, RangeBearing};
use tercel_neural::filter::{BankNetwork, LiquidKalman, LiquidMotion, LiquidNetwork, NeuralImm};
use tercel_neural::shipped;

const STEPS: u32 = 40;

/// Where two objects are, one of which turns; lengths are multiples of `unit`.
fn places(step: u32, unit: f64) -> [Vector2<f64>; 2] {
    let (time, angle) = (f64::from(step), 0.06 * f64::from(step));
    let turning = Vector2::new(300.0 * angle.cos(), 300.0 * angle.sin());
    [turning, Vector2::new(-400.0 + 12.0 * time, 200.0 - 5.0 * time)].map(|place| place * unit)
}

/// Errors of about a deviation in a fixed pattern, so that there are no random numbers.
fn error(step: u32, number: u32) -> f64 {
    f64::from((step * 7 + number * 5) % 11) / 5.0 - 1.0
}

/// What a sensor of positions says of them, with a false one.
fn positions(step: u32) -> Vec<Measurement<2>> {
    let mut scan: Vec<_> = (0..)
        .zip(places(step, 1.0))
        .map(|(number, place)| {
            let off = Vector2::new(error(step, number), error(step, number + 3)) * 5.0;
            Measurement::from(place + off)
        })
        .collect();
    scan.push([900.0 - 31.0 * f64::from(step % 7), -600.0 + 57.0 * f64::from(step % 5)].into());
    scan
}

/// What a radar at the origin says of them, far away.
fn plots(step: u32) -> Vec<Measurement<2>> {
    let plot = |(number, place): (u32, Vector2<f64>)| {
        let place = place + Vector2::new(60e3, 40e3);
        let range = place.norm() + 50.0 * error(step, number);
        Measurement::from([range, place.y.atan2(place.x) + 0.003 * error(step, number + 3)])
    };
    (0..).zip(places(step, 20.0)).map(plot).collect()
}

/// Mean distance of confirmed tracks from the objects over the second half; all must be found.
fn follow<F, T>(
    filter: &F,
    mut tracker: T,
    scan: fn(u32) -> Vec<Measurement<2>>,
    truth: impl Fn(u32) -> [Vector2<f64>; 2],
) -> f64
where
    F: Filter<4, Measurement = Measurement<2>>,
    T: Tracker<Belief = F::Belief>,
{
    let (detection, clutter) = (Detection::uniform(0.95).unwrap(), Clutter::Uniform(1e-10));
    let (mut sum, mut count) = (0.0, 0.0);
    for step in 0..STEPS {
        let measurements = &scan(step);
        let scan = Scan { time: f64::from(step), measurements, detection: &detection, clutter: &clutter };
        tracker.step(filter, &scan).unwrap();
        if step < STEPS / 2 {
            continue;
        }
        let confirmed = tracker.tracks().iter().filter(|track| track.status == Status::Confirmed);
        let found: Vec<_> = confirmed.map(|track| filter.state(&track.belief).mean.xy()).collect();
        for place in truth(step) {
            let nearest = found.iter().map(|found| (found - place).norm()).fold(f64::INFINITY, f64::min);
            sum += nearest;
            count += 1.0;
        }
    }
    sum / count
}

fn jpda<B>() -> Jpda<B> {
    Jpda::new(JpdaConfig::default()).unwrap()
}

fn pmbm<B>() -> Pmbm<B> {
    Pmbm::new(PmbmConfig::default()).unwrap()
}

#[test]
fn a_neural_bank_drives_jpda_and_pmbm() {
    let network = Arc::new(BankNetwork::from_model(&shipped::model("neural-imm").unwrap()).unwrap());
    let filter = NeuralImm::new(network, &[RangeBearing::new(50.0, 0.003).unwrap()]).unwrap();
    let truth = |step| places(step, 20.0).map(|place| place + Vector2::new(60e3, 40e3));
    for error in [follow(&filter, jpda(), plots, truth), follow(&filter, pmbm(), plots, truth)] {
        assert!(error < 250.0, "{error}");
    }
}

#[test]
fn a_neural_bank_of_positions_drives_every_tracker() {
    let model = shipped::model("neural-imm-position").unwrap();
    let network = Arc::new(BankNetwork::from_model(&model).unwrap());
    let filter = NeuralImm::new(network, &[Position::new(5.0).unwrap()]).unwrap();
    let truth = |step| places(step, 1.0);
    let phd = Phd::new(PhdConfig::default()).unwrap();
    let member = MultiBernoulli::new(MultiBernoulliConfig::default()).unwrap();
    let errors = [
        follow(&filter, jpda(), positions, truth),
        follow(&filter, pmbm(), positions, truth),
        follow(&filter, phd, positions, truth),
        follow(&filter, member, positions, truth),
    ];
    assert!(errors.iter().all(|error| *error < 7.0), "{errors:?}");
}

#[test]
fn a_liquid_network_drives_every_tracker_as_a_gaussian_and_as_particles() {
    let network = Arc::new(LiquidNetwork::from_model(&shipped::model("liquid").unwrap()).unwrap());
    let radar = Position::<2>::new(5.0).unwrap();
    let filter = LiquidKalman::new(network.clone(), radar).with_speed(20.0).unwrap();
    let cloud = LiquidMotion::new(network).with_speed(20.0).unwrap();
    let cloud = Particle::new(cloud, radar, 500, 1).unwrap().with_smoothing(0.2).unwrap();
    let truth = |step| places(step, 1.0);
    let phd = Phd::new(PhdConfig::default()).unwrap();
    let member = MultiBernoulli::new(MultiBernoulliConfig::default()).unwrap();
    let errors = [
        follow(&filter, jpda(), positions, truth),
        follow(&filter, pmbm(), positions, truth),
        follow(&filter, phd, positions, truth),
        follow(&filter, member, positions, truth),
        follow(&cloud, pmbm(), positions, truth),
    ];
    assert!(errors.iter().all(|error| *error < 8.0), "{errors:?}");
}
