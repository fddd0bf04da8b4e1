//! The rows of a text table, whatever its dialect.

use std::collections::VecDeque;
use std::sync::Arc;

use super::PREFIX;
use super::dialect::{Delimiter, is_value};
use super::record::{Record, Split};
use crate::error::{DataError, Place};
use crate::source::{Kind, Text, read_error, text};

/// Lines that are looked at to tell the dialect.
const SAMPLE: usize = 32;

/// The records of a text table after its header, with their lines in the file.
///
/// The delimiter (`,` `;` tab `|` or blanks), decimal commas, comments and the header are told from the first lines. A quote
/// that is never closed is a letter like any other.
pub(crate) struct Rows<'a> {
    /// Names of the columns; empty when the file has no header.
    pub header: Vec<String>,
    /// The JSON of the line that describes a table of ours.
    pub described: Option<String>,
    text: Text<'a>,
    /// The last byte of a line.
    end: u8,
    delimiter: Delimiter,
    /// Lines that were read ahead.
    ahead: VecDeque<String>,
    /// Number of the last line that was taken.
    line: u64,
    /// Number of cells in a row.
    width: usize,
    record: Record,
    /// Lines of text before the header.
    preamble: usize,
    stray_quotes: u64,
    comments: u64,
}

impl<'a> Rows<'a> {
    /// Looks at the first lines. `columns` are names for a file without header.
    pub fn new(
        mut reader: impl std::io::BufRead + 'a,
        file: &Arc<str>,
        columns: Option<&[String]>,
    ) -> Result<Self, DataError> {
        let start = reader.fill_buf().map_err(|error| read_error(file, error))?;
        if Kind::of(start) == Kind::Json {
            let help = "name the format: --from ndjson";
            return Err(DataError::unsettled(Place::whole(file), "this is JSON, not a table of cells", help));
        }
        // Old programs end lines by a carriage return alone.
        let end = if start.contains(&b'\r') && !start.contains(&b'\n') { b'\r' } else { b'\n' };
        let mut rows = Rows {
            end,
            header: Vec::new(),
            described: None,
            text: text(reader, file)?,
            delimiter: Delimiter::Blanks,
            ahead: VecDeque::new(),
            line: 0,
            width: 0,
            record: Record::default(),
            preamble: 0,
            stray_quotes: 0,
            comments: 0,
        };
        let comment = rows.begin(file)?;
        rows.find_header(comment, file)?;
        if let Some(columns) = columns {
            rows.name_columns(columns, file)?;
        }
        Ok(rows)
    }

    /// Reads what stands before the table and finds the delimiter; the last comment may turn out to be the header.
    fn begin(&mut self, file: &Arc<str>) -> Result<Option<String>, DataError> {
        let mut comment = None;
        let mut named = None;
        while let Some(line) = self.take_line(file)? {
            if let Some(json) = line.strip_prefix(PREFIX) {
                self.described = Some(json.trim().to_owned());
            } else if is_comment(&line) {
                comment = Some(line.trim_start_matches(['#', '%']).trim().to_owned());
            } else if named.is_none() && Delimiter::named(&line).is_some() {
                named = Delimiter::named(&line);
            } else if !line.trim().is_empty() {
                self.put_back(line);
                break;
            }
        }
        while self.ahead.len() < SAMPLE && self.read_ahead(file)? {}
        self.pass_preamble(named);
        Ok(comment)
    }

    /// Tells the delimiter, and passes over lines of text before a header, whose cells are fewer than those of the rows.
    fn pass_preamble(&mut self, named: Option<Delimiter>) {
        /// A title, a name, a date: more lines than this are no preamble.
        const LINES: usize = 12;
        let is_text = |line: &str| !line.trim().is_empty() && !is_comment(line);
        let told = |from: usize| {
            let lines =
                self.ahead.iter().skip(from).map(|line| without_end(line)).filter(|line| is_text(line));
            let delimiter = named.unwrap_or_else(|| Delimiter::sniff(lines.clone()));
            let mut record = Record::default();
            let mut counts = lines.map(|line| {
                record.split(line, delimiter);
                record.len()
            });
            let first = counts.next().unwrap_or(0);
            let (all, same) =
                counts.fold((0, 0), |(all, same), count| (all + 1, same + usize::from(count == first)));
            (delimiter, first > 1 && same * 2 >= all)
        };
        // Our own tables begin with their header, and names in their cells may be anything.
        if self.described.is_some() {
            let header = self.ahead.front().map(|line| without_end(line));
            self.delimiter = named.unwrap_or_else(|| Delimiter::sniff(header.into_iter()));
            return;
        }
        let starts = (0..self.ahead.len().min(LINES)).filter(|at| is_text(&self.ahead[*at]));
        let found = starts.map(|at| (at, told(at))).find(|(_, (_, even))| *even);
        let (start, delimiter) =
            found.map_or_else(|| (0, told(0).0), |(start, (delimiter, _))| (start, delimiter));
        self.delimiter = delimiter;
        self.ahead.drain(..start);
        self.line += start as u64;
        self.preamble = start;
    }

