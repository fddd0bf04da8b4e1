//! A table as columns of cells: what every file format reads and writes.

use std::sync::Arc;

use crate::column::{Column, Conversion, Kind};
use crate::error::{DataError, Place, Refusal, Spot};
use crate::remarks::Remarks;
use crate::time::{Clock, Moment};

/// Columns of equal length, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sheet {
    pub columns: Vec<Column>,
    pub values: Vec<Values>,
    /// Where each row stood in the file.
    pub spots: Vec<Spot>,
}

/// The cells of one column.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Values {
    Real(Vec<Option<f64>>),
    Count(Vec<Option<u64>>),
    Text(Vec<Option<Arc<str>>>),
    /// Times whose unit and zone are not settled yet.
    Time(Vec<Option<Moment>>),
}

impl Values {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Text => Values::Text(Vec::new()),
            Kind::Count => Values::Count(Vec::new()),
            Kind::Time => Values::Time(Vec::new()),
            Kind::Real(_) => Values::Real(Vec::new()),
        }
    }

    pub fn len(&self) -> usize {
        match self {
            Values::Real(cells) => cells.len(),
            Values::Count(cells) => cells.len(),
            Values::Text(cells) => cells.len(),
            Values::Time(cells) => cells.len(),
        }
    }

    fn clear(&mut self) {
        match self {
            Values::Real(cells) => cells.clear(),
            Values::Count(cells) => cells.clear(),
            Values::Text(cells) => cells.clear(),
            Values::Time(cells) => cells.clear(),
        }
    }

    fn truncate(&mut self, len: usize) {
        match self {
            Values::Real(cells) => cells.truncate(len),
            Values::Count(cells) => cells.truncate(len),
            Values::Text(cells) => cells.truncate(len),
            Values::Time(cells) => cells.truncate(len),
        }
    }

    /// Keeps the cells of the rows that are wanted.
    fn retain(&mut self, wanted: &[bool]) {
        fn kept<T>(cells: &mut Vec<T>, wanted: &[bool]) {
            let mut wanted = wanted.iter();
            cells.retain(|_| wanted.next().copied().unwrap_or(true));
        }
        match self {
            Values::Real(cells) => kept(cells, wanted),
            Values::Count(cells) => kept(cells, wanted),
            Values::Text(cells) => kept(cells, wanted),
            Values::Time(cells) => kept(cells, wanted),
        }
    }

    pub fn is_null(&self, row: usize) -> bool {
        match self {
            Values::Real(cells) => cells[row].is_none(),
            Values::Count(cells) => cells[row].is_none(),
            Values::Text(cells) => cells[row].is_none(),
            Values::Time(cells) => cells[row].is_none(),
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
            Values::Time(cells) => cells.push(None),
        }
        Ok(())
    }

    /// Adds a number that came as one.
    pub fn push_number(
        &mut self,
        number: f64,
        column: &Column,
        conversion: Conversion,
    ) -> Result<(), Refusal> {
        // Programs that know no empty number write "not a number".
        if number.is_nan() && conversion.foreign {
            return self.push_null(column);
        }
        match self {
            Values::Real(cells) => cells.push(Some(column.real_from(number, conversion)?)),
            Values::Count(cells) => cells.push(Some(whole(number, column)?)),
            Values::Time(cells) => cells.push(Some(Moment::Number(number))),
            Values::Text(_) => return self.push_name(&number.to_string()),
        }
        Ok(())
    }

    /// Adds a whole number that came as one.
    pub fn push_count(
        &mut self,
        number: u64,
        column: &Column,
        conversion: Conversion,
    ) -> Result<(), Refusal> {
        match self {
            Values::Count(cells) => cells.push(Some(number)),
            Values::Text(_) => return self.push_name(&number.to_string()),
            _ => return self.push_number(number as f64, column, conversion),
        }
        Ok(())
    }

    /// Adds a time that came as one.
    pub fn push_moment(&mut self, moment: Moment, column: &Column) -> Result<(), Refusal> {
        match self {
            Values::Time(cells) => cells.push(Some(moment)),
            _ => return Err(Refusal::new("a time", column.expected())),
        }
        Ok(())
    }

    /// Adds what stands in a text file. An empty text is an empty cell; so is `nan` or `null` in files of others.
    pub fn push_text(&mut self, text: &str, column: &Column, conversion: Conversion) -> Result<(), Refusal> {
        if text.is_empty() || (conversion.foreign && is_nothing(text)) {
            return self.push_null(column);
        }
        match self {
            Values::Real(cells) => {
                let number = text.trim().parse::<f64>().map_err(|_| not_a_number(text, column))?;
                cells.push(Some(column.real_from(number, conversion)?));
            }
            Values::Count(cells) => {
                let number = match (text.trim().parse::<u64>(), text.trim().parse::<f64>()) {
                    (Ok(number), _) => number,
                    (_, Ok(number)) => whole(number, column)?,
                    _ => return Err(Refusal::new(format!("`{text}`"), column.expected())),
                };
                cells.push(Some(number));
            }
            Values::Time(cells) => match Moment::parse(text) {
                Some(moment) => cells.push(Some(moment)),
                None => return Err(Refusal::new(format!("`{text}`"), column.expected())),
            },
            Values::Text(_) => return self.push_name(text),
        }
        Ok(())
    }

    fn push_name(&mut self, name: &str) -> Result<(), Refusal> {
        if let Values::Text(cells) = self {
            // Sensors and objects repeat from row to row, so most rows share the text of the one before.
            let shared = match cells.last() {
                Some(Some(last)) if last.as_ref() == name => Arc::clone(last),
                _ => Arc::from(name),
            };
            cells.push(Some(shared));
        }
        Ok(())
    }
}

