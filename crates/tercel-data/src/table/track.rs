//! What a tracker made of the detections.

pub use tercel_core::multi::Status;

use super::Origin;

/// The tracks of a recording: one row per reported track and scan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tracks {
    /// Where the local frame lies, if it is known.
    pub origin: Option<Origin>,
    /// Names of the state's components, in order: `x`, `y`, `vx`, `vy`, and then `ax`, `ay` or `turn_rate`
    /// (`z`, `vz`, `az` in space). They name the columns `x` ..., and `cov_x_x`, `cov_x_y` ... of the covariance.
    pub labels: Vec<String>,
    /// Names of the motion modes: columns `mode_NAME`. Empty for filters with one mode.
    pub modes: Vec<String>,
    /// The rows, in the order in which they were made.
    pub rows: Vec<Track>,
}

/// One track after one scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Time of the scan, s.
    pub time: f64,
    /// Name of the sensor whose scan it was.
    pub sensor: std::sync::Arc<str>,
    /// Number of the track; never used twice in a run.
    pub track: u64,
    /// Where the track is in its life.
    pub status: Status,
    /// Probability that the object exists, 0 to 1.
    pub existence: f64,
    /// Mean of the state, in the order of [`Tracks::labels`].
    pub state: Vec<f64>,
    /// Covariance of the state: upper triangle, row by row.
    pub covariance: Vec<f64>,
    /// Probability of each mode, in the order of [`Tracks::modes`].
    pub modes: Vec<f64>,
    /// Extent of the object: semi-axes (m) and orientation of the first (rad), if it is estimated.
    pub extent: Option<[f64; 3]>,
    /// Height above the WGS84 ellipsoid that detections gave last, m, where the state has no height of its own. Files keep it
    /// where the table has an origin.
    pub altitude: Option<f64>,
    /// What the object is called, where sensors said so.
    pub identity: Option<std::sync::Arc<str>>,
    /// The detection that updated the track in this scan, if one did.
    pub detection: Option<u64>,
}
