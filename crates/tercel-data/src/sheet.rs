//! A table as columns of cells: what every file format reads and writes.

use std::sync::Arc;

use crate::column::{Angles, Column, Kind};
use crate::error::{Place, Refusal, Spot};

/// Columns of equal length, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sheet {
    pub columns: Vec<Column>,
    pub values: Vec<Values>,
    /// The line on which each row stood, for text formats.
    pub lines: Vec<u64>,
}

/// The cells of one column.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Values {
    Real(Vec<Option<f64>>),
    Count(Vec<Option<u64>>),
    Text(Vec<Option<Arc<str>>>),
}

impl Values {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Text => Values::Text(Vec::new()),
            Kind::Count => Values::Count(Vec::new()),
            Kind::Time | Kind::Real(_) => Values::Real(Vec::new()),
        }
    }

    pub fn len(&self) -> usize {
        match self {
            Values::Real(cells) => cells.len(),
            Values::Count(cells) => cells.len(),
            Values::Text(cells) => cells.len(),
        }
    }

    fn clear(&mut self) {
        match self {
            Values::Real(cells) => cells.clear(),
            Values::Count(cells) => cells.clear(),
            Values::Text(cells) => cells.clear(),
        }
    }

    pub fn is_null(&self, row: usize) -> bool {
        match self {
            Values::Real(cells) => cells[row].is_none(),
            Values::Count(cells) => cells[row].is_none(),
            Values::Text(cells) => cells[row].is_none(),
        }
    }

    pub fn push_null(&mut self, column: &Column) -> Result<(), Refusal> {
        if column.needed {
            return Err(Refusal::new("empty", column.expected()));
        }
        match self {
            Values::Real(cells) => cells.push(None),
            Values::Count(cells) => cells.push(None),
            Values::Text(cells) => cells.push(None),
        }
        Ok(())
    }

    /// Adds a number that came as one.
    pub fn push_number(&mut self, number: f64, column: &Column, angles: Angles) -> Result<(), Refusal> {
        match self {
            Values::Real(cells) => cells.push(Some(column.real_from(number, angles)?)),
            Values::Count(cells) => cells.push(Some(whole(number, column)?)),
            Values::Text(_) => return Err(Refusal::new(number, column.expected())),
        }
        Ok(())
    }

    /// Adds a whole number that came as one.
    pub fn push_count(&mut self, number: u64, column: &Column, angles: Angles) -> Result<(), Refusal> {
        match self {
            Values::Count(cells) => cells.push(Some(number)),
            _ => return self.push_number(number as f64, column, angles),
        }
        Ok(())
    }

    /// Adds what stands in a text file. An empty text is an empty cell.
    pub fn push_text(&mut self, text: &str, column: &Column, angles: Angles) -> Result<(), Refusal> {
        if text.is_empty() {
            return self.push_null(column);
        }
        match self {
            Values::Real(cells) => {
                let number = match text.trim().parse::<f64>() {
                    Ok(number) => column.real_from(number, angles)?,
                    Err(_) if column.kind == Kind::Time => date(text, column)?,
                    Err(_) => return Err(not_a_number(text, column)),
                };
                cells.push(Some(number));
            }
            Values::Count(cells) => {
                let number = match (text.trim().parse::<u64>(), text.trim().parse::<f64>()) {
                    (Ok(number), _) => number,
                    (_, Ok(number)) => whole(number, column)?,
                    _ => return Err(Refusal::new(format!("`{text}`"), column.expected())),
                };
                cells.push(Some(number));
            }
            Values::Text(cells) => {
                // Sensors and objects repeat from row to row, so most rows share the text of the one before.
                let shared = match cells.last() {
                    Some(Some(last)) if last.as_ref() == text => Arc::clone(last),
                    _ => Arc::from(text),
                };
                cells.push(Some(shared));
            }
        }
        Ok(())
    }
}

/// Whole numbers are often written with a decimal point by programs that know no empty whole number.
fn whole(number: f64, column: &Column) -> Result<u64, Refusal> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if (0.0..=EXACT).contains(&number) && number.fract() == 0.0 {
        return Ok(number as u64);
    }
    Err(Refusal::new(number, column.expected()))
}

/// Seconds since 1970 of an RFC 3339 date and time.
fn date(text: &str, column: &Column) -> Result<f64, Refusal> {
    if let Ok(timestamp) = text.trim().parse::<jiff::Timestamp>() {
        return Ok(unix_seconds(timestamp));
    }
    let refusal = Refusal::new(format!("`{text}`"), column.expected());
    Err(match text.trim().parse::<jiff::civil::DateTime>() {
        Ok(_) => refusal.helped("the date has no offset: add Z if it is in universal time"),
        Err(_) => refusal,
    })
}

