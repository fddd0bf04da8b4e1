//! Tables of reports by other programs: the same things under many names and in many units, as text, Parquet or JSON.

mod json;
mod names;
mod parquet;
mod text;

use std::borrow::Cow;
use std::sync::Arc;

pub(super) use self::json::Shape;
pub(super) use self::names::{
    DEGREES, FEET, FOOT, KNOT, KNOTS, METRES, METRES_PER_SECOND, Names, PLAIN, plain,
};
use super::input::{Content, Input};
use crate::error::{DataError, Place, Refusal};
use crate::options::ReadOptions;
use crate::unit::{Dimension, Unit};

/// One cell of a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell<'a> {
    Nothing,
    Text(Cow<'a, str>),
    Number(f64),
    /// A point in time of a file that has such a type, Unix seconds.
    Time(f64),
}

/// Rows of cells, whatever holds them.
pub(super) trait Rows {
    /// Names of the columns, as they stand in the file.
    fn names(&self) -> &[String];

    /// Goes on to the next row; false at the end. After an error of one row the next call goes on behind it.
    fn advance(&mut self) -> Result<bool, DataError>;

    /// A cell of the row.
    fn cell(&self, column: usize) -> Cell<'_>;

    /// Where the row stands.
    fn place(&self) -> Place;

    /// What is worth saying about the file, once all is read.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// A column that was found, or not.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    column: Option<usize>,
    /// As it stands in the file.
    pub name: String,
    /// What brings a number of the column to SI, or to degrees.
    pub factor: f64,
    /// The name of the column tells its unit.
    pub unit_named: bool,
}

impl Field {
    const ABSENT: Field = Field { column: None, name: String::new(), factor: 1.0, unit_named: false };

    pub fn present(&self) -> bool {
        self.column.is_some()
    }
}

/// A table, row by row.
pub(super) struct Table {
    rows: Box<dyn Rows>,
    /// Names of the columns as they are compared: those that the user gave, where there are any.
    plain: Vec<String>,
    /// Units that the user gave.
    units: Vec<Option<Unit>>,
    file: Arc<str>,
}

impl Table {
    /// Begins to read a table. Of a file that is read by columns only those under a `wanted` name are.
    pub fn open(input: &Input, wanted: &[&Names], options: &ReadOptions) -> Result<Self, DataError> {
        let rows: Box<dyn Rows> = match input.content()? {
            Content::Parquet => Box::new(parquet::ParquetRows::new(input, wanted)?),
            Content::Json(shape) => Box::new(json::JsonRows::new(input, shape)?),
            _ => Box::new(text::TextRows::new(input, options)?),
        };
        let renamed =
            |name: &String| options.renames.iter().find(|(_, file)| file == name).map(|(known, _)| known);
        let plain = |name: &String| match options.ignore.contains(name) {
            true => String::new(),
            false => names::plain(renamed(name).unwrap_or(name)),
        };
        let unit =
            |name: &String| options.units.iter().find(|(known, _)| known == name).map(|(_, unit)| *unit);
        let (plain, units) = rows.names().iter().map(|name| (plain(name), unit(name))).unzip();
        Ok(Table { rows, plain, units, file: Arc::clone(&input.name) })
    }

    /// The first column that has one of the names.
    pub fn field(&self, names: &Names) -> Field {
        self.fields(names).next().unwrap_or(Field::ABSENT)
    }

    /// All columns that have one of the names, the best name first.
    pub fn fields(&self, names: &Names) -> impl Iterator<Item = Field> {
        names.found_in(&self.plain).map(|found| {
            let unit = self.units[found.column].map(factor);
            Field {
                column: Some(found.column),
                name: self.rows.names()[found.column].clone(),
                factor: unit.unwrap_or(found.factor),
                unit_named: found.unit_named || unit.is_some(),
            }
        })
    }

    /// All columns, as they are.
    pub fn columns(&self) -> impl Iterator<Item = Field> {
        let field =
            |(at, name): (usize, &String)| Field { column: Some(at), name: name.clone(), ..Field::ABSENT };
        self.rows.names().iter().enumerate().map(field)
    }

    /// The column of this name.
    pub fn column(&self, name: &str) -> Field {
        self.columns().find(|field| field.name == name).unwrap_or(Field::ABSENT)
    }

    /// The place of the file as a whole.
    pub fn whole(&self) -> Place {
        Place::whole(&self.file)
    }

    /// The error for columns that must be there and are not.
    pub fn missing(&self, names: &[&Names]) -> DataError {
        let first = names.iter().flat_map(|names| names.usual()).next().unwrap_or_default();
        let missing = names.iter().map(|names| names.usual().join("` or `")).collect();
        DataError::MissingColumns {
            place: self.whole(),
            missing,
            found: self.rows.names().to_vec(),
            help: format!(
                "say which column holds it: --column {first}=NAME, or choose another source: --from"
            ),
        }
    }

    /// Goes on to the next row; false at the end.
    pub fn advance(&mut self) -> Result<bool, DataError> {
        self.rows.advance()
    }

