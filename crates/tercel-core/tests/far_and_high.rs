//! Measurements beyond all bounds, and objects in space.

#![allow(clippy::unwrap_used)]

use nalgebra::{SVector, vector};
use tercel_core::filter::{
    Extended, Filter, Imm, Kalman, Padded, Particle, RandomTurns, RaoBlackwellised, Transition, Unscented,
};
use tercel_core::motion::{ConstantVelocity, Turn};
use tercel_core::multi::{
    Clutter, Detection, Jpda, JpdaConfig, NearestNeighbour, NearestNeighbourConfig, Scan, Status, Tracker,
};
use tercel_core::sensor::{Measurement, Position};

/// Follows an object, and gives the filter measurements that none can be: each is an error that leaves everything as it was.
fn refuses<const N: usize, F: Filter<N, Measurement = Measurement<2>>>(name: &str, filter: &F) {
    let mut belief = filter.birth(&[0.0, 0.0].into()).unwrap();
    for second in 1..10 {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &[10.0 * f64::from(second), 0.0].into()).unwrap();
    }
    let before = filter.state(&belief);
    let zeros = Measurement::from([90.0, 0.0]).with_noise(nalgebra::Matrix2::zeros());
    for plot in [[1e200, 0.0].into(), [0.0, -1e308].into(), [f64::NAN, 0.0].into(), zeros] {
        assert!(filter.innovation(&belief, &plot).is_err(), "{name}: {plot:?}");
        assert!(filter.update(&mut belief, &plot).is_err(), "{name}: {plot:?}");
        assert_eq!(filter.state(&belief), before, "{name}: {plot:?}");
        let mut found = Vec::new();
        filter.innovations(&belief, &[&plot, &[90.0, 0.0].into()], &mut found);
        assert!(found[0].is_err() && found[1].is_ok(), "{name}: {plot:?}");
    }
    // The largest that is taken leaves numbers to go on with.
    let _ = filter.update(&mut belief, &[1e90, 0.0].into());
    for _ in 0..5 {
        filter.predict(&mut belief, 1.0);
        let _ = filter.update(&mut belief, &[0.0, 0.0].into());
        let state = filter.state(&belief);
        assert!(state.mean.iter().chain(state.covariance.iter()).all(|x| x.is_finite()), "{name}: {state:?}");
    }
}

#[test]
fn plots_beyond_all_bounds_and_errors_of_zero_are_refused() {
    let radar = Position::<2>::new(5.0).unwrap();
    let motion = ConstantVelocity::new(1.0);
    refuses::<4, _>("Kalman", &Kalman::new(motion, radar));
    refuses::<4, _>("extended", &Extended::new(motion, radar));
    refuses::<4, _>("unscented", &Unscented::new(motion, radar));
    refuses::<6, _>("padded", &Padded::<_, 4>::new(Kalman::new(motion, radar), 1.0).unwrap());
    let modes = || [0.0, 0.1, -0.1].map(|rate| Turn::new(rate, 0.5));
    let imm = Imm::new(modes().map(|turn| Kalman::new(turn, radar)), Transition::sticky(0.9)).unwrap();
    refuses::<4, _>("interacting", &imm);
    let imm = Imm::new(modes().map(|turn| Unscented::new(turn, radar)), Transition::sticky(0.9)).unwrap();
    refuses::<4, _>("interacting, unscented", &imm);
    refuses::<4, _>("particles", &Particle::new(motion, radar, 500, 1).unwrap());
    let turns = RandomTurns::new(0.02, 0.2, 0.5..=1.0).unwrap();
    refuses::<4, _>("histories", &RaoBlackwellised::new(turns, radar, 50, 1).unwrap());
}

/// Numbers of confirmed tracks after ten scans of two aircraft, one above the other, seen as positions in space.
fn confirmed_in_space(mut tracker: impl Tracker<Belief = tercel_core::belief::Gaussian<6>>) -> usize {
    let sensor = Position::<3>::new(50.0).unwrap();
    let filter = Kalman::<_, _, 3>::new(ConstantVelocity::new(0.5).with_speed(150.0), sensor);
    let (detection, clutter) = (Detection::uniform(0.9).unwrap(), Clutter::Uniform(1e-9));
    for scan in 0..10 {
        let time = 4.0 * f64::from(scan);
        let places = [vector![200.0 * time, 0.0, 6_000.0], vector![0.0, -180.0 * time, 9_000.0]];
        let measurements: Vec<Measurement<3>> = places.map(|place: SVector<f64, 3>| place.into()).into();
        let scan = Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter };
        tracker.step::<6, _>(&filter, &scan).unwrap();
    }
    tracker.tracks().iter().filter(|track| track.status == Status::Confirmed).count()
}

#[test]
fn aircraft_in_space_are_confirmed_in_clutter_per_area() {
    let nearest = NearestNeighbour::new(NearestNeighbourConfig::default()).unwrap();
    assert_eq!(confirmed_in_space(nearest), 2);
    assert_eq!(confirmed_in_space(Jpda::new(JpdaConfig::default()).unwrap()), 2);
}
