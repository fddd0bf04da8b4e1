//! Time of one step (predict and update) of each filter: `cargo bench -p tercel-core --bench filters`.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use tercel_core::filter::{
    Extended, Filter, Imm, Kalman, Particle, RandomTurns, RaoBlackwellised, Transition, Unscented,
};
use tercel_core::motion::{ConstantVelocity, CoordinatedTurn, Turn};
use tercel_core::sensor::{ConvertedPolar, Measurement, Position, RangeBearing};

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
fn imm_of_nine_rates_by_seven_levels(bencher: Bencher) {
    let levels: Vec<_> = (1..=7).map(|n| Position::<2>::new(2.0 * f64::from(n)).unwrap()).collect();
    let rates = (-4..=4).map(|n| 0.05 * f64::from(n));
    let modes =
        rates.flat_map(|rate| levels.iter().map(move |&level| Kalman::new(Turn::new(rate, 0.5), level)));
    let transition = Transition::joint([(Transition::sticky(0.95), 9), (Transition::sticky(1.0), 7)]);
    let imm = Imm::new(modes, transition).unwrap();
    steps::<4, _>(bencher, imm, [100.0, 50.0]);
}

/// Steps of an aircraft on a curved path, which makes the particles resample as often as in use.
#[divan::bench(sample_count = 20)]
fn rao_blackwellised_3000(bencher: Bencher) {
    let radar = ConvertedPolar::new(50.0, 0.01).unwrap();
    let turns = RandomTurns::new(1.0 / 57.0, 0.2, 5.0..=20.0).unwrap().with_speed(300.0).unwrap();
    let filter = RaoBlackwellised::new(turns, radar, 3000, 1).unwrap();
    let seen = |step: u32| -> Measurement<2> {
        let time = f64::from(step);
        [100e3 + 40.0 * (1.7 * time).sin() + 200.0 * time, 0.5 + 0.05 * (0.05 * time).sin()].into()
    };
    bencher.counter(divan::counter::ItemsCount::new(STEPS)).bench_local(|| {
        let mut belief = filter.birth(&seen(0)).unwrap();
        for step in 1..=STEPS {
            filter.predict(black_box(&mut belief), black_box(1.0));
            black_box(filter.update(&mut belief, black_box(&seen(step)))).unwrap();
        }
    });
}

#[divan::bench]
fn particle_1000(bencher: Bencher) {
    let filter = Particle::new(ConstantVelocity::new(0.5), radar(), 1000, 1).unwrap();
    steps::<4, _>(bencher, filter, [100.0, 50.0]);
}
