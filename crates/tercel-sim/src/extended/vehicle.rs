//! A vehicle whose velocity depends on the velocities before.

use nalgebra::{Vector2, Vector4};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use tercel_core::motion::Kinematics;

use super::Ride;
use crate::{Interval, SimulationError, Stream};

/// A population of vehicles: ellipses along their velocity, which is auto-regressive of some order.
///
/// ## Definition
/// Each vehicle draws its weights `a` (see [`Generator`]) and its size. From rest, with `ε ~ N(0, I₂)` m/s:
/// ```text
/// v(k) = Σ_i a_i v(k-i) + ε(k)
/// p(k) = p(k-1) + T v(k)            backward; forward: p(k-1) + T v(k-1)
/// ```
/// The first 200 steps are dropped, and the position then begins at zero. The ellipse points along the
/// velocity; below 0.3 m/s it keeps its direction.
///
/// ## Use it when
/// filters of one extended object are compared: this is the population of the RMMNet paper.
///
/// ## Reference
/// RMMNet paper, section IV.A and eq. 43. It says nothing about unstable weights, which its text draws in 97
/// % of all cases; the generators are three ways to stable ones. As printed the position moves with the old
/// velocity, whose noise no filter can have seen; its figures need the new one, which is the default.
///
/// ```
/// use tercel_sim::extended::{Generator, Vehicle};
///
/// let ride = Vehicle::new(Generator::Smooth).ride(1, 0);
/// assert_eq!((ride.states().len(), ride.coefficients().len()), (1000, 10));
/// assert_eq!(ride, Vehicle::new(Generator::Smooth).ride(1, 0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vehicle {
    generator: Generator,
    order: usize,
    steps: usize,
    interval: f64,
    kinematics: Kinematics,
    sizes: Sizes,
}

/// How the weights of a vehicle are drawn. All draw numbers from `(-1, 1)` and sort them by size, the largest
/// first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Generator {
    /// All again until the motion is stable: velocities that oscillate, some for long.
    Reject,
    /// Scaled so that their sizes add up to 0.98.
    L1,
    /// Their sizes alone, scaled to the sum 0.98: velocities that change slowly, as those of vehicles do.
    Smooth,
}

/// The sizes of a population.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sizes {
    /// One size for all: semi-axes in metres, along the velocity first.
    Fixed(Vector2<f64>),
    /// Semi-axes drawn from these intervals, m.
    Random {
        /// Along the velocity.
        along: Interval,
        /// Across it.
        across: Interval,
    },
}

impl Sizes {
    /// The published size: 12 m by 2.5 m.
    pub const PUBLISHED: Sizes = Sizes::Fixed(Vector2::new(6.0, 1.25));

    /// Cars to lorries: 6 m to 18 m by 1.6 m to 4 m.
    pub const MIXED: Sizes =
        Sizes::Random { along: Interval::fixed(3.0, 9.0), across: Interval::fixed(0.8, 2.0) };

    fn draw(&self, random: &mut impl Rng) -> Vector2<f64> {
        match self {
            Sizes::Fixed(axes) => *axes,
            Sizes::Random { along, across } => Vector2::new(along.draw(random), across.draw(random)),
        }
    }
}

/// Steps that are dropped before a ride begins.
const BURN_IN: usize = 200;

/// Speed below which a vehicle keeps its direction, m/s.
const STANDING: f64 = 0.3;

/// Sum of the sizes of scaled weights.
const STABLE: f64 = 0.98;

/// Largest order: beyond it hardly any draw is stable.
const LARGEST_ORDER: usize = 12;

impl Generator {
    /// Draws the weights of one vehicle.
    fn draw(self, order: usize, random: &mut impl Rng) -> Vec<f64> {
        loop {
            let mut weights: Vec<f64> = (0..order).map(|_| 2.0 * random.random::<f64>() - 1.0).collect();
            weights.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
            let sum: f64 = weights.iter().map(|weight| weight.abs()).sum();
            match self {
                Generator::Reject if !is_stable(&weights) => continue,
                Generator::Reject => {}
                Generator::L1 => weights.iter_mut().for_each(|weight| *weight *= STABLE / sum),
                Generator::Smooth => {
                    weights.iter_mut().for_each(|weight| *weight = weight.abs() * STABLE / sum)
                }
            }
            return weights;
        }
    }
}

/// Whether a motion whose velocity depends on the velocities before with these weights, the newest first, is stable: all roots of
/// its polynomial lie inside the unit circle, because the reflection coefficients of the step-down recursion are below one.
pub fn is_stable(weights: &[f64]) -> bool {
    let mut polynomial: Vec<f64> = weights.iter().map(|weight| -weight).collect();
    while let Some(reflection) = polynomial.pop() {
        if reflection.abs() >= 1.0 {
            return false;
        }
        let scale = 1.0 / (1.0 - reflection * reflection);
        let last = polynomial.len();
        polynomial =
            (0..last).map(|i| (polynomial[i] - reflection * polynomial[last - 1 - i]) * scale).collect();
    }
    true
}