/// True for the words by which programs say that there is nothing.
fn is_nothing(text: &str) -> bool {
    let text = text.trim();
    text.len() <= 4
        && !text.starts_with(|c: char| c.is_ascii_digit())
        && ["", "nan", "null", "none", "na", "n/a", "#n/a", "-", "--"]
            .iter()
            .any(|word| text.eq_ignore_ascii_case(word))
}

/// Whole numbers are often written with a decimal point by programs that know no empty whole number.
fn whole(number: f64, column: &Column) -> Result<u64, Refusal> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if (0.0..=EXACT).contains(&number) && number.fract() == 0.0 {
        return Ok(number as u64);
    }
    Err(Refusal::new(number, column.expected()))
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
        Sheet { columns, values, spots: Vec::new() }
    }

    /// A sheet that is filled from a table, whose times are seconds.
    pub fn settled(columns: Vec<Column>) -> Self {
        let mut sheet = Sheet::new(columns);
        for values in &mut sheet.values {
            if let Values::Time(_) = values {
                *values = Values::Real(Vec::new());
            }
        }
        sheet
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.first().map_or(0, Values::len)
    }

    /// Empties the cells and keeps the columns, to be filled again.
    pub fn clear(&mut self) {
        self.values.iter_mut().for_each(Values::clear);
        self.spots.clear();
    }

    /// Forgets the rows from `len` on, the last of which may be incomplete.
    pub fn truncate(&mut self, len: usize) {
        self.values.iter_mut().for_each(|values| values.truncate(len));
        self.spots.truncate(len);
    }

    /// Turns times as the file has them into seconds. Rows whose time is none are refused.
    pub fn settle_times(
        &mut self,
        clock: &mut Clock,
        file: &Arc<str>,
        remarks: &mut Remarks,
    ) -> Result<(), DataError> {
        let Some(at) = self.columns.iter().position(|column| column.kind == Kind::Time) else {
            return Ok(());
        };
        let Values::Time(moments) = std::mem::replace(&mut self.values[at], Values::Real(Vec::new())) else {
            return Ok(());
        };
        let names = ["sensor", "object"].into_iter().find_map(|name| self.position(name));
        let mut wanted = vec![true; moments.len()];
        let mut seconds = Vec::with_capacity(moments.len());
        for (row, moment) in moments.into_iter().enumerate() {
            let name = names.and_then(|at| match &self.values[at] {
                Values::Text(cells) => cells[row].as_ref(),
                _ => None,
            });
            seconds.push(match moment.map(|moment| clock.seconds(moment, name)).transpose() {
                Ok(time) => time,
                Err(refusal) => {
                    remarks.refuse(refusal.at(self.place(file, row), &self.columns[at].name))?;
                    wanted[row] = false;
                    None
                }
            });
        }
        self.values[at] = Values::Real(seconds);
        if wanted.contains(&false) {
            self.values.iter_mut().for_each(|values| values.retain(&wanted));
            let mut wanted = wanted.iter();
            self.spots.retain(|_| wanted.next().copied().unwrap_or(true));
        }
        Ok(())
    }

    /// The times of the file, before they are settled.
    pub fn times(&self) -> &[Option<Moment>] {
        let times = self.values.iter().find_map(|values| match values {
            Values::Time(cells) => Some(cells.as_slice()),
            _ => None,
        });
        times.unwrap_or_default()
    }

    /// Where a row stands in `file`.
    pub fn place(&self, file: &Arc<str>, row: usize) -> Place {
        let spot = self.spots.get(row).copied().unwrap_or(Spot::Row(row as u64));
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
        Values::Real(cells) => cells[row].and_then(|number| column.check(number).err()),
        Values::Count(_) | Values::Text(_) | Values::Time(_) => None,
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
