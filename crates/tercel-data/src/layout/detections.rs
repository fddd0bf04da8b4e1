//! Columns of the detections: one row per detection, and one for each scan without any.

use std::collections::HashSet;
use std::io::BufRead;
use std::sync::Arc;

use super::header::missing_columns;
use super::{Context, Group, Layout};
use crate::column::{Column, Limits};
use crate::error::{DataError, Place};
use crate::metadata::Metadata;
use crate::ndjson::Scans;
use crate::options::ReadOptions;
use crate::remarks::Remarks;
use crate::sheet::{Cells, Sheet};
use crate::source::text;
use crate::table::{Detection, Detections, Noise, Observation, Scan};

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

    /// Lines of scans and lines of detections may both be there.
    fn from_lines(
        reader: &mut dyn BufRead,
        file: &Arc<str>,
        options: &ReadOptions,
        remarks: &mut Remarks,
    ) -> Result<Self, DataError> {
        let mut text = text(reader, file)?;
        let mut lines = Scans::new(text.reader.as_mut(), file, options.clone());
        let mut scans = Vec::new();
        let mut ids = HashSet::new();
        for scan in &mut lines {
            let scan = scan?;
            if let Some(twice) = scan.detections.iter().find(|detection| !ids.insert(detection.id)) {
                return Err(repeated(Place::whole(file), twice.id));
            }
            scans.push(scan);
        }
        let (origin, description) = (lines.origin(), lines.description());
        remarks.notes.extend(text.note());
        Ok(Detections { origin, description, scans })
    }

    fn from_sheet(sheet: &Sheet, metadata: Metadata, context: &Context<'_>) -> Result<Self, DataError> {
        let rows = Rows::new(sheet, context);
        rows.check_columns()?;
        let mut scans: Vec<Scan> = Vec::new();
        let mut last = None;
        let mut ids = HashSet::new();
        for row in 0..sheet.len() {
            let read = rows.read(row, ids.len() as u64)?;
            if let Some(detection) = &read.detection
                && !ids.insert(detection.id)
            {
                return Err(repeated(sheet.place(context.file, row), detection.id));
            }
            let number = read.scan;
            match scans.last_mut().filter(|scan| read.continues(scan, last)) {
                Some(scan) => read.join(scan, || sheet.place(context.file, row))?,
                None => scans.push(read.start()),
            }
            last = number;
        }
        Ok(Detections { origin: metadata.origin, description: metadata.description, scans })
    }
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

/// One row, read.
pub(crate) struct DetectionRow {
    pub time: f64,
    pub sensor: Arc<str>,
    /// Number of the scan, when the file numbers them.
    pub scan: Option<u64>,
    pub position: Option<[f64; 3]>,
    pub velocity: Option<[f64; 3]>,
    /// Nothing in a scan without detections.
    pub detection: Option<Detection>,
}

impl DetectionRow {
    /// True when this row belongs to `scan`, whose number in the file was `number`.
    pub fn continues(&self, scan: &Scan, number: Option<u64>) -> bool {
        self.sensor == scan.sensor
            && match (self.scan, number) {
                (Some(this), Some(last)) => this == last,
                (None, None) => self.time == scan.time,
                _ => false,
            }
    }

    /// Adds this row to the scan that it continues. Where the times differ each detection keeps its own, and the scan takes
    /// the last.
    pub fn join(mut self, scan: &mut Scan, place: impl FnOnce() -> Place) -> Result<(), DataError> {
        let problem = if self.position.is_some() && self.position != scan.position {
            "the sensor is at another place than in the row before, in the same scan".to_owned()
        } else {
            if self.time > scan.time {
                for detection in &mut scan.detections {
                    detection.time.get_or_insert(scan.time);
                }
                scan.time = self.time;
            } else if self.time < scan.time
                && let Some(detection) = &mut self.detection
            {
                detection.time = Some(self.time);
            }
            scan.detections.extend(self.detection);
            return Ok(());
        };
        let help = "a scan has one place: give the rows different numbers in the column `scan`";
        Err(DataError::Row { place: place(), problem, help })
    }

    /// The scan that begins with this row.
    pub fn start(self) -> Scan {
        let DetectionRow { time, sensor, position, velocity, detection, .. } = self;
        Scan { time, sensor, position, velocity, detections: detection.into_iter().collect() }
    }
}

