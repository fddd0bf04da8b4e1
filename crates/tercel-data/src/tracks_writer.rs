//! Writing tracks as they are made.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use crate::error::DataError;
use crate::export::{MapFormat, MapWriter};
use crate::format::{Format, SheetWriter};
use crate::layout::{Layout, TrackColumns};
use crate::output::AtomicFile;
use crate::sheet::Sheet;
use crate::source::file_name;
use crate::table::{Track, Tracks};

/// Writes tracks as they are made: a table, or a map ([`MapFormat`]), which gathers them until the end.
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
///     altitude: None,
///     identity: None,
///     detection: Some(17),
/// }])?;
/// assert!(!path.exists(), "the file appears when it is complete");
/// writer.finish()?;
/// assert_eq!(read_tracks(&path, &ReadOptions::default())?.rows.len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TracksWriter<'a> {
    kind: Kind<'a>,
    file: Arc<str>,
}

enum Kind<'a> {
    Table(Box<Table<'a>>),
    Map(Box<MapWriter>),
}

/// A table that is being written.
struct Table<'a> {
    writer: SheetWriter<Sink<'a>>,
    sheet: Sheet,
    columns: TrackColumns,
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
    /// As [`write_tracks`](crate::write_tracks).
    pub fn create(path: impl AsRef<Path>, head: &Tracks) -> Result<Self, DataError> {
        let path = path.as_ref();
        if let Some(format) = MapFormat::of(path) {
            let kind = Kind::Map(Box::new(MapWriter::new(format, head, path)?));
            let mut tracks = TracksWriter { kind, file: file_name(path) };
            tracks.append(&head.rows)?;
            return Ok(tracks);
        }
        let format = Format::to_write(path)?;
        TracksWriter::begin(Sink::File(AtomicFile::create(path)?), format, file_name(path), head)
    }

    /// Begins to write to a stream, such as standard output; `name` stands for it in messages.
    ///
    /// CSV and NDJSON rows are handed on as they are appended; Parquet comes at the end.
    ///
    /// # Errors
    /// As [`write_tracks`](crate::write_tracks).
    pub fn to(
        stream: impl Write + Send + 'a,
        format: Format,
        name: &str,
        head: &Tracks,
    ) -> Result<Self, DataError> {
        TracksWriter::begin(Sink::Stream(Box::new(stream)), format, name.into(), head)
    }

    fn begin(sink: Sink<'a>, format: Format, file: Arc<str>, head: &Tracks) -> Result<Self, DataError> {
        let columns = TrackColumns::new(head.origin, &head.labels, &head.modes);
        let sheet = Sheet::settled(columns.written());
        let writer = SheetWriter::new(sink, format, &sheet.columns, head.metadata(), &file)?;
        let kind = Kind::Table(Box::new(Table { writer, sheet, columns }));
        let mut tracks = TracksWriter { kind, file };
        tracks.append(&head.rows)?;
        Ok(tracks)
    }

    /// Appends rows.
    ///
    /// # Errors
    /// When a row does not have the state that the labels name, a number is not finite, or the system refuses.
    /// Row numbers in errors count within the call.
    pub fn append(&mut self, rows: &[Track]) -> Result<(), DataError> {
        match &mut self.kind {
            Kind::Map(map) => map.append(rows),
            Kind::Table(table) => {
                table.sheet.clear();
                table.columns.fill(&mut table.sheet, rows, &self.file)?;
                table.writer.write(&table.sheet, &self.file)
            }
        }
    }

    /// Hands on the rows that were appended so far, for a reader at the other end of a stream.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn flush(&mut self) -> Result<(), DataError> {
        match &mut self.kind {
            Kind::Map(_) => Ok(()),
            Kind::Table(table) => table.writer.flush(&self.file),
        }
    }

    /// What is not in the file, or in another way than in the rows, for the person who asked for it: sentences.
    pub fn notes(&self) -> Vec<String> {
        match &self.kind {
            Kind::Map(map) => map.notes(),
            Kind::Table(_) => Vec::new(),
        }
    }

    /// Completes the file and puts it in its place.
    ///
    /// # Errors
    /// When the system refuses; the file is then not there.
    pub fn finish(self) -> Result<(), DataError> {
        match self.kind {
            Kind::Map(map) => map.finish(),
            Kind::Table(table) => match table.writer.finish(&self.file)? {
                Sink::File(file) => file.finish(),
                Sink::Stream(mut stream) => {
                    stream.flush().map_err(|error| DataError::io(&self.file, "write", error))
                }
            },
        }
    }
}
