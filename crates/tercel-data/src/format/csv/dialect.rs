//! How a text table separates its cells, told from its first lines.

use super::record::{Record, is_comma_number};

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Delimiter {
    /// One ASCII character.
    Character(u8),
    /// Any number of blanks.
    Blanks,
}

impl Delimiter {
    pub fn is(self, c: char) -> bool {
        match self {
            Delimiter::Character(delimiter) => c == char::from(delimiter),
            Delimiter::Blanks => c == ' ' || c == '\t',
        }
    }

    /// A line without what is around its cells.
    pub fn trim(self, line: &str) -> &str {
        if self == Delimiter::Blanks { line.trim() } else { line }
    }

    /// What follows the delimiter with which `rest` begins; nothing at the end of the line.
    pub fn after(self, rest: &str) -> Option<&str> {
        match self {
            Delimiter::Character(_) => rest.get(1..),
            Delimiter::Blanks => Some(rest.trim_start()).filter(|rest| !rest.is_empty()),
        }
    }

    /// The delimiter that a line such as `sep=;` names.
    pub fn named(line: &str) -> Option<Self> {
        let name = line.trim_end_matches(['\r', '\n']);
        let name = name
            .strip_prefix("sep=")
            .or_else(|| name.strip_prefix("\"sep=").and_then(|name| name.strip_suffix('"')))?;
        match name.as_bytes() {
            [b' '] => Some(Delimiter::Blanks),
            [byte] if byte.is_ascii_punctuation() || *byte == b'\t' => Some(Delimiter::Character(*byte)),
            _ => None,
        }
    }

    /// The delimiter that splits these lines, of which the first may be the header, most evenly.
    ///
    /// A header shows the delimiter best: names of columns have no commas and semicolons. Without one, `1,5;2,5` is split
    /// evenly by commas, too; then commas that make numbers are decimal ones.
    pub fn sniff<'l>(lines: impl Iterator<Item = &'l str> + Clone) -> Self {
        const CANDIDATES: [u8; 4] = [b'\t', b';', b'|', b','];
        let mut best = (Delimiter::Blanks, (0, 0));
        let mut record = Record::default();
        for candidate in CANDIDATES.map(Delimiter::Character) {
            let mut counts = lines.clone().map(|line| {
                record.split(line, candidate);
                record.len()
            });
            let Some(first) = counts.next().filter(|first| *first > 1) else { continue };
            let same = counts.filter(|count| *count == first).count();
            if (same, first) > best.1 && !(best.1.0 == same && decimal_commas(best.0, lines.clone())) {
                best = (candidate, (same, first));
            }
        }
        best.0
    }
}

/// True when cells between these delimiters are numbers with a decimal comma.
fn decimal_commas<'l>(delimiter: Delimiter, lines: impl Iterator<Item = &'l str>) -> bool {
    let mut record = Record::default();
    let mut any = false;
    for line in lines {
        record.split(line, delimiter);
        any |= record.iter().any(is_comma_number);
    }
    any && delimiter != Delimiter::Blanks
}

/// True for text that no column is called: a number, a date, a time of day.
pub(super) fn is_value(cell: &str) -> bool {
    let cell = cell.trim();
    let starts = cell.trim_start_matches(['-', '+', '.']).starts_with(|c: char| c.is_ascii_digit());
    let number = cell.parse::<f64>().is_ok() || is_comma_number(cell);
    let date = cell.len() >= 5
        && cell.contains([':', '-', '/', '.'])
        && cell.bytes().all(|byte| byte.is_ascii_digit() || b":-/. TZ+".contains(&byte));
    starts && (number || date)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_delimiter_is_told_from_the_first_lines() {
        let sniff = |text: &str| Delimiter::sniff(text.lines());
        assert_eq!(sniff("time,x,y\n0,1,2\n"), Delimiter::Character(b','));
        assert_eq!(sniff("time;x;y\n0,5;1,5;2,5\n"), Delimiter::Character(b';'));
        assert_eq!(sniff("0,5;1,5;2,5\n1,5;1,5;2,5\n"), Delimiter::Character(b';'));
        assert_eq!(sniff("time\tx\ty\n0,5\t1,5\t2,5\n"), Delimiter::Character(b'\t'));
        assert_eq!(sniff("time|sensor|x\n0|a|1\n"), Delimiter::Character(b'|'));
        assert_eq!(sniff("time  x   y\n0.0   1   2\n"), Delimiter::Blanks);
        assert_eq!(sniff("time,note,x\n0,a;b;c,1\n1,a;b;c,1\n"), Delimiter::Character(b','));
        assert_eq!(sniff("date time,x\n2024-03-05 10:00:00,1\n"), Delimiter::Character(b','));
    }

    #[test]
    fn a_line_may_name_the_delimiter() {
        assert_eq!(Delimiter::named("sep=;\r\n"), Some(Delimiter::Character(b';')));
        assert_eq!(Delimiter::named("sep=\t\n"), Some(Delimiter::Character(b'\t')));
        assert_eq!(Delimiter::named("separator,x\n"), None);
    }

    #[test]
    fn names_of_columns_are_no_values() {
        for value in
            ["0", "-1.5", "1e3", "12,5", "2024-03-05", "10:00:00.5", "2024/03/05", "05/03/2024 10:00"]
        {
            assert!(is_value(value), "{value}");
        }
        for name in ["x", "nan", "inf", "A", "4ca2d6", "radar", "", "e1", "lat [deg]"] {
            assert!(!is_value(name), "{name}");
        }
    }
}
