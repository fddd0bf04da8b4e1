//! Instructions of one step (predict and update) of each filter, which do not depend on the load of the machine.
//!
//! Needs valgrind, and the runner in the version of the library:
//!
//! ```text
//! cargo install gungraun-runner --version 0.20.0
//! cargo bench -p tercel-core --features instructions --bench instructions
//! ```

// The macros of the harness make modules without documentation.
#![allow(clippy::unwrap_used, missing_docs)]

use std::hint::black_box;

use gungraun::{library_benchmark, library_benchmark_group, main};
use tercel_core::filter::{Extended, Filter, Imm, Kalman, Particle, Transition, Unscented};
use tercel_core::motion::{ConstantVelocity, Turn};
use tercel_core::sensor::{Measurement, Position, RangeBearing};

/// A filter, a belief and a measurement, ready for a step.
struct Ready<F: Filter<4>> {
    filter: F,
    belief: F::Belief,
    seen: Measurement<2>,
}

impl<F: Filter<4, Measurement = Measurement<2>>> Ready<F> {
    fn new(filter: F, seen: [f64; 2]) -> Self {
        let seen = seen.into();
        let mut ready = Ready { belief: filter.birth(&seen).unwrap(), filter, seen };
        (0..3).for_each(|_| ready.step());
        ready
    }

    fn step(&mut self) {
        self.filter.predict(black_box(&mut self.belief), black_box(1.0));
        black_box(self.filter.update(&mut self.belief, black_box(&self.seen))).unwrap();
    }
}

type Straight = ConstantVelocity;

fn kalman_ready() -> Ready<Kalman<Straight, Position<2>>> {
    Ready::new(Kalman::new(Straight::new(0.5), Position::new(5.0).unwrap()), [100.0, 50.0])
}

fn extended_ready() -> Ready<Extended<Straight, RangeBearing>> {
    Ready::new(Extended::new(Straight::new(0.5), RangeBearing::new(5.0, 0.01).unwrap()), [1000.0, 0.5])
}

fn unscented_ready() -> Ready<Unscented<Straight, RangeBearing>> {
    Ready::new(Unscented::new(Straight::new(0.5), RangeBearing::new(5.0, 0.01).unwrap()), [1000.0, 0.5])
}

fn imm_ready() -> Ready<Imm<Kalman<Turn, Position<2>>>> {
    let modes = [0.0, 0.1, -0.1].map(|rate| Kalman::new(Turn::new(rate, 0.5), Position::new(5.0).unwrap()));
    Ready::new(Imm::new(modes, Transition::sticky(0.95)).unwrap(), [100.0, 50.0])
}

fn particle_ready() -> Ready<Particle<Straight, Position<2>>> {
    let radar = Position::new(5.0).unwrap();
    Ready::new(Particle::new(Straight::new(0.5), radar, 1000, 1).unwrap(), [100.0, 50.0])
}

#[library_benchmark]
#[bench::step(kalman_ready())]
fn kalman(mut ready: Ready<Kalman<Straight, Position<2>>>) {
    ready.step();
}

#[library_benchmark]
#[bench::step(extended_ready())]
fn extended(mut ready: Ready<Extended<Straight, RangeBearing>>) {
    ready.step();
}

#[library_benchmark]
#[bench::step(unscented_ready())]
fn unscented(mut ready: Ready<Unscented<Straight, RangeBearing>>) {
    ready.step();
}

#[library_benchmark]
#[bench::step(imm_ready())]
fn imm_of_three(mut ready: Ready<Imm<Kalman<Turn, Position<2>>>>) {
    ready.step();
}

#[library_benchmark]
#[bench::step(particle_ready())]
fn particle_1000(mut ready: Ready<Particle<Straight, Position<2>>>) {
    ready.step();
}

library_benchmark_group!(
    name = steps,
    benchmarks = [kalman, extended, unscented, imm_of_three, particle_1000]
);
main!(library_benchmark_groups = steps);
