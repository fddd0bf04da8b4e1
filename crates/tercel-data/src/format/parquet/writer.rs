//! Tables as Parquet.

use std::io::Write;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use super::KEY;
use crate::column::{Column, Kind};
use crate::error::DataError;
use crate::sheet::{Sheet, Values};

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
        let properties = WriterProperties::builder()
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

fn data_type(kind: Kind) -> DataType {
    match kind {
        Kind::Text => DataType::Utf8,
        Kind::Count => DataType::UInt64,
        Kind::Time | Kind::Real(_) => DataType::Float64,
    }
}

fn array(values: &Values) -> ArrayRef {
    match values {
        Values::Real(cells) => Arc::new(cells.iter().copied().collect::<Float64Array>()),
        Values::Count(cells) => Arc::new(cells.iter().copied().collect::<UInt64Array>()),
        Values::Text(cells) => Arc::new(cells.iter().map(Option::as_deref).collect::<StringArray>()),
        // Tables of ours hold seconds.
        Values::Time(cells) => Arc::new(cells.iter().map(|_| None::<f64>).collect::<Float64Array>()),
    }
}

fn write_error(error: parquet::errors::ParquetError, file: &Arc<str>) -> DataError {
    DataError::io(file, "write", std::io::Error::other(error))
}
