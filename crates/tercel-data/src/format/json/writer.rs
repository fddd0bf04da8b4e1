//! Tables as lines of JSON.

use std::io::Write;
use std::sync::Arc;

use super::KEY;
use crate::error::DataError;
use crate::format::write_number;
use crate::sheet::{Sheet, Values};

/// Writes a file.
pub(crate) struct Writer<W: Write> {
    sink: W,
    text: Vec<u8>,
}

impl<W: Write> Writer<W> {
    /// Writes the description.
    pub fn new(mut sink: W, json: &str, file: &Arc<str>) -> Result<Self, DataError> {
        writeln!(sink, "{{\"{KEY}\":{json}}}").map_err(|error| DataError::io(file, "write", error))?;
        Ok(Writer { sink, text: Vec::new() })
    }

    pub fn write(&mut self, sheet: &Sheet, file: &Arc<str>) -> Result<(), DataError> {
        self.text.clear();
        (0..sheet.len())
            .try_for_each(|row| write_row(sheet, row, &mut self.text))
            .and_then(|()| self.sink.write_all(&self.text))
            .map_err(|error| DataError::io(file, "write", error))
    }

    pub fn flush(&mut self, file: &Arc<str>) -> Result<(), DataError> {
        self.sink.flush().map_err(|error| DataError::io(file, "write", error))
    }

    pub fn finish(self, _file: &Arc<str>) -> Result<W, DataError> {
        Ok(self.sink)
    }
}

/// Writes a row as an object and a line end; empty cells are left out.
pub(crate) fn write_row(sheet: &Sheet, row: usize, text: &mut Vec<u8>) -> std::io::Result<()> {
    text.push(b'{');
    let mut first = true;
    for (column, values) in sheet.columns.iter().zip(&sheet.values) {
        if values.is_null(row) {
            continue;
        }
        if !first {
            text.push(b',');
        }
        first = false;
        serde_json::to_writer(&mut *text, column.name.as_ref())?;
        text.push(b':');
        match values {
            Values::Real(cells) => cells[row].map_or(Ok(()), |number| write_real(number, text))?,
            Values::Count(cells) => cells[row].map_or(Ok(()), |number| write!(text, "{number}"))?,
            Values::Text(cells) => {
                serde_json::to_writer(&mut *text, cells[row].as_deref().unwrap_or_default())?
            }
            // Tables of ours hold seconds.
            Values::Time(_) => text.extend_from_slice(b"null"),
        }
    }
    text.extend_from_slice(b"}\n");
    Ok(())
}

fn write_real(number: f64, text: &mut Vec<u8>) -> std::io::Result<()> {
    if number.is_finite() {
        return write_number(number, text);
    }
    write!(text, "\"{number}\"")
}
