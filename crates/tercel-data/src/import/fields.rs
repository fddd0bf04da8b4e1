//! CSV files of other programs: the same things under many names and in many units.

use std::io::BufRead;
use std::sync::Arc;

use jiff::civil::DateTime;
use jiff::tz::TimeZone;

use crate::error::{DataError, Place, Refusal};
use crate::format::csv::{Record, Rows};
use crate::sheet::unix_seconds;

/// Metres in a foot.
pub(super) const FOOT: f64 = 0.3048;
/// Metres per second in a knot.
pub(super) const KNOT: f64 = 1852.0 / 3600.0;

/// Names under which a column goes, with the factor that brings it to SI; the first one that is there counts.
pub(super) type Names = &'static [(&'static str, f64)];

/// A column that was found, or not.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    column: Option<(usize, String)>,
    factor: f64,
}

/// Names of columns are compared in lower case, without `#`, and with `_` for blanks.
fn plain(name: &str) -> String {
    name.trim_start_matches('#').trim().to_lowercase().replace([' ', '-'], "_")
}

/// Reads the rows of a file of reports, line by line.
pub(super) struct Reports<'a> {
    rows: Rows<'a>,
    plain: Vec<String>,
    file: &'a Arc<str>,
}

impl<'a> Reports<'a> {
    pub fn new(reader: &'a mut dyn BufRead, file: &'a Arc<str>) -> Result<Self, DataError> {
        let rows = Rows::new(reader, file, None)?;
        let plain = rows.named(file)?.iter().map(|name| plain(name)).collect();
        Ok(Reports { rows, plain, file })
    }

    /// What is worth saying about the text, once all is read.
    pub fn notes(&self) -> Vec<String> {
        self.rows.notes()
    }

    /// Finds a column by its names.
    pub fn field(&self, names: Names) -> Field {
        let found = names.iter().find_map(|(name, factor)| {
            self.plain.iter().position(|plain| plain == name).map(|at| (at, factor))
        });
        match found {
            Some((at, factor)) => Field { column: Some((at, self.rows.header[at].clone())), factor: *factor },
            None => Field { column: None, factor: 1.0 },
        }
    }

    /// Finds columns that must be there.
    pub fn needed<const N: usize>(&self, names: [Names; N]) -> Result<[Field; N], DataError> {
        let fields = names.map(|names| self.field(names));
        let missing: Vec<String> = fields
            .iter()
            .zip(names)
            .filter(|(field, _)| !field.present())
            .map(|(_, names)| names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join("` or `"))
            .collect();
        if missing.is_empty() {
            return Ok(fields);
        }
        Err(DataError::MissingColumns {
            place: Place::whole(self.file),
            missing,
            found: self.rows.header.clone(),
            help: "rename the column that holds it, or choose another source: --from".to_owned(),
        })
    }

    /// The next report.
    pub fn next(&mut self) -> Result<Option<Report<'_>>, DataError> {
        let next = self.rows.next(self.file)?;
        Ok(next.map(|(record, line)| Report { record, line, file: self.file }))
    }
}

/// One line of a file of reports.
pub(super) struct Report<'a> {
    record: &'a Record,
    line: u64,
    file: &'a Arc<str>,
}

impl Report<'_> {
    /// What a field holds; an empty cell, `null`, `nan` and the like are nothing.
    pub fn text(&self, field: &Field) -> Option<String> {
        let (at, _) = field.column.as_ref()?;
        let text = self.record.get(*at)?.trim();
        let nothing =
            ["", "nan", "null", "none", "na", "n/a"].iter().any(|word| text.eq_ignore_ascii_case(word));
        (!nothing).then(|| text.to_owned())
    }

    /// A number in SI units.
    pub fn number(&self, field: &Field) -> Result<Option<f64>, DataError> {
        let Some(text) = self.text(field) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number * field.factor)),
            _ => Err(self.refuse(field, Refusal::new(format!("`{text}`"), "a number"))),
        }
    }

    /// A time in Unix seconds, from a number or a date, which is in universal time unless it says otherwise.
    pub fn time(&self, field: &Field) -> Result<Option<f64>, DataError> {
        let Some(text) = self.text(field) else { return Ok(None) };
        let Some(time) = text.parse().ok().or_else(|| date(&text)) else {
            let refusal =
                Refusal::new(format!("`{text}`"), "seconds, or a date and time such as 2016-01-12T13:02:11Z");
            return Err(self.refuse(field, refusal));
        };
        // The year 5138 in seconds, 1973 in milliseconds.
        if !(-1e11..1e11).contains(&time) {
            let refusal =
                Refusal::new(text, "seconds").helped("the times look like milliseconds: divide by 1000");
            return Err(self.refuse(field, refusal));
        }
        Ok(Some(time))
    }

    /// The error for a field that is not what it should be.
    pub fn refuse(&self, field: &Field, refusal: Refusal) -> DataError {
        let column = field.column.as_ref().map_or("", |(_, name)| name);
        refusal.at(Place::line(self.file, self.line), column)
    }
}

impl Field {
    pub fn present(&self) -> bool {
        self.column.is_some()
    }
}

/// Seconds since 1970 of a date with or without offset; of the Danish form, too, which begins with the day.
fn date(text: &str) -> Option<f64> {
    if let Ok(timestamp) = text.parse::<jiff::Timestamp>() {
        return Some(unix_seconds(timestamp));
    }
    let civil = text.parse::<DateTime>().ok().or_else(|| day_first(text))?;
    let timestamp = civil.to_zoned(TimeZone::UTC).ok()?.timestamp();
    Some(unix_seconds(timestamp))
}

/// `31/12/2019 23:59:58`.
fn day_first(text: &str) -> Option<DateTime> {
    let (date, time) = text.split_once(' ')?;
    let mut parts = date.split('/');
    let (day, month, year) = (parts.next()?, parts.next()?, parts.next()?);
    format!("{year}-{month}-{day}T{time}").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_without_an_offset_are_in_universal_time() {
        assert_eq!(date("1970-01-02 00:00:00.25"), Some(86400.25));
        assert_eq!(date("1970-01-02T00:00:00"), Some(86400.0));
        assert_eq!(date("02/01/1970 00:00:01"), Some(86401.0));
        assert_eq!(date("1970-01-02T01:00:00+01:00"), Some(86400.0));
        assert_eq!(date("yesterday"), None);
        assert_eq!(date("32/01/1970 00:00:01"), None);
    }

    #[test]
    fn names_are_compared_without_decoration() {
        assert_eq!(plain("# Timestamp"), "timestamp");
        assert_eq!(plain("Latitude degrees"), "latitude_degrees");
    }
}
