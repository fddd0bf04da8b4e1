//! Time of a scan. `cargo bench -p tercel-core --bench trackers`
#![allow(missing_docs, clippy::unwrap_used)]

use divan::Bencher;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_core::belief::Gaussian;
use tercel_core::filter::{Filter, Imm, Kalman, Transition};
use tercel_core::motion::{ConstantVelocity, Turn};
use tercel_core::multi::{
    Clutter, Detection, Jpda, JpdaConfig, MultiBernoulli, MultiBernoulliConfig, NearestNeighbour,
    NearestNeighbourConfig, Phd, PhdConfig, Pmbm, PmbmConfig, Scan, Tracker,
};
use tercel_core::sensor::{Measurement, Position};

fn main() {
    divan::main();
}

/// Objects on a square with room of 200 m each, and as many scans of them as asked for.
struct Scene {
    scans: Vec<Vec<Measurement<2>>>,
    detection: Detection,
    clutter: Clutter,
    filter: Kalman<ConstantVelocity, Position>,
}

fn scene(objects: usize, clutter: usize, scans: usize) -> Scene {
    scene_of(200.0, objects, clutter, scans)
}

/// The density of the study `clutter-partial`: a square of 866 m for each of ten objects, 40 false detections in all.
fn wide_scene() -> Scene {
    scene_of(866.0, 10, 40, 20)
}

fn scene_of(room: f64, objects: usize, clutter: usize, scans: usize) -> Scene {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let width = room * (objects as f64).sqrt();
    let states: Vec<[f64; 4]> = (0..objects)
        .map(|_| {
            let place = [random.random_range(0.0..width), random.random_range(0.0..width)];
            [place[0], place[1], random.random_range(-10.0..10.0), random.random_range(-10.0..10.0)]
        })
        .collect();
    let scans = (0..scans)
        .map(|step| {
            let mut plots: Vec<Measurement<2>> = Vec::new();
            for [x, y, vx, vy] in &states {
                let [dx, dy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut random));
                if random.random::<f64>() < 0.95 {
                    let time = step as f64;
                    plots.push([x + time * vx + 5.0 * dx, y + time * vy + 5.0 * dy].into());
                }
            }
            plots.extend((0..clutter).map(|_| {
                Measurement::from([random.random_range(0.0..width), random.random_range(0.0..width)])
            }));
            plots
        })
        .collect();
    Scene {
        scans,
        detection: Detection::uniform(0.95).unwrap(),
        clutter: Clutter::per_scan(clutter as f64, width * width).unwrap(),
        filter: Kalman::new(ConstantVelocity::new(0.1).with_speed(10.0), Position::new(5.0).unwrap()),
    }
}

/// One scan, after a tracker has seen those before it.
fn one_scan<T: Tracker<Belief = Gaussian<4>> + Clone>(bencher: Bencher, scene: &Scene, tracker: T) {
    one_scan_by(bencher, scene, &scene.filter, tracker);
}

/// The same with a filter of choice.
fn one_scan_by<F, T>(bencher: Bencher, scene: &Scene, filter: &F, tracker: T)
where
    F: Filter<4, Measurement = Measurement<2>>,
    T: Tracker<Belief = F::Belief> + Clone,
{
    let step = |tracker: &mut T, number: usize| {
        let scan = Scan {
            time: number as f64,
            measurements: &scene.scans[number],
            detection: &scene.detection,
            clutter: &scene.clutter,
        };
        tracker.step(filter, &scan).unwrap();
    };
    let last = scene.scans.len() - 1;
    let mut warm = tracker;
    (0..last).for_each(|number| step(&mut warm, number));
    bencher.with_inputs(|| warm.clone()).bench_local_values(|mut tracker| {
        step(&mut tracker, last);
        tracker
    });
}

#[divan::bench]
fn phd_10_objects_20_clutter_cap_100(bencher: Bencher) {
    let config = PhdConfig { cap: 100, ..PhdConfig::default() };
    one_scan(bencher, &scene(10, 20, 20), Phd::new(config).unwrap());
}

#[divan::bench]
fn nearest_neighbour_10_objects_20_clutter(bencher: Bencher) {
    one_scan(bencher, &scene(10, 20, 20), NearestNeighbour::new(NearestNeighbourConfig::default()).unwrap());
}

#[divan::bench(args = [100, 300, 1000, 3000], sample_count = 10)]
fn nearest_neighbour_objects_and_clutter(bencher: Bencher, objects: usize) {
    let tracker = NearestNeighbour::new(NearestNeighbourConfig::default()).unwrap();
    one_scan(bencher, &scene(objects, objects, 10), tracker);
}

#[divan::bench(args = [100, 300, 1000, 3000], sample_count = 10)]
fn phd_objects_and_clutter(bencher: Bencher, objects: usize) {
    let config = PhdConfig { cap: 20 * objects, ..PhdConfig::default() };
    one_scan(bencher, &scene(objects, objects, 10), Phd::new(config).unwrap());
}

/// Six modes: calm, turns to either side at two rates, agile.
fn bank() -> Imm<Kalman<Turn, Position<2>>> {
    let rates = [(0.0, 0.05), (5.0, 0.16), (-5.0, 0.16), (10.0, 0.16), (-10.0, 0.16), (0.0, 4.0)];
    let radar = Position::new(5.0).unwrap();
    let mode = |(rate, density): (f64, f64)| {
        Kalman::new(Turn::new(rate.to_radians(), density).with_speed(20.0), radar)
    };
    Imm::new(rates.map(mode), Transition::sticky(0.95).per(1.0)).unwrap()
}

#[divan::bench]
fn imm_jpda_10_objects_40_clutter(bencher: Bencher) {
    one_scan_by(bencher, &scene(10, 40, 20), &bank(), Jpda::new(JpdaConfig::default()).unwrap());
}

#[divan::bench]
fn imm_jpda_10_objects_40_clutter_wide(bencher: Bencher) {
    one_scan_by(bencher, &wide_scene(), &bank(), Jpda::new(JpdaConfig::default()).unwrap());
}

#[divan::bench]
fn imm_pmbm_10_objects_40_clutter_wide(bencher: Bencher) {
    one_scan_by(bencher, &wide_scene(), &bank(), Pmbm::new(PmbmConfig::default()).unwrap());
}

#[divan::bench]
fn imm_phd_10_objects_40_clutter(bencher: Bencher) {
    one_scan_by(bencher, &scene(10, 40, 20), &bank(), Phd::new(PhdConfig::default()).unwrap());
}

#[divan::bench]
fn imm_multi_bernoulli_10_objects_40_clutter(bencher: Bencher) {
    let tracker = MultiBernoulli::new(MultiBernoulliConfig::default()).unwrap();
    one_scan_by(bencher, &scene(10, 40, 20), &bank(), tracker);
}

#[divan::bench]
fn imm_pmbm_10_objects_40_clutter(bencher: Bencher) {
    one_scan_by(bencher, &scene(10, 40, 20), &bank(), Pmbm::new(PmbmConfig::default()).unwrap());
}

#[divan::bench(sample_count = 10)]
fn pmbm_300_objects_500_clutter(bencher: Bencher) {
    one_scan(bencher, &scene(300, 500, 10), Pmbm::new(PmbmConfig::default()).unwrap());
}