    pub fn notes(&self) -> Vec<String> {
        self.rows.notes()
    }

    /// What a field holds; an empty cell, `null`, `nan` and the like are nothing.
    pub fn cell(&self, field: &Field) -> Cell<'_> {
        let Some(column) = field.column else { return Cell::Nothing };
        match self.rows.cell(column) {
            Cell::Text(Cow::Borrowed(text)) if is_nothing(text.trim()) => Cell::Nothing,
            Cell::Text(Cow::Borrowed(text)) => Cell::Text(Cow::Borrowed(text.trim())),
            Cell::Number(number) if !number.is_finite() => Cell::Nothing,
            cell => cell,
        }
    }

    /// A text; whole numbers are written without a point.
    pub fn text(&self, field: &Field) -> Option<Cow<'_, str>> {
        match self.cell(field) {
            Cell::Nothing => None,
            Cell::Text(text) => Some(text),
            Cell::Number(number) | Cell::Time(number) => Some(Cow::Owned(format!("{number}"))),
        }
    }

    /// A number in SI units, or in degrees.
    pub fn number(&self, field: &Field) -> Result<Option<f64>, DataError> {
        match self.cell(field) {
            Cell::Nothing => Ok(None),
            Cell::Number(number) => Ok(Some(number * field.factor)),
            Cell::Text(text) => match text.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(Some(number * field.factor)),
                _ => Err(self.refuse(field, Refusal::new(format!("`{text}`"), "a number"))),
            },
            Cell::Time(time) => Err(self.refuse(field, Refusal::new(format!("the time {time}"), "a number"))),
        }
    }

    /// A number that is nothing where it cannot be read: of what the table can do without.
    pub fn number_if_any(&self, field: &Field) -> Option<f64> {
        self.number(field).ok().flatten()
    }

    /// A latitude in radians; nothing when the file says that it is not available.
    pub fn latitude(&self, field: &Field) -> Result<Option<f64>, DataError> {
        self.latitude_of(field, self.number(field)?)
    }

    /// A longitude in radians in [-π, π]; nothing when the file says that it is not available. Some files count to 360°.
    pub fn longitude(&self, field: &Field) -> Result<Option<f64>, DataError> {
        self.longitude_of(field, self.number(field)?)
    }

    /// Latitude and longitude of a text such as `47.45,8.55`, in radians.
    pub fn position(&self, field: &Field) -> Result<Option<(f64, f64)>, DataError> {
        let Some(text) = self.text(field) else { return Ok(None) };
        let degrees = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        let both = text.trim_matches(['(', ')', '[', ']']).split_once([',', ' ', ';']);
        let Some((latitude, longitude)) = both.and_then(|(a, b)| degrees(a).zip(degrees(b))) else {
            let refusal = Refusal::new(format!("`{text}`"), "latitude and longitude, such as 47.45,8.55");
            return Err(self.refuse(field, refusal));
        };
        Ok(self.latitude_of(field, Some(latitude))?.zip(self.longitude_of(field, Some(longitude))?))
    }

    fn latitude_of(&self, field: &Field, degrees: Option<f64>) -> Result<Option<f64>, DataError> {
        match degrees {
            Some(91.0) => Ok(None),
            Some(value) if value.abs() > 90.0 => {
                Err(self.refuse(field, Refusal::new(value, "degrees in [-90, 90]").helped(SKIP)))
            }
            value => Ok(value.map(f64::to_radians)),
        }
    }

    fn longitude_of(&self, field: &Field, degrees: Option<f64>) -> Result<Option<f64>, DataError> {
        match degrees {
            Some(181.0) => Ok(None),
            Some(value) if !(-180.0..=360.0).contains(&value) => {
                Err(self.refuse(field, Refusal::new(value, "degrees in [-180, 180]").helped(SKIP)))
            }
            Some(value) if value > 180.0 => Ok(Some((value - 360.0).to_radians())),
            value => Ok(value.map(f64::to_radians)),
        }
    }

    /// The error for a field that is not what it should be.
    pub fn refuse(&self, field: &Field, refusal: Refusal) -> DataError {
        let help = refusal.help.clone().unwrap_or_else(|| SKIP.to_owned());
        refusal.helped(help).at(self.rows.place(), &field.name)
    }
}

/// What brings a unit to SI, or to degrees.
fn factor(unit: Unit) -> f64 {
    if unit.dimension() == Dimension::Angle { unit.factor().to_degrees() } else { unit.factor() }
}

/// The way out for a file of which few rows are bad.
pub(super) const SKIP: &str = "correct the row, or leave such rows out: --on-error skip";

fn is_nothing(text: &str) -> bool {
    // Most cells are numbers; none of the words begins like one.
    match text.as_bytes() {
        [] => true,
        [b'n' | b'N' | b'-' | b'\\' | b'<', ..] => {
            ["nan", "null", "none", "na", "n/a", "nat", "-", "--", "\\n", "<na>", "nil"]
                .iter()
                .any(|word| text.eq_ignore_ascii_case(word))
        }
        _ => false,
    }
}
