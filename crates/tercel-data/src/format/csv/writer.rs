//! Tables as comma-separated values.

use std::io::Write;
use std::sync::Arc;

use super::PREFIX;
use crate::column::Column;
use crate::error::DataError;
use crate::format::write_number;
use crate::sheet::{Sheet, Values};

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
            for values in &sheet.values {
                self.write_cell(values, row).map_err(|error| write_error(error, file))?;
            }
            self.writer.write_record(None::<&[u8]>).map_err(|error| write_error(error, file))?;
        }
        Ok(())
    }

    fn write_cell(&mut self, values: &Values, row: usize) -> csv::Result<()> {
        self.cell.clear();
        match values {
            Values::Real(cells) => {
                cells[row].map_or(Ok(()), |number| write_number(number, &mut self.cell))?
            }
            Values::Count(cells) => cells[row].map_or(Ok(()), |number| write!(self.cell, "{number}"))?,
            // Tables of ours hold seconds.
            Values::Time(_) => {}
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
