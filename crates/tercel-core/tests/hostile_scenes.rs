//! Scenes that no tracker should be given, for every tracker of many objects, with a plain filter and with one of several modes:
//! each scan ends in sound tracks, of which there are no more than the caps allow.

#![allow(clippy::unwrap_used)]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::RangeInclusive;
use tercel_core::filter::{Filter, Imm, Kalman, Transition};
use tercel_core::motion::{ConstantVelocity, Turn};
use tercel_core::multi::{
    Clutter, Detection, Jpda, JpdaConfig, MultiBernoulli, MultiBernoulliConfig, NearestNeighbour,
    NearestNeighbourConfig, Phd, PhdConfig, Pmbm, PmbmConfig, Scan, Status, Tracker, Use,
};
use tercel_core::sensor::{Measurement, Position};

type Plots = Vec<Measurement<2>>;

/// Largest number of tracks, or of terms, of every tracker here.
const CAP: usize = 150;

/// Width of the square in which clutter lies, m.
const WIDTH: f64 = 1000.0;

/// A picture that goes wrong in one way.
struct Scene {
    name: &'static str,
    scans: Vec<(f64, Plots)>,
    detection: Detection,
    clutter: Clutter,
    /// How many tracks are confirmed after the last scan.
    confirmed: RangeInclusive<usize>,
}

/// Draws places with the noise of the radar.
struct Radar(ChaCha8Rng);

impl Radar {
    fn new() -> Self {
        Radar(ChaCha8Rng::seed_from_u64(17))
    }

    fn see(&mut self, [x, y]: [f64; 2]) -> Measurement<2> {
        let [dx, dy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut self.0));
        [x + 5.0 * dx, y + 5.0 * dy].into()
    }

    fn anywhere(&mut self, count: usize) -> Plots {
        let place = |_| Measurement::from([0, 1].map(|_| self.0.random_range(0.0..WIDTH)));
        (0..count).map(place).collect()
    }
}

/// Two objects that pass each other.
fn boats(time: f64) -> [[f64; 2]; 2] {
    [[200.0 + 8.0 * time, 500.0], [800.0, 900.0 - 6.0 * time]]
}

/// One scan a second.
fn every_second(scans: usize, mut see: impl FnMut(f64) -> Plots) -> Vec<(f64, Plots)> {
    (0..scans).map(|step| (step as f64, see(step as f64))).collect()
}

fn radar(detection: f64, clutter: f64) -> (Detection, Clutter) {
    (Detection::uniform(detection).unwrap(), Clutter::per_scan(clutter, WIDTH * WIDTH).unwrap())
}

fn scene(
    name: &'static str,
    confirmed: RangeInclusive<usize>,
    (detection, clutter): (Detection, Clutter),
    scans: Vec<(f64, Plots)>,
) -> Scene {
    Scene { name, scans, detection, clutter, confirmed }
}

/// Scenes in which there is too little, or too much.
fn extremes() -> Vec<Scene> {
    let mut radar_of = Radar::new();
    let mut seen = |time: f64| boats(time).map(|place| radar_of.see(place)).to_vec();
    let both = |time: f64| boats(time).map(Measurement::from).to_vec();
    let outage = |time: f64| if (10.0..40.0).contains(&time) { Plots::new() } else { both(time) };
    let gap = [0.0, 1.0, 2.0, 3.0, 4.0, 34.0, 35.0, 36.0, 37.0, 38.0, 39.0].map(|time| (time, both(time)));
    let mut clutter = Radar::new();
    vec![
        scene("no objects at all", 0..=0, radar(0.9, 10.0), every_second(40, |_| Plots::new())),
        scene("only clutter", 0..=2, radar(0.9, 60.0), every_second(20, |_| clutter.anywhere(60))),
        scene("a thousand births a scan", 0..=2 * CAP, radar(0.9, 10.0), {
            every_second(5, |_| clutter.anywhere(1000))
        }),
        scene("an outage of 30 scans", 2..=2, radar(0.95, 1.0), every_second(50, outage)),
        scene("30 s without a scan", 2..=2, radar(0.95, 1.0), gap.to_vec()),
        scene("a sensor that sees nothing", 0..=2, radar(0.0, 1.0), every_second(10, both)),
        scene("many scans at one time", 2..=2, radar(0.95, 1.0), {
            (0..20).map(|_| (3.0, seen(3.0))).collect()
        }),
    ]
}

/// Scenes whose probabilities are certainties.
fn certainties() -> Vec<Scene> {
    let mut of = Radar::new();
    let mut with_clutter = |time: f64, missing: bool| {
        let mut plots = of.anywhere(8);
        let places = boats(time);
        plots.extend(places[usize::from(missing)..].iter().map(|place| of.see(*place)));
        plots
    };
    // The first boat is missed in every fifth scan.
    let missing = |time: f64| time % 5.0 == 2.0;
    let all = (radar(1.0, 0.0), radar(1.0, 8.0), radar(0.9, 0.0));
    vec![
        scene("certain detection that fails", 0..=4, all.1, {
            every_second(30, |time| with_clutter(time, missing(time)))
        }),
        scene("no clutter, but false measurements", 0..=2 * CAP, all.2, {
            every_second(30, |time| with_clutter(time, false))
        }),
        scene("both", 0..=2 * CAP, all.0, every_second(30, |time| with_clutter(time, missing(time)))),
    ]
}

