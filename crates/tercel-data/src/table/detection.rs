//! What the sensors saw.

use std::sync::Arc;

use super::Origin;

/// All detections of a recording, scan by scan, in the order of the source.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detections {
    /// Where the local frame lies, if it is known.
    pub origin: Option<Origin>,
    /// The scans. In the file, a scan without detections is one row whose detection is empty.
    pub scans: Vec<Scan>,
}

/// What one sensor saw at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Seconds; any epoch, as long as it is the same for the whole recording.
    pub time: f64,
    /// Name of the sensor: the key of its section in a configuration.
    pub sensor: Arc<str>,
    /// Position of the sensor in the local frame (`x, y, z`), m, when it came with the data.
    pub position: Option<[f64; 3]>,
    /// What was seen; may be empty, which tells a tracker that nothing was.
    pub detections: Vec<Detection>,
}

/// One detection.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Number of the detection, unique in its recording.
    pub id: u64,
    /// What was measured.
    pub observation: Observation,
    /// Standard deviations that came with the detection, if any.
    pub noise: Noise,
    /// Identity of the object behind it, when it is known (simulations, cooperative reports).
    pub truth: Option<Arc<str>>,
}

/// The measured components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Observation {
    /// A position in the local frame, m.
    Position {
        /// East, m.
        x: f64,
        /// North, m.
        y: f64,
        /// Up, m, when it was measured.
        z: Option<f64>,
    },
    /// Components relative to the sensor. At least the bearing is known.
    Polar {
        /// Distance, m.
        range: Option<f64>,
        /// Mathematical bearing: from east (`x`) towards north (`y`), rad in [-π, π].
        bearing: f64,
        /// Range rate, m/s, positive when the object recedes.
        range_rate: Option<f64>,
    },
}

/// Standard deviations of the measured components. Columns `sigma_x` ... `sigma_range_rate`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Noise {
    /// Of `x`, m.
    pub x: Option<f64>,
    /// Of `y`, m.
    pub y: Option<f64>,
    /// Of `z`, m.
    pub z: Option<f64>,
    /// Of the range, m.
    pub range: Option<f64>,
    /// Of the bearing, rad.
    pub bearing: Option<f64>,
    /// Of the range rate, m/s.
    pub range_rate: Option<f64>,
}
