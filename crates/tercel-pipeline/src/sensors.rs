//! From a sensor section and a scan to a sensor and its measurements.

use nalgebra::{SMatrix, Vector2, vector};
use tercel_core::error::FilterError;
use tercel_core::multi::{Clutter, ClutterMap, Detection};
use tercel_core::sensor::{
    BearingOnly, ConvertedPolar, Measurement, Position, RangeBearing, RangeBearingRate,
};
use tercel_data::table::{self, Observation, Scan};

use crate::PipelineError;
use crate::config::{ClutterConfig, DetectionConfig, Measures, SensorConfig};

/// A sensor of the configuration, with what was learned of its clutter.
pub(crate) struct Station {
    pub kind: Kind,
    pub detection: Detection,
    pub clutter: Clutter,
    /// Where it stands unless a scan says.
    pub position: Vector2<f64>,
    /// Where it stood in the last scan, for its velocity.
    pub last: Option<(f64, Vector2<f64>)>,
}

/// What it measures.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Position(Position<2>),
    Converted(ConvertedPolar),
    RangeBearing(RangeBearing),
    RangeBearingRate(RangeBearingRate),
    Bearing(BearingOnly),
}

impl Station {
    pub fn new(name: &str, config: &SensorConfig) -> Result<Self, PipelineError> {
        let key = format!("sensors.{name}");
        let within =
            |part: &str, error: FilterError| PipelineError::parameter(&format!("{key}.{part}"), &error);
        Ok(Station {
            kind: Kind::new(&config.measures).map_err(|error| within("measures", error))?,
            detection: detection(&config.detection).map_err(|error| within("detection", error))?,
            clutter: clutter(&config.clutter).map_err(|error| within("clutter", error))?,
            position: config.position.into(),
            last: None,
        })
    }

    /// Moves the sensor to where the scan says it is.
    pub fn move_to(&mut self, scan: &Scan) {
        let Some([x, y, _]) = scan.position else { return };
        self.position = vector![x, y];
        let velocity = match self.last {
            Some((time, position)) if scan.time > time => (self.position - position) / (scan.time - time),
            _ => Vector2::zeros(),
        };
        self.last = Some((scan.time, self.position));
        self.kind = match self.kind {
            Kind::Position(sensor) => Kind::Position(sensor),
            Kind::Converted(sensor) => Kind::Converted(sensor.at(self.position)),
            Kind::RangeBearing(sensor) => Kind::RangeBearing(sensor.at(self.position)),
            Kind::RangeBearingRate(sensor) => Kind::RangeBearingRate(sensor.at(self.position, velocity)),
            Kind::Bearing(sensor) => Kind::Bearing(sensor.at(self.position)),
        };
    }

    /// How likely it sees an object, from where it stands.
    pub fn detection(&self) -> Detection {
        self.detection.clone().at(self.position)
    }
}

fn detection(config: &DetectionConfig) -> Result<Detection, FilterError> {
    match config {
        DetectionConfig::Uniform(probability) => Detection::uniform(probability.get()),
        DetectionConfig::ByRange(table) => Detection::by_range(
            table.iter().map(|(range, probability)| (range.get(), probability.get())).collect(),
        ),
    }
}

fn clutter(config: &ClutterConfig) -> Result<Clutter, FilterError> {
    Ok(match config {
        ClutterConfig::Uniform(uniform) => Clutter::Uniform(uniform.density.get()),
        ClutterConfig::Map(map) => {
            Clutter::Map(ClutterMap::new(map.cell.get(), map.background.get(), map.memory.get())?)
        }
    })
}

