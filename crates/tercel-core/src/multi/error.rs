//! Scans that a tracker refuses.

/// A scan that could not be taken in. The tracker is left as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrackerError {
    /// The scan is older than the last one.
    #[error("scan at {time} s is {} s older than the last one", .last - .time)]
    OutOfOrder {
        /// Time of the refused scan, s.
        time: f64,
        /// Time of the last scan, s.
        last: f64,
    },
    /// The time of the scan is not finite.
    #[error("the time of a scan is {time}; it must be finite")]
    Time {
        /// The time that was given.
        time: f64,
    },
    /// A measurement holds a number that is not finite.
    #[error("measurement {measurement} of the scan at {time} s is not finite")]
    Measurement {
        /// Time of the scan, s.
        time: f64,
        /// Number of the measurement in the scan, from zero.
        measurement: usize,
    },
}

/// The step from the `last` scan to one at `time`, zero for the first.
pub(super) fn step(time: f64, last: Option<f64>) -> Result<f64, TrackerError> {
    if !time.is_finite() {
        return Err(TrackerError::Time { time });
    }
    match last {
        Some(last) if time < last => Err(TrackerError::OutOfOrder { time, last }),
        Some(last) => Ok(time - last),
        None => Ok(0.0),
    }
}