/// The columns of a sheet of detections.
pub(crate) struct Rows<'a> {
    sheet: &'a Sheet,
    context: &'a Context<'a>,
    time: Cells<'a, f64>,
    sensor: Cells<'a, Arc<str>>,
    scan: Cells<'a, u64>,
    id: Cells<'a, u64>,
    /// The file has a column of detection numbers, so that every measurement has one.
    numbered: bool,
    xyz: [Cells<'a, f64>; 3],
    polar: [Cells<'a, f64>; 3],
    noise: [Cells<'a, f64>; 6],
    position: Group<'a, 2>,
    height: Cells<'a, f64>,
    velocity: Group<'a, 2>,
    climb: Cells<'a, f64>,
    identity: Cells<'a, Arc<str>>,
    truth: Cells<'a, Arc<str>>,
}

impl<'a> Rows<'a> {
    pub fn new(sheet: &'a Sheet, context: &'a Context<'a>) -> Self {
        let sigmas = ["sigma_x", "sigma_y", "sigma_z", "sigma_range", "sigma_bearing", "sigma_range_rate"];
        Rows {
            sheet,
            context,
            time: sheet.reals("time"),
            sensor: sheet.texts("sensor"),
            scan: sheet.counts("scan"),
            id: sheet.counts("detection"),
            numbered: sheet.counts("detection").present(),
            xyz: ["x", "y", "z"].map(|name| sheet.reals(name)),
            polar: ["range", "bearing", "range_rate"].map(|name| sheet.reals(name)),
            noise: sigmas.map(|name| sheet.reals(name)),
            position: Group::new(sheet, ["sensor_x", "sensor_y"]),
            height: sheet.reals("sensor_z"),
            velocity: Group::new(sheet, ["sensor_vx", "sensor_vy"]),
            climb: sheet.reals("sensor_vz"),
            identity: sheet.texts("identity"),
            truth: sheet.texts("truth"),
        }
    }

    /// One line of a stream, in which only the cells say what is there.
    pub fn of_line(sheet: &'a Sheet, context: &'a Context<'a>) -> Self {
        Rows { numbered: false, ..Rows::new(sheet, context) }
    }

    /// A table must be able to say where something was seen.
    fn check_columns(&self) -> Result<(), DataError> {
        let [x, y, _] = &self.xyz;
        if self.polar[1].present() || (x.present() && y.present()) {
            return Ok(());
        }
        let missing: &[&str] = if x.present() || y.present() {
            if x.present() { &["y"] } else { &["x"] }
        } else if self.polar[0].present() {
            &["bearing"]
        } else {
            &["x", "y"]
        };
        Err(missing_columns(self.context.file, missing, self.context.found))
    }

    /// Reads one row; a detection without a number gets `next`.
    pub fn read(&self, row: usize, next: u64) -> Result<DetectionRow, DataError> {
        let place = || self.sheet.place(self.context.file, row);
        let wrong =
            |problem: &str, help| DataError::Row { place: place(), problem: problem.to_owned(), help };
        let observation = self.observation(row).map_err(|(problem, help)| wrong(problem, help))?;
        let id = match (self.id.get(row), observation) {
            (Some(_), None) => {
                return Err(wrong("the detection has no measurement", "give x and y, or a bearing"));
            }
            (None, Some(_)) if self.numbered => {
                let help = "number all detections of the file, or leave the column `detection` out";
                return Err(wrong("the measurement has no detection number", help));
            }
            (id, _) => id.unwrap_or(next),
        };
        let [x, y, z, range, bearing, range_rate] = self.noise.map(|cells| cells.get(row));
        let noise = Noise { x, y, z, range, bearing, range_rate };
        let position = self.position.get(row, place)?;
        let velocity = self.velocity.get(row, place)?;
        Ok(DetectionRow {
            time: self.time.get(row).unwrap_or_default(),
            sensor: self.sensor(row)?,
            scan: self.scan.get(row),
            position: position.map(|[x, y]| [x, y, self.height.get(row).unwrap_or(0.0)]),
            velocity: velocity.map(|[x, y]| [x, y, self.climb.get(row).unwrap_or(0.0)]),
            detection: observation.map(|observation| Detection {
                id,
                time: None,
                observation,
                noise,
                identity: self.identity.get(row),
                truth: self.truth.get(row),
            }),
        })
    }

    fn sensor(&self, row: usize) -> Result<Arc<str>, DataError> {
        self.sensor.get(row).or_else(|| self.context.options.sensor.clone()).ok_or_else(|| {
            crate::error::Refusal::new("empty", "a name")
                .helped("fill the cell, or name the one sensor: --sensor NAME")
                .at(self.sheet.place(self.context.file, row), "sensor")
        })
    }

    /// What was measured in a row, if anything; otherwise what is wrong, and what helps.
    fn observation(&self, row: usize) -> Result<Option<Observation>, (&'static str, &'static str)> {
        let [x, y, z] = self.xyz.map(|cells| cells.get(row));
        let [range, bearing, range_rate] = self.polar.map(|cells| cells.get(row));
        let position = x.is_some() || y.is_some() || z.is_some();
        let polar = range.is_some() || bearing.is_some() || range_rate.is_some();
        match (x, y, bearing) {
            _ if position && polar => {
                Err(("both a position and polar components are given", "give what the sensor measures"))
            }
            (Some(x), Some(y), _) => Ok(Some(Observation::Position { x, y, z })),
            _ if position => Err(("a position needs both x and y", "fill the other cell")),
            (_, _, Some(bearing)) => Ok(Some(Observation::Polar { range, bearing, range_rate })),
            _ if polar => Err(("a range or range rate needs a bearing", "fill the column `bearing`")),
            _ => Ok(None),
        }
    }
}
