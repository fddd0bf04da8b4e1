//! How files are read.

use std::sync::Arc;

use crate::column::{Angles, Column};

/// How a table is read that may come from elsewhere.
///
/// ```
/// use tercel_data::{Angles, ReadOptions};
///
/// let degrees = ReadOptions { angles: Angles::Degrees, ..ReadOptions::default() };
/// # let _ = degrees;
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// The unit of angles in the file.
    pub angles: Angles,
    /// Name of the sensor where the file does not name one.
    pub sensor: Option<Arc<str>>,
    /// Names of the columns of a CSV file without header, in their order.
    pub columns: Option<Vec<String>>,
    /// What becomes of a row that cannot be used.
    pub on_error: OnError,
}

/// What becomes of a row that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OnError {
    /// The file is refused.
    #[default]
    Fail,
    /// The row is left out and counted.
    Skip,
}

impl ReadOptions {
    /// The columns that a file must have under these options.
    pub(crate) fn relaxed(&self, mut columns: Vec<Column>) -> Vec<Column> {
        if self.sensor.is_some() {
            columns
                .iter_mut()
                .filter(|column| column.name == "sensor")
                .for_each(|column| column.needed = false);
        }
        columns
    }
}
