//! Tables of reports as Parquet.

use std::borrow::Cow;
use std::io::Read;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, Float64Array, Int64Array, StringArray};
use arrow_cast::cast;
use arrow_schema::{DataType, TimeUnit};
use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};

use super::super::input::Input;
use super::{Cell, Names};
use crate::error::{DataError, Place, Spot};
use crate::format::guard::guarded;
use crate::source::read_error;

/// The rows of a Parquet file. Its bytes are held in memory, its rows batch by batch.
pub(super) struct ParquetRows {
    names: Vec<String>,
    /// For each column of the file, which one of a batch it is, if it is read.
    chosen: Vec<Option<usize>>,
    batches: ParquetRecordBatchReader,
    columns: Vec<Column>,
    /// Row of the batch, and rows of the batches before.
    row: usize,
    length: usize,
    before: u64,
    file: Arc<str>,
}

/// The cells of a column in a batch.
enum Column {
    Numbers(Float64Array),
    /// Whole seconds and nanoseconds of a point in time.
    Times(Int64Array),
    Texts(StringArray),
    /// Of a type that reports do not have.
    Other,
}

impl ParquetRows {
    pub fn new(input: &Input, wanted: &[&Names]) -> Result<Self, DataError> {
        let file = Arc::clone(&input.name);
        let mut bytes = Vec::new();
        input.open()?.read_to_end(&mut bytes).map_err(|error| read_error(&file, error))?;
        let bytes = Bytes::from(bytes);
        // As in the reader of our own tables: the decoder panics on some damaged files.
        let opened = guarded(|| {
            let skip = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
            let builder = ParquetRecordBatchReaderBuilder::try_new_with_options(bytes, skip)?;
            let names: Vec<String> =
                builder.schema().fields().iter().map(|field| field.name().clone()).collect();
            let is_wanted = |name: &String| wanted.iter().any(|wanted| wanted.has(name));
            let read: Vec<usize> = (0..names.len()).filter(|column| is_wanted(&names[*column])).collect();
            let chosen =
                (0..names.len()).map(|column| read.iter().position(|read| *read == column)).collect();
            let mask = ProjectionMask::roots(builder.parquet_schema(), read);
            let batches = builder.with_batch_size(8192).with_projection(mask).build()?;
            Ok::<_, parquet::errors::ParquetError>((names, chosen, batches))
        });
        match opened {
            Some(Ok((names, chosen, batches))) => Ok(ParquetRows {
                names,
                chosen,
                batches,
                columns: Vec::new(),
                row: 0,
                length: 0,
                before: 0,
                file,
            }),
            Some(Err(error)) => Err(corrupt(&file, error)),
            None => Err(corrupt(&file, "its parts contradict each other")),
        }
    }

    /// Decodes the next batch that has rows; false at the end.
    fn next_batch(&mut self) -> Result<bool, DataError> {
        loop {
            let batch = match guarded(|| self.batches.next()) {
                None => return Err(corrupt(&self.file, "its parts contradict each other")),
                Some(None) => return Ok(false),
                Some(Some(Err(error))) => return Err(corrupt(&self.file, error)),
                Some(Some(Ok(batch))) => batch,
            };
            self.before += self.length as u64;
            (self.length, self.row) = (batch.num_rows(), 0);
            self.columns = batch.columns().iter().map(Column::new).collect();
            if self.length > 0 {
                return Ok(true);
            }
        }
    }
}

impl Column {
    fn new(cells: &ArrayRef) -> Self {
        let number = |cells: &ArrayRef| cast(cells, &DataType::Float64).ok();
        let text = |cells: &ArrayRef| cast(cells, &DataType::Utf8).ok();
        let nanoseconds = |cells: &ArrayRef| {
            let unit = DataType::Timestamp(TimeUnit::Nanosecond, None);
            cast(&cast(cells, &unit).ok()?, &DataType::Int64).ok()
        };
        let column = match cells.data_type() {
            DataType::Timestamp(..) | DataType::Date32 | DataType::Date64 => {
                nanoseconds(cells).map(|times| Column::Times(times.as_primitive::<Int64Type>().clone()))
            }
            DataType::Boolean => text(cells).map(|texts| Column::Texts(texts.as_string::<i32>().clone())),
            kind if kind.is_numeric() => {
                number(cells).map(|numbers| Column::Numbers(numbers.as_primitive::<Float64Type>().clone()))
            }
            DataType::Utf8
            | DataType::LargeUtf8
            | DataType::Utf8View
            | DataType::Binary
            | DataType::LargeBinary
            | DataType::BinaryView
            | DataType::Dictionary(..) => {
                text(cells).map(|texts| Column::Texts(texts.as_string::<i32>().clone()))
            }
            _ => None,
        };
        column.unwrap_or(Column::Other)
    }

    fn cell(&self, row: usize) -> Cell<'_> {
        match self {
            Column::Numbers(cells) if cells.is_valid(row) => Cell::Number(cells.value(row)),
            Column::Times(cells) if cells.is_valid(row) => Cell::Time(seconds(cells.value(row))),
            Column::Texts(cells) if cells.is_valid(row) => Cell::Text(Cow::Borrowed(cells.value(row))),
            _ => Cell::Nothing,
        }
    }
}

fn seconds(nanoseconds: i64) -> f64 {
    const BILLION: i64 = 1_000_000_000;
    nanoseconds.div_euclid(BILLION) as f64 + nanoseconds.rem_euclid(BILLION) as f64 * 1e-9
}

fn corrupt(file: &Arc<str>, problem: impl std::fmt::Display) -> DataError {
    DataError::Corrupt {
        place: Place::whole(file),
        problem: format!("this is not a whole Parquet file: {problem}"),
        help: "the file may be truncated: write or copy it again",
    }
}

impl super::Rows for ParquetRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        self.row += 1;
        Ok(self.row < self.length || self.next_batch()?)
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        let read = self.chosen.get(column).copied().flatten();
        read.and_then(|read| self.columns.get(read)).map_or(Cell::Nothing, |cells| cells.cell(self.row))
    }

    fn place(&self) -> Place {
        Place { file: Arc::clone(&self.file), spot: Spot::Row(self.before + self.row as u64) }
    }
}
