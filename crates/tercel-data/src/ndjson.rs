//! Detections in and tracks out, line by line, while they are made.
//!
//! Every line is one JSON object whose keys are the columns of the table, or usual names that mean the same. Empty lines
//! are passed over. Keys that mean nothing are told by [`Scans::notes`]; a line without any key that holds a position is an
//! error. The list may go by another usual name (`objects`, `targets`, ...). A line of the form `{"tercel": {...}}` describes the table (units, origin).
//!
//! **One line per scan.** The object has `time`, `sensor`, possibly `sensor_x`, `sensor_y`, `sensor_z` and
//! `scan`, and a list `detections`, whose objects have the other columns. An empty list is a scan in which nothing
//! was seen. The scan is complete with its line.
//!
//! ```text
//! {"time": 12.0, "sensor": "radar", "detections": [{"x": 120.0, "y": 30.5}, {"range": 80.0, "bearing": 0.2}]}
//! {"time": 13.7, "sensor": "radar", "detections": []}
//! ```
//!
//! **One line per detection.** The object has all columns. A scan ends where `time` or `sensor` change or, if the
//! lines have a `scan`, where that or the sensor changes; the last one ends with the stream. A line without a
//! measurement is a scan in which nothing was seen. A scan in the other form ends one in this form, too.
//!
//! ```text
//! {"time": 12.0, "sensor": "radar", "x": 120.0, "y": 30.5}
//! {"time": 12.0, "sensor": "radar", "x": 64.0, "y": -7.0}
//! {"time": 13.7, "sensor": "radar"}
//! ```
//!
//! Detections without a number (`detection`) are numbered in the order of the stream, above every number before.
//! A number that is there twice is an error within a scan; a stream is too long to remember all of them.

use std::collections::VecDeque;
use std::io::{BufRead, Write};
use std::sync::Arc;

use serde_json::{Map, Value};
use tercel_core::geo::LocalFrame;

use crate::error::{DataError, Place};
use crate::format::json::{Keys, Lines, description, write_row};
use crate::geographic::{frame, on_earth};
use crate::layout::{Context, DetectionRow, Layout, Rows, detection_columns, fill_tracks, track_columns};
use crate::metadata::Metadata;
use crate::names::Naming;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::table::{Description, Detections, Origin, Scan, Track};
use crate::time::Clock;

/// Reads scans from a stream of lines.
///
/// A bad line gives an error that names it, and the next call goes on with the line after it; so a caller may
/// count bad lines and carry on. When the stream itself fails, the error is the last item. Lines of more than
/// 16 MiB are refused without being held in memory.
///
/// ```
/// use tercel_data::{ReadOptions, ndjson::Scans};
///
/// let lines = r#"
///     {"time": 0.0, "sensor": "radar", "detections": [{"x": 1.0, "y": 2.0}, {"x": 5.0, "y": 9.0}]}
///     oops
///     {"time": 1.0, "sensor": "radar", "x": 1.5, "y": 2.0}
/// "#;
/// let mut scans = Scans::new(lines.as_bytes(), "standard input", ReadOptions::default());
/// assert_eq!(scans.next().unwrap()?.detections.len(), 2);
/// assert!(scans.next().unwrap().unwrap_err().to_string().starts_with("standard input:3: "));
/// assert_eq!(scans.next().unwrap()?.time, 1.0);
/// assert!(scans.next().is_none());
/// # Ok::<(), tercel_data::DataError>(())
/// ```
#[derive(Debug)]
pub struct Scans<R> {
    lines: Lines<R>,
    options: ReadOptions,
    keys: Keys,
    sheet: Sheet,
    /// Made with the first line, whose key of the time may name a unit.
    clock: Option<Clock>,
    origin: Option<Origin>,
    frame: Option<LocalFrame>,
    description: Description,
    next_id: u64,
    /// The scan whose lines may go on, with its number in the file.
    open: Option<(Scan, Option<u64>)>,
    /// Scans that are complete, and wait to be handed out one by one.
    complete: VecDeque<Scan>,
}

