//! One way of scans through a tracker, with its rows handed on as they are made.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use tercel_data::table::{Detections, Origin, Scan, Status, Track, Tracks};
use tercel_data::{Format, TracksWriter};
use tercel_pipeline::{Pipeline, PipelineError, Summary};

use crate::failure::Failure;
use crate::output::{STDOUT, Target};

/// A tracker at work.
pub struct Run {
    pipeline: Pipeline,
    target: Option<Target>,
    writer: Option<TracksWriter<'static>>,
    begun: bool,
    /// Whether tentative tracks are written.
    all: bool,
    /// Tracks that were written and not given up yet.
    reported: HashSet<u64>,
    /// What scores and the report need; nothing is kept without them.
    keep: bool,
    /// The scans that were tracked.
    pub seen: Detections,
    /// The rows that were written.
    pub tracks: Tracks,
    /// Scans and detections that came in.
    pub scans: u64,
    /// Detections of scans that were late or of an ignored sensor.
    pub left_out: u64,
    busy: Duration,
}

impl Run {
    /// Prepares to track; with `keep`, scans and rows are kept for scores and the report.
    pub fn new(pipeline: Pipeline, target: Option<Target>, all: bool, keep: bool) -> Self {
        let (labels, modes) = (pipeline.labels().to_vec(), pipeline.modes().to_vec());
        Run {
            pipeline,
            target,
            writer: None,
            begun: false,
            all,
            reported: HashSet::new(),
            keep,
            seen: Detections::default(),
            tracks: Tracks { labels, modes, ..Tracks::default() },
            scans: 0,
            left_out: 0,
            busy: Duration::ZERO,
        }
    }

    /// Opens the output, once it is known where the local frame lies. Only the first call does something.
    pub fn begin(&mut self, origin: Option<Origin>) -> Result<(), Failure> {
        if std::mem::replace(&mut self.begun, true) {
            return Ok(());
        }
        self.tracks.origin = origin;
        self.seen.origin = origin;
        self.writer = match &self.target {
            None => None,
            Some(Target::File(path)) => Some(TracksWriter::create(path, &self.tracks)?),
            Some(Target::Stdout) => {
                Some(TracksWriter::to(std::io::stdout(), Format::Ndjson, STDOUT, &self.tracks)?)
            }
        };
        Ok(())
    }

    /// Tracks a scan and returns the rows that it led to.
    pub fn track(&mut self, scan: Scan) -> Result<Vec<Track>, PipelineError> {
        let detections = scan.detections.len() as u64;
        let copy = self.keep.then(|| scan.clone());
        let before = self.pipeline.summary();
        let started = Instant::now();
        let rows = self.pipeline.push(scan)?;
        self.busy += started.elapsed();
        let after = self.pipeline.summary();
        self.scans += 1;
        if (after.late, after.ignored) == (before.late, before.ignored) {
            self.seen.scans.extend(copy);
        } else {
            self.left_out += detections;
        }
        Ok(rows)
    }

    /// Writes those of the rows that are wanted, so that a reader has them at once.
    pub fn hand_on(&mut self, mut rows: Vec<Track>) -> Result<(), Failure> {
        rows.retain(|row| self.wants(row));
        if let Some(writer) = &mut self.writer {
            writer.append(&rows)?;
            if self.target == Some(Target::Stdout) {
                writer.flush()?;
            }
        }
        if self.keep {
            self.tracks.rows.extend(rows);
        }
        Ok(())
    }

    /// Tracks what is still held back, and returns its rows.
    pub fn end(&mut self) -> Result<Vec<Track>, PipelineError> {
        let started = Instant::now();
        let rows = self.pipeline.finish();
        self.busy += started.elapsed();
        rows
    }

    /// Puts the file of tracks in its place.
    pub fn finish(&mut self) -> Result<(), Failure> {
        Ok(self.writer.take().map_or(Ok(()), TracksWriter::finish)?)
    }

    /// What happened to the scans.
    pub fn summary(&self) -> Summary {
        self.pipeline.summary()
    }

    /// Time spent in the tracker itself, s.
    pub fn seconds(&self) -> f64 {
        self.busy.as_secs_f64()
    }

    /// A row is wanted when its track is believed, or was and is given up.
    fn wants(&mut self, row: &Track) -> bool {
        match row.status {
            Status::Confirmed | Status::Coasted => {
                self.reported.insert(row.track);
                true
            }
            Status::Deleted => self.reported.remove(&row.track) || self.all,
            Status::Tentative => self.all,
        }
    }
}
