//! Extended objects: an ellipse that moves, and the points that a sensor sees of it.
//!
//! | scenario | what happens |
//! |---|---|
//! | [`Vehicle`] | an ellipse along its velocity, which depends on the velocities before |
//! | [`Heading`] | the direction of an aircraft on a track that was recorded |
//! | [`Crossing`] | several ellipses that cross among false points |
//!
//! [`Scatterers`] draw the points of all of them.

mod crossing;
mod heading;
mod scatterers;
mod vehicle;

use nalgebra::{Vector2, Vector4};
use tercel_core::extended::{Ellipse, Points};

use crate::{SimulationError, Stream};

pub use crossing::{Crossing, CrossingScene};
pub use heading::Heading;
pub use scatterers::Scatterers;
pub use vehicle::{Generator, Sizes, Vehicle, is_stable};

/// The truth of one extended object at equal steps of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Ride {
    interval: f64,
    states: Vec<Vector4<f64>>,
    angles: Vec<f64>,
    axes: Vector2<f64>,
    coefficients: Vec<f64>,
}

impl Ride {
    /// A truth with these states (`x, y, vx, vy`), directions of the first semi-axis (rad), and semi-axes
    /// (m).
    ///
    /// # Errors
    /// When there is not one angle per state, or a number is not finite or not positive where it has to be.
    pub fn new(
        interval: f64,
        states: Vec<Vector4<f64>>,
        angles: Vec<f64>,
        axes: Vector2<f64>,
    ) -> Result<Self, SimulationError> {
        let unless = SimulationError::unless;
        unless(
            interval > 0.0 && interval.is_finite(),
            "time between steps",
            interval,
            "it must be positive",
        )?;
        let count = angles.len() as f64;
        unless(angles.len() == states.len(), "number of angles", count, "there must be one per state")?;
        for axis in axes.iter().copied() {
            unless(axis > 0.0 && axis.is_finite(), "semi-axis", axis, "it must be positive and finite")?;
        }
        for value in states.iter().flat_map(|state| state.iter()).chain(&angles).copied() {
            unless(value.is_finite(), "state or angle", value, "it must be finite")?;
        }
        Ok(Ride { interval, states, angles, axes, coefficients: Vec::new() })
    }

    /// Time between steps, s.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// `x, y, vx, vy` of the centre at each step.
    pub fn states(&self) -> &[Vector4<f64>] {
        &self.states
    }

    /// Semi-axes (m), the one along the direction first.
    pub fn axes(&self) -> Vector2<f64> {
        self.axes
    }

    /// Weights of the last velocities in the next, the newest first; none when the motion was not drawn.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// The ellipse at a step.
    pub fn ellipse(&self, step: usize) -> Ellipse {
        let state = &self.states[step];
        Ellipse { center: Vector2::new(state.x, state.y), axes: self.axes, angle: self.angles[step] }
    }

    /// The points that are seen at each step. They depend on the seed, the number of the run and the truth
    /// alone.
    pub fn observe(&self, scatterers: &Scatterers, seed: u64, run: u64) -> Vec<Points> {
        let mut noise = Stream::Noise { realisation: 0 }.of(seed, run);
        let mut counts = Stream::Detection { realisation: 0 }.of(seed, run);
        (0..self.states.len())
            .map(|step| {
                let count = scatterers.count(&mut counts);
                scatterers.points(&self.ellipse(step), count, &mut noise).collect()
            })
            .collect()
    }
}
