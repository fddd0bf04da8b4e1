//! Recordings whose scans are written out: our own tables, and the Autoferry benchmark.

use std::io::Read;
use std::path::Path;

use super::source::{Kind, Source};
use super::{ImportOptions, Imported, autoferry};
use crate::error::DataError;
use crate::import::LeftOut;
use crate::options::ReadOptions;
use crate::read::{import_table_from, read_as};
use crate::table::Origin;

/// Brings in files.
pub(super) fn import<P: AsRef<Path>>(
    source: Source,
    paths: &[P],
    options: &ImportOptions,
) -> Result<Imported, DataError> {
    let mut whole: Option<Imported> = None;
    for path in paths {
        let path = path.as_ref();
        // All files share the frame of the first.
        let origin = whole.as_ref().and_then(|whole| whole.detections.origin);
        let part = match source.kind() {
            Kind::Table(format) => read_as(path, format, &read_options(options, origin))?,
            _ => autoferry::read(path, options)?,
        };
        whole = Some(match whole {
            Some(whole) => join(whole, part, path)?,
            None => part,
        });
    }
    Ok(whole.unwrap_or_default())
}

/// Brings in a stream.
pub(super) fn import_from(
    source: Source,
    reader: impl Read,
    name: &str,
    options: &ImportOptions,
) -> Result<Imported, DataError> {
    match source.kind() {
        Kind::Table(format) => import_table_from(reader, format, name, &read_options(options, None)),
        _ => {
            let detections = autoferry::read_detections_from(reader, name)?;
            Ok(Imported { detections, ..Imported::default() })
        }
    }
}

/// How a table is read whose positions may be latitudes and longitudes.
fn read_options(options: &ImportOptions, origin: Option<Origin>) -> ReadOptions {
    ReadOptions { origin: options.origin.or(options.read.origin).or(origin), ..options.read.clone() }
}

/// Appends a recording to another; detections are numbered anew, since two files may use the same numbers.
fn join(mut whole: Imported, part: Imported, path: &Path) -> Result<Imported, DataError> {
    if whole.detections.origin != part.detections.origin {
        return Err(DataError::Metadata {
            file: crate::format::file_name(path),
            problem: "the origin is another one than in the file before".to_owned(),
            help: "bring in the files one by one".to_owned(),
        });
    }
    whole.detections.scans.extend(part.detections.scans);
    whole.detections.scans.sort_by(|a, b| a.time.total_cmp(&b.time));
    let detections = whole.detections.scans.iter_mut().flat_map(|scan| &mut scan.detections);
    detections.zip(0..).for_each(|(detection, id)| detection.id = id);
    whole.truths = match (whole.truths, part.truths) {
        (Some(mut truths), Some(more)) => {
            truths.rows.extend(more.rows);
            Some(truths)
        }
        (truths, more) => truths.or(more),
    };
    for LeftOut { reason, rows } in part.left_out {
        match whole.left_out.iter_mut().find(|known| known.reason == reason) {
            Some(known) => known.rows += rows,
            None => whole.left_out.push(LeftOut { reason, rows }),
        }
    }
    let news: Vec<String> = part.notes.into_iter().filter(|note| !whole.notes.contains(note)).collect();
    whole.notes.extend(news);
    Ok(whole)
}
