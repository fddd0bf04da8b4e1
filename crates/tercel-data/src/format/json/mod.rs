//! Objects of JSON: one per line, in an array, or one after another.

mod keys;
mod lines;
mod writer;

use std::io::BufRead;
use std::sync::Arc;

use serde_json::{Map, Value};

use super::{Content, naming, unused};
use crate::error::DataError;
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::source::text;
use crate::unit::Unit;

pub(crate) use keys::Keys;
pub(crate) use lines::Lines;
pub(crate) use writer::{Writer, write_row};

/// Key of the object that describes the table.
pub(crate) const KEY: &str = "tercel";

/// Reads a file of rows.
pub(crate) fn read<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ReadOptions,
    remarks: &mut Remarks,
) -> Result<Content, DataError> {
    let mut text = text(reader, file)?;
    let mut lines = Lines::new(text.reader.as_mut(), Arc::clone(file));
    let mut described = None;
    let mut first = None;
    for row in lines.by_ref() {
        match row {
            Ok((object, _)) if description(&object).is_some() => {
                let json = description(&object).unwrap_or_default();
                described = Some(Metadata::parse(&json, T::TABLE, file)?);
            }
            Ok(row) => {
                first = Some(row);
                break;
            }
            Err(error) => remarks.refuse(error)?,
        }
    }
    let found: Vec<String> = match (&first, &described) {
        (Some((object, _)), _) => object.keys().cloned().collect(),
        (None, Some(metadata)) => T::columns(metadata).iter().map(|column| column.name.to_string()).collect(),
        (None, None) => return Err(DataError::Empty { file: Arc::clone(file) }),
    };
    let ours = described.is_some();
    let (mut metadata, naming) = naming::<T>(&found, described, file, options)?;
    let mut sheet = Sheet::new(naming.columns().to_vec());
    let mut keys = Keys::new(naming, T::LISTS, options);
    for row in first.map(Ok).into_iter().chain(lines.by_ref()) {
        let taken = row.and_then(|(object, place)| match description(&object) {
            // A table may be several that were put one after another.
            Some(json) => Metadata::parse(&json, T::TABLE, file).map(|again| metadata = again),
            None => keys.take(&object, &place, &mut sheet).map(|_| ()),
        });
        if let Err(error) = taken {
            remarks.refuse(error)?;
        }
    }
    drop(lines);
    remarks.notes.extend(text.note());
    remarks.notes.extend(keys.notes());
    let time_unit = if ours { Some(Unit::Second) } else { keys.time_unit() };
    Ok(Content { sheet, metadata, found, time_unit, ours })
}

/// The JSON of the description, when the object holds one.
pub(crate) fn description(object: &Map<String, Value>) -> Option<String> {
    object.get(KEY).filter(|_| object.len() == 1).map(Value::to_string)
}

/// What is said of keys that nothing was read from.
fn passed_over(names: &[String]) -> Option<String> {
    (!names.is_empty()).then(|| unused(names))
}