    /// Takes the header: the first line, unless it holds values; then perhaps the comment before it.
    fn find_header(&mut self, comment: Option<String>, file: &Arc<str>) -> Result<(), DataError> {
        let Some(line) = self.take_line(file)? else {
            if comment.is_none() && self.described.is_none() {
                return Err(DataError::Empty { file: Arc::clone(file) });
            }
            if let Some(comment) = comment {
                self.delimiter = Delimiter::sniff(std::iter::once(comment.as_str()));
                self.set_header(&comment);
            }
            if self.width < 2 {
                self.header.clear();
            }
            return self.need_names(file);
        };
        let ours = self.described.is_some();
        self.record.split(without_end(&line), self.delimiter);
        self.width = self.record.len();
        if ours || !self.record.iter().any(is_value) {
            self.set_header(&line);
            return self.need_names(file);
        }
        let mut names = Record::default();
        let delimiter = self.delimiter;
        if let Some(comment) = comment.filter(|comment| {
            names.split(comment, delimiter);
            names.len() == self.width && !names.iter().any(is_value)
        }) {
            self.set_header(&comment);
        }
        self.put_back(line);
        Ok(())
    }

    fn set_header(&mut self, line: &str) {
        let mut names = Record::default();
        names.split(without_end(line), self.delimiter);
        self.width = names.len();
        // In our own files every blank belongs to a name.
        let ours = self.described.is_some();
        self.header = names.iter().map(|name| if ours { name } else { name.trim() }.to_owned()).collect();
    }

    fn need_names(&self, file: &Arc<str>) -> Result<(), DataError> {
        if self.header.iter().any(|name| !name.trim().is_empty()) {
            return Ok(());
        }
        Err(DataError::Corrupt {
            place: Place::line(file, self.line.max(1)),
            problem: "there is no header".to_owned(),
            help: "begin the file with the names of its columns",
        })
    }

    /// Gives the columns of a file names, in place of those of its header.
    fn name_columns(&mut self, columns: &[String], file: &Arc<str>) -> Result<(), DataError> {
        if self.width != columns.len() {
            return Err(DataError::Corrupt {
                place: Place::line(file, self.line.max(1)),
                problem: format!("the rows have {} cells; --columns names {}", self.width, columns.len()),
                help: "name every column, those that are not needed by any name",
            });
        }
        self.header = columns.to_vec();
        Ok(())
    }

    /// The names of the columns of a file that must have a header.
    pub fn named(&self, file: &Arc<str>) -> Result<&[String], DataError> {
        if !self.header.is_empty() {
            return Ok(&self.header);
        }
        let usual = ["time", "sensor", "x", "y", "z"];
        let usual = if self.width == 3 { &["time", "x", "y"] } else { &usual[..] };
        let guess: Vec<String> = (1..=self.width)
            .map(|at| usual.get(at - 1).map_or_else(|| format!("other{at}"), |name| (*name).to_owned()))
            .collect();
        let guess = guess.join(",");
        Err(DataError::unsettled(
            Place::line(file, self.line + 1),
            format!("there is no header: the first line has {} values and no names", self.width),
            format!("name the {} columns in their order, such as --columns {guess}", self.width),
        ))
    }

    /// The record that was read last.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// The next record and its line, from 1. After an error of one row the next one can be read.
    pub fn next(&mut self, file: &Arc<str>) -> Result<Option<(&Record, u64)>, DataError> {
        let ours = self.described.is_some();
        loop {
            let Some(line) = self.take_line(file)? else { return Ok(None) };
            if line.trim().is_empty() {
                continue;
            }
            if !ours && line.starts_with('#') {
                self.comments += 1;
                continue;
            }
            let number = self.line;
            self.split(line, number, file)?;
            if !matches!(self.delimiter, Delimiter::Character(b',')) {
                self.record.point_for_comma();
            }
            return Ok(Some((&self.record, number)));
        }
    }

