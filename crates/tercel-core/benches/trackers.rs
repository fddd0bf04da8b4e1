//! Time of a scan. `cargo bench -p tercel-core --bench trackers`
#![allow(missing_docs, clippy::unwrap_used)]

use divan::Bencher;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_core::belief::Gaussian;
use tercel_core::filter::Kalman;
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{
    Clutter, Detection, NearestNeighbour, NearestNeighbourConfig, Phd, PhdConfig, Scan, Tracker,
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
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let width = 200.0 * (objects as f64).sqrt();
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
    let step = |tracker: &mut T, number: usize| {
        let scan = Scan {
            time: number as f64,
            measurements: &scene.scans[number],
            detection: &scene.detection,
            clutter: &scene.clutter,
        };
        tracker.step(&scene.filter, &scan).unwrap();
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
