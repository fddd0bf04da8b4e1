//! Altitudes of tracks whose state has no height.

use std::collections::HashMap;

use tercel_data::table::{Observation, Origin, Scan, Status, Track};

/// Remembers the altitudes that come with detections, and gives them to the tracks that these update.
#[derive(Debug, Default)]
pub struct Altitudes {
    origin: Option<Origin>,
    /// Of the detections of scans that may still be held back.
    waiting: HashMap<u64, f64>,
    /// Those scans: time, and numbers of the detections.
    scans: Vec<(f64, Vec<u64>)>,
    /// The last one of each track.
    known: HashMap<u64, f64>,
}

impl Altitudes {
    /// Heights over the plane of the local frame become altitudes, if it is known where that lies.
    pub fn new(origin: Option<Origin>) -> Self {
        Altitudes { origin, ..Altitudes::default() }
    }

    /// Remembers the heights of a scan.
    pub fn hear(&mut self, scan: &Scan) {
        let Some(origin) = self.origin else { return };
        let mut numbers = Vec::new();
        for detection in &scan.detections {
            if let Observation::Position { x, y, z: Some(z) } = detection.observation
                && let Some(altitude) = origin.altitude_of([x, y, z])
            {
                self.waiting.insert(detection.id, altitude);
                numbers.push(detection.id);
            }
        }
        if !numbers.is_empty() {
            self.scans.push((scan.time, numbers));
        }
    }

    /// Gives rows the altitude that was heard last of their track.
    pub fn give(&mut self, rows: &mut [Track]) {
        for row in rows {
            if let Some(altitude) = row.detection.and_then(|number| self.waiting.get(&number)) {
                self.known.insert(row.track, *altitude);
            }
            row.altitude = self.known.get(&row.track).copied();
            if row.status == Status::Deleted {
                self.known.remove(&row.track);
            }
        }
    }

    /// Forgets the detections that have led to rows: all but the newest `held`.
    pub fn forget(&mut self, held: usize) {
        if self.waiting.len() <= held {
            return;
        }
        self.scans.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut over = self.waiting.len() - held;
        let gone = self.scans.iter().take_while(|(_, numbers)| {
            let fits = numbers.len() <= over;
            over -= numbers.len().min(over);
            fits
        });
        let gone = gone.count();
        for (_, numbers) in self.scans.drain(..gone) {
            numbers.iter().for_each(|number| {
                self.waiting.remove(number);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tercel_data::table::Detection;

    fn scan(time: f64, id: u64, z: Option<f64>) -> Scan {
        Scan::new(time, "adsb", vec![Detection::new(id, Observation::Position { x: 0.0, y: 0.0, z })])
    }

    fn row(status: Status, detection: Option<u64>) -> Track {
        Track {
            time: 0.0,
            sensor: "adsb".into(),
            track: 5,
            status,
            existence: 1.0,
            state: vec![],
            covariance: vec![],
            modes: vec![],
            extent: None,
            altitude: None,
            identity: None,
            detection,
        }
    }

    #[test]
    fn a_track_keeps_the_altitude_that_was_heard_last() {
        let origin = Origin { latitude: 0.8, longitude: 0.1, altitude: 400.0 };
        let mut altitudes = Altitudes::new(Some(origin));
        let mut given = |scan: Scan, row: Track| {
            altitudes.hear(&scan);
            let mut rows = [row];
            altitudes.give(&mut rows);
            altitudes.forget(0);
            rows[0].altitude.map(f64::round)
        };
        assert_eq!(given(scan(0.0, 1, None), row(Status::Confirmed, Some(1))), None);
        assert_eq!(given(scan(1.0, 2, Some(600.0)), row(Status::Confirmed, Some(2))), Some(1000.0));
        assert_eq!(given(scan(2.0, 3, None), row(Status::Coasted, None)), Some(1000.0));
        assert_eq!(given(scan(3.0, 4, Some(700.0)), row(Status::Coasted, None)), Some(1000.0));
        assert_eq!(given(scan(4.0, 5, None), row(Status::Deleted, None)), Some(1000.0));
        assert_eq!(given(scan(5.0, 6, None), row(Status::Confirmed, None)), None, "another life");
    }

    #[test]
    fn scans_that_are_held_back_are_remembered_and_others_are_not() {
        let origin = Origin { latitude: 0.8, longitude: 0.1, altitude: 0.0 };
        let mut altitudes = Altitudes::new(Some(origin));
        for (time, id) in [(0.0, 1), (2.0, 2), (1.0, 3)] {
            altitudes.hear(&scan(time, id, Some(9.0)));
        }
        altitudes.forget(1);
        assert_eq!(altitudes.waiting.keys().collect::<Vec<_>>(), [&2]);
    }
}
