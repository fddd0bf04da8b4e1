//! Apache Parquet.

use std::io::{BufRead, Write};
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, UInt64Type};
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_cast::cast;
use arrow_cast::display::{ArrayFormatter, FormatOptions};
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use bytes::Bytes;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::arrow::{ArrowWriter, ProjectionMask};
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;

use super::guard::guarded;
use super::{Content, Plan, read_error};
use crate::column::{self, Column};
use crate::error::{DataError, Place, Refusal, Spot};
use crate::layout::Layout;
use crate::metadata::Metadata;
use crate::options::ReadOptions;
use crate::sheet::{Sheet, Values};
use crate::source::Kind;

/// Key of the description in the metadata of a file.
const KEY: &str = "tercel";

/// Reads a file. All of it is held in memory, since the table is.
pub(crate) fn read<T: Layout>(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ReadOptions,
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
    guarded(|| decode::<T>(bytes.into(), file, options))
        .unwrap_or_else(|| Err(corrupt(file, "its parts contradict each other")))
}

fn corrupt(file: &Arc<str>, problem: impl std::fmt::Display) -> DataError {
    DataError::Corrupt {
        place: Place::whole(file),
        problem: format!("this is not a whole Parquet file: {problem}"),
        help: "the file may be truncated: write or copy it again",
    }
}

fn decode<T: Layout>(bytes: Bytes, file: &Arc<str>, options: &ReadOptions) -> Result<Content, DataError> {
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
    let plan = Plan::new::<T>(&found, described, file, options)?;
    let mask = ProjectionMask::roots(builder.parquet_schema(), plan.columns.iter().map(|(at, _)| *at));
    let batches = builder.with_projection(mask).build().map_err(|error| corrupt(file, error))?;
    let mut sheet = plan.sheet();
    for batch in batches {
        let batch = batch.map_err(|error| corrupt(file, error))?;
        for (column, values) in sheet.columns.iter().zip(&mut sheet.values) {
            let cells =
                batch.column_by_name(&column.name).ok_or_else(|| corrupt(file, "a column is missing"))?;
            append(cells, column, values, options, file)?;
        }
    }
    Ok(Content { sheet, metadata: plan.metadata, found })
}

/// Appends the cells of an array; other programs may have chosen other number types than ours.
fn append(
    cells: &ArrayRef,
    column: &Column,
    values: &mut Values,
    options: &ReadOptions,
    file: &Arc<str>,
) -> Result<(), DataError> {
    let wrong_type = || DataError::Column {
        place: Place::whole(file),
        column: column.name.to_string(),
        problem: "has another type",
        help: format!("it is {}; expected {}", cells.data_type(), column.expected()),
    };
    let to = |data_type: &DataType| cast(cells, data_type).map_err(|_| wrong_type());
    let first = values.len();
    let at = |row: usize| Place { file: Arc::clone(file), spot: Spot::Row((first + row) as u64) };
    let refused = |row: usize| move |refusal: Refusal| refusal.at(at(row), &column.name);
    match (column.kind, cells.data_type()) {
        (
            column::Kind::Text,
            DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View | DataType::Dictionary(..),
        ) => {
            let texts = to(&DataType::Utf8)?;
            for (row, text) in texts.as_string::<i32>().iter().enumerate() {
                values.push_text(text.unwrap_or_default(), column, options.angles).map_err(refused(row))?;
            }
        }
        (column::Kind::Time, DataType::Timestamp(..)) => {
            let nanoseconds = to(&DataType::Timestamp(TimeUnit::Nanosecond, None))?;
            let nanoseconds = cast(&nanoseconds, &DataType::Int64).map_err(|_| wrong_type())?;
            for (row, time) in nanoseconds.as_primitive::<Int64Type>().iter().enumerate() {
                let pushed = match time {
                    Some(time) => values.push_number(seconds(time), column, options.angles),
                    None => values.push_null(column),
                };
                pushed.map_err(refused(row))?;
            }
        }
        (column::Kind::Count, integer) if integer.is_integer() => {
            let counts = to(&DataType::UInt64)?;
            for (row, count) in counts.as_primitive::<UInt64Type>().iter().enumerate() {
                let pushed = match count {
                    Some(count) => values.push_count(count, column, options.angles),
                    None if cells.is_null(row) => values.push_null(column),
                    None => Err(Refusal::new(shown(cells, row), column.expected())),
                };
                pushed.map_err(refused(row))?;
            }
        }
        (column::Kind::Count | column::Kind::Time | column::Kind::Real(_), number) if number.is_numeric() => {
            let numbers = to(&DataType::Float64)?;
            for (row, number) in numbers.as_primitive::<Float64Type>().iter().enumerate() {
                let pushed = match number {
                    Some(number) => values.push_number(number, column, options.angles),
                    None => values.push_null(column),
                };
                pushed.map_err(refused(row))?;
            }
        }
        (_, DataType::Null) => {
            for row in 0..cells.len() {
                values.push_null(column).map_err(refused(row))?;
            }
        }
        _ => return Err(wrong_type()),
    }
    Ok(())
}

