//! The filter section.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Count, MotionConfig, SensorConfig};
use crate::PipelineError;

/// How an object's state is estimated.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterConfig {
    /// The recursion.
    pub estimator: Estimator,
    /// With `estimator = "particle"`: number of particles per object. The default is 1,000.
    #[schemars(extend("x-unit" = "1"))]
    pub particles: Option<Count>,
    /// With `estimator = "particle"`: seed of the random numbers; equal seeds give equal tracks. Any whole number from 0.
    #[schemars(extend("x-unit" = "1"))]
    pub seed: u64,
}

/// The recursion that estimates one object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Estimator {
    /// Kalman where motion and sensors are linear; unscented for bearings alone, and for ranges and bearings where the arc of a
    /// bearing's error leaves its tangent by as much as the error of the range; extended elsewhere.
    #[default]
    Auto,
    /// Kalman filter: linear motion, sensors of positions or converted polar ones.
    Kalman,
    /// Extended Kalman filter: linearised at the mean.
    Extended,
    /// Unscented Kalman filter: sigma points.
    Unscented,
    /// Bootstrap particle filter.
    Particle,
}

impl FilterConfig {
    pub(super) fn check(
        &self,
        motion: &MotionConfig,
        sensors: &BTreeMap<String, SensorConfig>,
    ) -> Result<(), PipelineError> {
        let curved = sensors.iter().find(|(_, sensor)| !sensor.measures.is_linear());
        match (self.estimator, curved) {
            (Estimator::Kalman, Some((name, _))) => {
                let reason = format!(
                    "the sensor `{name}` is not linear; use \"extended\", \"unscented\" or \"particle\", or set its convert = true"
                );
                Err(PipelineError::config("filter.estimator", &reason))
            }
            (Estimator::Kalman | Estimator::Extended | Estimator::Unscented | Estimator::Particle, _)
                if matches!(motion, MotionConfig::Learned(_)) =>
            {
                Err(PipelineError::config(
                    "filter.estimator",
                    "a learned motion has a filter of its own; leave this key out",
                ))
            }
            (Estimator::Kalman, None) if !motion.is_linear() => Err(PipelineError::config(
                "filter.estimator",
                "coordinated_turn is not linear; use \"extended\", \"unscented\" or \"particle\"",
            )),
            (Estimator::Particle, _) if matches!(motion, MotionConfig::Switching(_)) => {
                Err(PipelineError::config(
                    "filter.estimator",
                    "a particle filter with switching motion is not available; use \"extended\" or \"unscented\"",
                ))
            }
            (Estimator::Particle, _) => Ok(()),
            (Estimator::Auto | Estimator::Kalman | Estimator::Extended | Estimator::Unscented, _) => {
                let idle = match (self.particles, self.seed) {
                    (Some(_), _) => "filter.particles",
                    (None, 0) => return Ok(()),
                    (None, _) => "filter.seed",
                };
                Err(PipelineError::config(idle, "needs filter.estimator = \"particle\""))
            }
        }
    }
}
