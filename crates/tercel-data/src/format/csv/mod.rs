//! Comma-separated values, and text tables of other dialects.

mod dialect;
mod record;
mod rows;
mod writer;

use std::io::BufRead;
use std::sync::Arc;

use super::{Content, Plan};
use crate::error::{DataError, Place, Refusal, Spot};
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::Sheet;

use record::Record;
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
    let plan = Plan::new::<T>(&found, described, file, options, remarks)?;
    let mut sheet = plan.sheet();
    loop {
        let pushed = match rows.next(file) {
            Ok(None) => break,
            Ok(Some((record, line))) => push(&mut sheet, &plan, record, trim)
                .map(|()| sheet.spots.push(Spot::Line(line)))
                .map_err(|(at, refusal)| refusal.at(Place::line(file, line), &found[plan.columns[at].at])),
            Err(error) => Err(error),
        };
        if let Err(error) = pushed {
            sheet.truncate(sheet.spots.len());
            remarks.refuse(error)?;
        }
    }
    remarks.notes.extend(rows.notes());
    Ok(Content { sheet, metadata: plan.metadata, found, time_unit: plan.time_unit, ours: plan.ours })
}

/// Appends a row, or says which of the columns refuses, and why.
fn push(sheet: &mut Sheet, plan: &Plan, record: &Record, trim: bool) -> Result<(), (usize, Refusal)> {
    for (at, (source, values)) in plan.columns.iter().zip(&mut sheet.values).enumerate() {
        let text = record.get(source.at).unwrap_or_default();
        let text = if trim { text.trim() } else { text };
        values.push_text(text, &source.column, source.conversion).map_err(|refusal| (at, refusal))?;
    }
    Ok(())
}
