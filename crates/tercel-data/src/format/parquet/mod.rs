//! Apache Parquet.

mod cells;
mod writer;

use std::io::BufRead;
use std::sync::Arc;

use arrow_array::RecordBatch;
use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};

use self::cells::Cells;
use super::guard::guarded;
use super::{Content, Plan, read_error};
use crate::error::{DataError, Place, Refusal, Spot};
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::source::Kind;

pub(crate) use writer::Writer;

/// Key of the description in the metadata of a file.
const KEY: &str = "tercel";

/// Reads a file. All of it is held in memory, since the table is.
pub(crate) fn read<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ReadOptions,
    remarks: &mut Remarks,
) -> Result<Content, DataError> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).map_err(|error| read_error(file, error))?;
    if !bytes.starts_with(b"PAR1") {
        let (what, help) = match Kind::of(&bytes) {
            Kind::Other(what) => (what, "give a Parquet file, or save the table as CSV with a header"),
            Kind::Json => ("JSON", "name the format: --from ndjson"),
            Kind::Text | Kind::Parquet => ("text", "name the format: --from csv"),
        };
        return Err(DataError::unsettled(
            Place::whole(file),
            format!("this is no Parquet file but {what}"),
            help,
        ));
    }
    // The decoder checks most of what it reads, but not all: about one damaged file in 400 makes it panic.
    guarded(|| decode::<T>(bytes.into(), file, options, remarks))
        .unwrap_or_else(|| Err(corrupt(file, "its parts contradict each other")))
}

fn corrupt(file: &Arc<str>, problem: impl std::fmt::Display) -> DataError {
    DataError::Corrupt {
        place: Place::whole(file),
        problem: format!("this is not a whole Parquet file: {problem}"),
        help: "the file may be truncated: write or copy it again",
    }
}

fn decode<T: Layout>(
    bytes: Bytes,
    file: &Arc<str>,
    options: &ReadOptions,
    remarks: &mut Remarks,
) -> Result<Content, DataError> {
    // Files may also hold their schema in the form of Arrow, whose decoder panics on what it does not know. The
    // schema of Parquet itself says all that is needed here.
    let skip = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let builder = ParquetRecordBatchReaderBuilder::try_new_with_options(bytes, skip)
        .map_err(|error| corrupt(file, error))?;
    let description = builder
        .metadata()
        .file_metadata()
        .key_value_metadata()
        .and_then(|pairs| pairs.iter().find(|pair| pair.key == KEY))
        .and_then(|pair| pair.value.as_deref());
    let described = description.map(|json| Metadata::parse(json, T::TABLE, file)).transpose()?;
    let found: Vec<String> = builder.schema().fields().iter().map(|field| field.name().clone()).collect();
    let plan = Plan::new::<T>(&found, described, file, options, remarks)?;
    let mask = ProjectionMask::roots(builder.parquet_schema(), plan.columns.iter().map(|source| source.at));
    let batches = builder.with_projection(mask).build().map_err(|error| corrupt(file, error))?;
    let mut sheet = plan.sheet();
    let mut first = 0;
    for batch in batches {
        let batch = batch.map_err(|error| corrupt(file, error))?;
        append(&batch, &plan, &found, &mut sheet, &mut first, file, remarks)?;
    }
    Ok(Content { sheet, metadata: plan.metadata, found, time_unit: plan.time_unit, ours: plan.ours })
}

/// Appends the rows of a batch. `first` counts the rows of the file.
fn append(
    batch: &RecordBatch,
    plan: &Plan,
    found: &[String],
    sheet: &mut Sheet,
    first: &mut u64,
    file: &Arc<str>,
    remarks: &mut Remarks,
) -> Result<(), DataError> {
    let mut columns = Vec::new();
    for source in &plan.columns {
        let name = &found[source.at];
        let cells = batch.column_by_name(name).ok_or_else(|| corrupt(file, "a column is missing"))?;
        columns.push(Cells::of(cells, &source.column).ok_or_else(|| DataError::Column {
            place: Place::whole(file),
            column: name.clone(),
            problem: "has another type",
            help: format!("it is {}; expected {}", cells.data_type(), source.column.expected()),
        })?);
    }
    let rows = columns.first().map_or(0, Cells::len);
    for row in 0..rows {
        let spot = Spot::Row(*first);
        if let Err((at, refusal)) = push(&columns, row, plan, sheet) {
            let place = Place { file: Arc::clone(file), spot };
            sheet.truncate(sheet.spots.len());
            remarks.refuse(refusal.at(place, &found[plan.columns[at].at]))?;
        } else {
            sheet.spots.push(spot);
        }
        *first += 1;
    }
    Ok(())
}

/// Appends a row, or says which of the columns refuses, and why.
fn push(columns: &[Cells], row: usize, plan: &Plan, sheet: &mut Sheet) -> Result<(), (usize, Refusal)> {
    let targets = plan.columns.iter().zip(&mut sheet.values);
    for (at, (cells, (source, values))) in columns.iter().zip(targets).enumerate() {
        cells.push(row, values, &source.column, source.conversion).map_err(|refusal| (at, refusal))?;
    }
    Ok(())
}
