//! One JSON object per line.

use std::io::{BufRead, Write};
use std::sync::Arc;

use serde_json::{Map, Value};

use super::{Content, Plan, read_error, write_number};
use crate::column::{Angles, Column};
use crate::error::{DataError, Place, Refusal};
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::sheet::{Sheet, Values};

/// Key of the object that describes the table.
pub(crate) const KEY: &str = "tercel";

/// Longest line that is read, in bytes. A longer one is no table but a runaway.
pub(crate) const LONGEST: usize = 16 << 20;

/// Reads a file of rows. The keys of the first row are its columns.
pub(crate) fn read<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ReadOptions,
) -> Result<Content, DataError> {
    let mut lines = Lines::new(reader, Arc::clone(file));
    let mut described = None;
    let mut first = None;
    for row in lines.by_ref() {
        let (object, line) = row?;
        match description(&object) {
            Some(json) => described = Some(Metadata::parse(&json, T::TABLE, file)?),
            None => {
                first = Some((object, line));
                break;
            }
        }
    }
    let found: Vec<String> = match (&first, &described) {
        (Some((object, _)), _) => object.keys().cloned().collect(),
        (None, Some(metadata)) => T::columns(metadata).iter().map(|column| column.name.to_string()).collect(),
        (None, None) => return Err(DataError::Empty { file: Arc::clone(file) }),
    };
    let (metadata, columns) = plan::<T>(&found, described, file, options)?;
    let mut sheet = Sheet::new(columns);
    for row in first.map(Ok).into_iter().chain(lines) {
        let (object, line) = row?;
        push_with(&mut sheet, |name| object.get(name), options.angles)
            .map_err(|(column, refusal)| refusal.at(Place::line(file, line), &column))?;
        sheet.lines.push(line);
    }
    Ok(Content { sheet, metadata, found })
}

/// Later rows may have keys that the first has not, so all columns are kept.
fn plan<T: Layout>(
    found: &[String],
    described: Option<Metadata>,
    file: &Arc<str>,
    options: &ReadOptions,
) -> Result<(Metadata, Vec<Column>), DataError> {
    let plan = Plan::new::<T>(found, described, file, options)?;
    let columns = options.relaxed(T::columns(&plan.metadata));
    Ok((plan.metadata, columns))
}

/// The JSON of the description, when the object holds one.
pub(crate) fn description(object: &Map<String, Value>) -> Option<String> {
    object.get(KEY).filter(|_| object.len() == 1).map(Value::to_string)
}

/// Appends the values that `find` has for the columns as a row; otherwise names the column that refuses.
pub(crate) fn push_with<'a>(
    sheet: &mut Sheet,
    find: impl Fn(&str) -> Option<&'a Value>,
    angles: Angles,
) -> Result<(), (String, Refusal)> {
    for (column, values) in sheet.columns.iter().zip(&mut sheet.values) {
        push_value(values, find(&column.name).unwrap_or(&Value::Null), column, angles)
            .map_err(|refusal| (column.name.to_string(), refusal))?;
    }
    Ok(())
}

fn push_value(values: &mut Values, value: &Value, column: &Column, angles: Angles) -> Result<(), Refusal> {
    match value {
        Value::Null => values.push_null(column),
        // Numbers that JSON has no way to write come as text.
        Value::String(text) => values.push_text(text, column, angles),
        Value::Number(number) => match (number.as_u64(), number.as_f64()) {
            (Some(count), _) => values.push_count(count, column, angles),
            (_, Some(real)) => values.push_number(real, column, angles),
            _ => Err(Refusal::new(number, column.expected())),
        },
        other => Err(Refusal::new(other, column.expected())),
    }
}

/// The objects of a stream, line by line, with the numbers of their lines. Empty lines are passed over.
///
/// After an error the next line can be read, unless the stream itself failed.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    reader: R,
    file: Arc<str>,
    line: u64,
    buffer: Vec<u8>,
    ended: bool,
}

impl<R: BufRead> Lines<R> {
    pub fn new(reader: R, file: Arc<str>) -> Self {
        Lines { reader, file, line: 0, buffer: Vec::new(), ended: false }
    }

    pub fn file(&self) -> &Arc<str> {
        &self.file
    }

    /// Reads the next line into the buffer; false at the end.
    fn advance(&mut self) -> Result<bool, DataError> {
        self.buffer.clear();
        let mut too_long = false;
        loop {
            let chunk = self.reader.fill_buf().map_err(|error| {
                self.ended = true;
                read_error(&self.file, error)
            })?;
            let end = chunk.iter().position(|byte| *byte == b'\n');
            let part = &chunk[..end.unwrap_or(chunk.len())];
            let at_end = chunk.is_empty();
            too_long |= self.buffer.len() + part.len() > LONGEST;
            if !too_long {
                self.buffer.extend_from_slice(part);
            }
            let used = part.len() + usize::from(end.is_some());
            self.reader.consume(used);
            if at_end || end.is_some() {
                self.line += 1;
                self.ended = at_end;
                break;
            }
        }
        if too_long {
            return Err(self.bad_line(format!("the line is longer than {LONGEST} bytes")));
        }
        Ok(!self.ended || !self.buffer.is_empty())
    }

    fn bad_line(&self, problem: String) -> DataError {
        DataError::Corrupt {
            place: Place::line(&self.file, self.line),
            problem,
            help: "expected one JSON object per line, such as {\"time\": 0.0, \"sensor\": \"radar\", \"x\": 1.0, \"y\": 2.0}",
        }
    }
}

impl<R: BufRead> Iterator for Lines<R> {
    type Item = Result<(Map<String, Value>, u64), DataError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.ended {
            match self.advance() {
                Ok(true) if self.buffer.iter().all(u8::is_ascii_whitespace) => {}
                Ok(true) => {
                    let row = serde_json::from_slice::<Map<String, Value>>(&self.buffer)
                        .map(|object| (object, self.line))
                        .map_err(|error| self.bad_line(format!("this is not a JSON object: {error}")));
                    return Some(row);
                }
                Ok(false) => return None,
                Err(error) => return Some(Err(error)),
            }
        }
        None
    }
}

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
