//! How files are read.

use std::sync::Arc;

use crate::column::{Angles, Column};
use crate::table::Origin;
use crate::unit::Unit;

/// How a table is read that may come from elsewhere.
///
/// ```
/// use tercel_data::{Angles, Bearings, ReadOptions};
///
/// let radar = ReadOptions {
///     angles: Angles::Degrees,
///     bearings: Some(Bearings::Compass),
///     ..ReadOptions::default()
/// };
/// # let _ = radar;
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// The unit of angles in the file.
    pub angles: Angles,
    /// From where and which way round bearings run; without it, the name of the column tells.
    pub bearings: Option<Bearings>,
    /// Units of columns, by the name of the column in the table or in the file, or by `length`, `speed`, `angle`.
    pub units: Vec<(String, Unit)>,
    /// Name of the sensor where the file does not name one.
    pub sensor: Option<Arc<str>>,
    /// Names of the columns of a CSV file without header, in their order.
    pub columns: Option<Vec<String>>,
    /// Columns by other names: the name in the table, and that in the file.
    pub renames: Vec<(String, String)>,
    /// Columns of the file that are not looked at.
    pub ignore: Vec<String>,
    /// Key of the list of detections in lines of JSON, where it is not one of the usual ones.
    pub list: Option<String>,
    /// The unit of times; without it, the numbers tell.
    pub time_unit: Option<Unit>,
    /// The zone of dates without one: `UTC`, `+02:00`, `Europe/Oslo`. Without it, UTC.
    pub time_zone: Option<String>,
    /// What stands first in dates such as `05/03/2024`; without it, the column must tell.
    pub date_order: Option<DateOrder>,
    /// What becomes of rows that cannot be used.
    pub on_error: OnError,
    /// Whether rows that repeat another row of their scan are left out.
    pub drop_repeated: bool,
    /// Origin of the local frame for positions in latitude and longitude; without one, their median.
    pub origin: Option<Origin>,
}

/// From where and which way round bearings run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bearings {
    /// From east (`x`) towards north (`y`).
    Math,
    /// Clockwise from north.
    Compass,
}

/// What stands first in a date such as `05/03/2024`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DateOrder {
    /// 5 March.
    DayFirst,
    /// 3 May.
    MonthFirst,
}

/// What becomes of a row that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OnError {
    /// The file is refused, with the line.
    #[default]
    Fail,
    /// The row is left out and counted.
    Skip,
}

impl ReadOptions {
    /// The columns that a file must have under these options: a sensor that is not named has a name all the same.
    pub(crate) fn relaxed(&self, mut columns: Vec<Column>) -> Vec<Column> {
        columns.iter_mut().filter(|column| column.name == "sensor").for_each(|column| column.needed = false);
        columns
    }
}
