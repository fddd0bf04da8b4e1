//! Time of one step (predict and update) of each filter: `cargo bench -p tercel-core --bench filters`.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use tercel_core::filter::{Extended, Filter, Imm, Kalman, Particle, Transition, Unscented};
use tercel_core::motion::{ConstantVelocity, CoordinatedTurn, Turn};
use tercel_core::sensor::{Measurement, Position, RangeBearing};

fn main() {
    divan::main();
}

/// Steps timed together, so that the clock does not count.
const STEPS: u32 = 100;

fn steps<const N: usize, F>(bencher: Bencher, filter: F, seen: [f64; 2])
where
    F: Filter<N, Measurement = Measurement<2>>,
{
    let seen: Measurement<2> = seen.into();
    let mut belief = filter.birth(&seen).unwrap();
    bencher.counter(divan::counter::ItemsCount::new(STEPS)).bench_local(|| {
        for _ in 0..STEPS {
            filter.predict(black_box(&mut belief), black_box(1.0));
            black_box(filter.update(&mut belief, black_box(&seen))).unwrap();
        }
    });
}

fn radar() -> Position<2> {
    Position::new(5.0).unwrap()
}

fn polar() -> RangeBearing {
    RangeBearing::new(5.0, 0.01).unwrap()
}

#[divan::bench]
fn kalman(bencher: Bencher) {
    steps::<4, _>(bencher, Kalman::new(ConstantVelocity::new(0.5), radar()), [100.0, 50.0]);
}

#[divan::bench]
fn kalman_turn(bencher: Bencher) {
    steps::<4, _>(bencher, Kalman::new(Turn::new(0.1, 0.5), radar()), [100.0, 50.0]);
}

#[divan::bench]
fn extended(bencher: Bencher) {
    steps::<4, _>(bencher, Extended::new(ConstantVelocity::new(0.5), polar()), [1000.0, 0.5]);
}

#[divan::bench]
fn extended_coordinated_turn(bencher: Bencher) {
    steps::<5, _>(bencher, Extended::new(CoordinatedTurn::new(0.5, 1e-4), polar()), [1000.0, 0.5]);
}

#[divan::bench]
fn unscented(bencher: Bencher) {
    steps::<4, _>(bencher, Unscented::new(ConstantVelocity::new(0.5), polar()), [1000.0, 0.5]);
}

#[divan::bench]
fn imm_of_three(bencher: Bencher) {
    let modes = [0.0, 0.1, -0.1].map(|rate| Kalman::new(Turn::new(rate, 0.5), radar()));
    let imm = Imm::new(modes, Transition::sticky(0.95)).unwrap();
    steps::<4, _>(bencher, imm, [100.0, 50.0]);
}

#[divan::bench]
fn imm_of_three_in_continuous_time(bencher: Bencher) {
    let modes = [0.0, 0.1, -0.1].map(|rate| Kalman::new(Turn::new(rate, 0.5), radar()));
    let imm = Imm::new(modes, Transition::sticky(0.95).per(1.0)).unwrap();
    steps::<4, _>(bencher, imm, [100.0, 50.0]);
}

#[divan::bench]
fn particle_1000(bencher: Bencher) {
    let filter = Particle::new(ConstantVelocity::new(0.5), radar(), 1000, 1).unwrap();
    steps::<4, _>(bencher, filter, [100.0, 50.0]);
}
