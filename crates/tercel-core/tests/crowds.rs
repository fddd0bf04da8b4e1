//! Crowds: as many objects as false measurements, closer and closer together. Default settings must find most of them, whatever
//! the tracker, and little else.

#![allow(clippy::unwrap_used)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_core::belief::Gaussian;
use tercel_core::filter::Kalman;
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{
    Clutter, Detection, Jpda, JpdaConfig, MultiBernoulli, MultiBernoulliConfig, NearestNeighbour,
    NearestNeighbourConfig, Phd, PhdConfig, Pmbm, PmbmConfig, Scan, Status, Tracker,
};
use tercel_core::sensor::{Measurement, Position};

/// Objects, and false measurements a scan.
const OBJECTS: usize = 300;

/// One scan a second.
const SCANS: usize = 20;

/// Objects on a grid that all go their own ways, and clutter on the same square.
struct Crowd {
    /// Places of the objects after the last scan.
    places: Vec<[f64; 2]>,
    scans: Vec<Vec<Measurement<2>>>,
    clutter: Clutter,
}

impl Crowd {
    /// A crowd with a square of `room` m for each object.
    fn new(room: f64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let side = (OBJECTS as f64).sqrt().ceil();
        let width = room * side;
        let states: Vec<[f64; 4]> = (0..OBJECTS)
            .map(|number| {
                let (row, column) = ((number as f64 / side).floor(), number as f64 % side);
                let [vx, vy] = [0, 1].map(|_| random.random_range(-10.0..10.0));
                [room * (column + 0.5), room * (row + 0.5), vx, vy]
            })
            .collect();
        let at = |time: f64| states.iter().map(move |[x, y, vx, vy]| [x + time * vx, y + time * vy]);
        let scans = (0..SCANS)
            .map(|step| {
                let mut plots: Vec<Measurement<2>> = Vec::new();
                for [x, y] in at(step as f64) {
                    let [dx, dy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut random));
                    if random.random::<f64>() < 0.95 {
                        plots.push([x + 5.0 * dx, y + 5.0 * dy].into());
                    }
                }
                let false_one = |_| Measurement::from([0, 1].map(|_| random.random_range(0.0..width)));
                plots.extend((0..OBJECTS).map(false_one));
                plots
            })
            .collect();
        let clutter = Clutter::per_scan(OBJECTS as f64, width * width).unwrap();
        Crowd { places: at((SCANS - 1) as f64).collect(), scans, clutter }
    }

    /// How many of the objects have a believed track within 20 m after the last scan, and how many believed tracks are left
    /// over.
    fn follow<T: Tracker<Belief = Gaussian<4>>>(&self, mut tracker: T) -> (usize, usize) {
        let filter =
            Kalman::new(ConstantVelocity::new(0.1).with_speed(10.0), Position::<2>::new(5.0).unwrap());
        let detection = Detection::uniform(0.95).unwrap();
        for (step, plots) in self.scans.iter().enumerate() {
            let scan = Scan {
                time: step as f64,
                measurements: plots,
                detection: &detection,
                clutter: &self.clutter,
            };
            tracker.step(&filter, &scan).unwrap();
        }
        let believed = |status| matches!(status, Status::Confirmed | Status::Coasted);
        let mut tracks: Vec<[f64; 2]> = tracker
            .tracks()
            .iter()
            .filter(|track| believed(track.status))
            .map(|track| [track.belief.mean[0], track.belief.mean[1]])
            .collect();
        let mut found = 0;
        for [x, y] in &self.places {
            let nearest = tracks
                .iter()
                .map(|track| (track[0] - x).hypot(track[1] - y))
                .enumerate()
                .min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((number, _)) = nearest.filter(|(_, distance)| *distance < 20.0) {
                tracks.swap_remove(number);
                found += 1;
            }
        }
        (found, tracks.len())
    }
}

/// Follows a crowd with a square of 120, 80 and 60 m for each object, and demands that so many are found.
fn check<T: Tracker<Belief = Gaussian<4>>>(least: [usize; 3], make: impl Fn() -> T) {
    for (room, least) in [120.0, 80.0, 60.0].into_iter().zip(least) {
        let (found, others) = Crowd::new(room).follow(make());
        assert!(found >= least, "{room} m: {found} of {OBJECTS} found");
        assert!(others <= OBJECTS / 10, "{room} m: {others} tracks of nothing");
    }
}

#[test]
fn nearest_neighbour_starts_in_a_crowd() {
    check([290, 290, 230], || NearestNeighbour::new(NearestNeighbourConfig::default()).unwrap());
}

#[test]
fn jpda_starts_in_a_crowd() {
    check([290, 290, 250], || Jpda::new(JpdaConfig::default()).unwrap());
}

#[test]
fn pmbm_starts_in_a_crowd() {
    check([290, 270, 200], || Pmbm::new(PmbmConfig::default()).unwrap());
}

#[test]
fn multi_bernoulli_starts_in_a_crowd() {
    check([290, 270, 250], || MultiBernoulli::new(MultiBernoulliConfig::default()).unwrap());
}

#[test]
fn phd_starts_in_a_crowd() {
    check([290, 250, 150], || Phd::new(PhdConfig::default()).unwrap());
}
