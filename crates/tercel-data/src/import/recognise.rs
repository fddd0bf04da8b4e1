//! Telling the source of a recording from the file.

use std::io::BufRead;
use std::path::Path;

use super::{Source, adsb, ais, fields};
use crate::error::DataError;
use crate::format::{Format, file_name, open};

impl Source {
    /// The source that a file seems to come from, by its name and, for CSV, by its columns.
    ///
    /// Parquet and NDJSON files are canonical tables. A CSV file with a column for the address of an aircraft
    /// (`icao24`) or the number of a ship (`MMSI`) is ADS-B or AIS, every other one a canonical table. JSON files
    /// are Autoferry recordings when they begin like one.
    ///
    /// # Errors
    /// [`DataError::UnknownFormat`] when nothing fits, and when the file cannot be read.
    pub fn recognise(path: impl AsRef<Path>) -> Result<Source, DataError> {
        let path = path.as_ref();
        let unknown = DataError::UnknownFormat {
            file: file_name(path),
            known: "csv, parquet, ndjson, autoferry, adsb and ais",
        };
        match Format::of_input(path).ok_or(()) {
            Ok(Format::Parquet) => Ok(Source::Parquet),
            Ok(Format::Ndjson) => Ok(Source::Ndjson),
            Ok(Format::Csv) => {
                let (file, mut reader) = open(path)?;
                let lines = match fields::Reports::new(reader.as_mut(), &file) {
                    Ok(lines) => lines,
                    // The reader of the table says better what is wrong.
                    Err(error) if !error.is_io() => return Ok(Source::Csv),
                    Err(error) => return Err(error),
                };
                Ok(if lines.field(adsb::AIRCRAFT).present() {
                    Source::Adsb
                } else if lines.field(ais::SHIP).present() {
                    Source::Ais
                } else {
                    Source::Csv
                })
            }
            Err(_) if begins_like_autoferry(path)? => Ok(Source::Autoferry),
            Err(_) => Err(unknown),
        }
    }
}

/// True when one of the first fields is that of a sensor of the Autoferry recordings. `path` may also be the
/// common beginning of the names of a recording.
fn begins_like_autoferry(path: &Path) -> Result<bool, DataError> {
    let (file, mut reader) = open(&super::autoferry::detections_file(path))?;
    let start = reader.fill_buf().map_err(|error| crate::format::read_error(&file, error))?;
    let start = &start[..start.len().min(4096)];
    Ok(start.trim_ascii_start().starts_with(b"[") && start.windows(10).any(|part| part == b"\"sensorID\""))
}
