//! The file formats. Each reads and writes a [`Sheet`]; none knows what the columns mean.

pub(crate) mod csv;
pub(crate) mod guard;
pub(crate) mod json;
pub(crate) mod parquet;

use std::collections::HashSet;
use std::io::{BufRead, Write};
use std::path::Path;
use std::sync::Arc;

use crate::column::{Column, Conversion};
use crate::error::{DataError, Place};
use crate::layout::{Context, Layout, check_names};
use crate::metadata::Metadata;
use crate::names::Naming;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::time::Clock;
use crate::unit::Unit;

pub(crate) use crate::source::{decompressed, file_name, open, read_error};

/// A format in which every table can be read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// Text in cells, separated by commas or otherwise. The first line may describe the table: `# tercel: {...}`.
    Csv,
    /// Apache Parquet. The key `tercel` of the file's metadata describes the table.
    Parquet,
    /// JSON objects, one per line or in an array. The first may describe the table: `{"tercel": {...}}`.
    Ndjson,
}

const KNOWN: &str = ".csv, .parquet and .ndjson (and .csv.gz and .ndjson.gz when reading)";

impl Format {
    /// The format of a file that is read, as far as its name tells: endings of compressed files are looked past, and text
    /// tables have other endings, too.
    pub(crate) fn of_input(path: &Path) -> Option<Format> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let bare =
            [".gz", ".zst", ".zstd", ".xz", ".zip"].iter().find_map(|ending| name.strip_suffix(ending));
        let name = bare.unwrap_or(&name);
        match name.rsplit_once('.')?.1 {
            "csv" | "tsv" | "tab" | "txt" | "dat" | "psv" => Some(Format::Csv),
            "parquet" | "pq" => Some(Format::Parquet),
            "ndjson" | "jsonl" => Some(Format::Ndjson),
            _ => None,
        }
    }

    /// The format that the name of a file tells: `.csv`, `.parquet`, `.ndjson` or `.jsonl`. An ending `.gz` is
    /// looked past.
    ///
    /// # Errors
    /// [`DataError::UnknownFormat`], which lists the known ones.
    pub fn of(path: &Path) -> Result<Format, DataError> {
        let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        let name = name.strip_suffix(".gz").unwrap_or(&name);
        let (_, extension) = name.rsplit_once('.').unwrap_or_default();
        match extension {
            "csv" => Ok(Format::Csv),
            "parquet" => Ok(Format::Parquet),
            "ndjson" | "jsonl" => Ok(Format::Ndjson),
            _ => Err(DataError::UnknownFormat { file: file_name(path), known: KNOWN }),
        }
    }

    /// The format for writing, which does not compress text.
    pub(crate) fn to_write(path: &Path) -> Result<Format, DataError> {
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz")) {
            return Err(DataError::UnknownFormat {
                file: file_name(path),
                known: ".csv, .parquet and .ndjson",
            });
        }
        Format::of(path)
    }
}

/// What the beginning of a file says: its description and its columns, with where they stand in the file.
pub(crate) struct Plan {
    pub metadata: Metadata,
    pub columns: Vec<Source>,
    /// Times are seconds, as our own files have them, or are of the unit that their column names.
    pub time_unit: Option<Unit>,
    pub ours: bool,
}

/// A column of a table and where it comes from.
pub(crate) struct Source {
    pub at: usize,
    pub column: Column,
    pub conversion: Conversion,
}

impl Plan {
    pub fn new<T: Layout>(
        found: &[String],
        described: Option<Metadata>,
        file: &Arc<str>,
        options: &ReadOptions,
        remarks: &mut Remarks,
    ) -> Result<Self, DataError> {
        let trouble = |(problem, help)| DataError::unsettled(Place::whole(file), problem, help);
        let ours = described.is_some();
        let (metadata, naming) = naming::<T>(found, described, file, options)?;
        let choice = naming.choose(found).map_err(trouble)?;
        check_names(&naming, &choice, found, file)?;
        remarks.notes.extend(choice.notes);
        if !ours && !choice.unused.is_empty() {
            remarks.notes.push(unused(&choice.unused));
        }
        let time_unit = choice.used.iter().find_map(|(_, meaning)| meaning.time_unit);
        let mut used = choice.used;
        used.sort_by_key(|(_, meaning)| meaning.column);
        let columns = used
            .into_iter()
            .map(|(at, meaning)| Source {
                at,
                column: naming.columns()[meaning.column].clone(),
                conversion: meaning.conversion,
            })
            .collect();
        Ok(Plan { metadata, columns, ours, time_unit: if ours { Some(Unit::Second) } else { time_unit } })
    }

    pub fn sheet(&self) -> Sheet {
        Sheet::new(self.columns.iter().map(|source| source.column.clone()).collect())
    }
}

/// The description of a file and the names of its columns.
pub(crate) fn naming<T: Layout>(
    found: &[String],
    described: Option<Metadata>,
    file: &Arc<str>,
    options: &ReadOptions,
) -> Result<(Metadata, Naming), DataError> {
    let ours = described.is_some();
    let metadata = match described {
        Some(metadata) => metadata,
        None => {
            let widest = Naming::new(T::TABLE, false, T::columns(&T::widest()), options);
            T::guess(&widest.in_our_words(found))
        }
    };
    let mut columns = options.relaxed(T::columns(&metadata));
    no_repetition(&columns, file)?;
    metadata.check_units(&columns, options.angles, file)?;
    if !ours {
        columns.extend(T::foreign_columns());
    }
    Ok((metadata, Naming::new(T::TABLE, ours, columns, options)))
}

