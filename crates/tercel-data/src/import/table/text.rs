//! Tables of reports as CSV and other text.

use std::borrow::Cow;
use std::sync::Arc;

use super::super::input::Input;
use super::Cell;
use crate::error::{DataError, Place};
use crate::format::csv;
use crate::options::ReadOptions;

/// The rows of a text table.
pub(super) struct TextRows {
    rows: csv::Rows<'static>,
    names: Vec<String>,
    line: u64,
    file: Arc<str>,
}

impl TextRows {
    pub fn new(input: &Input, options: &ReadOptions) -> Result<Self, DataError> {
        let file = Arc::clone(&input.name);
        let rows = csv::Rows::new(input.open()?, &file, options.columns.as_deref())?;
        let names = rows.named(&file)?.to_vec();
        Ok(TextRows { rows, names, line: 0, file })
    }
}

impl super::Rows for TextRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        let next = self.rows.next(&self.file)?;
        if let Some((_, line)) = next {
            self.line = line;
        }
        Ok(next.is_some())
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        self.rows.record().get(column).map_or(Cell::Nothing, |text| Cell::Text(Cow::Borrowed(text)))
    }

    fn place(&self) -> Place {
        Place::line(&self.file, self.line)
    }

    fn notes(&self) -> Vec<String> {
        self.rows.notes()
    }
}