/// Seconds since 1970, as near as a double comes.
pub(crate) fn unix_seconds(timestamp: jiff::Timestamp) -> f64 {
    timestamp.as_second() as f64 + f64::from(timestamp.subsec_nanosecond()) * 1e-9
}

fn not_a_number(text: &str, column: &Column) -> Refusal {
    let refusal = Refusal::new(format!("`{text}`"), column.expected());
    if text.contains(',') && text.trim().replace(',', ".").parse::<f64>().is_ok() {
        return refusal.helped("write numbers with a decimal point");
    }
    refusal
}

impl Sheet {
    pub fn new(columns: Vec<Column>) -> Self {
        let values = columns.iter().map(|column| Values::new(column.kind)).collect();
        Sheet { columns, values, lines: Vec::new() }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.first().map_or(0, Values::len)
    }

    /// Empties the cells and keeps the columns, to be filled again.
    pub fn clear(&mut self) {
        self.values.iter_mut().for_each(Values::clear);
        self.lines.clear();
    }

    /// Where a row stands in `file`.
    pub fn place(&self, file: &Arc<str>, row: usize) -> Place {
        let spot = self.lines.get(row).map_or(Spot::Row(row as u64), |line| Spot::Line(*line));
        Place { file: Arc::clone(file), spot }
    }

    pub fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }

    /// The numbers of a column, or nothing in every row when there is no such column.
    pub fn reals(&self, name: &str) -> Cells<'_, f64> {
        match self.position(name).map(|i| &self.values[i]) {
            Some(Values::Real(cells)) => Cells(Some(cells)),
            _ => Cells(None),
        }
    }

    /// The whole numbers of a column, or nothing in every row when there is no such column.
    pub fn counts(&self, name: &str) -> Cells<'_, u64> {
        match self.position(name).map(|i| &self.values[i]) {
            Some(Values::Count(cells)) => Cells(Some(cells)),
            _ => Cells(None),
        }
    }

    /// The names of a column, or nothing in every row when there is no such column.
    pub fn texts(&self, name: &str) -> Cells<'_, Arc<str>> {
        match self.position(name).map(|i| &self.values[i]) {
            Some(Values::Text(cells)) => Cells(Some(cells)),
            _ => Cells(None),
        }
    }

    /// Adds a row to a sheet that is being written, cell by cell in the order of the columns.
    pub fn filler(&mut self) -> Filler<'_> {
        Filler { sheet: self, next: 0 }
    }

    /// The first cell that a reader of the file would refuse: its row, its column, and why.
    pub fn first_refused(&self) -> Option<(usize, &Column, Refusal)> {
        self.columns.iter().zip(&self.values).find_map(|(column, values)| {
            (0..values.len())
                .find_map(|row| refused(column, values, row).map(|refusal| (row, column, refusal)))
        })
    }
}

fn refused(column: &Column, values: &Values, row: usize) -> Option<Refusal> {
    if values.is_null(row) {
        return column.needed.then(|| Refusal::new("empty", column.expected()));
    }
    match values {
        Values::Real(cells) => cells[row].and_then(|number| column.real_from(number, Angles::Radians).err()),
        Values::Count(_) | Values::Text(_) => None,
    }
}

/// A column that may be absent.
#[derive(Debug)]
pub(crate) struct Cells<'a, T>(Option<&'a [Option<T>]>);

// A derived copy would ask the cells themselves to be copies.
impl<T> Clone for Cells<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Cells<'_, T> {}

impl<T: Clone> Cells<'_, T> {
    /// True when the file has the column.
    pub fn present(&self) -> bool {
        self.0.is_some()
    }

    pub fn get(&self, row: usize) -> Option<T> {
        self.0.and_then(|cells| cells.get(row)).cloned().flatten()
    }
}

/// Fills one row of a [`Sheet`].
pub(crate) struct Filler<'a> {
    sheet: &'a mut Sheet,
    next: usize,
}

impl Filler<'_> {
    fn slot(&mut self) -> &mut Values {
        self.next += 1;
        &mut self.sheet.values[self.next - 1]
    }

    pub fn real(&mut self, value: impl Into<Option<f64>>) -> &mut Self {
        let value = value.into();
        if let Values::Real(cells) = self.slot() {
            cells.push(value);
        }
        self
    }

    pub fn reals(&mut self, values: impl IntoIterator<Item = Option<f64>>) -> &mut Self {
        for value in values {
            self.real(value);
        }
        self
    }

    pub fn count(&mut self, value: impl Into<Option<u64>>) -> &mut Self {
        let value = value.into();
        if let Values::Count(cells) = self.slot() {
            cells.push(value);
        }
        self
    }

    /// An empty name is no name.
    pub fn text(&mut self, value: Option<&Arc<str>>) -> &mut Self {
        let value = value.filter(|text| !text.is_empty()).cloned();
        if let Values::Text(cells) = self.slot() {
            cells.push(value);
        }
        self
    }
}
