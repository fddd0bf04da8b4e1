//! Trackers of many objects on cells of points.
//!
//! | method | one object | many objects |
//! |---|---|---|
//! | `giw-phd` | random matrix with a rate of points | PHD |
//! | `giw-nearest-neighbour` | the same | global nearest neighbour |
//! | `rmmnet-phd` | random matrix with a learned memory, and the same rate | PHD |
//! | `rmmnet-nearest-neighbour` | the same | global nearest neighbour |
//! | `point-phd` | Kalman filter on the means of the cells | PHD |

use std::sync::Arc;

use nalgebra::{Matrix2, Vector2};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{
    Evolution, GaussianInverseWishart, InverseWishart, Points, RandomMatrix, Rate, Rule, Scattering,
    distance_partition,
};
use tercel_core::filter::{Filter, Kalman};
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{
    Clutter, Detection, NearestNeighbour, NearestNeighbourConfig, Phd, PhdConfig, Scan, Status, Track,
    Tracker,
};
use tercel_core::sensor::{Measurement, Position};
use tercel_neural::filter::{RmmNet, RmmNetBelief, RmmNetwork};
use tercel_neural::shipped;
use tercel_sim::extended::Crossing;

use crate::StudyError;

/// Names of all methods.
pub const METHODS: [&str; 5] =
    ["giw-phd", "giw-nearest-neighbour", "rmmnet-phd", "rmmnet-nearest-neighbour", "point-phd"];

/// A confirmed object after a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Number of its track.
    pub track: u64,
    /// Its centre, m.
    pub place: Vector2<f64>,
    /// Its extent matrix (m²), if the method has one.
    pub extent: Option<Matrix2<f64>>,
}

/// A way to follow the objects of a scene.
pub trait Method: Sync {
    /// The confirmed objects after each scan.
    ///
    /// # Errors
    /// When a tracker refuses a scan.
    fn follow(&self, scans: &[Vec<Vector2<f64>>]) -> Result<Vec<Vec<Report>>, FilterError>;
}

/// What is known of the sensor.
#[derive(Debug, Clone)]
struct Sensor {
    noise: Matrix2<f64>,
    points: f64,
    detection: Detection,
    clutter: Clutter,
}

/// Points closer than this are of one cell, m: wider than the gaps within objects.
const DISTANCE: f64 = 4.5;

/// Density of the white acceleration that is expected, m²/s³.
const DENSITY: f64 = 0.1;

/// Deviation of the velocity of a new object, m/s per axis.
const SPEED: f64 = 8.0;

/// The method of that name for a scene.
pub(super) fn method(name: &str, scene: &Crossing) -> Result<Box<dyn Method>, StudyError> {
    let scatterers = scene.scatterers();
    let sensor = Sensor {
        noise: scatterers.noise(),
        points: scatterers.mean(),
        detection: Detection::uniform(scene.detection())?,
        clutter: Clutter::per_scan(scene.clutter_density() * scene.area(), scene.area())?,
    };
    Ok(match name {
        "giw-phd" => Box::new(Cells { sensor, phd: true }),
        "giw-nearest-neighbour" => Box::new(Cells { sensor, phd: false }),
        "rmmnet-phd" => Box::new(Remembering { filter: remembering(&sensor)?, sensor, phd: true }),
        "rmmnet-nearest-neighbour" => {
            Box::new(Remembering { filter: remembering(&sensor)?, sensor, phd: false })
        }
        "point-phd" => Box::new(Means { sensor }),
        _ => {
            let known = METHODS.join(", ");
            return Err(StudyError::UnknownMethod { study: "extended-scene", name: name.to_owned(), known });
        }
    })
}

fn motion() -> ConstantVelocity {
    ConstantVelocity::new(DENSITY).with_speed(SPEED)
}

/// Random matrices on cells.
struct Cells {
    sensor: Sensor,
    phd: bool,
}

impl Cells {
    fn filter(&self) -> Result<RandomMatrix<ConstantVelocity>, FilterError> {
        let scattering = Scattering::uniform(self.sensor.noise)?;
        let prior = InverseWishart::new(Matrix2::identity() * 36.0, 4.0)?;
        let filter =
            RandomMatrix::new(motion(), scattering, prior, Evolution::forget(10.0)?, Rule::Distorted);
        filter.with_rate(Rate::new(self.sensor.points, 3.0)?, 20.0)
    }
}

