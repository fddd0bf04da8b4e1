//! Reading tables, by the name of a file or from a stream.

use std::io::{BufRead, Read};
use std::path::Path;
use std::sync::Arc;

use crate::error::DataError;
use crate::format::{Format, read_table};
use crate::import::Imported;
use crate::layout::Layout;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::source::{decompressed, open};
use crate::table::{Detections, Metrics, Tracks, Truths};

fn from_path<T: Layout>(path: &Path, options: &ReadOptions) -> Result<T, DataError> {
    let format = Format::of_input(path).map_or_else(|| Format::of(path), Ok)?;
    let (file, mut reader) = open(path)?;
    read_table(reader.as_mut(), format, &file, options, &mut Remarks::new(options.on_error))
}

/// Reads detections in a format that was chosen by hand.
pub(crate) fn read_as(path: &Path, format: Format, options: &ReadOptions) -> Result<Imported, DataError> {
    let (file, mut reader) = open(path)?;
    imported(reader.as_mut(), format, &file, options)
}

/// Reads detections from a stream, with what was decided and left out on the way; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] that says where the stream is wrong, and what was expected.
pub fn import_table_from(
    reader: impl Read,
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Imported, DataError> {
    let file: Arc<str> = name.into();
    let mut reader = decompressed(reader, &file)?;
    imported(reader.as_mut(), format, &file, options)
}

fn imported(
    reader: &mut dyn BufRead,
    format: Format,
    file: &Arc<str>,
    options: &ReadOptions,
) -> Result<Imported, DataError> {
    let mut remarks = Remarks::new(options.on_error);
    let detections = read_table(reader, format, file, options, &mut remarks)?;
    Ok(Imported { detections, notes: remarks.notes, left_out: remarks.left_out, truths: None })
}

fn from_stream<T: Layout>(
    reader: impl Read,
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<T, DataError> {
    let file: Arc<str> = name.into();
    let mut reader = decompressed(reader, &file)?;
    read_table(reader.as_mut(), format, &file, options, &mut Remarks::new(options.on_error))
}

/// Reads detections from a CSV, Parquet or JSON file, compressed or not.
///
/// Of the columns only `time` and either `x` and `y`, `bearing`, or `latitude` and `longitude` are needed; usual other
/// names are known, and [`ReadOptions`] say the rest. Rows of one scan may stand anywhere: they have the same sensor and
/// number in `scan`; without that column, the same time and sensor. Scans come in the order of time. Where there is a
/// column `detection`, a row without a number in it is a scan in which nothing was seen; without that column, a
/// row without a measurement is.
///
/// What was decided and left out on the way is told by [`import()`](crate::import()), which reads the same.
///
/// # Errors
/// A [`DataError`] that says where the file is wrong, and what was expected.
pub fn read_detections(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Detections, DataError> {
    from_path(path.as_ref(), options)
}

/// Reads detections as [`read_detections`] does, from a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] that says where the stream is wrong, and what was expected.
pub fn read_detections_from(
    reader: impl Read,
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Detections, DataError> {
    from_stream(reader, format, name, options)
}

/// Reads the truth from a CSV, Parquet or JSON file, compressed or not.
///
/// The columns `time`, `object`, `x` and `y` are needed.
///
/// # Errors
/// A [`DataError`] that says where the file is wrong, and what was expected.
pub fn read_truths(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Truths, DataError> {
    from_path(path.as_ref(), options)
}

/// Reads the truth as [`read_truths`] does, from a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] that says where the stream is wrong, and what was expected.
pub fn read_truths_from(
    reader: impl Read,
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Truths, DataError> {
    from_stream(reader, format, name, options)
}

/// Reads tracks from a CSV, Parquet or JSON file, compressed or not.
///
/// Tracks of other programs need the columns `time`, `track`, `x` and `y` only: a missing status is read as
/// confirmed, a missing existence probability as 1, and a missing covariance is empty.
///
/// # Errors
/// A [`DataError`] that says where the file is wrong, and what was expected.
pub fn read_tracks(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Tracks, DataError> {
    from_path(path.as_ref(), options)
}

/// Reads tracks as [`read_tracks`] does, from a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] that says where the stream is wrong, and what was expected.
pub fn read_tracks_from(
    reader: impl Read,
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Tracks, DataError> {
    from_stream(reader, format, name, options)
}

/// Reads metrics from a CSV, Parquet or JSON file, compressed or not.
///
/// An empty `value` is not a number.
///
/// # Errors
/// A [`DataError`] that says where the file is wrong, and what was expected.
pub fn read_metrics(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Metrics, DataError> {
    from_path(path.as_ref(), options)
}

/// Reads metrics as [`read_metrics`] does, from a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] that says where the stream is wrong, and what was expected.
pub fn read_metrics_from(
    reader: impl Read,
    format: Format,
    name: &str,
    options: &ReadOptions,
) -> Result<Metrics, DataError> {
    from_stream(reader, format, name, options)
}
