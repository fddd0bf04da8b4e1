//! Time of the evaluation of long and of crowded recordings on one core: `cargo bench -p tercel-study --bench evaluate`.
//!
//! It follows the rows of the tables: ten times the scans, or ten times the objects, take about ten times as long.

use divan::{Bencher, counter::ItemsCount};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_data::table::{Status, Track, Tracks, Truth, Truths};
use tercel_study::evaluate::{EvaluateOptions, evaluate};

fn main() {
    divan::main();
}

/// A recording with a scan each second.
struct Recording {
    scans: usize,
    /// Objects at any time.
    objects: usize,
    /// Scans that an object lives for.
    life: usize,
}

/// An object on its way.
struct Ship {
    name: usize,
    place: [f64; 2],
    speed: [f64; 2],
    age: usize,
    track: u64,
}

struct Making {
    random: ChaCha8Rng,
    tracks: Tracks,
    truths: Truths,
    next_track: u64,
}

impl Recording {
    /// Ships that cross a square with room of 200 m for each, one after the other, and tracks that follow them with an error
    /// of 3 m from the third scan on. Every fifth track breaks and begins anew.
    fn tables(&self) -> (Tracks, Truths) {
        let labels = ["x", "y"].map(String::from).to_vec();
        let mut making = Making {
            random: ChaCha8Rng::seed_from_u64(1),
            tracks: Tracks { labels, ..Tracks::default() },
            truths: Truths::default(),
            next_track: 0,
        };
        let side = 200.0 * (self.objects as f64).sqrt();
        let first = |object: usize| object * self.life / self.objects;
        let mut ships: Vec<Ship> =
            (0..self.objects).map(|object| making.ship(object, first(object), side)).collect();
        let mut named = self.objects;
        for scan in 0..self.scans {
            for ship in &mut ships {
                if ship.age == self.life {
                    *ship = making.ship(named, 0, side);
                    named += 1;
                }
                making.step(scan as f64, ship, self.life, side);
            }
        }
        (making.tracks, making.truths)
    }
}

impl Making {
    fn ship(&mut self, name: usize, age: usize, side: f64) -> Ship {
        self.next_track += 1;
        let place = [self.random.random_range(0.0..side), self.random.random_range(0.0..side)];
        let speed = [self.random.random_range(-8.0..8.0), self.random.random_range(-8.0..8.0)];
        Ship { name, place, speed, age, track: self.next_track }
    }

    fn step(&mut self, time: f64, ship: &mut Ship, life: usize, side: f64) {
        for axis in 0..2 {
            // Ships turn at the edge.
            if !(0.0..side).contains(&(ship.place[axis] + ship.speed[axis])) {
                ship.speed[axis] = -ship.speed[axis];
            }
            ship.place[axis] += ship.speed[axis];
        }
        let object = format!("ship {}", ship.name).into();
        self.truths.rows.push(Truth {
            time,
            object,
            position: ship.place,
            z: None,
            velocity: None,
            extent: None,
        });
        ship.age += 1;
        if ship.age == life / 2 && ship.name.is_multiple_of(5) {
            self.next_track += 1;
            ship.track = self.next_track;
        }
        if ship.age > 2 {
            let state = ship.place.map(|place| {
                let error: f64 = StandardNormal.sample(&mut self.random);
                place + 3.0 * error
            });
            self.tracks.rows.push(Track {
                time,
                sensor: "radar".into(),
                track: ship.track,
                status: Status::Confirmed,
                existence: 1.0,
                state: state.to_vec(),
                covariance: Vec::new(),
                modes: Vec::new(),
                extent: None,
                altitude: None,
                identity: None,
                detection: None,
            });
        }
    }
}

fn time(bencher: Bencher, recording: &Recording) {
    let (tracks, truths) = recording.tables();
    bencher
        .counter(ItemsCount::new(truths.rows.len()))
        .bench(|| evaluate(&tracks, &truths, &EvaluateOptions::default()));
}

/// Twenty objects at a time that live 200 scans each.
#[divan::bench(args = [1_000, 10_000, 100_000], sample_count = 1, sample_size = 1)]
fn scans_of_20_objects(bencher: Bencher, scans: usize) {
    time(bencher, &Recording { scans, objects: 20, life: 200 });
}

/// A hundred scans of many objects at a time.
#[divan::bench(args = [100, 1_000, 10_000], sample_count = 1, sample_size = 1)]
fn objects_of_100_scans(bencher: Bencher, objects: usize) {
    time(bencher, &Recording { scans: 100, objects, life: 200 });
}

/// An hour of a harbour.
#[divan::bench(sample_count = 1, sample_size = 1)]
fn ships_300_for_an_hour(bencher: Bencher) {
    time(bencher, &Recording { scans: 3_600, objects: 300, life: 3_600 });
}
