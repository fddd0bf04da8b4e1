//! One way of scans through a tracker, with its rows handed on as they are made.

use std::time::{Duration, Instant};

use tercel_data::table::{Description, Detections, Origin, Scan, Track, Tracks};
use tercel_data::{Format, TracksWriter};
use tercel_pipeline::{Notice, Pipeline, PipelineError, Summary};

use super::altitudes::Altitudes;
use super::rows::{Rows, Selection};
use crate::console::Console;
use crate::failure::Failure;
use crate::output::{STDOUT, Target};

/// What is wanted of a run.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Where the rows go.
    pub target: Option<Target>,
    /// Which rows are written; without a choice, the recording tells.
    pub rows: Option<Rows>,
    /// Whether tentative tracks are written.
    pub all: bool,
    /// Whether scans and rows are kept for scores and the report.
    pub keep: bool,
}

/// A tracker at work.
pub struct Run {
    pipeline: Pipeline,
    wanted: Wanted,
    writer: Option<TracksWriter<'static>>,
    begun: bool,
    selection: Selection,
    altitudes: Altitudes,
    /// The scans that were tracked, if they are kept.
    pub seen: Detections,
    /// The rows of every scan, if they are kept: scores and the report do not depend on what is written.
    pub tracks: Tracks,
    /// Scans that came in.
    pub scans: u64,
    busy: Duration,
}

impl Run {
    /// Prepares to track.
    pub fn new(pipeline: Pipeline, wanted: Wanted) -> Self {
        let (labels, modes) = (pipeline.labels().to_vec(), pipeline.modes().to_vec());
        Run {
            pipeline,
            writer: None,
            begun: false,
            selection: Selection::new(wanted.rows.unwrap_or(Rows::Scans), wanted.all),
            altitudes: Altitudes::default(),
            wanted,
            seen: Detections::default(),
            tracks: Tracks { labels, modes, ..Tracks::default() },
            scans: 0,
            busy: Duration::ZERO,
        }
    }

    /// Opens the output, once it is known what the recording is and where its frame lies. Only the first call does something.
    ///
    /// `first` are the first scans of a recording that is at hand; they show what nothing says of its sensors.
    pub fn begin(
        &mut self,
        origin: Option<Origin>,
        recording: Description,
        first: &[Scan],
    ) -> Result<(), Failure> {
        if std::mem::replace(&mut self.begun, true) {
            return Ok(());
        }
        self.pipeline.expect(&recording, first)?;
        let reports = self.pipeline.reports() || recording.all_report();
        let rows = self.wanted.rows.unwrap_or(if reports { Rows::Updates } else { Rows::Scans });
        self.selection = Selection::new(rows, self.wanted.all);
        self.altitudes = Altitudes::new(origin);
        self.tracks.origin = origin;
        self.seen.origin = origin;
        self.seen.description = recording;
        self.writer = match &self.wanted.target {
            None => None,
            Some(Target::File(path)) => Some(TracksWriter::create(path, &self.tracks)?),
            Some(Target::Stdout) => {
                Some(TracksWriter::to(std::io::stdout(), Format::Ndjson, STDOUT, &self.tracks)?)
            }
        };
        Ok(())
    }

    /// Tracks a scan and hands on the rows that it led to, so that a reader has them at once. The inner error is one of the
    /// tracker, after which other scans may follow.
    pub fn track(&mut self, scan: Scan) -> Result<Result<(), PipelineError>, Failure> {
        let started = Instant::now();
        let rows = self.push(scan);
        let handed_on = rows.map(|rows| self.hand_on(rows));
        self.busy += started.elapsed();
        match handed_on {
            Ok(handed_on) => handed_on.map(Ok),
            Err(error) => Ok(Err(error)),
        }
    }

    fn push(&mut self, scan: Scan) -> Result<Vec<Track>, PipelineError> {
        let copy = self.wanted.keep.then(|| scan.clone());
        self.altitudes.hear(&scan);
        let before = self.pipeline.summary();
        let rows = self.pipeline.push(scan)?;
        let after = self.pipeline.summary();
        self.scans += 1;
        if (after.late, after.ahead, after.ignored) == (before.late, before.ahead, before.ignored) {
            self.seen.scans.extend(copy);
        }
        Ok(rows)
    }

    /// Writes those of the rows that are wanted.
    fn hand_on(&mut self, mut rows: Vec<Track>) -> Result<(), Failure> {
        self.altitudes.give(&mut rows);
        self.altitudes.forget(self.pipeline.held());
        let mut written = Vec::with_capacity(rows.len());
        for row in rows {
            if !self.selection.believes(&row) {
                continue;
            }
            let taken = self.selection.takes(&row);
            if self.wanted.keep {
                self.tracks.rows.push(row.clone());
            }
            written.extend(taken.then_some(row));
        }
        if let Some(writer) = &mut self.writer {
            writer.append(&written)?;
            if self.wanted.target == Some(Target::Stdout) {
                writer.flush()?;
            }
        }
        Ok(())
    }

    /// Tracks what is still held back, and hands on its rows.
    pub fn end(&mut self) -> Result<Result<(), PipelineError>, Failure> {
        let started = Instant::now();
        let handed_on = self.pipeline.finish().map(|rows| self.hand_on(rows));
        self.busy += started.elapsed();
        match handed_on {
            Ok(handed_on) => handed_on.map(Ok),
            Err(error) => Ok(Err(error)),
        }
    }

    /// Puts the file of tracks in its place.
    pub fn finish(&mut self, console: &Console) -> Result<(), Failure> {
        let Some(writer) = self.writer.take() else { return Ok(()) };
        writer.notes().iter().for_each(|note| console.note(note));
        Ok(writer.finish()?)
    }

    /// What the user should be told since the last call.
    pub fn notices(&mut self) -> Vec<Notice> {
        self.pipeline.notices()
    }

    /// What happened to the scans.
    pub fn summary(&self) -> Summary {
        self.pipeline.summary()
    }

    /// Time spent on tracking and writing, s.
    pub fn seconds(&self) -> f64 {
        self.busy.as_secs_f64()
    }
}