fn seconds(nanoseconds: i64) -> f64 {
    const BILLION: i64 = 1_000_000_000;
    nanoseconds.div_euclid(BILLION) as f64 + nanoseconds.rem_euclid(BILLION) as f64 * 1e-9
}

/// A cell as text.
fn shown(cells: &ArrayRef, row: usize) -> String {
    ArrayFormatter::try_new(cells, &FormatOptions::default())
        .map(|formatter| formatter.value(row).to_string())
        .unwrap_or_default()
}

/// Writes a file.
pub(crate) struct Writer<W: Write + Send> {
    writer: ArrowWriter<W>,
    schema: Arc<Schema>,
}

impl<W: Write + Send> Writer<W> {
    /// Begins the file; its description goes to the end with the rest of the metadata.
    pub fn new(sink: W, columns: &[Column], json: String, file: &Arc<str>) -> Result<Self, DataError> {
        let fields: Vec<Field> = columns
            .iter()
            .map(|column| Field::new(column.name.as_ref(), data_type(column.kind), !column.needed))
            .collect();
        let schema = Arc::new(Schema::new(fields));
        // Measured and estimated numbers hardly repeat: a dictionary of them costs time and saves nothing.
        let plain = columns.iter().filter(|column| matches!(column.kind, column::Kind::Real(_)));
        let properties = plain
            .map(|column| ColumnPath::new(vec![column.name.to_string()]))
            .fold(WriterProperties::builder(), |builder, path| {
                builder.set_column_dictionary_enabled(path, false)
            })
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_created_by(concat!("tercel ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(vec![KeyValue::new(KEY.to_owned(), json)]))
            .build();
        let options = ArrowWriterOptions::new().with_properties(properties).with_skip_arrow_metadata(true);
        let writer = ArrowWriter::try_new_with_options(sink, Arc::clone(&schema), options)
            .map_err(|error| write_error(error, file))?;
        Ok(Writer { writer, schema })
    }

    pub fn write(&mut self, sheet: &Sheet, file: &Arc<str>) -> Result<(), DataError> {
        let arrays = sheet.values.iter().map(array).collect();
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays)
            .map_err(|error| DataError::io(file, "write", std::io::Error::other(error)))?;
        self.writer.write(&batch).map_err(|error| write_error(error, file))
    }

    pub fn finish(self, file: &Arc<str>) -> Result<W, DataError> {
        self.writer.into_inner().map_err(|error| write_error(error, file))
    }
}

fn data_type(kind: column::Kind) -> DataType {
    match kind {
        column::Kind::Text => DataType::Utf8,
        column::Kind::Count => DataType::UInt64,
        column::Kind::Time | column::Kind::Real(_) => DataType::Float64,
    }
}

fn array(values: &Values) -> ArrayRef {
    match values {
        Values::Real(cells) => Arc::new(cells.iter().copied().collect::<Float64Array>()),
        Values::Count(cells) => Arc::new(cells.iter().copied().collect::<UInt64Array>()),
        Values::Text(cells) => Arc::new(cells.iter().map(Option::as_deref).collect::<StringArray>()),
    }
}

fn write_error(error: parquet::errors::ParquetError, file: &Arc<str>) -> DataError {
    DataError::io(file, "write", std::io::Error::other(error))
}
