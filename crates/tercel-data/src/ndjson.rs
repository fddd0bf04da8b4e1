//! Detections in and tracks out, line by line, while they are made.
//!
//! Every line is one JSON object whose keys are the columns of the table. Empty lines are passed over, and so are
//! keys that are no columns. A line of the form `{"tercel": {...}}` describes the table (units, origin).
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

use std::collections::HashSet;
use std::io::{BufRead, Write};
use std::sync::Arc;

use serde_json::{Map, Value};

use crate::error::{DataError, Place};
use crate::format::json::{Lines, description, push_with, write_row};
use crate::layout::{Context, DetectionRow, Layout, Rows, TrackColumns, detection_columns, near_miss};
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::sheet::Sheet;
use crate::table::{Description, Detections, Origin, Scan, Track};

/// Key of the list in a line that is a whole scan.
const LIST: &str = "detections";
/// What a whole scan says once for all of its detections.
const SHARED: [&str; 6] = ["time", "sensor", "scan", "sensor_x", "sensor_y", "sensor_z"];

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
    sheet: Sheet,
    origin: Option<Origin>,
    description: Description,
    next_id: u64,
    /// Keys that are no columns and look like none.
    strangers: HashSet<String>,
    /// The scan whose lines may go on, with its number in the file.
    open: Option<(Scan, Option<u64>)>,
    /// A whole scan that waits for the one before it to be handed out.
    waiting: Option<Scan>,
}

impl<R: BufRead> Scans<R> {
    /// Reads from `reader`; `name` stands for it in messages.
    pub fn new(reader: R, name: &str, options: ReadOptions) -> Self {
        Scans {
            lines: Lines::new(reader, name.into()),
            sheet: Sheet::new(options.relaxed(detection_columns())),
            options,
            origin: None,
            description: Description::default(),
            next_id: 0,
            strangers: HashSet::new(),
            open: None,
            waiting: None,
        }
    }

    /// Where the local frame lies, once a line has said so.
    pub fn origin(&self) -> Option<Origin> {
        self.origin
    }

    /// What the recording was before it became this stream, as far as the lines read so far say.
    pub fn description(&self) -> Description {
        self.description.clone()
    }

    /// Takes in a line; a scan that it completes is handed out.
    fn take(&mut self, object: &Map<String, Value>, line: u64) -> Result<Option<Scan>, DataError> {
        if let Some(json) = description(object) {
            return self.describe(&json).map(|()| None);
        }
        match object.get(LIST) {
            None => {
                self.check_keys(object, line)?;
                let numbered = self.next_id;
                let row = self.row(object, object, line)?;
                self.take_row(row, numbered, line)
            }
            Some(Value::Array(list)) => {
                self.check_keys(object, line)?;
                let scan = self.whole(object, list, line)?;
                match self.open.take() {
                    Some((before, _)) => {
                        self.waiting = Some(scan);
                        Ok(Some(before))
                    }
                    None => Ok(Some(scan)),
                }
            }
            Some(_) => {
                Err(self.wrong(line, "`detections` is no list", "give a list of objects, possibly empty"))
            }
        }
    }

    fn describe(&mut self, json: &str) -> Result<(), DataError> {
        let metadata = Metadata::parse(json, Detections::TABLE, self.lines.file())?;
        metadata.check_units(&self.sheet.columns, self.options.angles, self.lines.file())?;
        self.origin = metadata.origin;
        self.description = metadata.description;
        Ok(())
    }

    fn wrong(&self, line: u64, problem: &str, help: &'static str) -> DataError {
        DataError::Row { place: Place::line(self.lines.file(), line), problem: problem.to_owned(), help }
    }