impl<R: BufRead> Scans<R> {
    /// Reads from `reader`; `name` stands for it in messages.
    pub fn new(reader: R, name: &str, options: ReadOptions) -> Self {
        let naming = naming(false, &options);
        Scans {
            lines: Lines::new(reader, name.into()),
            sheet: Sheet::new(naming.columns().to_vec()),
            keys: Keys::new(naming, true, &options),
            clock: None,
            origin: options.origin,
            frame: None,
            options,
            description: Description::default(),
            next_id: 0,
            open: None,
            complete: VecDeque::new(),
        }
    }

    /// Where the local frame lies, once a line has said so. Without that, positions in latitude and longitude lie around the
    /// first of them.
    pub fn origin(&self) -> Option<Origin> {
        self.origin
    }

    /// What the recording was before it became this stream, as far as the lines read so far say.
    pub fn description(&self) -> Description {
        self.description.clone()
    }

    /// What was decided so far and the user should know, in sentences.
    pub fn notes(&self) -> Vec<String> {
        self.keys.notes().into_iter().chain(self.clock.as_ref().and_then(Clock::note)).collect()
    }

    /// Takes in a line; the scans that it completes are then there.
    fn take(&mut self, object: &Map<String, Value>, place: &Place) -> Result<(), DataError> {
        if let Some(json) = description(object) {
            return self.describe(&json);
        }
        self.sheet = Sheet::new(std::mem::take(&mut self.sheet.columns));
        let taken = self.keys.take(object, place, &mut self.sheet)?;
        let mut numbered = self.next_id;
        let rows = self.rows()?;
        if !taken.whole {
            return rows.into_iter().try_for_each(|row| self.take_row(row, numbered, place));
        }
        let mut scan: Option<Scan> = None;
        for row in rows {
            let next = row.detection.as_ref().map_or(0, |detection| detection.id.saturating_add(1));
            match &mut scan {
                Some(scan) => {
                    no_repetition(scan, &row, numbered, place)?;
                    row.join(scan, || place.clone())?;
                }
                None => scan = Some(row.start()),
            }
            numbered = numbered.max(next);
        }
        self.complete.extend(self.open.take().map(|(before, _)| before));
        self.complete.extend(scan);
        Ok(())
    }

    fn describe(&mut self, json: &str) -> Result<(), DataError> {
        let file = self.lines.file();
        let metadata = Metadata::parse(json, Detections::TABLE, file)?;
        metadata.check_units(&detection_columns(), self.options.angles, file)?;
        self.origin = metadata.origin;
        self.description = metadata.description;
        let naming = naming(true, &self.options);
        self.sheet = Sheet::new(naming.columns().to_vec());
        self.keys.describe(naming);
        self.clock = None;
        Ok(())
    }

    /// The rows of the line that was taken in.
    fn rows(&mut self) -> Result<Vec<DetectionRow>, DataError> {
        let file = Arc::clone(self.lines.file());
        let clock = match &mut self.clock {
            Some(clock) => clock,
            None => self.clock.insert(Clock::new(&self.options, self.keys.time_unit(), &file)?),
        };
        self.sheet.settle_times(clock, &file, &mut Remarks::default())?;
        self.find_frame(&file)?;
        let context = Context { file: &file, options: &self.options, found: &[], ours: false, keyed: true };
        let reader = Rows::new(&self.sheet, &context, self.frame.as_ref());
        let mut next = self.next_id;
        let mut rows = Vec::with_capacity(self.sheet.len());
        for row in 0..self.sheet.len() {
            let row = reader.read(row, next)?;
            if let Some(detection) = &row.detection {
                next = next.max(detection.id.saturating_add(1));
            }
            rows.push(row);
        }
        self.next_id = next;
        Ok(rows)
    }

    /// Lays the local frame at the first position in latitude and longitude, unless it is known where it lies.
    fn find_frame(&mut self, file: &Arc<str>) -> Result<(), DataError> {
        if self.frame.is_some() {
            return Ok(());
        }
        let [latitude, longitude] = ["latitude", "longitude"].map(|name| self.sheet.reals(name));
        let first =
            (0..self.sheet.len()).find_map(|row| on_earth(latitude.get(row)?, longitude.get(row)?).ok());
        if let Some((latitude, longitude)) = first {
            let origin = *self.origin.get_or_insert(Origin { latitude, longitude, altitude: 0.0 });
            self.frame = Some(frame(origin, file)?);
        }
        Ok(())
    }

