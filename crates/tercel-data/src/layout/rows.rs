//! Rows of detections, one by one.

use std::sync::Arc;

use tercel_core::geo::{Geodetic, LocalFrame};

use super::header::missing_columns;
use super::{Context, Group};
use crate::error::{DataError, Place, Refusal};
use crate::geographic::on_earth;
use crate::sheet::{Cells, Sheet};
use crate::table::{Detection, Noise, Observation, Scan};

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
            // A row without a detection says nothing of the time at which the others were made.
            if scan.detections.is_empty() {
                scan.time = if self.detection.is_some() { self.time } else { scan.time.max(self.time) };
            } else if self.detection.is_none() {
                return Ok(());
            } else if self.time > scan.time {
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
    /// The name of a sensor that has none.
    nameless: Arc<str>,
    scan: Cells<'a, u64>,
    id: Cells<'a, u64>,
    /// The table has a column of detection numbers, so that every measurement has one.
    numbered: bool,
    xyz: [Cells<'a, f64>; 3],
    polar: [Cells<'a, f64>; 3],
    noise: [Cells<'a, f64>; 6],
    position: Group<'a, 2>,
    height: Cells<'a, f64>,
    velocity: Group<'a, 2>,
    climb: Cells<'a, f64>,
    geographic: [Cells<'a, f64>; 2],
    frame: Option<&'a LocalFrame>,
    identity: Cells<'a, Arc<str>>,
    truth: Cells<'a, Arc<str>>,
}

impl<'a> Rows<'a> {
    /// `frame` is that of positions in latitude and longitude.
    pub fn new(sheet: &'a Sheet, context: &'a Context<'a>, frame: Option<&'a LocalFrame>) -> Self {
        let sigmas = ["sigma_x", "sigma_y", "sigma_z", "sigma_range", "sigma_bearing", "sigma_range_rate"];
        Rows {
            sheet,
            context,
            time: sheet.reals("time"),
            sensor: sheet.texts("sensor"),
            nameless: "sensor".into(),
            scan: sheet.counts("scan"),
            id: sheet.counts("detection"),
            numbered: sheet.counts("detection").present() && !context.keyed,
            xyz: ["x", "y", "z"].map(|name| sheet.reals(name)),
            polar: ["range", "bearing", "range_rate"].map(|name| sheet.reals(name)),
            noise: sigmas.map(|name| sheet.reals(name)),
            position: Group::new(sheet, ["sensor_x", "sensor_y"]),
            height: sheet.reals("sensor_z"),
            velocity: Group::new(sheet, ["sensor_vx", "sensor_vy"]),
            climb: sheet.reals("sensor_vz"),
            geographic: ["latitude", "longitude"].map(|name| sheet.reals(name)),
            frame,
            identity: sheet.texts("identity"),
            truth: sheet.texts("truth"),
        }
    }

    /// A table must be able to say where something was seen.
    pub fn check_columns(&self) -> Result<(), DataError> {
        let ([x, y, _], [latitude, longitude]) = (&self.xyz, &self.geographic);
        let pair = |missing: &'static str, other: &Cells<'_, f64>| other.present().then_some(missing);
        let missing: &[&str] = if self.context.keyed
            || self.polar[1].present()
            || (x.present() && y.present())
            || (latitude.present() && longitude.present())
        {
            return Ok(());
        } else if let Some(missing) = pair("y", x).or(pair("x", y)) {
            &[missing]
        } else if let Some(missing) = pair("longitude", latitude).or(pair("latitude", longitude)) {
            &[missing]
        } else if self.polar[0].present() {
            &["bearing"]
        } else {
            &["x", "y"]
        };
        Err(missing_columns(&Place::whole(self.context.file), missing, self.context.found))
    }

    /// Reads one row; a detection without a number gets `next`.
    pub fn read(&self, row: usize, next: u64) -> Result<DetectionRow, DataError> {
        let place = || self.sheet.place(self.context.file, row);
        let wrong =
            |problem: &str, help| DataError::Row { place: place(), problem: problem.to_owned(), help };
        let geographic = self.on_earth(row)?;
        let observation = match geographic {
            Some(position) => Some(position),
            None => self.observation(row).map_err(|(problem, help)| wrong(problem, help))?,
        };
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

    /// A position in latitude and longitude, brought into the local frame.
    fn on_earth(&self, row: usize) -> Result<Option<Observation>, DataError> {
        if !self.geographic.iter().all(Cells::present) {
            return Ok(None);
        }
        let place = || self.sheet.place(self.context.file, row);
        let (latitude, longitude) = match self.geographic.map(|cells| cells.get(row)) {
            [Some(latitude), Some(longitude)] => (latitude, longitude),
            [None, None] => return Ok(None),
            _ => {
                let problem = "a position needs both latitude and longitude".to_owned();
                return Err(DataError::Row { place: place(), problem, help: "fill the other cell" });
            }
        };
        let (latitude, longitude) =
            on_earth(latitude, longitude).map_err(|(column, refusal)| refusal.at(place(), column))?;
        let Some(frame) = self.frame else { return Ok(None) };
        let altitude = self.xyz[2].get(row);
        let there = Geodetic { latitude, longitude, altitude: altitude.unwrap_or(0.0) };
        let enu = frame.to_enu(&there);
        Ok(Some(Observation::Position { x: enu.x, y: enu.y, z: altitude.map(|_| enu.z) }))
    }

    fn sensor(&self, row: usize) -> Result<Arc<str>, DataError> {
        match (self.sensor.get(row), &self.context.options.sensor) {
            (Some(sensor), _) => Ok(sensor),
            (None, Some(sensor)) => Ok(Arc::clone(sensor)),
            (None, None) if !self.sensor.present() || self.context.keyed => Ok(Arc::clone(&self.nameless)),
            (None, None) => Err(Refusal::new("empty", "a name")
                .helped("fill the cell, or name the one sensor: --sensor NAME")
                .at(self.sheet.place(self.context.file, row), "sensor")),
        }
    }

    /// What was measured in a row, if anything; otherwise what is wrong, and what helps.
    fn observation(&self, row: usize) -> Result<Option<Observation>, (&'static str, &'static str)> {
        let [x, y, z] = self.xyz.map(|cells| cells.get(row));
        let [range, bearing, range_rate] = self.polar.map(|cells| cells.get(row));
        let position = x.is_some() || y.is_some() || z.is_some();
        let polar = range.is_some() || bearing.is_some() || range_rate.is_some();
        match (x, y, bearing) {
            _ if position && polar => Err((
                "both a position and polar components are given",
                "give what the sensor measures; --ignore NAME passes over a column",
            )),
            (Some(x), Some(y), _) => Ok(Some(Observation::Position { x, y, z })),
            _ if position => Err(("a position needs both x and y", "fill the other cell")),
            (_, _, Some(bearing)) => Ok(Some(Observation::Polar { range, bearing, range_rate })),
            _ if polar => Err(("a range or range rate needs a bearing", "fill the column `bearing`")),
            _ => Ok(None),
        }
    }
}
