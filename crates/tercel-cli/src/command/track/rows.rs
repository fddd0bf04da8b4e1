//! Which rows of the tracks are written.

use std::collections::HashMap;

use tercel_data::table::{Status, Track};

/// When a track has a row. Its first and its last one are always there, and one whenever its status changes. Without a choice
/// it is when a detection updated it, for reports, and after every scan otherwise: a report of one object says nothing of the
/// others, so a row of every track at every report would only repeat what was known before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rows {
    /// When a detection updated it.
    Updates,
    /// After every scan.
    Scans,
    /// At most so often, s.
    Every(f64),
}

impl Rows {
    /// Reads an argument.
    pub fn parse(text: &str) -> Result<Rows, String> {
        match (text, text.parse::<f64>()) {
            ("updates", _) => Ok(Rows::Updates),
            ("scans", _) => Ok(Rows::Scans),
            (_, Ok(seconds)) if seconds > 0.0 && seconds.is_finite() => Ok(Rows::Every(seconds)),
            _ => Err("expected updates, scans or a number of seconds above 0".to_owned()),
        }
    }
}

/// Chooses rows, track by track.
#[derive(Debug)]
pub struct Selection {
    rows: Rows,
    /// Whether tentative tracks have rows.
    all: bool,
    /// Time and status of the last row that was written of each track which is not given up.
    written: HashMap<u64, (f64, Status)>,
}

impl Selection {
    /// Chooses such rows, of tentative tracks with `all`.
    pub fn new(rows: Rows, all: bool) -> Self {
        Selection { rows, all, written: HashMap::new() }
    }

    /// True when the track is of interest: it is believed, or was and is given up.
    pub fn believes(&self, row: &Track) -> bool {
        match row.status {
            Status::Confirmed | Status::Coasted => true,
            Status::Deleted => self.all || self.written.contains_key(&row.track),
            Status::Tentative => self.all,
        }
    }

    /// True when the row of such a track is written.
    pub fn takes(&mut self, row: &Track) -> bool {
        if row.status == Status::Deleted {
            self.written.remove(&row.track);
            return true;
        }
        let last = self.written.get(&row.track);
        let changed = last.is_none_or(|(_, status)| *status != row.status);
        let due = match (self.rows, last) {
            (Rows::Scans, _) | (_, None) => true,
            (Rows::Updates, _) => row.detection.is_some(),
            (Rows::Every(seconds), Some((time, _))) => row.time - time >= seconds,
        };
        if changed || due {
            self.written.insert(row.track, (row.time, row.status));
        }
        changed || due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time: f64, status: Status, detection: Option<u64>) -> Track {
        Track {
            time,
            sensor: "ais".into(),
            track: 1,
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

    /// A life of nine scans: two updates, two without, one missed, one more update, two missed, the end.
    fn life() -> Vec<Track> {
        use Status::{Coasted, Confirmed, Deleted};
        let scans = [
            (Confirmed, Some(1)),
            (Confirmed, Some(2)),
            (Confirmed, None),
            (Confirmed, None),
            (Coasted, None),
            (Confirmed, Some(3)),
            (Coasted, None),
            (Coasted, None),
            (Deleted, None),
        ];
        scans
            .iter()
            .zip(0..)
            .map(|((status, detection), time)| row(f64::from(time), *status, *detection))
            .collect()
    }

    fn times(rows: Rows) -> Vec<f64> {
        let mut selection = Selection::new(rows, false);
        let taken = life().into_iter().filter(|row| selection.believes(row) && selection.takes(row));
        taken.map(|row| row.time).collect()
    }

    #[test]
    fn a_row_for_every_update_and_every_change() {
        assert_eq!(times(Rows::Updates), [0.0, 1.0, 4.0, 5.0, 6.0, 8.0]);
    }

    #[test]
    fn a_row_for_every_scan() {
        assert_eq!(times(Rows::Scans).len(), 9);
    }

    #[test]
    fn a_row_every_so_often_and_at_every_change() {
        assert_eq!(times(Rows::Every(3.0)), [0.0, 3.0, 4.0, 5.0, 6.0, 8.0]);
    }

    #[test]
    fn tentative_tracks_have_rows_when_asked_for() {
        let tentative = row(0.0, Status::Tentative, Some(1));
        assert!(!Selection::new(Rows::Updates, false).believes(&tentative));
        let mut selection = Selection::new(Rows::Updates, true);
        assert!(selection.believes(&tentative) && selection.takes(&tentative));
        let end = row(1.0, Status::Deleted, None);
        assert!(selection.believes(&end) && selection.takes(&end));
        assert!(!Selection::new(Rows::Scans, false).believes(&end), "it was never believed");
    }

    #[test]
    fn words_and_seconds_are_read() {
        assert_eq!(Rows::parse("updates"), Ok(Rows::Updates));
        assert_eq!(Rows::parse("10"), Ok(Rows::Every(10.0)));
        for text in ["0", "-1", "nan", "inf", "all", ""] {
            assert!(Rows::parse(text).is_err(), "{text}");
        }
    }
}