/// Scenes in which things lie in one place.
fn coincidences() -> Vec<Scene> {
    let mut of = Radar::new();
    let together = every_second(25, |time| {
        let place = boats(time)[0];
        (0..3).map(|_| of.see(place)).collect()
    });
    let exactly = every_second(25, |time| vec![boats(time)[0].into(); 4]);
    let crowd = every_second(3, |_| vec![[500.0, 500.0].into(); 100]);
    let far = every_second(10, |time| {
        let [boat, _] = boats(time);
        vec![boat.into(), [1e12, -1e12].into(), [-1e300, 1e300].into(), [1e-300, 0.0].into()]
    });
    vec![
        scene("three objects in one place", 1..=4, radar(0.95, 1.0), together),
        scene("each measurement four times", 1..=4, radar(0.95, 1.0), exactly),
        scene("a hundred measurements in one place", 0..=100, radar(0.95, 1.0), crowd),
        scene("measurements at the ends of the world", 1..=4, radar(0.95, 1.0), far),
    ]
}

/// Takes a tracker through a scene.
fn survives<F, T>(tracker_name: &str, filter: &F, mut tracker: T, scene: &Scene)
where
    F: Filter<4, Measurement = Measurement<2>>,
    T: Tracker<Belief = F::Belief>,
{
    for (number, (time, plots)) in scene.scans.iter().enumerate() {
        let place = format!("{tracker_name}, {}, scan {number}", scene.name);
        let scan =
            Scan { time: *time, measurements: plots, detection: &scene.detection, clutter: &scene.clutter };
        tracker.step(filter, &scan).unwrap();
        sound(&place, filter, &tracker, plots.len());
    }
    let believed = |status: Status| matches!(status, Status::Confirmed | Status::Coasted);
    let confirmed = tracker.tracks().iter().filter(|track| believed(track.status)).count();
    assert!(scene.confirmed.contains(&confirmed), "{tracker_name}, {}: {confirmed}", scene.name);
}

fn sound<F, T>(place: &str, filter: &F, tracker: &T, measurements: usize)
where
    F: Filter<4>,
    T: Tracker<Belief = F::Belief>,
{
    let tracks = tracker.tracks();
    assert!(tracks.windows(2).all(|pair| pair[0].id < pair[1].id), "{place}");
    let alive = tracks.iter().filter(|track| track.status != Status::Deleted).count();
    // What this scan starts may wait for the next one.
    assert!(alive <= CAP + measurements, "{place}: {alive} tracks");
    for track in tracks {
        let state = filter.state(&track.belief);
        assert!((0.0..=1.0).contains(&track.existence), "{place}: {}", track.existence);
        assert!(state.mean.iter().all(|value| value.is_finite()), "{place}: {}", state.mean);
        assert!(state.covariance.iter().all(|value| value.is_finite()), "{place}: {}", state.covariance);
        assert!(
            state.covariance.diagonal().iter().all(|value| *value > 0.0),
            "{place}: {}",
            state.covariance
        );
        assert!(track.measurement.is_none_or(|number| number < measurements), "{place}");
    }
    assert_eq!(tracker.uses().len(), measurements, "{place}");
    for used in tracker.uses() {
        if let Use::Updated(id) | Use::Started(id) = used {
            assert!(tracks.binary_search_by_key(id, |track| track.id).is_ok(), "{place}: {id}");
        }
    }
}

/// Takes every tracker through the scenes, with both filters.
fn all_survive(scenes: &[Scene]) {
    let radar = Position::new(5.0).unwrap();
    let plain = Kalman::new(ConstantVelocity::new(0.1).with_speed(10.0), radar);
    let turns = [(0.0, 0.1), (0.1, 0.2), (-0.1, 0.2)]
        .map(|(rate, density)| Turn::new(rate, density).with_speed(10.0));
    let modes = turns.map(|turn| Kalman::new(turn, radar));
    let imm = Imm::new(modes, Transition::sticky(0.95).per(1.0)).unwrap();
    scenes.iter().for_each(|scene| {
        every_tracker("", &plain, scene);
        every_tracker("IMM in ", &imm, scene);
    });
}

fn every_tracker<F>(filter_name: &str, filter: &F, scene: &Scene)
where
    F: Filter<4, Measurement = Measurement<2>>,
{
    let named = |tracker: &str| format!("{filter_name}{tracker}");
    let nearest = NearestNeighbourConfig { cap: CAP, ..NearestNeighbourConfig::default() };
    survives(&named("nearest neighbour"), filter, NearestNeighbour::new(nearest).unwrap(), scene);
    let jpda = JpdaConfig { cap: CAP, ..JpdaConfig::default() };
    survives(&named("JPDA"), filter, Jpda::new(jpda).unwrap(), scene);
    let phd = PhdConfig { cap: CAP, ..PhdConfig::default() };
    survives(&named("PHD"), filter, Phd::new(phd).unwrap(), scene);
    let member = MultiBernoulliConfig { cap: CAP, ..MultiBernoulliConfig::default() };
    survives(&named("multi-Bernoulli"), filter, MultiBernoulli::new(member).unwrap(), scene);
    let pmbm = PmbmConfig { cap: CAP, ..PmbmConfig::default() };
    survives(&named("PMBM"), filter, Pmbm::new(pmbm).unwrap(), scene);
}

#[test]
fn every_tracker_survives_too_little_and_too_much() {
    all_survive(&extremes());
}

#[test]
fn every_tracker_survives_certainties() {
    all_survive(&certainties());
}

#[test]
fn every_tracker_survives_coincidences() {
    all_survive(&coincidences());
}
