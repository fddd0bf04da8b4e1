//! How each table lies in columns: the one description from which every format is read and written.

mod detections;
mod header;
mod metrics;
mod rows;
mod scans;
mod tracks;
mod truths;

use std::sync::Arc;

use crate::column::Column;
use crate::error::{DataError, Place};
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::{Cells, Sheet};

pub(crate) use detections::detection_columns;
pub(crate) use header::{check_names, missing_columns, near_miss};
pub(crate) use rows::{DetectionRow, Rows};
pub(crate) use tracks::{fill_tracks, track_columns};

/// A table that can lie in columns.
pub(crate) trait Layout: Sized {
    /// Name of the table in the description of a file.
    const TABLE: &'static str;

    /// The columns of a file with this description, in the order in which they are written.
    fn columns(metadata: &Metadata) -> Vec<Column>;

    /// The description of a file that has none, from the names of its columns.
    fn guess(_found: &[String]) -> Metadata {
        Metadata::new(Self::TABLE, None)
    }

    /// The description of this table, without units.
    fn metadata(&self) -> Metadata;

    /// Appends the rows of this table to a sheet of [`Layout::columns`]. Row numbers in errors count from 0.
    fn fill(&self, sheet: &mut Sheet, file: &Arc<str>) -> Result<(), DataError>;

    /// Lines of JSON may hold several rows in a list.
    const LISTS: bool = false;

    /// A description with all columns that are known by name.
    fn widest() -> Metadata {
        Metadata::new(Self::TABLE, None)
    }

    /// Columns that files of other programs may have in place of ours.
    fn foreign_columns() -> Vec<Column> {
        Vec::new()
    }

    /// The table of a sheet whose cells are already right one by one.
    fn from_sheet(
        sheet: &Sheet,
        metadata: Metadata,
        context: &Context<'_>,
        remarks: &mut Remarks,
    ) -> Result<Self, DataError>;
}

/// What a layout must know about the file that it reads.
pub(crate) struct Context<'a> {
    pub file: &'a Arc<str>,
    pub options: &'a ReadOptions,
    /// Names of all columns of the file, the unknown ones too.
    pub found: &'a [String],
    /// The file is one of our own.
    pub ours: bool,
    /// Rows are objects, each of which says what it has.
    pub keyed: bool,
}

/// Numbers that are in a row all together or not at all.
pub(crate) struct Group<'a, const N: usize> {
    names: [&'static str; N],
    cells: [Cells<'a, f64>; N],
}

impl<'a, const N: usize> Group<'a, N> {
    pub fn new(sheet: &'a Sheet, names: [&'static str; N]) -> Self {
        Group { names, cells: names.map(|name| sheet.reals(name)) }
    }

    pub fn get(&self, row: usize, place: impl FnOnce() -> Place) -> Result<Option<[f64; N]>, DataError> {
        let values = self.cells.map(|cells| cells.get(row));
        let known = values.iter().flatten().count();
        if known == 0 {
            return Ok(None);
        }
        if known < N {
            return Err(DataError::Row {
                place: place(),
                problem: format!(
                    "of the columns {} some have a value and some have none",
                    self.names.join(", ")
                ),
                help: "give all of them or none",
            });
        }
        Ok(Some(values.map(Option::unwrap_or_default)))
    }
}

pub(crate) const EXTENT: [&str; 3] = ["semi_axis_1", "semi_axis_2", "orientation"];

/// Columns of the extent of an object.
pub(crate) fn extent_columns() -> [Column; 3] {
    use crate::column::Limits;
    [
        Column::real(EXTENT[0], "m", Limits::NotNegative),
        Column::real(EXTENT[1], "m", Limits::NotNegative),
        Column::real(EXTENT[2], "rad", Limits::Finite),
    ]
}
