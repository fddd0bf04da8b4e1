//! What a method sees of a flight, and what it makes of it.

use nalgebra::{Matrix4, Vector2, Vector4};
use tercel_core::error::FilterError;
use tercel_sim::air_traffic::{AirTraffic, Flight, Radar};

/// A flight as a radar recorded it.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The truth.
    pub flight: Flight,
    /// The radar, with the accuracy that its data sheet states.
    pub radar: Radar,
    /// Range (m) and bearing (rad) at each step, or nothing where the radar missed.
    pub plots: Vec<Option<Vector2<f64>>>,
    /// The seed from which it was drawn.
    pub seed: u64,
    /// The number of the flight.
    pub run: u64,
}

/// What a method believes of the flight after a step.
#[derive(Debug, Clone, PartialEq)]
pub struct StepEstimate {
    /// `x, y, vx, vy` in m and m/s. NaN where the method says nothing.
    pub mean: Vector4<f64>,
    /// Covariance of the state, if the method has one.
    pub covariance: Option<Matrix4<f64>>,
    /// Probabilities of straight flight, a left and a right turn, if the method tells them apart.
    pub manoeuvres: Option<[f64; 3]>,
}

/// A way to estimate a flight.
pub trait Method: Sync {
    /// Estimates at every step of the recording.
    ///
    /// # Errors
    /// When the filter fails.
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError>;
}

impl Recording {
    /// Flight number `run` of a population, seen by its own radar.
    pub fn new(scenario: &AirTraffic, seed: u64, run: u64) -> Self {
        let flight = scenario.flight(seed, run);
        let radar = flight.radar();
        Recording::with_radar(flight, radar, seed, run)
    }

    /// A flight seen by any radar.
    pub fn with_radar(flight: Flight, radar: Radar, seed: u64, run: u64) -> Self {
        let plots = flight.observe(&radar, seed, run);
        Recording { flight, radar, plots, seed, run }
    }
}
