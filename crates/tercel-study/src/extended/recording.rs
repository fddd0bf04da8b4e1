//! What a method sees of an extended object, and what it makes of it.

use nalgebra::{Matrix2, Matrix4, SVector, Vector4};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::Points;
use tercel_core::filter::Filter;
use tercel_sim::extended::{Ride, Scatterers};

/// An extended object as a sensor recorded it.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The truth.
    pub ride: Ride,
    /// How its points spread.
    pub scatterers: Scatterers,
    /// The points of each step.
    pub scans: Vec<Points>,
    /// Seed of the random numbers of methods.
    pub seed: u64,
}

/// What a method believes of the object after a step.
#[derive(Debug, Clone, PartialEq)]
pub struct StepEstimate {
    /// `x, y, vx, vy` in m and m/s. NaN where the method says nothing.
    pub mean: Vector4<f64>,
    /// Covariance of the state.
    pub covariance: Matrix4<f64>,
    /// The extent matrix, m².
    pub extent: Matrix2<f64>,
}

/// A way to estimate an extended object.
pub trait Method: Sync {
    /// Estimates at every step of the recording.
    ///
    /// # Errors
    /// When the filter fails.
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError>;
}

/// Variance of the first state, in m² and m²/s²: filters begin at the truth, as published.
const START: f64 = 10.0;

/// Runs a filter over a recording, from the true first state on. Velocities before it are believed to be the
/// first.
pub(super) fn follow<const N: usize, F>(
    recording: &Recording,
    filter: &F,
) -> Result<Vec<StepEstimate>, FilterError>
where
    F: Filter<N, Measurement = Points> + ?Sized,
{
    let Some(first) = recording.scans.iter().find(|scan| !scan.is_empty()) else {
        return Ok(Vec::new());
    };
    let mut belief = filter.birth(first)?;
    let start = recording.ride.states()[0];
    let state = filter.state(&belief);
    // Components beyond position and velocity are velocities before, or accelerations, of which nothing is
    // known.
    let before = |i: usize| if N > 6 { start[2 + i % 2] } else { state.mean[i] };
    let mean = SVector::<f64, N>::from_fn(|i, _| if i < 4 { start[i] } else { before(i) });
    let covariance = nalgebra::SMatrix::identity() * START;
    filter.set_state(&mut belief, &Gaussian { mean, covariance });
    let mut estimates = Vec::with_capacity(recording.scans.len());
    for (step, scan) in recording.scans.iter().enumerate() {
        if step > 0 {
            filter.predict(&mut belief, recording.ride.interval());
            filter.update(&mut belief, scan)?;
        }
        let estimate = filter.estimate(&belief);
        let state = Gaussian { mean: estimate.mean, covariance: estimate.covariance }.leading::<4>();
        let extent = estimate.extent.unwrap_or_else(|| Matrix2::repeat(f64::NAN));
        estimates.push(StepEstimate { mean: state.mean, covariance: state.covariance, extent });
    }
    Ok(estimates)
}
