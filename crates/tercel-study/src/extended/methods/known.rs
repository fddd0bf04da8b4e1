//! Filters that know the size of the object.

use nalgebra::{SMatrix, SVector};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{Aligned, AlignedAutoRegressive, KnownSize, Pointing};
use tercel_core::motion::AutoRegressive;

use super::matrix::{sensor, straight};
use super::{Method, Recording, Settings, StepEstimate};
use crate::extended::recording::follow;

/// Known size, the angle from the scan or the course.
pub(super) struct Sized(pub Settings);

impl Method for Sized {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let pointing = if self.0.course { Pointing::Course } else { Pointing::Scan };
        let motion = straight(self.0.jump_known);
        let filter = KnownSize::new(motion, sensor(recording)?, recording.ride.axes(), pointing)?;
        follow::<4, _>(recording, &filter)
    }
}

/// Aligned, in straight motion.
pub(super) struct Straight(pub Settings);

impl Method for Straight {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let motion = straight(self.0.jump_aligned);
        follow::<4, _>(recording, &Aligned::new(motion, sensor(recording)?, recording.ride.axes())?)
    }
}

/// Order of the regressions.
const ORDER: usize = 10;

/// Length of a state with so many velocities.
const STATE: usize = 2 + 2 * ORDER;

/// Aligned, in a motion that is identified on line.
pub(super) struct Regressive(pub Settings);

impl Method for Regressive {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let (axes, interval) = (recording.ride.axes(), recording.ride.interval());
        let weights = Gaussian {
            mean: SVector::from_fn(|lag, _| if lag == 0 { 1.0 } else { 0.0 }),
            covariance: SMatrix::identity() * self.0.weights,
        };
        let filter =
            AlignedAutoRegressive::<ORDER>::new(sensor(recording)?, axes, interval, self.0.residual)?;
        follow::<STATE, _>(recording, &filter.with_coefficients(weights))
    }
}

/// Aligned, in the true motion.
pub(super) struct Oracle;

impl Method for Oracle {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let ride = &recording.ride;
        let weights = SVector::from_fn(|lag, _| ride.coefficients().get(lag).copied().unwrap_or(0.0));
        let motion = AutoRegressive::<ORDER>::new(weights, ride.interval(), 1.0);
        follow::<STATE, _>(recording, &Aligned::new(motion, sensor(recording)?, ride.axes())?)
    }
}