    fn take_row(&mut self, row: DetectionRow, numbered: u64, place: &Place) -> Result<(), DataError> {
        match &mut self.open {
            Some((scan, number)) if row.continues(scan, *number) => {
                no_repetition(scan, &row, numbered, place)?;
                row.join(scan, || place.clone())
            }
            _ => {
                let number = row.scan;
                self.complete.extend(self.open.replace((row.start(), number)).map(|(before, _)| before));
                Ok(())
            }
        }
    }
}

/// The keys of a stream, which is one of ours or not.
fn naming(ours: bool, options: &ReadOptions) -> Naming {
    let mut columns = options.relaxed(detection_columns());
    if !ours {
        columns.extend(Detections::foreign_columns());
    }
    Naming::new(Detections::TABLE, ours, columns, options)
}

/// Refuses a detection number that the scan has already. Numbers from `numbered` on were not there before.
fn no_repetition(scan: &Scan, row: &DetectionRow, numbered: u64, place: &Place) -> Result<(), DataError> {
    let Some(new) = row.detection.as_ref().filter(|detection| detection.id < numbered) else { return Ok(()) };
    if scan.detections.iter().all(|detection| detection.id != new.id) {
        return Ok(());
    }
    Err(DataError::Row {
        place: place.clone(),
        problem: format!("detection {} is there a second time", new.id),
        help: "number the detections of a stream without repetition, or leave the key out",
    })
}

impl<R: BufRead> Iterator for Scans<R> {
    type Item = Result<Scan, DataError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(scan) = self.complete.pop_front() {
                return Some(Ok(scan));
            }
            let taken = match self.lines.next() {
                None => return self.open.take().map(|(scan, _)| Ok(scan)),
                Some(Ok((object, place))) => self.take(&object, &place),
                Some(Err(error)) => Err(error),
            };
            if let Err(error) = taken {
                return Some(Err(error));
            }
        }
    }
}

/// Writes a track as one line; `labels` and `modes` are those of its [`Tracks`](crate::table::Tracks).
///
/// A program that writes many does better with a [`TracksWriter`](crate::TracksWriter), which keeps its buffers.
///
/// ```
/// use tercel_data::ndjson::write_track;
/// use tercel_data::table::{Status, Track};
///
/// let track = Track {
///     time: 12.5,
///     sensor: "radar".into(),
///     track: 1,
///     status: Status::Confirmed,
///     existence: 0.98,
///     state: vec![10.0, 20.5],
///     covariance: vec![4.0, 0.0, 4.0],
///     modes: vec![],
///     extent: None,
///     identity: None,
///     detection: None,
/// };
/// let mut line = Vec::new();
/// write_track(&mut line, &track, &["x".to_owned(), "y".to_owned()], &[])?;
/// let line = String::from_utf8(line)?;
/// assert!(line.starts_with(r#"{"time":12.5,"sensor":"radar","track":1,"status":"confirmed","existence":0.98,"x":10"#));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When the track does not have the state that the labels name, a number is not finite, or the system refuses.
pub fn write_track(
    mut writer: impl Write,
    track: &Track,
    labels: &[String],
    modes: &[String],
) -> Result<(), DataError> {
    let file: Arc<str> = "the stream of tracks".into();
    let mut sheet = Sheet::settled(track_columns(labels, modes));
    fill_tracks(&mut sheet, std::slice::from_ref(track), labels, modes, &file)?;
    if let Some((_, column, refusal)) = sheet.first_refused() {
        return Err(refusal.at(Place::whole(&file), &column.name));
    }
    let mut text = Vec::new();
    write_row(&sheet, 0, &mut text)
        .and_then(|()| writer.write_all(&text))
        .map_err(|error| DataError::io(&file, "write", error))
}