/// Names the columns that nothing was read from.
pub(crate) fn unused(names: &[String]) -> String {
    const SHOWN: usize = 16;
    let mut text = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    format!("not used: {text}")
}

/// Refuses names of components and modes that make two columns one.
fn no_repetition(columns: &[Column], file: &Arc<str>) -> Result<(), DataError> {
    let mut names = HashSet::new();
    match columns.iter().find(|column| !names.insert(column.name.as_ref())) {
        None => Ok(()),
        Some(twice) => Err(DataError::Column {
            place: Place::whole(file),
            column: twice.name.to_string(),
            problem: "would be there twice",
            help: "give components and modes of the state names of their own".to_owned(),
        }),
    }
}

/// A file as cells.
pub(crate) struct Content {
    pub sheet: Sheet,
    pub metadata: Metadata,
    /// Names of all columns of the file.
    pub found: Vec<String>,
    /// The unit of its times, where it is known.
    pub time_unit: Option<Unit>,
    /// The file is one of our own.
    pub ours: bool,
}

/// Reads a table from a stream that is already decompressed.
pub(crate) fn read_table<T: Layout>(
    reader: &mut dyn BufRead,
    format: Format,
    file: &Arc<str>,
    options: &ReadOptions,
    remarks: &mut Remarks,
) -> Result<T, DataError> {
    if reader.fill_buf().map_err(|error| read_error(file, error))?.is_empty() {
        return Err(DataError::Empty { file: Arc::clone(file) });
    }
    let Content { mut sheet, metadata, found, time_unit, ours } = match format {
        Format::Csv => csv::read::<T>(reader, file, options, remarks)?,
        Format::Parquet => parquet::read::<T>(reader, file, options, remarks)?,
        Format::Ndjson => json::read::<T>(reader, file, options, remarks)?,
    };
    let mut clock = Clock::new(options, time_unit, file)?;
    let looked = clock.look_at(sheet.times());
    remarks
        .notes
        .extend(looked.map_err(|(problem, help)| DataError::unsettled(Place::whole(file), problem, help))?);
    sheet.settle_times(&mut clock, file, remarks)?;
    remarks.notes.extend(clock.note());
    T::from_sheet(
        &sheet,
        metadata,
        &Context { file, options, found: &found, ours, keyed: format == Format::Ndjson },
        remarks,
    )
}

/// Writes sheets one after another in one of the formats.
pub(crate) enum SheetWriter<W: Write + Send> {
    Csv(Box<csv::Writer<W>>),
    Parquet(Box<parquet::Writer<W>>),
    Ndjson(json::Writer<W>),
}

impl<W: Write + Send> SheetWriter<W> {
    /// Begins a file with these columns.
    pub fn new(
        sink: W,
        format: Format,
        columns: &[Column],
        metadata: Metadata,
        file: &Arc<str>,
    ) -> Result<Self, DataError> {
        no_repetition(columns, file)?;
        let json = metadata.with_units(columns).to_json();
        Ok(match format {
            Format::Csv => SheetWriter::Csv(Box::new(csv::Writer::new(sink, columns, &json, file)?)),
            Format::Parquet => {
                SheetWriter::Parquet(Box::new(parquet::Writer::new(sink, columns, json, file)?))
            }
            Format::Ndjson => SheetWriter::Ndjson(json::Writer::new(sink, &json, file)?),
        })
    }

    /// Appends a sheet, whose columns must be those with which the file began.
    pub fn write(&mut self, sheet: &Sheet, file: &Arc<str>) -> Result<(), DataError> {
        // A file that we write must be one that we read.
        if let Some((row, column, refusal)) = sheet.first_refused() {
            return Err(refusal.at(sheet.place(file, row), &column.name));
        }
        match self {
            SheetWriter::Csv(writer) => writer.write(sheet, file),
            SheetWriter::Parquet(writer) => writer.write(sheet, file),
            SheetWriter::Ndjson(writer) => writer.write(sheet, file),
        }
    }

    /// Hands on what is still held back, where the format allows it.
    pub fn flush(&mut self, file: &Arc<str>) -> Result<(), DataError> {
        match self {
            SheetWriter::Csv(writer) => writer.flush(file),
            SheetWriter::Parquet(_) => Ok(()),
            SheetWriter::Ndjson(writer) => writer.flush(file),
        }
    }

    /// Completes the file.
    pub fn finish(self, file: &Arc<str>) -> Result<W, DataError> {
        match self {
            SheetWriter::Csv(writer) => writer.finish(file),
            SheetWriter::Parquet(writer) => writer.finish(file),
            SheetWriter::Ndjson(writer) => writer.finish(file),
        }
    }
}

/// Writes a number so that reading it gives the same bits, and very large and small ones stay short.
pub(crate) fn write_number(number: f64, text: &mut Vec<u8>) -> std::io::Result<()> {
    let magnitude = number.abs();
    if magnitude != 0.0 && magnitude.is_finite() && !(1e-5..1e16).contains(&magnitude) {
        write!(text, "{number:e}")
    } else {
        write!(text, "{number}")
    }
}
