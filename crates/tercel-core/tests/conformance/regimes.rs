//! Regimes of the suite's straight motion.

use rand::{Rng, RngExt};
use tercel_core::conformance::Problem;
use tercel_core::filter::{RandomTurns, Regime};
use tercel_core::motion::ConstantVelocity;

/// Modes that jump at every step, and are all the right model.
pub struct Equal {
    motion: ConstantVelocity,
    modes: usize,
}

impl Equal {
    pub fn of(problem: &Problem, modes: usize) -> Self {
        Equal { motion: problem.motion(), modes }
    }
}

impl Regime<4> for Equal {
    type Parameters = usize;
    type Motion = ConstantVelocity;

    fn draw(&self, random: &mut impl Rng) -> usize {
        random.random_range(0..self.modes)
    }
    fn jump(&self, mode: &mut usize, _: f64, random: &mut impl Rng) {
        *mode = self.draw(random);
    }
    fn motion(&self, _: &usize) -> ConstantVelocity {
        self.motion
    }
    fn modes(&self) -> usize {
        self.modes
    }
    fn mode(&self, mode: &usize) -> usize {
        *mode
    }
}

/// Noises somewhat below and above the right one, which change now and then.
pub struct Levels(Problem);

impl Levels {
    pub fn of(problem: &Problem) -> Self {
        Levels(*problem)
    }
}

impl Regime<4> for Levels {
    type Parameters = f64;
    type Motion = ConstantVelocity;

    fn draw(&self, random: &mut impl Rng) -> f64 {
        random.random_range(0.7..1.3)
    }
    fn jump(&self, factor: &mut f64, dt: f64, random: &mut impl Rng) {
        if random.random_bool(1.0 - (-0.1 * dt).exp()) {
            *factor = self.draw(random);
        }
    }
    fn motion(&self, factor: &f64) -> ConstantVelocity {
        Problem { density: self.0.density * factor, ..self.0 }.motion()
    }
}

/// Turns of aircraft, with accelerations about as strong as those of the problem over a second.
pub fn turns(problem: &Problem) -> RandomTurns {
    let size = problem.density.sqrt();
    RandomTurns::new(0.05, 0.2, 0.5 * size..=2.0 * size).unwrap().with_speed(20.0).unwrap()
}
