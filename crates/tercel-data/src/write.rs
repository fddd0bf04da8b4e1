//! Writing tables, to a file or a stream.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use crate::error::DataError;
use crate::format::{Format, SheetWriter};
use crate::layout::Layout;
use crate::output::AtomicFile;
use crate::sheet::Sheet;
use crate::source::file_name;
use crate::table::{Detections, Metrics, Tracks, Truths};
use crate::tracks_writer::TracksWriter;

fn to_path<T: Layout>(path: &Path, table: &T) -> Result<(), DataError> {
    let format = Format::to_write(path)?;
    let file = file_name(path);
    to_sink(AtomicFile::create(path)?, format, table, &file)?.finish()
}

fn to_stream<T: Layout>(
    writer: impl Write + Send,
    format: Format,
    name: &str,
    table: &T,
) -> Result<(), DataError> {
    let file: Arc<str> = name.into();
    to_sink(writer, format, table, &file)?.flush().map_err(|error| DataError::io(&file, "write", error))
}

fn to_sink<W: Write + Send, T: Layout>(
    sink: W,
    format: Format,
    table: &T,
    file: &Arc<str>,
) -> Result<W, DataError> {
    let metadata = table.metadata();
    let mut sheet = Sheet::settled(T::written(&metadata));
    table.fill(&mut sheet, file)?;
    let mut writer = SheetWriter::new(sink, format, &sheet.columns, metadata, file)?;
    writer.write(&sheet, file)?;
    writer.finish(file)
}

/// Writes detections to a `.csv`, `.parquet` or `.ndjson` file, which appears whole or not at all.
///
/// # Errors
/// When the name tells no format, the table holds what a reader would refuse (a number that is not finite, a
/// detection number twice), or the file cannot be written.
pub fn write_detections(path: impl AsRef<Path>, detections: &Detections) -> Result<(), DataError> {
    to_path(path.as_ref(), detections)
}

/// Writes detections to a stream; `name` stands for it in messages.
///
/// # Errors
/// As [`write_detections`].
pub fn write_detections_to(
    writer: impl Write + Send,
    format: Format,
    name: &str,
    detections: &Detections,
) -> Result<(), DataError> {
    to_stream(writer, format, name, detections)
}

/// Writes truth to a `.csv`, `.parquet` or `.ndjson` file, which appears whole or not at all.
///
/// # Errors
/// When the name tells no format, a number is not finite, or the file cannot be written.
pub fn write_truths(path: impl AsRef<Path>, truths: &Truths) -> Result<(), DataError> {
    to_path(path.as_ref(), truths)
}

/// Writes truth to a stream; `name` stands for it in messages.
///
/// # Errors
/// As [`write_truths`].
pub fn write_truths_to(
    writer: impl Write + Send,
    format: Format,
    name: &str,
    truths: &Truths,
) -> Result<(), DataError> {
    to_stream(writer, format, name, truths)
}

/// Writes tracks to a `.csv`, `.parquet` or `.ndjson` file or a map ([`MapFormat`](crate::MapFormat)), which appears whole or
/// not at all.
///
/// # Errors
/// When the name tells no format, a row does not have the state that the labels name, a number is not finite, the file
/// cannot be written, or it is a map and the tracks have no origin.
pub fn write_tracks(path: impl AsRef<Path>, tracks: &Tracks) -> Result<(), DataError> {
    TracksWriter::create(path, tracks)?.finish()
}

/// Writes tracks to a stream; `name` stands for it in messages.
///
/// # Errors
/// As [`write_tracks`].
pub fn write_tracks_to(
    writer: impl Write + Send,
    format: Format,
    name: &str,
    tracks: &Tracks,
) -> Result<(), DataError> {
    to_stream(writer, format, name, tracks)
}

/// Writes metrics to a `.csv`, `.parquet` or `.ndjson` file, which appears whole or not at all.
///
/// # Errors
/// When the name tells no format, or the file cannot be written.
pub fn write_metrics(path: impl AsRef<Path>, metrics: &Metrics) -> Result<(), DataError> {
    to_path(path.as_ref(), metrics)
}

/// Writes metrics to a stream; `name` stands for it in messages.
///
/// # Errors
/// As [`write_metrics`].
pub fn write_metrics_to(
    writer: impl Write + Send,
    format: Format,
    name: &str,
    metrics: &Metrics,
) -> Result<(), DataError> {
    to_stream(writer, format, name, metrics)
}
