//! Cells of Parquet files, whatever types other programs chose for them.

use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, UInt64Type};
use arrow_array::{Array, ArrayRef};
use arrow_cast::cast;
use arrow_cast::display::{ArrayFormatter, FormatOptions};
use arrow_schema::{DataType, TimeUnit};

use crate::column::{Column, Conversion, Kind};
use crate::error::Refusal;
use crate::sheet::Values;
use crate::time::Moment;

/// An array whose cells are read one by one.
pub(super) struct Cells {
    raw: ArrayRef,
    kind: CellKind,
}

enum CellKind {
    Empty,
    Text(ArrayRef),
    Count(ArrayRef),
    Number(ArrayRef),
    /// Nanoseconds since 1970; with a zone or not.
    Date(ArrayRef, bool),
    /// Nanoseconds since midnight.
    OfDay(ArrayRef),
}

impl Cells {
    /// Looks at the type of a column; nothing when its cells are none that a table holds.
    pub fn of(cells: &ArrayRef, column: &Column) -> Option<Self> {
        let to = |data_type: DataType| cast(cells, &data_type).ok();
        let plain = match cells.data_type() {
            DataType::Dictionary(_, values) => values.as_ref(),
            other => other,
        };
        let nanoseconds = |cells: &ArrayRef, data_type: DataType| {
            cast(&cast(cells, &data_type).ok()?, &DataType::Int64).ok()
        };
        let kind = match plain {
            DataType::Null => CellKind::Empty,
            DataType::Utf8
            | DataType::LargeUtf8
            | DataType::Utf8View
            | DataType::Binary
            | DataType::LargeBinary
            | DataType::BinaryView => CellKind::Text(to(DataType::Utf8)?),
            DataType::Timestamp(_, zone) => CellKind::Date(
                nanoseconds(cells, DataType::Timestamp(TimeUnit::Nanosecond, zone.clone()))?,
                zone.is_some(),
            ),
            DataType::Date32 | DataType::Date64 => {
                CellKind::Date(nanoseconds(cells, DataType::Timestamp(TimeUnit::Nanosecond, None))?, false)
            }
            DataType::Time32(_) | DataType::Time64(_) => {
                CellKind::OfDay(nanoseconds(cells, DataType::Time64(TimeUnit::Nanosecond))?)
            }
            integer if integer.is_integer() && matches!(column.kind, Kind::Count | Kind::Text) => {
                CellKind::Count(to(DataType::UInt64)?)
            }
            number if number.is_numeric() => CellKind::Number(to(DataType::Float64)?),
            _ => return None,
        };
        let fits = match kind {
            CellKind::Date(..) | CellKind::OfDay(_) => column.kind == Kind::Time,
            _ => true,
        };
        fits.then(|| Cells { raw: Arc::clone(cells), kind })
    }

    pub fn len(&self) -> usize {
        self.raw.len()
    }

    /// Appends a cell to a column.
    pub fn push(
        &self,
        row: usize,
        values: &mut Values,
        column: &Column,
        conversion: Conversion,
    ) -> Result<(), Refusal> {
        const BILLION: i64 = 1_000_000_000;
        let seconds = |nanoseconds: i64| {
            nanoseconds.div_euclid(BILLION) as f64 + nanoseconds.rem_euclid(BILLION) as f64 * 1e-9
        };
        if self.raw.is_null(row) {
            return values.push_null(column);
        }
        match &self.kind {
            CellKind::Empty => values.push_null(column),
            CellKind::Text(cells) if cells.is_valid(row) => {
                values.push_text(cells.as_string::<i32>().value(row), column, conversion)
            }
            CellKind::Count(cells) if cells.is_valid(row) => {
                values.push_count(cells.as_primitive::<UInt64Type>().value(row), column, conversion)
            }
            CellKind::Number(cells) if cells.is_valid(row) => {
                values.push_number(cells.as_primitive::<Float64Type>().value(row), column, conversion)
            }
            CellKind::Date(cells, zoned) if cells.is_valid(row) => {
                let time = seconds(cells.as_primitive::<Int64Type>().value(row));
                values.push_moment(if *zoned { Moment::Instant(time) } else { Moment::Civil(time) }, column)
            }
            CellKind::OfDay(cells) if cells.is_valid(row) => values
                .push_moment(Moment::OfDay(seconds(cells.as_primitive::<Int64Type>().value(row))), column),
            _ if column.kind == Kind::Text => values.push_text(&self.shown(row), column, conversion),
            _ => Err(Refusal::new(self.shown(row), column.expected())),
        }
    }

    /// A cell as text.
    fn shown(&self, row: usize) -> String {
        ArrayFormatter::try_new(&self.raw, &FormatOptions::default())
            .map(|formatter| formatter.value(row).to_string())
            .unwrap_or_default()
    }
}
