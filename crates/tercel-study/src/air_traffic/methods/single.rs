//! Filters of one straight motion that work on polar measurements.

use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Filter, Unscented};
use tercel_core::motion::{AccelerationNoise, ConstantVelocity};
use tercel_core::sensor::{Measurement, RangeBearing};

use super::{Plot, bank::NOMINAL, follow, stated};
use crate::air_traffic::{Method, Recording, StepEstimate};

/// Acceleration that stands for the turns which a straight motion does not have, m/s² per axis.
const ACCELERATION: f64 = 45.0;

fn motion() -> ConstantVelocity {
    ConstantVelocity::with_noise(AccelerationNoise::Piecewise(ACCELERATION)).with_speed(300.0)
}

fn run<F>(recording: &Recording, filter: &F) -> Result<Vec<StepEstimate>, FilterError>
where
    F: Filter<4, Belief = Gaussian<4>, Measurement = Measurement<2>>,
{
    let measure = |plot: &Plot| stated(plot, recording);
    follow(recording, filter, measure, measure, |belief| StepEstimate {
        mean: belief.mean,
        covariance: Some(belief.covariance),
        manoeuvres: None,
    })
}

/// The extended Kalman filter.
pub(super) struct StraightExtended;

impl Method for StraightExtended {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        run(recording, &Extended::new(motion(), RangeBearing::new(NOMINAL.0, NOMINAL.1)?))
    }
}

/// The unscented Kalman filter.
pub(super) struct StraightUnscented;

impl Method for StraightUnscented {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        run(recording, &Unscented::new(motion(), RangeBearing::new(NOMINAL.0, NOMINAL.1)?))
    }
}
