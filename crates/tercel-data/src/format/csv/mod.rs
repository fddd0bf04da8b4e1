//! Comma-separated values, and text tables of other dialects.

mod dialect;
mod record;
mod rows;
mod writer;

use std::io::BufRead;
use std::sync::Arc;

use super::{Content, Plan};
use crate::error::{DataError, Place};
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::remarks::Remarks;

pub(crate) use rows::Rows;
pub(crate) use writer::Writer;

/// Begins the line that describes a table.
const PREFIX: &str = "# tercel:";

/// Reads a file.
pub(crate) fn read<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ReadOptions,
    remarks: &mut Remarks,
) -> Result<Content, DataError> {
    let mut rows = Rows::new(reader, file, options.columns.as_deref())?;
    let described =
        rows.described.as_deref().map(|json| Metadata::parse(json, T::TABLE, file)).transpose()?;
    // Files of other programs often have blanks after their commas; in our own every blank belongs to a name.
    let trim = described.is_none();
    let found = rows.named(file)?.to_vec();
    let plan = Plan::new::<T>(&found, described, file, options)?;
    let mut sheet = plan.sheet();
    while let Some((record, line)) = rows.next(file)? {
        for ((at, column), values) in plan.columns.iter().zip(&mut sheet.values) {
            let text = record.get(*at).unwrap_or_default();
            let text = if trim { text.trim() } else { text };
            values
                .push_text(text, column, options.angles)
                .map_err(|refusal| refusal.at(Place::line(file, line), &column.name))?;
        }
        sheet.lines.push(line);
    }
    remarks.notes.extend(rows.notes());
    Ok(Content { sheet, metadata: plan.metadata, found })
}