impl Vehicle {
    /// The published population with this generator: order 10, 1000 steps of 1 s, 12 m by 2.5 m.
    pub fn new(generator: Generator) -> Self {
        Vehicle {
            generator,
            order: 10,
            steps: 1000,
            interval: 1.0,
            kinematics: Kinematics::Backward,
            sizes: Sizes::PUBLISHED,
        }
    }

    /// Sets the number of velocities before that a velocity depends on.
    ///
    /// # Errors
    /// Unless it is 1 to 12.
    pub fn with_order(self, order: usize) -> Result<Self, SimulationError> {
        let holds = (1..=LARGEST_ORDER).contains(&order);
        SimulationError::unless(holds, "order of the motion", order as f64, "it must be 1 to 12")?;
        Ok(Vehicle { order, ..self })
    }

    /// Sets the number of steps of a ride, the first state included.
    ///
    /// # Errors
    /// When there is none.
    pub fn with_steps(self, steps: usize) -> Result<Self, SimulationError> {
        SimulationError::unless(steps >= 1, "number of steps", steps as f64, "there must be at least 1")?;
        Ok(Vehicle { steps, ..self })
    }

    /// Sets which velocity moves the position.
    pub fn with_kinematics(self, kinematics: Kinematics) -> Self {
        Vehicle { kinematics, ..self }
    }

    /// Sets the sizes.
    ///
    /// # Errors
    /// When a semi-axis may be zero or less.
    pub fn with_sizes(self, sizes: Sizes) -> Result<Self, SimulationError> {
        let least = match sizes {
            Sizes::Fixed(axes) => axes.min(),
            Sizes::Random { along, across } => along.low().min(across.low()),
        };
        SimulationError::unless(least > 0.0, "smallest semi-axis", least, "it must be positive")?;
        Ok(Vehicle { sizes, ..self })
    }

    /// Number of steps of a ride.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Time between steps, s.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// Ride number `run`.
    pub fn ride(&self, seed: u64, run: u64) -> Ride {
        let mut random = Stream::Truth.of(seed, run);
        let weights = self.generator.draw(self.order, &mut random);
        let axes = self.sizes.draw(&mut random);
        let total = BURN_IN + self.steps;
        let mut velocities: Vec<Vector2<f64>> = Vec::with_capacity(total);
        for _ in 0..total {
            let before = velocities.iter().rev().zip(&weights).map(|(velocity, weight)| velocity * *weight);
            let noise = Vector2::from_fn(|_, _| StandardNormal.sample(&mut random));
            velocities.push(before.sum::<Vector2<f64>>() + noise);
        }
        let (mut place, mut angle) = (Vector2::zeros(), 0.0);
        let (mut states, mut angles) = (Vec::with_capacity(self.steps), Vec::with_capacity(self.steps));
        for (step, velocity) in velocities.iter().enumerate() {
            if velocity.norm() >= STANDING {
                angle = velocity.y.atan2(velocity.x);
            }
            if step < BURN_IN {
                continue;
            }
            if step > BURN_IN {
                let moving = match self.kinematics {
                    Kinematics::Backward => velocity,
                    Kinematics::Forward => &velocities[step - 1],
                };
                place += moving * self.interval;
            }
            states.push(Vector4::new(place.x, place.y, velocity.x, velocity.y));
            angles.push(angle);
        }
        Ride { interval: self.interval, states, angles, axes, coefficients: weights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_down_recursion_knows_the_unit_circle() {
        assert!(is_stable(&[0.99]) && !is_stable(&[1.0]) && !is_stable(&[-1.01]));
        // Complex roots of radius √0.9, √1.1.
        assert!(is_stable(&[1.2, -0.9]) && !is_stable(&[1.2, -1.1]));
        // (1 - 0.5 z)(1 - 2 z) has a root outside.
        assert!(!is_stable(&[2.5, -1.0]));
    }

    #[test]
    fn about_three_draws_in_a_hundred_of_order_ten_are_stable() {
        let mut random = Stream::Truth.of(5, 0);
        let mut stable = 0;
        for _ in 0..20_000 {
            let mut weights: Vec<f64> = (0..10).map(|_| 2.0 * random.random::<f64>() - 1.0).collect();
            weights.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
            stable += u32::from(is_stable(&weights));
        }
        assert!((480..680).contains(&stable), "{stable}");
    }

    #[test]
    fn positions_move_with_the_velocity_that_the_kinematics_say() {
        let vehicle = Vehicle::new(Generator::Reject).with_steps(50).unwrap();
        for (kinematics, lag) in [(Kinematics::Backward, 0), (Kinematics::Forward, 1)] {
            let ride = vehicle.with_kinematics(kinematics).ride(3, 1);
            for step in 1..50 {
                let (state, before) = (ride.states()[step], ride.states()[step - 1]);
                let moving = ride.states()[step - lag];
                assert!((state.x - before.x - moving.z).abs() < 1e-12);
                assert!((state.y - before.y - moving.w).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_ellipse_points_where_the_vehicle_goes() {
        let ride = Vehicle::new(Generator::L1).ride(3, 1);
        let fast = ride.states().iter().enumerate().filter(|(_, state)| state.z.hypot(state.w) > STANDING);
        for (step, state) in fast {
            assert_eq!(ride.ellipse(step).angle, state.w.atan2(state.z));
        }
    }
}
