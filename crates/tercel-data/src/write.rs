//! Writing tables, to a file or a stream.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use crate::error::DataError;
use crate::format::{Format, SheetWriter};
use crate::layout::{Layout, fill_tracks, track_columns};
use crate::output::AtomicFile;
use crate::sheet::Sheet;
use crate::source::file_name;
use crate::table::{Detections, Metrics, Track, Tracks, Truths};

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
    let mut sheet = Sheet::settled(T::columns(&metadata));
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

/// Writes tracks to a `.csv`, `.parquet` or `.ndjson` file, which appears whole or not at all.
///
/// # Errors
/// When the name tells no format, a row does not have the state that the labels name, a number is not finite, or
/// the file cannot be written.
pub fn write_tracks(path: impl AsRef<Path>, tracks: &Tracks) -> Result<(), DataError> {
    to_path(path.as_ref(), tracks)
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

/// Writes tracks as they are made.
///
/// ```
/// use tercel_data::{ReadOptions, TracksWriter, read_tracks};
/// use tercel_data::table::{Status, Track, Tracks};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("tracks.parquet");
/// let labels = ["x", "y"].map(String::from).to_vec();
/// let mut writer = TracksWriter::create(&path, &Tracks { labels, ..Tracks::default() })?;
/// writer.append(&[Track {
///     time: 0.0,
///     sensor: "radar".into(),
///     track: 1,
///     status: Status::Tentative,
///     existence: 0.5,
///     state: vec![10.0, 20.0],
///     covariance: vec![4.0, 0.0, 4.0],
///     modes: vec![],
///     extent: None,
///     identity: None,
///     detection: Some(17),
/// }])?;
/// assert!(!path.exists(), "the file appears when it is complete");
/// writer.finish()?;
/// assert_eq!(read_tracks(&path, &ReadOptions::default())?.rows.len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TracksWriter<'a> {
    writer: SheetWriter<Sink<'a>>,
    sheet: Sheet,
    labels: Vec<String>,
    modes: Vec<String>,
    file: Arc<str>,
}

enum Sink<'a> {
    File(AtomicFile),
    Stream(Box<dyn Write + Send + 'a>),
}

impl Write for Sink<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Sink::File(file) => file.write(bytes),
            Sink::Stream(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Sink::File(file) => file.flush(),
            Sink::Stream(stream) => stream.flush(),
        }
    }
}

impl<'a> TracksWriter<'a> {
    /// Begins a file with the origin, labels, modes and rows of `head`; its name chooses the format.
    ///
    /// # Errors
    /// As [`write_tracks`].
    pub fn create(path: impl AsRef<Path>, head: &Tracks) -> Result<Self, DataError> {
        let path = path.as_ref();
        let format = Format::to_write(path)?;
        TracksWriter::begin(Sink::File(AtomicFile::create(path)?), format, file_name(path), head)
    }

    /// Begins to write to a stream, such as standard output; `name` stands for it in messages.
    ///
    /// CSV and NDJSON rows are handed on as they are appended; Parquet comes at the end.
    ///
    /// # Errors
    /// As [`write_tracks`].
    pub fn to(
        stream: impl Write + Send + 'a,
        format: Format,
        name: &str,
        head: &Tracks,
    ) -> Result<Self, DataError> {
        TracksWriter::begin(Sink::Stream(Box::new(stream)), format, name.into(), head)
    }

    fn begin(sink: Sink<'a>, format: Format, file: Arc<str>, head: &Tracks) -> Result<Self, DataError> {
        let sheet = Sheet::settled(track_columns(&head.labels, &head.modes));
        let writer = SheetWriter::new(sink, format, &sheet.columns, head.metadata(), &file)?;
        let (labels, modes) = (head.labels.clone(), head.modes.clone());
        let mut tracks = TracksWriter { writer, sheet, labels, modes, file };
        tracks.append(&head.rows)?;
        Ok(tracks)
    }

    /// Appends rows.
    ///
    /// # Errors
    /// When a row does not have the state that the labels name, a number is not finite, or the system refuses.
    /// Row numbers in errors count within the call.
    pub fn append(&mut self, rows: &[Track]) -> Result<(), DataError> {
        self.sheet.clear();
        fill_tracks(&mut self.sheet, rows, &self.labels, &self.modes, &self.file)?;
        self.writer.write(&self.sheet, &self.file)
    }

    /// Hands on the rows that were appended so far, for a reader at the other end of a stream.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn flush(&mut self) -> Result<(), DataError> {
        self.writer.flush(&self.file)
    }

    /// Completes the file and puts it in its place.
    ///
    /// # Errors
    /// When the system refuses; the file is then not there.
    pub fn finish(self) -> Result<(), DataError> {
        match self.writer.finish(&self.file)? {
            Sink::File(file) => file.finish(),
            Sink::Stream(mut stream) => {
                stream.flush().map_err(|error| DataError::io(&self.file, "write", error))
            }
        }
    }
}