    /// Splits a line, with those after it where a cell goes on there.
    fn split(&mut self, mut line: String, number: u64, file: &Arc<str>) -> Result<(), DataError> {
        let end = without_end(&line).len();
        let ended = end < line.len();
        let split = self.record.split(&line[..end], self.delimiter);
        if split == Split::Whole && self.fits() {
            return Ok(());
        }
        let cells = self.record.len();
        if split == Split::Open && self.join_lines(&line, file)? {
            return Ok(());
        }
        line.truncate(end);
        self.record.split_plainly(&line, self.delimiter);
        if split != Split::Whole && self.fits() {
            self.stray_quotes += 1;
            return Ok(());
        }
        let cells = if split == Split::Whole { cells } else { self.record.len() };
        let cut = !ended && self.ahead.is_empty() && cells < self.width;
        Err(DataError::Row {
            place: Place::line(file, number),
            problem: match cut {
                true => {
                    format!("the last line is cut: it has {cells} of {} cells and no line end", self.width)
                }
                false => format!("the line has {cells} cells; the header has {}", self.width),
            },
            help: match cut {
                true => "the file may be truncated: copy it again, or leave such lines out: --on-error skip",
                false => {
                    "put names that contain the delimiter into quotes, or leave such lines out: --on-error skip"
                }
            },
        })
    }

    /// True when the record has a cell for every column; empty ones beyond are forgotten.
    fn fits(&mut self) -> bool {
        if self.record.len() > self.width
            && self.record.iter().skip(self.width).all(|cell| cell.trim().is_empty())
        {
            self.record.truncate(self.width);
        }
        self.record.len() == self.width
    }

    /// Looks for the end of a quoted cell in the lines that follow; false when they do not make a row.
    fn join_lines(&mut self, line: &str, file: &Arc<str>) -> Result<bool, DataError> {
        /// A cell of more lines than this is a quote that was never closed. Our own files close every quote.
        const LINES: usize = 16;
        let limit = if self.described.is_some() { usize::MAX } else { LINES };
        let mut joined = line.to_owned();
        let mut taken = 0;
        while taken < limit {
            if taken == self.ahead.len() && !self.read_ahead(file)? {
                break;
            }
            joined.push_str(&self.ahead[taken]);
            taken += 1;
            match self.record.split(without_end(&joined), self.delimiter) {
                Split::Open => {}
                Split::Whole if self.fits() => {
                    self.ahead.drain(..taken);
                    self.line += taken as u64;
                    return Ok(true);
                }
                Split::Whole | Split::Stray => break,
            }
        }
        Ok(false)
    }

    /// The next line with its end.
    fn take_line(&mut self, file: &Arc<str>) -> Result<Option<String>, DataError> {
        if self.ahead.is_empty() {
            self.read_ahead(file)?;
        }
        let line = self.ahead.pop_front();
        self.line += u64::from(line.is_some());
        Ok(line)
    }

    fn put_back(&mut self, line: String) {
        self.ahead.push_front(line);
        self.line -= 1;
    }

    /// Reads one more line; false at the end of the file.
    fn read_ahead(&mut self, file: &Arc<str>) -> Result<bool, DataError> {
        let mut line = Vec::new();
        self.text.reader.read_until(self.end, &mut line).map_err(|error| read_error(file, error))?;
        // The text was made UTF-8 already.
        let line = String::from_utf8(line).unwrap_or_default();
        let some = !line.is_empty();
        if some {
            self.ahead.push_back(line);
        }
        Ok(some)
    }

    /// What is worth saying about the text, once all is read.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.text.note().into_iter().collect();
        if self.preamble > 0 {
            notes.push(format!("{} lines before the header were passed over", self.preamble));
        }
        if self.stray_quotes > 0 {
            notes.push(format!(
                "{} rows have a quote that is never closed; it was read as a letter",
                self.stray_quotes
            ));
        }
        if self.comments > 0 {
            notes.push(format!("{} comment lines among the rows were passed over", self.comments));
        }
        notes
    }
}

fn without_end(line: &str) -> &str {
    line.trim_end_matches(['\r', '\n'])
}

fn is_comment(line: &str) -> bool {
    line.starts_with(['#', '%'])
}
