//! Columns of the detections: one row per detection, and one for each scan without any.

use std::collections::HashSet;
use std::sync::Arc;

use tercel_core::geo::LocalFrame;

use super::rows::Rows;
use super::scans::scans;
use super::{Context, Layout};
use crate::column::{Column, Limits};
use crate::error::{DataError, Place};
use crate::geographic::{frame, middle, on_earth};
use crate::metadata::Metadata;
use crate::remarks::Remarks;
use crate::sheet::Sheet;
use crate::table::{Detection, Detections, Observation, Origin, Scan};

/// The columns of the table.
pub(crate) fn detection_columns() -> Vec<Column> {
    let length = |name| Column::real(name, "m", Limits::Finite);
    let speed = |name| Column::real(name, "m/s", Limits::Finite);
    let sigma = |name, unit| Column::real(name, unit, Limits::Positive);
    vec![
        Column::time(),
        Column::text("sensor").needed(),
        Column::count("scan"),
        Column::count("detection"),
        length("x"),
        length("y"),
        length("z"),
        Column::real("range", "m", Limits::NotNegative),
        Column::real("bearing", "rad", Limits::Angle),
        Column::real("range_rate", "m/s", Limits::Finite),
        sigma("sigma_x", "m"),
        sigma("sigma_y", "m"),
        sigma("sigma_z", "m"),
        sigma("sigma_range", "m"),
        sigma("sigma_bearing", "rad"),
        sigma("sigma_range_rate", "m/s"),
        length("sensor_x"),
        length("sensor_y"),
        length("sensor_z"),
        speed("sensor_vx"),
        speed("sensor_vy"),
        speed("sensor_vz"),
        Column::text("identity"),
        Column::text("truth"),
    ]
}

impl Layout for Detections {
    const TABLE: &'static str = "detections";
    const LISTS: bool = true;

    fn foreign_columns() -> Vec<Column> {
        ["latitude", "longitude"].map(|name| Column::real(name, "rad", Limits::Finite)).to_vec()
    }

    fn columns(_metadata: &Metadata) -> Vec<Column> {
        detection_columns()
    }

    fn metadata(&self) -> Metadata {
        Metadata { description: self.description.clone(), ..Metadata::new(Self::TABLE, self.origin) }
    }

    fn fill(&self, sheet: &mut Sheet, file: &Arc<str>) -> Result<(), DataError> {
        let mut ids = HashSet::new();
        for (number, scan) in self.scans.iter().enumerate() {
            if scan.detections.is_empty() {
                fill_row(sheet, number as u64, scan, None);
            }
            for detection in &scan.detections {
                if !ids.insert(detection.id) {
                    return Err(repeated(sheet.place(file, sheet.len()), detection.id));
                }
                fill_row(sheet, number as u64, scan, Some(detection));
            }
        }
        Ok(())
    }

    fn from_sheet(
        sheet: &Sheet,
        metadata: Metadata,
        context: &Context<'_>,
        remarks: &mut Remarks,
    ) -> Result<Self, DataError> {
        let (origin, frame) = local_frame(sheet, &metadata, context, remarks)?;
        let reader = Rows::new(sheet, context, frame.as_ref());
        reader.check_columns()?;
        let mut rows = Vec::with_capacity(sheet.len());
        let (mut next, mut ids) = (0, HashSet::new());
        // Detections that are numbered here are not numbered twice.
        let numbered = sheet.counts("detection").present();
        for row in 0..sheet.len() {
            let read = reader.read(row, next).and_then(|read| match &read.detection {
                Some(detection) if numbered && !ids.insert(detection.id) => {
                    Err(repeated(sheet.place(context.file, row), detection.id))
                }
                _ => Ok(read),
            });
            match read {
                Ok(read) => {
                    if let Some(detection) = &read.detection {
                        next = next.max(detection.id.saturating_add(1));
                    }
                    rows.push((read, row));
                }
                Err(error) => remarks.refuse(error)?,
            }
        }
        let nameless = (0..sheet.len()).all(|row| sheet.texts("sensor").get(row).is_none());
        if nameless && !rows.is_empty() && context.options.sensor.is_none() {
            let note =
                "no column names the sensor, which is called `sensor`; --sensor NAME calls it otherwise";
            remarks.notes.push(note.to_owned());
        }
        let empty = rows.iter().filter(|(row, _)| row.detection.is_none()).count();
        if empty > 0 && !context.ours {
            remarks.notes.push(format!(
                "{empty} of {} rows have no measurement (empty or nan); \
                 a scan of such rows alone is one in which nothing was seen",
                rows.len()
            ));
        }
        let scans = scans(rows, |row| sheet.place(context.file, row), context.options, remarks)?;
        Ok(Detections { origin, description: metadata.description, scans })
    }
}

/// The frame of a table whose positions are latitudes and longitudes.
fn local_frame(
    sheet: &Sheet,
    metadata: &Metadata,
    context: &Context<'_>,
    remarks: &mut Remarks,
) -> Result<(Option<Origin>, Option<LocalFrame>), DataError> {
    let [latitude, longitude] = ["latitude", "longitude"].map(|name| sheet.reals(name));
    if !latitude.present() || !longitude.present() {
        return Ok((metadata.origin, None));
    }
    let positions = (0..sheet.len()).filter_map(|row| on_earth(latitude.get(row)?, longitude.get(row)?).ok());
    let said = context.options.origin.or(metadata.origin);
    let Some(origin) = said.or_else(|| middle(positions)) else { return Ok((None, None)) };
    if said.is_none() {
        remarks.notes.push(format!(
            "the positions are latitudes and longitudes; x and y are east and north of {:.4}, {:.4}",
            origin.latitude.to_degrees(),
            origin.longitude.to_degrees()
        ));
    }
    Ok((Some(origin), Some(frame(origin, context.file)?)))
}

fn fill_row(sheet: &mut Sheet, number: u64, scan: &Scan, detection: Option<&Detection>) {
    let mut filler = sheet.filler();
    filler
        .real(detection.and_then(|detection| detection.time).unwrap_or(scan.time))
        .text(Some(&scan.sensor))
        .count(number)
        .count(detection.map(|detection| detection.id));
    let (xyz, polar) = match detection.map(|detection| detection.observation) {
        None => ([None; 3], [None; 3]),
        Some(Observation::Position { x, y, z }) => ([Some(x), Some(y), z], [None; 3]),
        Some(Observation::Polar { range, bearing, range_rate }) => {
            ([None; 3], [range, Some(bearing), range_rate])
        }
    };
    let noise = detection.map(|detection| detection.noise).unwrap_or_default();
    filler.reals(xyz).reals(polar);
    filler.reals([noise.x, noise.y, noise.z, noise.range, noise.bearing, noise.range_rate]);
    match scan.position {
        Some(position) => filler.reals(position.map(Some)),
        None => filler.reals([None; 3]),
    };
    match scan.velocity {
        Some(velocity) => filler.reals(velocity.map(Some)),
        None => filler.reals([None; 3]),
    };
    filler
        .text(detection.and_then(|detection| detection.identity.as_ref()))
        .text(detection.and_then(|detection| detection.truth.as_ref()));
}

fn repeated(place: Place, id: u64) -> DataError {
    DataError::Row {
        place,
        problem: format!("detection {id} is there a second time"),
        help: "number the detections of a recording without repetition, or leave the column out",
    }
}
