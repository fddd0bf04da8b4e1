//! Scans and detections as columns.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;
use tercel_data::table::{Detection, Detections, Observation, Scan};

use super::SensorNote;
use super::budget::stride;
use crate::report::number::{Id, Number};

/// Sensors, scans and detections of a recording, in columns that follow each other scan by scan.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub(super) struct Plots {
    sensors: Vec<SensorData>,
    scans: ScanColumns,
    detections: DetectionColumns,
    /// Names that `detections.truth` points to.
    objects: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct SensorData {
    name: String,
    count: usize,
}

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
struct ScanColumns {
    t: Vec<Number>,
    /// Index of the sensor.
    s: Vec<usize>,
    /// How many of the detections that follow belong to the scan.
    n: Vec<usize>,
    /// Position of the sensor.
    x: Vec<Number>,
    y: Vec<Number>,
}

/// Columns without any known value are left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
struct DetectionColumns {
    id: Vec<Id>,
    x: Vec<Number>,
    y: Vec<Number>,
    /// Bearing of detections that have no range: they are drawn as rays.
    #[serde(skip_serializing_if = "unknown")]
    bearing: Vec<Number>,
    #[serde(skip_serializing_if = "unknown")]
    rate: Vec<Number>,
    #[serde(skip_serializing_if = "nobody")]
    truth: Vec<Option<usize>>,
}

fn unknown(column: &[Number]) -> bool {
    column.iter().all(|value| !value.is_known())
}

fn nobody(column: &[Option<usize>]) -> bool {
    column.iter().all(Option::is_none)
}

impl Plots {
    /// Takes the scans in the order of time, and an even share of the detections when there are more than `limit`.
    pub(super) fn of(
        detections: &Detections,
        notes: &[SensorNote],
        start: f64,
        limit: usize,
        remarks: &mut Vec<String>,
    ) -> Plots {
        let total: usize = detections.scans.iter().map(|scan| scan.detections.len()).sum();
        let stride = stride(total, limit);
        let mut scans: Vec<&Scan> = detections.scans.iter().filter(|scan| scan.time.is_finite()).collect();
        scans.sort_by(|a, b| a.time.total_cmp(&b.time));
        let mut filling = Filling { stride, ..Filling::default() };
        for scan in scans {
            filling.scan(scan, notes, start);
        }
        let timeless = detections.scans.iter().filter(|scan| !scan.time.is_finite());
        let lost = filling.lost + timeless.map(|scan| scan.detections.len()).sum::<usize>();
        if stride > 1 {
            remarks.push(format!("One in {stride} of {total} detections is drawn."));
        }
        if lost > 0 {
            remarks.push(format!("{lost} detections without a finite time or position are not drawn."));
        }
        filling.plots
    }
}

/// The columns while they grow.
#[derive(Default)]
struct Filling<'a> {
    plots: Plots,
    sensors: BTreeMap<&'a str, usize>,
    objects: HashMap<&'a str, usize>,
    stride: usize,
    seen: usize,
    lost: usize,
}

impl<'a> Filling<'a> {
    fn scan(&mut self, scan: &'a Scan, notes: &[SensorNote], start: f64) {
        let note = notes.iter().find(|note| *note.sensor == *scan.sensor);
        let sensor = self.sensor(&scan.sensor, note);
        let position = scan.position.map(|[x, y, _]| [x, y]).or(note.and_then(|note| note.position));
        let before = self.plots.detections.id.len();
        for detection in &scan.detections {
            self.detection(detection, position.unwrap_or_default());
        }
        self.plots.sensors[sensor].count += scan.detections.len();
        // Of a thinned recording, scans of which nothing is drawn would only take room.
        if self.stride > 1 && self.plots.detections.id.len() == before {
            return;
        }
        let columns = &mut self.plots.scans;
        columns.t.push(Number::milli(scan.time - start));
        columns.s.push(sensor);
        columns.n.push(self.plots.detections.id.len() - before);
        columns.x.push(Number::optional(position.map(|position| position[0])));
        columns.y.push(Number::optional(position.map(|position| position[1])));
    }

    fn sensor(&mut self, name: &'a str, note: Option<&SensorNote>) -> usize {
        let sensors = &mut self.plots.sensors;
        *self.sensors.entry(name).or_insert_with(|| {
            let label = note.and_then(|note| note.label.as_deref()).unwrap_or(name);
            sensors.push(SensorData { name: label.to_owned(), count: 0 });
            sensors.len() - 1
        })
    }

