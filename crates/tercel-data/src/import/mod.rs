//! Recordings of other programs, brought into the tables.

pub mod adsb;
pub mod ais;
pub mod autoferry;
mod clock;
mod content;
mod input;
mod merge;
pub mod nmea;
mod recognise;
mod recording;
mod report;
pub mod sbs;
mod scans;
mod source;
mod station;
mod survey;
mod table;
mod tables;

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use self::content::Content;
use self::input::Input;
pub use self::recording::Recording;
use self::report::{Reporter, Reports};
use self::source::Kind;
pub use self::source::Source;
use crate::error::DataError;
use crate::options::ReadOptions;
use crate::table::{Detections, Origin, Truths};

/// How a recording is brought in.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportOptions {
    /// How tables are read: times, dates, and what becomes of rows that cannot be used, of all sources.
    pub read: ReadOptions,
    /// Origin of the local frame for sources with geographic coordinates; without one, their median position.
    pub origin: Option<Origin>,
    /// Whether the truth is brought in, too: the file beside the detections, or what objects say of themselves.
    pub truths: bool,
    /// Whether reports that repeat a position are kept, and those that another receiver had heard as well.
    pub keep_repeated: bool,
    /// Whether a report keeps its own time where the time of its position is known.
    pub reported_time: bool,
    /// Whether an aircraft with another callsign is another object: `3c4591/BOX413`.
    pub split_callsigns: bool,
    /// Whether base stations, aids to navigation and aircraft in AIS are kept.
    pub all_stations: bool,
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
            all_stations: false,
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
/// [`Recording`] gives the same scans one by one, without holding a long recording in memory.
///
/// # Errors
/// A [`DataError`] that says where a file is wrong, and what was expected; also when tables do not fit together, because they
/// lie in different local frames.
pub fn import<P: AsRef<Path>>(
    source: Source,
    paths: &[P],
    options: &ImportOptions,
) -> Result<Imported, DataError> {
    match source.kind() {
        Kind::Reports(_) => Recording::open(source, paths, options)?.collect(options),
        _ => tables::import(source, paths, options),
    }
}

/// Brings in a recording from a stream; `name` stands for it in messages.
///
/// ```
/// use tercel_data::{ImportOptions, Source, import_from};
///
/// let csv = "mmsi,time,lat,lon\n219000101,2024-03-05T10:00:00Z,56.1,11.2\n";
/// let imported = import_from(Source::Ais, csv.as_bytes(), "standard input", &ImportOptions::default())?;
/// assert_eq!(imported.detections.scans[0].detections[0].identity.as_deref(), Some("219000101"));
/// # Ok::<(), tercel_data::DataError>(())
/// ```
///
/// # Errors
/// A [`DataError`] that says where the stream is wrong, and what was expected.
pub fn import_from(
    source: Source,
    reader: impl Read,
    name: &str,
    options: &ImportOptions,
) -> Result<Imported, DataError> {
    match source.kind() {
        Kind::Reports(_) => Recording::from_reader(source, reader, name, options)?.collect(options),
        _ => tables::import_from(source, reader, name, options),
    }
}

/// Begins to read the reports of a file: in the form that its content has, if the source has several.
fn open_reports(source: Source, input: &Input, options: &ImportOptions) -> Result<Reports, DataError> {
    let content = input.content()?;
    let reporter: Box<dyn Reporter> = match (source, source.family(), content) {
        (_, _, Content::Empty) => return Err(DataError::Empty { file: input.name.clone() }),
        (Source::Nmea, ..) | (_, Source::Ais, Content::Nmea) => {
            Box::new(nmea::Sentences::new(input, options)?)
        }
        (Source::Sbs, ..) | (_, Source::Adsb, Content::Sbs) => Box::new(sbs::Messages::new(input, options)?),
        (_, Source::Ais, _) => Box::new(ais::Ships::new(input, options)?),
        _ => Box::new(adsb::Aircraft::new(input, options)?),
    };
    Ok(Reports::new(reporter, options.read.on_error))
}
