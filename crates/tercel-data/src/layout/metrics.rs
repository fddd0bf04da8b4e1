//! Columns of the metrics: one row per number.

use std::sync::Arc;

use super::{Context, Layout};
use crate::column::{Column, Limits};
use crate::error::DataError;
use crate::metadata::Metadata;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::table::{Metric, Metrics};

impl Layout for Metrics {
    const TABLE: &'static str = "metrics";

    fn columns(_metadata: &Metadata) -> Vec<Column> {
        let mut columns = ["study", "method", "run"].map(Column::text).to_vec();
        columns.push(Column::text("metric").needed());
        columns.push(Column::text("component"));
        columns.push(Column::real("value", "", Limits::None));
        columns
    }

    fn metadata(&self) -> Metadata {
        Metadata::new(Self::TABLE, None)
    }

    fn fill(&self, sheet: &mut Sheet, _file: &Arc<str>) -> Result<(), DataError> {
        for row in &self.rows {
            let mut filler = sheet.filler();
            for text in [&row.study, &row.method, &row.run, &row.metric, &row.component] {
                filler.text(Some(&Arc::from(text.as_str())));
            }
            // A mean over nothing is not a number, which in a table is an empty cell.
            filler.real(Some(row.value).filter(|value| !value.is_nan()));
        }
        Ok(())
    }

    fn from_sheet(
        sheet: &Sheet,
        _metadata: Metadata,
        _context: &Context<'_>,
        _remarks: &mut Remarks,
    ) -> Result<Self, DataError> {
        let texts = ["study", "method", "run", "metric", "component"].map(|name| sheet.texts(name));
        let value = sheet.reals("value");
        let rows = (0..sheet.len())
            .map(|row| {
                let [study, method, run, metric, component] =
                    texts.map(|cells| cells.get(row).map(|text| text.to_string()).unwrap_or_default());
                Metric { study, method, run, metric, component, value: value.get(row).unwrap_or(f64::NAN) }
            })
            .collect();
        Ok(Metrics { rows })
    }
}
