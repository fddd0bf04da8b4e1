//! What is true of every tracker of reports that name their objects.

use super::*;
use crate::filter::{Identified, Identity, Named, NamedBelief};

type Ship = NamedBelief<Gaussian<4>>;

/// Ships that lie 60 m apart, in this order, and one that passes.
const HARBOUR: [[f64; 4]; 5] = [
    [0.0, 0.0, 0.0, 0.0],
    [60.0, 0.0, 0.0, 0.0],
    [120.0, 0.0, 0.0, 0.0],
    [180.0, 0.0, 0.0, 0.0],
    [-300.0, 30.0, 3.0, 0.0],
];

fn named() -> Identified<Plain> {
    let motion = ConstantVelocity::new(0.002).with_speed(8.0);
    Identified::new(Kalman::new(motion, Position::new(5.0).unwrap()), 0.999).unwrap()
}

fn reports() -> (Detection, Clutter) {
    (Detection::reports(), Clutter::Uniform(1e-12))
}

fn report(place: [f64; 2], name: u32) -> [Named<Measurement<2>>; 1] {
    [Named { measurement: place.into(), identity: Some(Identity(name)) }]
}

macro_rules! every_tracker_of_reports {
    ($name:ident, $make:expr) => {
        mod $name {
            use super::*;

            #[test]
            fn each_ship_of_a_harbour_is_one_track_with_its_own_name() {
                let (filter, scene, mut random) = (named(), reports(), ChaCha8Rng::seed_from_u64(8));
                let mut tracker = $make;
                for turn in 0..10 {
                    for (ship, object) in HARBOUR.iter().enumerate() {
                        let time = f64::from(turn) * 60.0 + 7.0 * ship as f64;
                        let [dx, dy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut random));
                        let [x, y] = truth(&[*object], time)[0];
                        let report = report([x + 3.0 * dx, y + 3.0 * dy], ship as u32);
                        tracker.step(&filter, &scan(time, &report, &scene)).unwrap();
                    }
                }
                let mut names: Vec<u32> = confirmed(tracker.tracks())
                    .iter()
                    .filter_map(|track| Filter::<4>::called(&filter, &track.belief))
                    .map(|identity| identity.0)
                    .collect();
                names.sort_unstable();
                assert_eq!(names, [0, 1, 2, 3, 4]);
            }

            #[test]
            fn the_silence_of_one_ship_says_nothing_while_another_reports() {
                let (filter, scene) = (named(), reports());
                let mut tracker = $make;
                for time in 0..400 {
                    let time = f64::from(time);
                    tracker.step(&filter, &scan(time, &report([2.0 * time, 0.0], 1), &scene)).unwrap();
                    if time as u32 % 100 == 0 {
                        let other = report([0.0, 5000.0 + time], 2);
                        tracker.step(&filter, &scan(time, &other, &scene)).unwrap();
                    }
                }
                assert_eq!(confirmed(tracker.tracks()).len(), 2);
            }

            #[test]
            fn two_ships_under_one_name_far_apart_stay_two() {
                let (filter, scene) = (named(), reports());
                let mut tracker = $make;
                for time in 0..60 {
                    let place = if time % 2 == 0 { [0.0, 0.0] } else { [20_000.0, 0.0] };
                    tracker.step(&filter, &scan(f64::from(time) * 5.0, &report(place, 1), &scene)).unwrap();
                }
                assert_eq!(confirmed(tracker.tracks()).len(), 2);
            }
        }
    };
}

/// The rules of a track of reports: ten minutes of silence end it.
fn management(rule: Management) -> Management {
    Management { max_coast: Some(600.0), max_misses: u32::MAX, min_existence: 1e-6, ..rule }
}

every_tracker_of_reports!(nearest_neighbour, {
    let config = NearestNeighbourConfig { birth: 0.9, survival: 0.9999, ..Default::default() };
    let config = NearestNeighbourConfig { management: management(config.management), ..config };
    NearestNeighbour::<Ship>::new(config).unwrap()
});
every_tracker_of_reports!(jpda, {
    let config = JpdaConfig { birth: 0.9, survival: 0.9999, ..Default::default() };
    let config = JpdaConfig { management: management(config.management), ..config };
    Jpda::<Ship>::new(config).unwrap()
});
every_tracker_of_reports!(phd, {
    let config = PhdConfig { birth: 0.9, survival: 0.9999, ..Default::default() };
    let config = PhdConfig { management: management(config.management), ..config };
    Phd::<Ship>::new(config).unwrap()
});
every_tracker_of_reports!(multi_bernoulli, {
    let config = MultiBernoulliConfig { birth: 0.9, survival: 0.9999, ..Default::default() };
    let config = MultiBernoulliConfig { management: management(config.management), ..config };
    MultiBernoulli::<Ship>::new(config).unwrap()
});
every_tracker_of_reports!(pmbm, {
    let config = PmbmConfig { survival: 0.9999, ..Default::default() };
    let config = PmbmConfig { management: management(config.management), ..config };
    Pmbm::<Ship>::new(config).unwrap()
});

#[test]
fn a_report_concerns_its_own_track_alone() {
    let (filter, scene) = (named(), reports());
    let mut tracker = NearestNeighbour::<Ship>::new(NearestNeighbourConfig::default()).unwrap();
    for ship in 0..50 {
        let place = [f64::from(ship) * 100.0, 0.0];
        tracker.step(&filter, &scan(0.1 * f64::from(ship), &report(place, ship), &scene)).unwrap();
    }
    tracker.step(&filter, &scan(6.0, &report([700.0, 0.0], 7), &scene)).unwrap();
    assert_eq!(tracker.active(), Some(&[7][..]));
    let times: Vec<f64> = tracker.tracks()[6..9].iter().map(|track| track.time).collect();
    assert_eq!(times, [0.1 * 6.0, 6.0, 0.1 * 8.0]);
}

#[test]
fn a_radar_moves_all_tracks_to_its_own_time() {
    let (filter, scene, radar) = (named(), reports(), scene());
    let mut tracker = NearestNeighbour::<Ship>::new(NearestNeighbourConfig::default()).unwrap();
    for time in 0..10 {
        let time = f64::from(time);
        for (ship, y) in [(0, 0.0), (1, 3000.0)] {
            let time = time + 0.3 * f64::from(ship);
            tracker.step(&filter, &scan(time, &report([4.0 * time, y], ship), &scene)).unwrap();
        }
    }
    let plots = [[40.0, 0.0], [40.0, 3000.0]];
    let plots = plots.map(|place| Named { measurement: Measurement::from(place), identity: None });
    tracker.step(&filter, &scan(10.0, &plots, &radar)).unwrap();
    assert!(tracker.tracks().iter().all(|track| track.time == 10.0 && track.measurement.is_some()));
    assert_eq!(tracker.tracks().len(), 2);
}
