//! Telling the source of a recording from the file.

use std::path::Path;

use super::content::Content;
use super::input::Input;
use super::source::NAMES;
use super::table::{Names, PLAIN, Shape, Table};
use super::{Source, adsb, ais, autoferry};
use crate::error::{DataError, Place};
use crate::format::{Format, file_name};
use crate::options::ReadOptions;

/// Columns that only our own tables have.
const CANONICAL: Names = Names(&[(PLAIN, &["x", "bearing", "detections"])]);
/// Of a plot that a sensor made, whatever else is known of it.
const SENSOR: Names = Names(&[(PLAIN, &["sensor"])]);

impl Source {
    /// The source that a file seems to come from: by its content, and where that says little, by its name.
    ///
    /// A table (CSV or other text, Parquet, lines of JSON) with a column for the number of a ship (`MMSI`) or the address of
    /// an aircraft (`icao24`, `hex`) is AIS or ADS-B, and a table of ours otherwise. Sentences of AIS receivers, messages of
    /// BaseStation feeds, `aircraft.json` and the answers of the OpenSky Network are told by their first lines, and so are
    /// Autoferry recordings.
    ///
    /// # Errors
    /// [`DataError::UnknownFormat`] when nothing fits, [`DataError::Unsettled`] for the boxes of the MOT Challenge, which are
    /// not read, and when the file cannot be read.
    pub fn recognise(path: impl AsRef<Path>) -> Result<Source, DataError> {
        let path = path.as_ref();
        // The name may be the common beginning of those of a recording.
        let input = Input::file(&autoferry::detections_file(path));
        let unknown = DataError::UnknownFormat { file: file_name(path), known: NAMES };
        let named = match Format::of_input(path) {
            Some(Format::Csv) => Some(Source::Csv),
            Some(Format::Parquet) => Some(Source::Parquet),
            Some(Format::Ndjson) => Some(Source::Ndjson),
            None => None,
        };
        match input.content()? {
            Content::Autoferry => Ok(Source::Autoferry),
            Content::Nmea => Ok(Source::Nmea),
            Content::Sbs => Ok(Source::Sbs),
            Content::Json(Shape::Aircraft) => Ok(Source::AircraftJson),
            Content::Json(Shape::States) => Ok(Source::OpenSky),
            Content::Json(Shape::Objects) => {
                // Other JSON than lines has the ending `.json`, too.
                let ours = || has_time(&input) || Format::of(path).is_ok();
                by_columns(&input).or_else(|| ours().then_some(Source::Ndjson)).ok_or(unknown)
            }
            Content::Parquet => Ok(by_columns(&input).unwrap_or(Source::Parquet)),
            Content::Described => Ok(Source::Csv),
            Content::Text => by_columns(&input).or(named).ok_or(unknown),
            Content::Empty => named.ok_or(unknown),
            Content::Mot => Err(DataError::unsettled(
                Place::whole(&input.name),
                "these are pixel boxes of the MOT Challenge, which are not read",
                "write the points of interest, such as the middles of the lower edges, as a table with `time`, `sensor`, \
                 `x`, `y` in m",
            )),
        }
    }
}

/// The source of a table, if its columns tell that it is one of ships or aircraft. Of files that cannot be read the reader
/// says better what is wrong.
fn by_columns(input: &Input) -> Option<Source> {
    let wanted: Vec<&Names> =
        ais::NAMES.into_iter().chain(adsb::NAMES).chain([&CANONICAL, &SENSOR]).collect();
    let table = Table::open(input, &wanted, &ReadOptions::default()).ok()?;
    let has = |names| table.field(names).present();
    let place = has(&adsb::LATITUDE) || has(&adsb::POSITION);
    if has(&CANONICAL) {
        None
    } else if has(&adsb::AIRCRAFT) || (place && has(&adsb::CALLSIGN) && !has(&ais::SHIP) && !has(&SENSOR)) {
        Some(Source::Adsb)
    } else if has(&ais::SHIP) {
        Some(Source::Ais)
    } else {
        None
    }
}

/// True when rows have a time, or the first line describes a table of ours.
fn has_time(input: &Input) -> bool {
    const TIME: Names = Names(&[(PLAIN, &["time", "tercel"])]);
    Table::open(input, &[], &ReadOptions::default()).is_ok_and(|table| table.field(&TIME).present())
}
