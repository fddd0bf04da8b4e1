//! One row of a text table, cell by cell.

use super::dialect::Delimiter;

/// The cells of a row, without the quotes around them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Record {
    text: String,
    ends: Vec<usize>,
}

/// How the cells of a line came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Split {
    /// Every quote that was opened is closed before a delimiter or the end of the line.
    Whole,
    /// The line ends within quotes.
    Open,
    /// Text follows a closing quote, so that the quote is none.
    Stray,
}

impl Record {
    /// Number of cells.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// The text of a cell.
    pub fn get(&self, at: usize) -> Option<&str> {
        let end = *self.ends.get(at)?;
        let start = at.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.text.get(start..end)
    }

    pub fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.len()).filter_map(|at| self.get(at))
    }

    fn clear(&mut self) {
        self.text.clear();
        self.ends.clear();
    }

    fn end_cell(&mut self) {
        self.ends.push(self.text.len());
    }

    /// Forgets cells from `len` on.
    pub(super) fn truncate(&mut self, len: usize) {
        self.ends.truncate(len);
        self.text.truncate(self.ends.last().copied().unwrap_or(0));
    }

    /// Splits a line at every delimiter; quotes are text like any other.
    pub(super) fn split_plainly(&mut self, line: &str, delimiter: Delimiter) {
        self.clear();
        match delimiter {
            Delimiter::Character(delimiter) => {
                // Cells are short: looking at each byte is quicker than searching for the next delimiter.
                let mut start = 0;
                for (at, byte) in line.bytes().enumerate() {
                    if byte == delimiter {
                        self.text.push_str(&line[start..at]);
                        self.end_cell();
                        start = at + 1;
                    }
                }
                self.text.push_str(&line[start..]);
                self.end_cell();
            }
            Delimiter::Blanks => {
                for cell in line.split_ascii_whitespace() {
                    self.text.push_str(cell);
                    self.end_cell();
                }
            }
        }
    }

    /// Splits a line whose cells may stand in quotes.
    pub(super) fn split(&mut self, line: &str, delimiter: Delimiter) -> Split {
        if !line.contains('"') {
            self.split_plainly(line, delimiter);
            return Split::Whole;
        }
        self.clear();
        let mut rest = delimiter.trim(line);
        loop {
            let after = match rest.trim_start_matches(' ').strip_prefix('"') {
                Some(quoted) => match self.take_quoted(quoted, delimiter) {
                    Ok(after) => after,
                    Err(split) => return split,
                },
                None => self.take_plain(rest, delimiter),
            };
            match after {
                Some(after) => rest = after,
                None => return Split::Whole,
            }
        }
    }

    /// Takes a cell without quotes; the rest of the line after its delimiter, if there is one.
    fn take_plain<'l>(&mut self, rest: &'l str, delimiter: Delimiter) -> Option<&'l str> {
        let end = rest.find(|c| delimiter.is(c)).unwrap_or(rest.len());
        self.text.push_str(&rest[..end]);
        self.end_cell();
        delimiter.after(&rest[end..])
    }

    /// Takes a cell after its opening quote.
    fn take_quoted<'l>(&mut self, mut rest: &'l str, delimiter: Delimiter) -> Result<Option<&'l str>, Split> {
        loop {
            let Some(quote) = rest.find('"') else { return Err(Split::Open) };
            self.text.push_str(&rest[..quote]);
            rest = &rest[quote + 1..];
            if let Some(after) = rest.strip_prefix('"') {
                self.text.push('"');
                rest = after;
                continue;
            }
            let blanks = rest.trim_start_matches(' ');
            if !blanks.is_empty()
                && !blanks.starts_with(|c| delimiter.is(c))
                && delimiter != Delimiter::Blanks
            {
                return Err(Split::Stray);
            }
            self.end_cell();
            return Ok(delimiter.after(if delimiter == Delimiter::Blanks { rest } else { blanks }));
        }
    }

    /// Writes numbers with a decimal comma with a point; false when a number has both.
    pub(super) fn point_for_comma(&mut self) {
        let mut start = 0;
        for end in &self.ends {
            if is_comma_number(&self.text[start..*end]) {
                let at = self.text[start..*end].find(',').unwrap_or(0) + start;
                self.text.replace_range(at..=at, ".");
            }
            start = *end;
        }
    }
}

/// True for `-1,5` and `2,5e-3`.
pub(super) fn is_comma_number(cell: &str) -> bool {
    let cell = cell.trim();
    let Some((whole, fraction)) = cell.split_once(',') else { return false };
    let digits = whole.trim_start_matches(['-', '+']);
    let (fraction, exponent) = fraction.split_once(['e', 'E']).unwrap_or((fraction, "0"));
    digits.bytes().all(|byte| byte.is_ascii_digit())
        && !fraction.is_empty()
        && fraction.bytes().all(|byte| byte.is_ascii_digit())
        && exponent.parse::<i32>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMMA: Delimiter = Delimiter::Character(b',');

    fn split(line: &str, delimiter: Delimiter) -> (Split, Vec<String>) {
        let mut record = Record::default();
        let split = record.split(line, delimiter);
        (split, record.iter().map(str::to_owned).collect())
    }

    #[test]
    fn quotes_hold_cells_together() {
        let (whole, cells) = split(r#"1,"a, ""b""", "c" ,d"e,"#, COMMA);
        assert_eq!(whole, Split::Whole);
        assert_eq!(cells, ["1", "a, \"b\"", "c", "d\"e", ""]);
        assert_eq!(split("\"a b\"  2   3", Delimiter::Blanks).1, ["a b", "2", "3"]);
    }

    #[test]
    fn quotes_that_do_not_close_are_told() {
        assert_eq!(split("1,\"NAME,2", COMMA).0, Split::Open);
        assert_eq!(split("1,\"NAME\"X,2", COMMA).0, Split::Stray);
    }

    #[test]
    fn decimal_commas_become_points_in_numbers_only() {
        let mut record = Record::default();
        record.split_plainly("-1,5;a,b;2,5e3;1,2,3;12", Delimiter::Character(b';'));
        record.point_for_comma();
        assert_eq!(record.iter().collect::<Vec<_>>(), ["-1.5", "a,b", "2.5e3", "1,2,3", "12"]);
    }
}
