//! Columns of the truth: one row per object and time.

use std::sync::Arc;

use super::{Context, EXTENT, Group, Layout, extent_columns};
use crate::column::{Column, Limits};
use crate::error::DataError;
use crate::metadata::Metadata;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::table::{Truth, Truths};

impl Layout for Truths {
    const TABLE: &'static str = "truth";

    fn columns(_metadata: &Metadata) -> Vec<Column> {
        let mut columns = vec![
            Column::time(),
            Column::text("object").needed(),
            Column::real("x", "m", Limits::Finite).needed(),
            Column::real("y", "m", Limits::Finite).needed(),
            Column::real("z", "m", Limits::Finite),
            Column::real("vx", "m/s", Limits::Finite),
            Column::real("vy", "m/s", Limits::Finite),
        ];
        columns.extend(extent_columns());
        columns
    }

    fn metadata(&self) -> Metadata {
        Metadata::new(Self::TABLE, self.origin)
    }

    fn fill(&self, sheet: &mut Sheet, _file: &Arc<str>) -> Result<(), DataError> {
        for truth in &self.rows {
            let mut filler = sheet.filler();
            filler.real(truth.time).text(Some(&truth.object)).reals(truth.position.map(Some)).real(truth.z);
            match truth.velocity {
                Some(velocity) => filler.reals(velocity.map(Some)),
                None => filler.reals([None; 2]),
            };
            match truth.extent {
                Some(extent) => filler.reals(extent.map(Some)),
                None => filler.reals([None; 3]),
            };
        }
        Ok(())
    }

    fn from_sheet(
        sheet: &Sheet,
        metadata: Metadata,
        context: &Context<'_>,
        remarks: &mut Remarks,
    ) -> Result<Self, DataError> {
        let [time, x, y, z] = ["time", "x", "y", "z"].map(|name| sheet.reals(name));
        let object = sheet.texts("object");
        let velocity = Group::new(sheet, ["vx", "vy"]);
        let extent = Group::new(sheet, EXTENT);
        let mut rows = Vec::with_capacity(sheet.len());
        for row in 0..sheet.len() {
            let place = || sheet.place(context.file, row);
            let parts = velocity.get(row, place).and_then(|velocity| Ok((velocity, extent.get(row, place)?)));
            let (velocity, extent) = match parts {
                Ok(parts) => parts,
                Err(error) => {
                    remarks.refuse(error)?;
                    continue;
                }
            };
            rows.push(Truth {
                time: time.get(row).unwrap_or_default(),
                object: object.get(row).unwrap_or_default(),
                position: [x.get(row).unwrap_or_default(), y.get(row).unwrap_or_default()],
                z: z.get(row),
                velocity,
                extent,
            });
        }
        Ok(Truths { origin: metadata.origin, rows })
    }
}