impl Kind {
    fn new(measures: &Measures) -> Result<Self, FilterError> {
        Ok(match measures {
            Measures::Position(position) => {
                Kind::Position(Position::new(position.deviation.get())?.with_lag(position.lag.get()))
            }
            Measures::Polar(polar) => {
                let (range, bearing) = (polar.range_deviation.get(), polar.bearing_deviation.get());
                match polar.range_rate_deviation {
                    Some(rate) => Kind::RangeBearingRate(RangeBearingRate::new(range, bearing, rate.get())?),
                    None if polar.convert => {
                        Kind::Converted(ConvertedPolar::new(range, bearing)?.with_lag(polar.lag.get()))
                    }
                    None => Kind::RangeBearing(RangeBearing::new(range, bearing)?),
                }
            }
            Measures::Bearing(bearing) => {
                let sensor = BearingOnly::new(bearing.deviation.get())?;
                Kind::Bearing(match bearing.start_range {
                    Some(range) => {
                        let deviation = bearing.start_range_deviation.map_or(0.5 * range.get(), |d| d.get());
                        sensor.with_range(range.get(), deviation)?
                    }
                    None => sensor,
                })
            }
        })
    }
}

/// The detections of a scan as positions.
pub(crate) fn positions(scan: &Scan) -> Result<Vec<Measurement<2>>, PipelineError> {
    collect(scan, "position", "polar", |detection| match detection.observation {
        Observation::Position { x, y, .. } => {
            let noise = diagonal([detection.noise.x, detection.noise.y]);
            Some(Measurement { value: vector![x, y], noise, age: 0.0 })
        }
        Observation::Polar { .. } => None,
    })
}

/// The detections of a scan as ranges and bearings.
pub(crate) fn ranges(scan: &Scan) -> Result<Vec<Measurement<2>>, PipelineError> {
    collect(scan, "range and bearing", "position", |detection| match detection.observation {
        Observation::Polar { range: Some(range), bearing, .. } => {
            let noise = diagonal([detection.noise.range, detection.noise.bearing]);
            Some(Measurement { value: vector![range, bearing], noise, age: 0.0 })
        }
        _ => None,
    })
}

/// The detections of a scan as ranges, bearings and range rates.
pub(crate) fn range_rates(scan: &Scan) -> Result<Vec<Measurement<3>>, PipelineError> {
    collect(scan, "range, bearing and range rate", "position", |detection| match detection.observation {
        Observation::Polar { range: Some(range), bearing, range_rate: Some(rate) } => {
            let noise =
                diagonal([detection.noise.range, detection.noise.bearing, detection.noise.range_rate]);
            Some(Measurement { value: vector![range, bearing, rate], noise, age: 0.0 })
        }
        _ => None,
    })
}

/// The detections of a scan as bearings.
pub(crate) fn bearings(scan: &Scan) -> Result<Vec<Measurement<1>>, PipelineError> {
    collect(scan, "bearing", "position", |detection| match detection.observation {
        Observation::Polar { bearing, .. } => Some(Measurement {
            value: vector![bearing],
            noise: diagonal([detection.noise.bearing]),
            age: 0.0,
        }),
        Observation::Position { .. } => None,
    })
}

/// Measures every detection of a scan; the first that is not of the expected kind is an error, with a hint at the kind of
/// sensor that the configuration may have meant.
fn collect<const M: usize>(
    scan: &Scan,
    expected: &'static str,
    instead: &str,
    measure: impl Fn(&table::Detection) -> Option<Measurement<M>>,
) -> Result<Vec<Measurement<M>>, PipelineError> {
    let one = |detection: &table::Detection| {
        measure(detection).ok_or_else(|| PipelineError::Observation {
            time: scan.time,
            sensor: scan.sensor.to_string(),
            detection: detection.id,
            expected,
            help: format!(
                "say what it measures: [sensors.{}] measures = {{ {instead} = {{ .. }} }}",
                scan.sensor
            ),
        })
    };
    scan.detections.iter().map(one).collect()
}

/// A diagonal covariance, if all its deviations came with the detection.
fn diagonal<const M: usize>(deviations: [Option<f64>; M]) -> Option<SMatrix<f64, M, M>> {
    let mut noise = SMatrix::zeros();
    for (i, deviation) in deviations.into_iter().enumerate() {
        noise[(i, i)] = deviation? * deviation?;
    }
    Some(noise)
}
