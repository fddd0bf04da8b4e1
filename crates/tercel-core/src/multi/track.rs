//! What a tracker reports.

use crate::filter::Identity;

/// Number of a track: unique in the life of its tracker.
pub type TrackId = u64;

/// One object, as a tracker sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Track<B> {
    /// Its number.
    pub id: TrackId,
    /// What is known of it.
    pub belief: B,
    /// Probability that it exists.
    pub existence: f64,
    /// Where it is in its life.
    pub status: Status,
    /// The measurement of the last scan that updated it, if one did.
    pub measurement: Option<usize>,
    /// Scans that updated it.
    pub hits: u32,
    /// Scans in a row that should have seen it and did not.
    pub misses: u32,
    /// Time of the scan in which it started, s.
    pub started: f64,
    /// Time of the last scan that updated it, s.
    pub updated: f64,
    /// Time of its belief, s: that of the last scan that concerned it.
    pub time: f64,
    /// Mean time between the scans that updated it, the last ones counting most, s; zero before the second.
    pub interval: f64,
    /// What the object is called, if that is known.
    pub(super) identity: Option<Identity>,
    /// Whether a report updated it last.
    pub(super) reports: bool,
    /// Whether each of the last 64 scans in view updated it; the newest in the lowest bit.
    pub(super) history: u64,
    /// Scans in view, at most 64.
    pub(super) seen: u32,
    pub(super) confirmed: bool,
    /// Existence after the last scan that updated it.
    pub(super) known: f64,
    /// About the longest of the last times between scans, s.
    pub(super) pace: f64,
}

/// Share of the newest of the intervals in their mean.
const NEWEST: f64 = 0.25;
/// Share of the longest time between scans that is kept from scan to scan.
const PACE_MEMORY: f64 = 0.95;

impl<B> Track<B> {
    /// A tentative track, just started by a measurement.
    pub(super) fn new(id: TrackId, belief: B, existence: f64, measurement: usize, time: f64) -> Self {
        Track {
            id,
            belief,
            existence,
            status: Status::Tentative,
            measurement: Some(measurement),
            hits: 1,
            misses: 0,
            started: time,
            updated: time,
            time,
            interval: 0.0,
            identity: None,
            reports: false,
            history: 1,
            seen: 1,
            confirmed: false,
            known: existence,
            pace: 0.0,
        }
    }

    /// Lets the time between two scans pass, s. What lies 50 scans back is forgotten.
    pub(super) fn wait(&mut self, dt: f64) {
        self.pace = dt.max(PACE_MEMORY * self.pace);
    }

    /// Records that the scan at `time` updated the track.
    pub(super) fn hit(&mut self, measurement: usize, time: f64) {
        self.measurement = Some(measurement);
        self.hits = self.hits.saturating_add(1);
        self.misses = 0;
        let passed = time - self.updated;
        self.interval += (passed - self.interval) * if self.hits <= 2 { 1.0 } else { NEWEST };
        self.updated = time;
        self.history = self.history << 1 | 1;
        self.seen = (self.seen + 1).min(64);
    }

    /// Records that a scan that should have seen the track did not.
    pub(super) fn miss(&mut self) {
        self.measurement = None;
        self.misses = self.misses.saturating_add(1);
        self.history <<= 1;
        self.seen = (self.seen + 1).min(64);
    }

    /// Records a scan that could not have seen the track.
    pub(super) fn unseen(&mut self) {
        self.measurement = None;
    }
}

/// Where a track is in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Status {
    /// Seen, but not yet believed.
    Tentative,
    /// Believed, and seen in the last scan or out of that sensor's view.
    Confirmed,
    /// Believed, but missed in the last scan.
    Coasted,
    /// Given up in the last scan; it is reported this once.
    Deleted,
}

impl Status {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Status::Tentative => "tentative",
            Status::Confirmed => "confirmed",
            Status::Coasted => "coasted",
            Status::Deleted => "deleted",
        }
    }
}

/// What became of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// It updated this track.
    Updated(TrackId),
    /// It started this track.
    Started(TrackId),
    /// It was counted as clutter.
    Clutter,
}
