//! Comma-separated values.

use std::io::{BufRead, Write};
use std::sync::Arc;

use super::{Content, Plan, read_error, write_rounded};
use crate::column::{Column, Written};
use crate::error::{DataError, Place};
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::sheet::{Sheet, Values};

const PREFIX: &str = "# tercel:";

/// Reads a file whose first byte is already known to be there.
pub(crate) fn read<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ReadOptions,
) -> Result<Content, DataError> {
    let (described, skipped) = read_comments::<T>(reader, file)?;
    let mut rows = Rows::new(reader, file, skipped)?;
    // Files of other programs often have blanks after their commas; in our own every blank belongs to a name.
    let trim = described.is_none();
    if trim {
        rows.header.iter_mut().for_each(|name| *name = name.trim().to_owned());
    }
    let plan = Plan::new::<T>(&rows.header, described, file, options)?;
    let mut sheet = plan.sheet();
    while let Some((record, line)) = rows.next(file)? {
        for ((at, column), values) in plan.columns.iter().zip(&mut sheet.values) {
            let text = text(&record[*at], &column.name, file, line)?;
            let text = if trim { text.trim() } else { text };
            values
                .push_text(text, column, options.angles)
                .map_err(|refusal| refusal.at(Place::line(file, line), &column.name))?;
        }
        sheet.lines.push(line);
    }
    Ok(Content { sheet, metadata: plan.metadata, found: rows.header })
}

fn text<'a>(bytes: &'a [u8], column: &str, file: &Arc<str>, line: u64) -> Result<&'a str, DataError> {
    std::str::from_utf8(bytes).map_err(|_| DataError::Corrupt {
        place: Place::line(file, line),
        problem: format!("column `{column}` is not UTF-8 text"),
        help: "save the file as UTF-8",
    })
}

/// Reads the lines before the header: the description, if there is one, and the number of lines.
fn read_comments<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
) -> Result<(Option<Metadata>, u64), DataError> {
    let mut described = None;
    let mut lines = 0;
    let start = reader.fill_buf().map_err(|error| read_error(file, error))?;
    if start.starts_with(b"\xef\xbb\xbf") {
        reader.consume(3);
    }
    while reader.fill_buf().map_err(|error| read_error(file, error))?.first() == Some(&b'#') {
        let mut line = Vec::new();
        reader.read_until(b'\n', &mut line).map_err(|error| read_error(file, error))?;
        lines += 1;
        if let Some(json) = std::str::from_utf8(&line).ok().and_then(|line| line.strip_prefix(PREFIX)) {
            described = Some(Metadata::parse(json.trim(), T::TABLE, file)?);
        }
    }
    Ok((described, lines))
}

/// The records of a CSV file after its header, with their lines in the file.
pub(crate) struct Rows<'a> {
    pub header: Vec<String>,
    reader: csv::Reader<&'a mut dyn BufRead>,
    record: csv::ByteRecord,
    skipped: u64,
}

impl<'a> Rows<'a> {
    /// Reads the header; `skipped` lines of the file came before.
    pub fn new(reader: &'a mut dyn BufRead, file: &Arc<str>, skipped: u64) -> Result<Self, DataError> {
        let mut reader = csv::ReaderBuilder::new().from_reader(reader);
        let header = reader.byte_headers().map_err(|error| failure(error, file, skipped))?;
        let header: Vec<String> =
            header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
        if header.iter().all(|name| name.trim().is_empty()) {
            return Err(DataError::Corrupt {
                place: Place::line(file, skipped + 1),
                problem: "there is no header".to_owned(),
                help: "begin the file with the names of its columns",
            });
        }
        Ok(Rows { header, reader, record: csv::ByteRecord::new(), skipped })
    }

    /// The next record and its line, from 1.
    pub fn next(&mut self, file: &Arc<str>) -> Result<Option<(&csv::ByteRecord, u64)>, DataError> {
        let more = self
            .reader
            .read_byte_record(&mut self.record)
            .map_err(|error| failure(error, file, self.skipped))?;
        let line = self.record.position().map_or(0, csv::Position::line) + self.skipped;
        Ok(more.then_some((&self.record, line)))
    }
}

fn failure(error: csv::Error, file: &Arc<str>, skipped: u64) -> DataError {
    let line = |position: &Option<csv::Position>| position.as_ref().map_or(0, csv::Position::line) + skipped;
    match error.into_kind() {
        csv::ErrorKind::Io(error) => read_error(file, error),
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => DataError::Row {
            place: Place::line(file, line(&pos)),
            problem: format!("the line has {len} cells; the header has {expected_len}"),
            help: "the file may be truncated here; put names that contain a comma into quotes",
        },
        kind => DataError::Corrupt {
            place: Place::whole(file),
            problem: format!("this is not CSV: {:?}", kind),
            help: "check that the file is text",
        },
    }
}

/// Writes a file.
pub(crate) struct Writer<W: Write> {
    writer: csv::Writer<W>,
    cell: Vec<u8>,
}

impl<W: Write> Writer<W> {
    /// Writes the description and the header.
    pub fn new(mut sink: W, columns: &[Column], json: &str, file: &Arc<str>) -> Result<Self, DataError> {
        writeln!(sink, "{PREFIX} {json}").map_err(|error| DataError::io(file, "write", error))?;
        let mut writer = csv::Writer::from_writer(sink);
        writer
            .write_record(columns.iter().map(|column| column.name.as_bytes()))
            .map_err(|error| write_error(error, file))?;
        Ok(Writer { writer, cell: Vec::new() })
    }

    pub fn write(&mut self, sheet: &Sheet, file: &Arc<str>) -> Result<(), DataError> {
        for row in 0..sheet.len() {
            for (column, values) in sheet.columns.iter().zip(&sheet.values) {
                self.write_cell(values, row, column.written).map_err(|error| write_error(error, file))?;
            }
            self.writer.write_record(None::<&[u8]>).map_err(|error| write_error(error, file))?;
        }
        Ok(())
    }

    fn write_cell(&mut self, values: &Values, row: usize, written: Written) -> csv::Result<()> {
        self.cell.clear();
        match values {
            Values::Real(cells) => {
                cells[row].map_or(Ok(()), |number| write_rounded(number, written, &mut self.cell))?
            }
            Values::Count(cells) => cells[row].map_or(Ok(()), |number| write!(self.cell, "{number}"))?,
            Values::Text(cells) => self.cell.extend(cells[row].iter().flat_map(|text| text.bytes())),
        }
        self.writer.write_field(&self.cell)
    }

    pub fn flush(&mut self, file: &Arc<str>) -> Result<(), DataError> {
        self.writer.flush().map_err(|error| DataError::io(file, "write", error))
    }

    pub fn finish(self, file: &Arc<str>) -> Result<W, DataError> {
        self.writer.into_inner().map_err(|error| DataError::io(file, "write", error.into_error()))
    }
}

fn write_error(error: csv::Error, file: &Arc<str>) -> DataError {
    let error = match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        kind => std::io::Error::other(format!("{kind:?}")),
    };
    DataError::io(file, "write", error)
}