impl Method for Cells {
    fn follow(&self, scans: &[Vec<Vector2<f64>>]) -> Result<Vec<Vec<Report>>, FilterError> {
        let filter = self.filter()?;
        let cells = |scan: &Vec<Vector2<f64>>| distance_partition(scan, DISTANCE);
        type Belief = GaussianInverseWishart<4>;
        let read = |belief: &Belief| {
            let place = Vector2::new(belief.state.mean[0], belief.state.mean[1]);
            (place, Some(filter.extent_of(belief)))
        };
        if self.phd {
            let tracker = Phd::<Belief>::new(PhdConfig::default())?;
            follow(tracker, &filter, &self.sensor, scans, cells, read)
        } else {
            let tracker = NearestNeighbour::<Belief>::new(NearestNeighbourConfig::default())?;
            follow(tracker, &filter, &self.sensor, scans, cells, read)
        }
    }
}

/// Random matrices with a learned memory on cells.
struct Remembering {
    filter: RmmNet,
    sensor: Sensor,
    phd: bool,
}

/// The filter with the model that comes with Tercel for such objects.
fn remembering(sensor: &Sensor) -> Result<RmmNet, StudyError> {
    let network = Arc::new(RmmNetwork::from_model(&shipped::model("rmmnet-crossing")?)?);
    let filter = RmmNet::new(network, Scattering::uniform(sensor.noise)?);
    Ok(filter.with_rate(Rate::new(sensor.points, 3.0)?, 20.0)?)
}

impl Method for Remembering {
    fn follow(&self, scans: &[Vec<Vector2<f64>>]) -> Result<Vec<Vec<Report>>, FilterError> {
        let cells = |scan: &Vec<Vector2<f64>>| distance_partition(scan, DISTANCE);
        let read = |belief: &RmmNetBelief| {
            let estimate = self.filter.estimate(belief);
            (estimate.mean.xy(), estimate.extent)
        };
        if self.phd {
            let tracker = Phd::<RmmNetBelief>::new(PhdConfig::default())?;
            follow(tracker, &self.filter, &self.sensor, scans, cells, read)
        } else {
            let tracker = NearestNeighbour::<RmmNetBelief>::new(NearestNeighbourConfig::default())?;
            follow(tracker, &self.filter, &self.sensor, scans, cells, read)
        }
    }
}

/// Kalman filters on the means of cells.
struct Means {
    sensor: Sensor,
}

/// Deviation of the mean of a cell from the centre of its object, m.
const MEAN: f64 = 1.5;

impl Method for Means {
    fn follow(&self, scans: &[Vec<Vector2<f64>>]) -> Result<Vec<Vec<Report>>, FilterError> {
        let filter = Kalman::new(motion(), Position::<2>::new(MEAN)?);
        let tracker = Phd::<Gaussian<4>>::new(PhdConfig::default())?;
        let means = |scan: &Vec<Vector2<f64>>| {
            distance_partition(scan, DISTANCE)
                .iter()
                .map(|cell: &Points| Measurement::from(cell.mean()))
                .collect()
        };
        let read = |belief: &Gaussian<4>| (Vector2::new(belief.mean[0], belief.mean[1]), None);
        follow(tracker, &filter, &self.sensor, scans, means, read)
    }
}

/// Runs a tracker over the scans. Its beliefs are read as a centre and an extent.
fn follow<T, F, Z>(
    mut tracker: T,
    filter: &F,
    sensor: &Sensor,
    scans: &[Vec<Vector2<f64>>],
    cut: impl Fn(&Vec<Vector2<f64>>) -> Vec<Z>,
    read: impl Fn(&T::Belief) -> (Vector2<f64>, Option<Matrix2<f64>>),
) -> Result<Vec<Vec<Report>>, FilterError>
where
    T: Tracker,
    F: Filter<4, Belief = T::Belief, Measurement = Z>,
{
    let mut reports = Vec::with_capacity(scans.len());
    for (step, scan) in scans.iter().enumerate() {
        let measurements = cut(scan);
        let scan = Scan {
            time: step as f64,
            measurements: &measurements,
            detection: &sensor.detection,
            clutter: &sensor.clutter,
        };
        tracker.step(filter, &scan).map_err(|_| FilterError::NotFinite { what: "a point of the scan" })?;
        let confirmed = tracker.tracks().iter().filter(|track| track.status == Status::Confirmed);
        let report = |track: &Track<T::Belief>| {
            let (place, extent) = read(&track.belief);
            Report { track: track.id, place, extent }
        };
        reports.push(confirmed.map(report).collect());
    }
    Ok(reports)
}
