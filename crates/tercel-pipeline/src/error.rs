//! What can go wrong between a configuration, its scans and its tracks.

use tercel_core::error::FilterError;
use tercel_core::multi::TrackerError;

/// A configuration or a scan that a pipeline refuses.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The configuration is not valid TOML, has an unknown key, or a value outside its range.
    #[error("{0}")]
    Syntax(Box<toml::de::Error>),
    /// Parts of the configuration do not fit together.
    #[error("configuration key `{key}`: {reason}")]
    Config {
        /// The key, with dots.
        key: String,
        /// What is wrong and what was expected.
        reason: String,
    },
    /// A scan comes from a sensor that the configuration does not describe.
    #[error(
        "the scan at {time} s comes from the sensor `{sensor}`, which the configuration does not describe\n  \
         help: add a section [sensors.{sensor}], or leave it out with [input] ignore = [\"{sensor}\"]"
    )]
    UnknownSensor {
        /// Time of the scan, s.
        time: f64,
        /// Name of the sensor.
        sensor: String,
    },
    /// A detection does not hold what its sensor is said to measure.
    #[error("detection {detection} of sensor `{sensor}` at {time} s has no {expected}\n  help: {help}")]
    Observation {
        /// Time of the scan, s.
        time: f64,
        /// Name of the sensor.
        sensor: String,
        /// Number of the detection.
        detection: u64,
        /// What was expected of it.
        expected: &'static str,
        /// What would help.
        help: String,
    },
    /// What a track says is not finite: its numbers have become too large.
    #[error(
        "track {track} at {time} s has a state that is not finite\n  help: are the times in seconds, and the measurements in metres?"
    )]
    Estimate {
        /// Time of the scan, s.
        time: f64,
        /// Number of the track.
        track: u64,
    },
    /// The tracker refused a scan.
    #[error("sensor `{sensor}`: {source}")]
    Tracker {
        /// Name of the sensor.
        sensor: String,
        /// Why.
        source: TrackerError,
    },
}

impl PipelineError {
    pub(crate) fn config(key: &str, reason: &str) -> Self {
        PipelineError::Config { key: key.to_string(), reason: reason.to_string() }
    }

    /// An error of the mathematics that a value of the configuration causes.
    pub(crate) fn parameter(key: &str, source: &FilterError) -> Self {
        PipelineError::Config { key: key.to_string(), reason: source.to_string() }
    }
}
