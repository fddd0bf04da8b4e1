//! The objects of a stream of JSON.

use std::io::BufRead;
use std::sync::Arc;

use serde_json::{Map, Value};

use crate::error::{DataError, Place, Spot};
use crate::source::read_error;

/// Longest line that is read, in bytes. A longer one is no table but a runaway.
const LONGEST: usize = 16 << 20;

const EXPECTED: &str = "expected one JSON object per line, such as {\"time\": 0.0, \"sensor\": \"radar\", \"x\": 1.0, \"y\": 2.0}";

/// The objects of a stream, line by line, with where they stand. Empty lines are passed over.
///
/// A stream that begins with an array, or with an object over several lines, is read as a whole.
///
/// After an error the next line can be read, unless the stream itself failed.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    reader: R,
    file: Arc<str>,
    line: u64,
    buffer: Vec<u8>,
    ended: bool,
    /// Nothing but empty lines was there so far.
    begins: bool,
    /// The objects of a stream that was read as a whole.
    objects: Option<std::vec::IntoIter<Result<Map<String, Value>, DataError>>>,
    row: u64,
}

impl<R: BufRead> Lines<R> {
    pub fn new(reader: R, file: Arc<str>) -> Self {
        Lines { reader, file, line: 0, buffer: Vec::new(), ended: false, begins: true, objects: None, row: 0 }
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
        // One line may hold a whole array.
        if too_long && !(self.begins && self.is_document()) {
            return Err(self.bad_line(format!("the line is longer than {LONGEST} bytes")));
        }
        Ok(!self.ended || !self.buffer.is_empty())
    }

    /// True when the first line begins a document rather than being an object of its own.
    fn is_document(&self) -> bool {
        let text = self.buffer.trim_ascii();
        let begins = |byte| text.first() == Some(&byte);
        begins(b'[') || (begins(b'{') && matches!(text.last(), Some(b'{' | b'[' | b',')))
    }

    /// Reads all that is left as one document.
    fn read_document(&mut self) -> Result<(), DataError> {
        self.ended = true;
        self.buffer.push(b'\n');
        self.reader.read_to_end(&mut self.buffer).map_err(|error| read_error(&self.file, error))?;
        let mut objects = Vec::new();
        for value in serde_json::Deserializer::from_slice(&self.buffer).into_iter::<Value>() {
            match value {
                Ok(Value::Array(elements)) => {
                    objects.extend(elements.into_iter().map(|element| self.object(element)))
                }
                Ok(value) => objects.push(self.object(value)),
                Err(error) => {
                    let line = self.line - 1 + error.line() as u64;
                    objects.push(Err(DataError::Corrupt {
                        place: Place::line(&self.file, line),
                        problem: format!("this is not JSON: {error}"),
                        help: "expected an array of objects, or one object per line",
                    }));
                }
            }
        }
        self.buffer = Vec::new();
        self.objects = Some(objects.into_iter());
        Ok(())
    }

    fn object(&self, value: Value) -> Result<Map<String, Value>, DataError> {
        match value {
            Value::Object(object) => Ok(object),
            _ => Err(DataError::Corrupt {
                place: Place::line(&self.file, self.line),
                problem: "the array holds what is no object".to_owned(),
                help: "expected an array of objects with the keys time, sensor, x and y",
            }),
        }
    }

    fn bad_line(&self, problem: String) -> DataError {
        DataError::Corrupt { place: Place::line(&self.file, self.line), problem, help: EXPECTED }
    }

    /// Reads the line in the buffer.
    fn parse(&self, first: bool) -> Result<(Map<String, Value>, Place), DataError> {
        serde_json::from_slice(&self.buffer)
            .map(|object| (object, Place::line(&self.file, self.line)))
            .map_err(|error| {
                if first && !self.buffer.trim_ascii().starts_with(b"{") {
                    let problem = format!("this is not JSON: {error}");
                    let help = "a text table with a header is read with --from csv; JSON begins with { or [";
                    return DataError::Corrupt { place: Place::line(&self.file, self.line), problem, help };
                }
                let problem = format!("this is not a JSON object: {error}");
                if self.buffer.windows(3).any(|word| word == b"NaN")
                    || self.buffer.windows(8).any(|word| word == b"Infinity")
                {
                    let help =
                        "JSON has no NaN or Infinity: write null, or leave such lines out: --on-error skip";
                    return DataError::Corrupt { place: Place::line(&self.file, self.line), problem, help };
                }
                self.bad_line(problem)
            })
    }
}

impl<R: BufRead> Iterator for Lines<R> {
    type Item = Result<(Map<String, Value>, Place), DataError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(objects) = &mut self.objects {
                let spot = Spot::Row(self.row);
                self.row += 1;
                let place = Place { file: Arc::clone(&self.file), spot };
                return objects.next().map(|object| object.map(|object| (object, place)));
            }
            if self.ended {
                return None;
            }
            match self.advance() {
                Ok(true) if self.buffer.iter().all(u8::is_ascii_whitespace) => {}
                Ok(true) => {
                    if self.begins && self.buffer.starts_with(b"\xef\xbb\xbf") {
                        self.buffer.drain(..3);
                    }
                    let first = std::mem::replace(&mut self.begins, false);
                    if !(first && self.is_document()) {
                        return Some(self.parse(first));
                    }
                    if let Err(error) = self.read_document() {
                        return Some(Err(error));
                    }
                }
                Ok(false) => return None,
                Err(error) => return Some(Err(error)),
            }
        }
    }
}