    /// Refuses keys that are almost columns: without them a line may look like an empty scan.
    fn check_keys(&mut self, object: &Map<String, Value>, line: u64) -> Result<(), DataError> {
        /// A stream with more strange keys than this is not worth remembering.
        const REMEMBERED: usize = 256;
        for key in object.keys() {
            if key == LIST || self.sheet.position(key).is_some() || self.strangers.contains(key) {
                continue;
            }
            if let Some(error) = near_miss(key, &self.sheet.columns, || Place::line(self.lines.file(), line))
            {
                return Err(error);
            }
            if self.strangers.len() < REMEMBERED {
                self.strangers.insert(key.clone());
            }
        }
        Ok(())
    }

    /// Reads a detection whose shared columns stand in `scan`.
    fn row(
        &mut self,
        detection: &Map<String, Value>,
        scan: &Map<String, Value>,
        line: u64,
    ) -> Result<DetectionRow, DataError> {
        let Scans { sheet, options, lines, .. } = self;
        sheet.clear();
        sheet.lines.push(line);
        let find =
            |name: &str| detection.get(name).or_else(|| scan.get(name).filter(|_| SHARED.contains(&name)));
        push_with(sheet, find, options.angles)
            .map_err(|(column, refusal)| refusal.at(Place::line(lines.file(), line), &column))?;
        let context = Context { file: lines.file(), options, found: &[] };
        let row = Rows::of_line(sheet, &context).read(0, self.next_id)?;
        if let Some(detection) = &row.detection {
            self.next_id = self.next_id.max(detection.id.saturating_add(1));
        }
        Ok(row)
    }

    fn take_row(&mut self, row: DetectionRow, numbered: u64, line: u64) -> Result<Option<Scan>, DataError> {
        let place = Place::line(self.lines.file(), line);
        match &mut self.open {
            Some((scan, number)) if row.continues(scan, *number) => {
                no_repetition(scan, &row, numbered, &place)?;
                row.join(scan, || place).map(|()| None)
            }
            _ => {
                let number = row.scan;
                Ok(self.open.replace((row.start(), number)).map(|(before, _)| before))
            }
        }
    }

    /// Reads a line that is a whole scan.
    fn whole(&mut self, object: &Map<String, Value>, list: &[Value], line: u64) -> Result<Scan, DataError> {
        let place = Place::line(self.lines.file(), line);
        let mut scan: Option<Scan> = None;
        for element in list {
            let Value::Object(detection) = element else {
                return Err(self.wrong(
                    line,
                    "`detections` holds what is no object",
                    "give a list of objects",
                ));
            };
            self.check_keys(detection, line)?;
            let numbered = self.next_id;
            let row = self.row(detection, object, line)?;
            if row.detection.is_none() {
                return Err(self.wrong(line, "a detection has no measurement", "give x and y, or a bearing"));
            }
            match &mut scan {
                Some(scan) => {
                    no_repetition(scan, &row, numbered, &place)?;
                    row.join(scan, || place.clone())?;
                }
                None => scan = Some(row.start()),
            }
        }
        match scan {
            Some(scan) => Ok(scan),
            None => Ok(self.row(&Map::new(), object, line)?.start()),
        }
    }
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
        if let Some(scan) = self.waiting.take() {
            return Some(Ok(scan));
        }
        loop {
            let taken = match self.lines.next() {
                None => return self.open.take().map(|(scan, _)| Ok(scan)),
                Some(Ok((object, line))) => self.take(&object, line),
                Some(Err(error)) => Err(error),
            };
            if let Some(item) = taken.transpose() {
                return Some(item);
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
///     altitude: None,
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
    let columns = TrackColumns::new(None, labels, modes);
    let mut sheet = Sheet::new(columns.written());
    columns.fill(&mut sheet, std::slice::from_ref(track), &file)?;
    if let Some((_, column, refusal)) = sheet.first_refused() {
        return Err(refusal.at(Place::whole(&file), &column.name));
    }
    let mut text = Vec::new();
    write_row(&sheet, 0, &mut text)
        .and_then(|()| writer.write_all(&text))
        .map_err(|error| DataError::io(&file, "write", error))
}
