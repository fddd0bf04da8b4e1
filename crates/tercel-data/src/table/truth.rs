//! What was really there.

use std::sync::Arc;

use super::Origin;

/// The true states of the objects of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truths {
    /// Where the local frame lies, if it is known.
    pub origin: Option<Origin>,
    /// The rows, grouped by nothing and in any order.
    pub rows: Vec<Truth>,
}

/// One object at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Seconds, in the epoch of the detections.
    pub time: f64,
    /// Identity of the object.
    pub object: Arc<str>,
    /// Position in the local frame, m; `z` where it is known.
    pub position: [f64; 2],
    /// Height, m.
    pub z: Option<f64>,
    /// Velocity, m/s, where it is known.
    pub velocity: Option<[f64; 2]>,
    /// Extent: semi-axes (m) and orientation of the first (rad), where it is known.
    pub extent: Option<[f64; 3]>,
}
