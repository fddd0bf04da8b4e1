//! Tables of figures.

/// A table of text: a heading, names of the columns, and rows.
///
/// ```
/// use tercel_study::report::{Report, Table};
///
/// let table = Table::new("Position error, m", ["method", "mean"]).with_row(["Kalman", "12.5"]).with_row(["IMM", "9.1"]);
/// assert!(Report::new("Errors").with(table).render()?.contains("<td>12.5</td>"));
/// # Ok::<(), tercel_study::report::ReportError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    pub(super) heading: String,
    pub(super) note: Option<String>,
    pub(super) folded: bool,
    pub(super) columns: Vec<String>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows. Any text may stand in it; it is shown as it is.
    pub fn new<T: Into<String>>(heading: impl Into<String>, columns: impl IntoIterator<Item = T>) -> Table {
        let columns = columns.into_iter().map(Into::into).collect();
        Table { heading: heading.into(), note: None, folded: false, columns, rows: Vec::new() }
    }

    /// A sentence below the heading.
    pub fn with_note(self, note: impl Into<String>) -> Table {
        Table { note: Some(note.into()), ..self }
    }

    /// Shows the heading alone until it is clicked: for long tables.
    pub fn folded(self) -> Table {
        Table { folded: true, ..self }
    }

    /// Adds a row. Missing cells stay empty, and what is beyond the last column is not shown.
    pub fn with_row<T: Into<String>>(mut self, cells: impl IntoIterator<Item = T>) -> Table {
        let mut row: Vec<String> = cells.into_iter().map(Into::into).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
        self
    }
}
