//! From a sensor section and a scan to a sensor and its measurements.

use std::borrow::Cow;

use nalgebra::{SMatrix, Vector2, vector};
use tercel_core::error::FilterError;
use tercel_core::multi::{Clutter, ClutterMap, Detection};
use tercel_core::sensor::{
    BearingOnly, ConvertedPolar, Measurement, Position, RangeBearing, RangeBearingRate,
};
use tercel_data::table::{self, Observation, Scan};

use crate::PipelineError;
use crate::carrier::{Carrier, Velocity};
use crate::config::{ClutterConfig, DetectionConfig, Measures, SensorConfig, SensorKind};
use crate::slant::Slant;
use crate::turns::Turns;

/// A sensor of the configuration, with what was learned of its clutter.
pub(crate) struct Station {
    pub kind: Kind,
    /// How it sees, from where it stands.
    pub detection: Detection,
    pub clutter: Clutter,
    /// Probability that a detection names its object rightly.
    pub reliability: f64,
    /// Its plots, where they are gathered while an antenna turns.
    pub turns: Option<Turns>,
    /// Where it stands unless a scan says.
    pub position: Vector2<f64>,
    carrier: Carrier,
    slant: Slant,
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
        let position: Vector2<f64> = config.position.into();
        let seen = match (config.kind, &config.detection) {
            (SensorKind::Reports, _) => Detection::reports(),
            (_, Some(table)) => detection(table).map_err(|error| within("detection", error))?,
            (_, None) => {
                detection(&DetectionConfig::default()).map_err(|error| within("detection", error))?
            }
        };
        Ok(Station {
            kind: Kind::new(&config.measures)
                .map_err(|error| within("measures", error))?
                .at(position, Velocity::NONE),
            detection: seen.at(position),
            clutter: clutter(&config.clutter).map_err(|error| within("clutter", error))?,
            reliability: config.identity.reliability.get(),
            turns: config.scans.as_ref().map(|turn| Turns::new(turn.period.get())),
            position,
            carrier: Carrier::new(config.position_deviation.get()),
            slant: Slant::new(&config.measures),
        })
    }

    /// Takes its detections as reports from now on.
    pub fn report(&mut self) {
        self.detection = Detection::reports();
    }

    /// Moves the sensor to where the scan says it is. Its velocity is that of the scan, or follows from its last places.
    pub fn move_to(&mut self, scan: &Scan) {
        let Some([x, y, z]) = scan.position else { return };
        self.position = vector![x, y];
        self.slant.sensor = z;
        let velocity = match scan.velocity {
            Some([vx, vy, _]) => Velocity { value: vector![vx, vy], deviation: 0.0 },
            None => {
                self.carrier.fix(scan.time, self.position);
                self.carrier.velocity()
            }
        };
        self.detection = std::mem::replace(&mut self.detection, Detection::reports()).at(self.position);
        self.kind = self.kind.at(self.position, velocity);
    }

    /// How it sees in a scan that looked at this sector.
    pub fn looking(&self, sector: Option<(f64, f64)>) -> Cow<'_, Detection> {
        match sector {
            Some((from, width)) => Cow::Owned(self.detection.clone().looking(from, width)),
            None => Cow::Borrowed(&self.detection),
        }
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
    /// The same sensor at another place, and in motion.
    fn at(self, place: Vector2<f64>, velocity: Velocity) -> Self {
        match self {
            Kind::Position(sensor) => Kind::Position(sensor),
            Kind::Converted(sensor) => Kind::Converted(sensor.at(place)),
            Kind::RangeBearing(sensor) => Kind::RangeBearing(sensor.at(place)),
            Kind::RangeBearingRate(sensor) => {
                let moved = sensor.at(place, velocity.value);
                Kind::RangeBearingRate(moved.with_velocity_deviation(velocity.deviation).unwrap_or(moved))
            }
            Kind::Bearing(sensor) => Kind::Bearing(sensor.at(place)),
        }
    }

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
    collect(scan, "position", |detection, age| match detection.observation {
        Observation::Position { x, y, .. } => {
            let noise = diagonal([detection.noise.x, detection.noise.y]);
            Some(Measurement { value: vector![x, y], noise, age })
        }
        Observation::Polar { .. } => None,
    })
}

