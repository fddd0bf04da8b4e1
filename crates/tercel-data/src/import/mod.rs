//! Recordings of other programs, brought into the tables.

pub mod adsb;
pub mod ais;
pub mod autoferry;
mod cooperative;
mod fields;
mod recognise;

use std::borrow::Cow;
use std::path::Path;

use crate::error::{DataError, Refusal};
use crate::format::Format;
use crate::options::ReadOptions;
use crate::read::read_as;
use crate::table::{Detections, Origin, Truths};

/// Where a recording comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The table of detections as CSV.
    Csv,
    /// The table of detections as Parquet.
    Parquet,
    /// The table of detections as NDJSON.
    Ndjson,
    /// The Autoferry benchmark: radar, lidar and cameras of a small ferry, with GNSS truth.
    Autoferry,
    /// Positions that aircraft broadcast, as CSV in the manner of the OpenSky Network.
    Adsb,
    /// Positions that ships broadcast, as CSV.
    Ais,
}

impl Source {
    /// Every source, in the order in which help texts list them.
    pub const ALL: [Source; 6] =
        [Source::Csv, Source::Parquet, Source::Ndjson, Source::Autoferry, Source::Adsb, Source::Ais];

    /// The name used on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Source::Csv => "csv",
            Source::Parquet => "parquet",
            Source::Ndjson => "ndjson",
            Source::Autoferry => "autoferry",
            Source::Adsb => "adsb",
            Source::Ais => "ais",
        }
    }
}

/// How a recording is brought in.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// How a canonical table is read.
    pub read: ReadOptions,
    /// Origin of the local frame for sources with geographic coordinates; without one, their median position.
    pub origin: Option<Origin>,
    /// Whether the truth is brought in, too: the file beside the detections, or what objects say of themselves.
    pub truths: bool,
    /// Whether reports that repeat a position are kept.
    pub keep_repeated: bool,
    /// Whether a report keeps its own time where the time of its position is known.
    pub reported_time: bool,
    /// Whether an aircraft with another callsign is another object: `3c4591/BOX413`.
    pub split_callsigns: bool,
}

impl Default for ImportOptions {
    fn default() -> Self {
        ImportOptions {
            read: ReadOptions::default(),
            origin: None,
            truths: true,
            keep_repeated: false,
            reported_time: false,
            split_callsigns: false,
        }
    }
}

/// A recording in the tables.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Imported {
    /// What the sensors saw.
    pub detections: Detections,
    /// What was really there, where the source knows it.
    pub truths: Option<Truths>,
    /// Rows of the source that are not in the tables, by reason.
    pub left_out: Vec<LeftOut>,
    /// What was decided while reading and the user should know, in sentences.
    pub notes: Vec<String>,
}

/// Rows that were left out for one reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The reason, as a sentence part: `a repeated position`.
    pub reason: Cow<'static, str>,
    /// How many.
    pub rows: usize,
}

impl LeftOut {
    fn list<const N: usize>(reasons: [(&'static str, usize); N]) -> Vec<LeftOut> {
        reasons
            .into_iter()
            .filter(|(_, rows)| *rows > 0)
            .map(|(reason, rows)| LeftOut { reason: reason.into(), rows })
            .collect()
    }
}

/// Brings in a recording. Of several files the scans follow each other in the order of time.
///
/// ```no_run
/// use tercel_data::{ImportOptions, Source, import};
///
/// let recording = ["data/autoferry/scenario2_detections.json.gz"];
/// let imported = import(Source::Autoferry, &recording, &ImportOptions::default())?;
/// println!("{} scans", imported.detections.scans.len());
/// # Ok::<(), tercel_data::DataError>(())
/// ```
///
/// # Errors
/// A [`DataError`] that says where a file is wrong, and what was expected; also when the files do not fit
/// together, because they lie in different local frames or number their detections alike.
pub fn import<P: AsRef<Path>>(
    source: Source,
    paths: &[P],
    options: &ImportOptions,
) -> Result<Imported, DataError> {
    let mut whole: Option<Imported> = None;
    for path in paths {
        let path = path.as_ref();
        // All files share the frame of the first.
        let origin = options.origin.or(whole.as_ref().and_then(|whole| whole.detections.origin));
        let part = import_one(source, path, &ImportOptions { origin, ..options.clone() })?;
        whole = Some(match whole {
            Some(whole) => join(whole, part, path)?,
            None => part,
        });
    }
    Ok(whole.unwrap_or_default())
}

fn import_one(source: Source, path: &Path, options: &ImportOptions) -> Result<Imported, DataError> {
    let read = ReadOptions { origin: options.origin.or(options.read.origin), ..options.read.clone() };
    let table = |format| read_as(path, format, &read);
    match source {
        Source::Csv => table(Format::Csv),
        Source::Parquet => table(Format::Parquet),
        Source::Ndjson => table(Format::Ndjson),
        Source::Autoferry => autoferry::read(path, options),
        Source::Adsb => adsb::read(path, options),
        Source::Ais => ais::read(path, options),
    }
}

/// Appends a recording to another; detections are numbered anew, since two files may use the same numbers.
fn join(mut whole: Imported, part: Imported, path: &Path) -> Result<Imported, DataError> {
    if whole.detections.origin != part.detections.origin {
        return Err(DataError::Metadata {
            file: crate::format::file_name(path),
            problem: "the origin is another one than in the file before".to_owned(),
            help: "bring in the files one by one".to_owned(),
        });
    }
    whole.detections.scans.extend(part.detections.scans);
    whole.detections.scans.sort_by(|a, b| a.time.total_cmp(&b.time));
    let detections = whole.detections.scans.iter_mut().flat_map(|scan| &mut scan.detections);
    detections.zip(0..).for_each(|(detection, id)| detection.id = id);
    whole.truths = match (whole.truths, part.truths) {
        (Some(mut truths), Some(more)) => {
            truths.rows.extend(more.rows);
            Some(truths)
        }
        (truths, more) => truths.or(more),
    };
    for LeftOut { reason, rows } in part.left_out {
        match whole.left_out.iter_mut().find(|known| known.reason == reason) {
            Some(known) => known.rows += rows,
            None => whole.left_out.push(LeftOut { reason, rows }),
        }
    }
    let news: Vec<String> = part.notes.into_iter().filter(|note| !whole.notes.contains(note)).collect();
    whole.notes.extend(news);
    Ok(whole)
}

/// A latitude in radians; nothing when the file says that it is not available.
fn latitude(line: &fields::Report<'_>, field: &fields::Field) -> Result<Option<f64>, DataError> {
    degrees(line, field, 90.0)
}

/// A longitude in radians; nothing when the file says that it is not available.
fn longitude(line: &fields::Report<'_>, field: &fields::Field) -> Result<Option<f64>, DataError> {
    degrees(line, field, 180.0)
}

fn degrees(line: &fields::Report<'_>, field: &fields::Field, limit: f64) -> Result<Option<f64>, DataError> {
    match line.number(field)? {
        // 91 and 181 stand for an unknown position.
        Some(value) if value == limit + 1.0 => Ok(None),
        Some(value) if value.abs() > limit => {
            let expected = format!("degrees in [-{limit}, {limit}]");
            Err(line.refuse(field, Refusal::new(value, expected)))
        }
        value => Ok(value.map(f64::to_radians)),
    }
}
