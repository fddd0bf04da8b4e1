//! The canonical tables: flat, SI units, radians.

mod detection;
mod metric;
mod track;
mod truth;

pub use detection::{Description, Detection, Detections, Noise, Observation, Scan, SensorDescription};
pub use metric::{Metric, Metrics};
pub use track::{Status, Track, Tracks};
pub use truth::{Truth, Truths};

use serde::{Deserialize, Serialize};

/// The local frame of a table: where its origin lies on the Earth, if anywhere. Axes are `x` east, `y` north, `z` up.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// WGS84 latitude of the origin, rad, north positive.
    pub latitude: f64,
    /// WGS84 longitude of the origin, rad, east positive.
    pub longitude: f64,
    /// Height of the origin above the WGS84 ellipsoid, m.
    pub altitude: f64,
}