/// The detections of a scan as ranges and bearings.
pub(crate) fn ranges(station: &Station, scan: &Scan) -> Result<Vec<Measurement<2>>, PipelineError> {
    collect(scan, "range and bearing", |detection, age| match detection.observation {
        Observation::Polar { range: Some(range), bearing, z, .. } => {
            let (range, noise, _) = station.slant.over_ground(range, z, &detection.noise);
            let noise = diagonal([noise.range, noise.bearing]);
            Some(Measurement { value: vector![range, bearing], noise, age })
        }
        _ => None,
    })
}

/// The detections of a scan as ranges, bearings and range rates.
pub(crate) fn range_rates(station: &Station, scan: &Scan) -> Result<Vec<Measurement<3>>, PipelineError> {
    collect(scan, "range, bearing and range rate", |detection, age| match detection.observation {
        Observation::Polar { range: Some(range), bearing, range_rate: Some(rate), z } => {
            let (range, noise, stretch) = station.slant.over_ground(range, z, &detection.noise);
            let noise = diagonal([noise.range, noise.bearing, noise.range_rate]);
            Some(Measurement { value: vector![range, bearing, rate * stretch], noise, age })
        }
        _ => None,
    })
}

/// The detections of a scan as bearings.
pub(crate) fn bearings(scan: &Scan) -> Result<Vec<Measurement<1>>, PipelineError> {
    collect(scan, "bearing", |detection, age| match detection.observation {
        Observation::Polar { bearing, .. } => {
            Some(Measurement { value: vector![bearing], noise: diagonal([detection.noise.bearing]), age })
        }
        Observation::Position { .. } => None,
    })
}

/// Measures every detection of a scan; the first that is not of the expected kind is an error, with the section that fits it.
fn collect<const M: usize>(
    scan: &Scan,
    expected: &'static str,
    measure: impl Fn(&table::Detection, f64) -> Option<Measurement<M>>,
) -> Result<Vec<Measurement<M>>, PipelineError> {
    let one = |detection: &table::Detection| {
        let age = detection.time.map_or(0.0, |time| scan.time - time);
        measure(detection, age).ok_or_else(|| PipelineError::Observation {
            time: scan.time,
            sensor: scan.sensor.to_string(),
            detection: detection.id,
            expected,
            help: section(&scan.sensor, &detection.observation),
        })
    };
    scan.detections.iter().map(one).collect()
}

/// A section for a sensor that gives such detections, to be pasted into a configuration.
fn section(sensor: &str, seen: &Observation) -> String {
    const PLANE: &str = "clutter = { uniform = { density = 1e-6 } }    # false detections per scan and m²";
    const ANGLE: &str = "clutter = { uniform = { density = 0.1 } }    # false detections per scan and rad";
    let (what, measures, clutter) = match seen {
        Observation::Position { .. } => ("positions", "{ position = { deviation = 10.0 } }    # m", PLANE),
        Observation::Polar { range: Some(_), .. } => (
            "ranges and bearings",
            "{ polar = { range_deviation = 20.0, bearing_deviation = 0.01 } }    # m, rad",
            PLANE,
        ),
        Observation::Polar { range: None, .. } => {
            ("bearings", "{ bearing = { deviation = 0.02 } }    # rad", ANGLE)
        }
    };
    format!(
        "it gives {what}; with its own numbers that is\n    [sensors.{sensor}]\n    measures = {measures}\n    {clutter}"
    )
}

/// A diagonal covariance, if all its deviations came with the detection.
fn diagonal<const M: usize>(deviations: [Option<f64>; M]) -> Option<SMatrix<f64, M, M>> {
    let mut noise = SMatrix::zeros();
    for (i, deviation) in deviations.into_iter().enumerate() {
        noise[(i, i)] = deviation? * deviation?;
    }
    Some(noise)
}