    fn detection(&mut self, detection: &'a Detection, sensor: [f64; 2]) {
        let place = Place::of(&detection.observation, sensor);
        if !(place.x.is_known() && place.y.is_known()) {
            self.lost += 1;
            return;
        }
        self.seen += 1;
        if !(self.seen - 1).is_multiple_of(self.stride) {
            return;
        }
        let objects = &mut self.plots.objects;
        let truth = detection.truth.as_deref().map(|name| {
            *self.objects.entry(name).or_insert_with(|| {
                objects.push(name.to_owned());
                objects.len() - 1
            })
        });
        let columns = &mut self.plots.detections;
        columns.id.push(Id(detection.id));
        columns.x.push(place.x);
        columns.y.push(place.y);
        columns.bearing.push(place.bearing);
        columns.rate.push(place.rate);
        columns.truth.push(truth);
    }
}

/// Where a detection is drawn. One without a range starts at its sensor and has a bearing.
struct Place {
    x: Number,
    y: Number,
    bearing: Number,
    rate: Number,
}

impl Place {
    fn of(observation: &Observation, sensor: [f64; 2]) -> Place {
        let at = |x, y, bearing, rate| Place {
            x: Number::milli(x),
            y: Number::milli(y),
            bearing: Number::rounded(bearing, 5),
            rate: Number::optional(rate),
        };
        match *observation {
            Observation::Position { x, y, .. } => at(x, y, f64::NAN, None),
            Observation::Polar { range: Some(range), bearing, range_rate, .. } => {
                let (sine, cosine) = bearing.sin_cos();
                at(sensor[0] + range * cosine, sensor[1] + range * sine, f64::NAN, range_rate)
            }
            // Without a finite bearing there is no ray to draw: the sine is then NaN, and so is the place.
            Observation::Polar { range: None, bearing, range_rate, .. } => {
                at(sensor[0] + 0.0 * bearing.sin(), sensor[1], bearing, range_rate)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(time: f64, observations: &[Observation]) -> Scan {
        let detection = |(id, &observation): (usize, &Observation)| Detection::new(id as u64, observation);
        Scan {
            time,
            sensor: "radar".into(),
            position: Some([100.0, 50.0, 0.0]),
            velocity: None,
            detections: observations.iter().enumerate().map(detection).collect(),
        }
    }

    fn plots(scans: Vec<Scan>, limit: usize) -> (serde_json::Value, Vec<String>) {
        let mut remarks = Vec::new();
        let plots = Plots::of(&Detections { scans, ..Detections::default() }, &[], 0.0, limit, &mut remarks);
        (serde_json::to_value(plots).unwrap(), remarks)
    }

    #[test]
    fn polar_detections_are_placed_around_their_sensor() {
        let north = Observation::Polar {
            range: Some(10.0),
            bearing: std::f64::consts::FRAC_PI_2,
            range_rate: Some(-2.0),
            z: None,
        };
        let ray = Observation::Polar { range: None, bearing: 1.0, range_rate: None, z: None };
        let (json, remarks) = plots(vec![scan(0.0, &[north, ray])], 100);
        assert_eq!(json["detections"]["x"], serde_json::json!([100, 100]));
        assert_eq!(json["detections"]["y"], serde_json::json!([60, 50]));
        assert_eq!(json["detections"]["bearing"], serde_json::json!([null, 1]));
        assert_eq!(json["detections"]["rate"], serde_json::json!([-2, null]));
        assert!(remarks.is_empty());
    }

    #[test]
    fn what_cannot_be_placed_is_counted() {
        let lost = Observation::Position { x: f64::NAN, y: 0.0, z: None };
        let ray = Observation::Polar { range: None, bearing: f64::INFINITY, range_rate: None, z: None };
        let fine = Observation::Position { x: 1.0, y: 0.0, z: None };
        let (json, remarks) = plots(vec![scan(0.0, &[lost, fine, ray]), scan(f64::NAN, &[fine])], 100);
        assert_eq!(json["scans"]["n"], serde_json::json!([1]));
        assert_eq!(remarks, ["3 detections without a finite time or position are not drawn."]);
    }

    #[test]
    fn too_many_detections_are_thinned_evenly_and_the_page_says_so() {
        let fine = Observation::Position { x: 1.0, y: 0.0, z: None };
        let (json, remarks) = plots((0..50).map(|k| scan(k as f64, &[fine; 3])).collect(), 60);
        assert_eq!(json["detections"]["x"].as_array().unwrap().len(), 50);
        assert_eq!(json["sensors"][0]["count"], 150);
        assert_eq!(remarks, ["One in 3 of 150 detections is drawn."]);
    }
}
