//! What the sensors saw.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Origin;

/// All detections of a recording, scan by scan, in the order of the source.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detections {
    /// Where the local frame lies, if it is known.
    pub origin: Option<Origin>,
    /// What the recording was before it became a table.
    pub description: Description,
    /// The scans. In the file, a scan without detections is one row whose detection is empty.
    pub scans: Vec<Scan>,
}

/// What one sensor saw at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Seconds; any epoch, as long as it is the same for the whole recording. That of the last detection, where these have
    /// times of their own.
    pub time: f64,
    /// Name of the sensor: the key of its section in a configuration.
    pub sensor: Arc<str>,
    /// Position of the sensor in the local frame (`x, y, z`), m, when it came with the data.
    pub position: Option<[f64; 3]>,
    /// Velocity of the sensor in the local frame (`x, y, z`), m/s, when it came with the data.
    pub velocity: Option<[f64; 3]>,
    /// What was seen; may be empty, which tells a tracker that nothing was.
    pub detections: Vec<Detection>,
}

/// One detection.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Number of the detection, unique in its recording.
    pub id: u64,
    /// When the object was measured, s, where that is not the time of the scan: a radar that turns sees one object after the
    /// other.
    pub time: Option<f64>,
    /// What was measured.
    pub observation: Observation,
    /// Standard deviations that came with the detection, if any.
    pub noise: Noise,
    /// What the object or the sensor says that it is: the number of a ship (MMSI), the address or code of an aircraft, the
    /// number of a track that the sensor keeps. Evidence for the tracker, which may be wrong.
    pub identity: Option<Arc<str>>,
    /// The object that is really behind it, when it is known (simulations). Trackers never see it.
    pub truth: Option<Arc<str>>,
}

impl Detection {
    /// A detection at the time of its scan, without anything that need not be known.
    pub fn new(id: u64, observation: Observation) -> Self {
        Detection { id, time: None, observation, noise: Noise::default(), identity: None, truth: None }
    }
}

impl Scan {
    /// A scan by a sensor whose place does not come with the data.
    pub fn new(time: f64, sensor: impl Into<Arc<str>>, detections: Vec<Detection>) -> Self {
        Scan { time, sensor: sensor.into(), position: None, velocity: None, detections }
    }
}

/// What a recording was before it became a table: what is needed to track the table as the original.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Description {
    /// Name of the source, as `--from` takes it: `ais`, `adsb`, `autoferry`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// What is known of the sensors, by name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub sensors: BTreeMap<String, SensorDescription>,
}

/// What a recording says of one of its sensors.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorDescription {
    /// Each detection is a report that one object made of itself, and says nothing of others (AIS, ADS-B, GPS).
    pub reports: bool,
    /// Its detections carry an identity.
    pub identity: bool,
    /// Median time between scans; for reports, between those of one object, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval: Option<f64>,
}

impl Description {
    /// True when nothing is known.
    pub fn is_empty(&self) -> bool {
        *self == Description::default()
    }

    /// What is known of a recording that this one and `other` were joined into: the source if it is that of both, and of a
    /// sensor what holds for both.
    pub fn joined(mut self, other: Description) -> Description {
        self.source = self.source.filter(|source| other.source.as_ref() == Some(source));
        for (name, theirs) in other.sensors {
            let ours = self.sensors.entry(name).or_insert_with(|| theirs.clone());
            *ours = SensorDescription {
                reports: ours.reports && theirs.reports,
                identity: ours.identity && theirs.identity,
                interval: ours.interval.zip(theirs.interval).map(|(ours, theirs)| ours.min(theirs)),
            };
        }
        self
    }

    /// True when every sensor is known to report objects one by one, so that a report says nothing of other objects.
    pub fn all_report(&self) -> bool {
        !self.sensors.is_empty() && self.sensors.values().all(|sensor| sensor.reports)
    }
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
        /// Height of the object in the local frame, m, when it came with the measurement; the range is then a slant range.
        z: Option<f64>,
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

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(source: &str, sensors: &[(&str, bool, Option<f64>)]) -> Description {
        let sensors = sensors.iter().map(|(name, reports, interval)| {
            let sensor = SensorDescription { reports: *reports, identity: true, interval: *interval };
            ((*name).to_owned(), sensor)
        });
        Description { source: Some(source.to_owned()), sensors: sensors.collect() }
    }

    #[test]
    fn of_joined_recordings_what_holds_for_both_is_known() {
        let (monday, tuesday) =
            (recording("ais", &[("ais", true, Some(10.0))]), recording("ais", &[("ais", true, Some(8.0))]));
        assert_eq!(monday.clone().joined(tuesday), recording("ais", &[("ais", true, Some(8.0))]));
        let both = monday.clone().joined(recording("autoferry", &[("radar", false, None)]));
        assert_eq!((both.source.as_deref(), both.sensors.len(), both.all_report()), (None, 2, false));
        let doubtful = monday.clone().joined(recording("ais", &[("ais", false, None)]));
        assert!(!doubtful.all_report() && monday.all_report() && !Description::default().all_report());
    }
}
