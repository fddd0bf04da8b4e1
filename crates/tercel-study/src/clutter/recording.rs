//! What a method sees of a scene, and what it makes of it.

use tercel_core::error::FilterError;
use tercel_core::filter::Filter;
use tercel_core::multi::{Clutter, Detection, Scan, Status, TrackId, Tracker};
use tercel_core::sensor::Measurement;
use tercel_sim::clutter::{Plot, Scenario, Scene, Sensor};

use crate::StudyError;

/// A scene as its sensor recorded it.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The truth.
    pub scene: Scene,
    /// The plots of each scan.
    pub plots: Vec<Vec<Plot>>,
    /// The same for trackers.
    pub scans: Vec<Vec<Measurement<2>>>,
    /// The number of the scene.
    pub run: u64,
}

/// An object that a method believes in after a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Reported {
    /// Number of its track.
    pub track: TrackId,
    /// `x, y, vx, vy` in m and m/s.
    pub state: [f64; 4],
}

/// A way to track the objects of a scene.
pub trait Method: Sync {
    /// The objects that it believes in after each scan.
    ///
    /// # Errors
    /// When the filter or the tracker fails.
    fn follow(&self, recording: &Recording) -> Result<Vec<Vec<Reported>>, StudyError>;
}

/// A filter in a tracker: one method. Both are made anew for each recording, from what is known of its sensor.
///
/// The output rule is the same for all: a track is reported when it was confirmed and exists with a probability of one half
/// at least. No track is reported beyond what its tracker believes.
pub struct Tracked<F, T> {
    filter: F,
    tracker: T,
}

impl<F, T> Tracked<F, T> {
    /// A method from a function that makes the filter, and one that makes the tracker.
    pub fn new<A, B>(filter: F, tracker: T) -> Self
    where
        F: Fn(&Sensor) -> Result<A, FilterError>,
        T: Fn(&Recording) -> Result<B, FilterError>,
    {
        Tracked { filter, tracker }
    }
}

/// Existence from which on a confirmed track is reported.
const REPORTED: f64 = 0.5;

impl<F, T, A, B> Method for Tracked<F, T>
where
    F: Fn(&Sensor) -> Result<A, FilterError> + Sync,
    T: Fn(&Recording) -> Result<B, FilterError> + Sync,
    A: Filter<4, Measurement = Measurement<2>>,
    B: Tracker<Belief = A::Belief>,
{
    fn follow(&self, recording: &Recording) -> Result<Vec<Vec<Reported>>, StudyError> {
        let sensor = recording.scene.sensor();
        let filter = (self.filter)(&sensor)?;
        let mut tracker = (self.tracker)(recording)?;
        let detection = Detection::uniform(sensor.detection)?;
        let clutter = Clutter::per_scan(sensor.clutter, recording.scene.area())?;
        let mut all = Vec::with_capacity(recording.scans.len());
        for (step, measurements) in recording.scans.iter().enumerate() {
            let time = step as f64 * recording.scene.interval();
            let scan = Scan { time, measurements, detection: &detection, clutter: &clutter };
            tracker.step(&filter, &scan).map_err(|error| StudyError::Option(error.to_string()))?;
            let believed = tracker.tracks().iter().filter(|track| {
                matches!(track.status, Status::Confirmed | Status::Coasted) && track.existence >= REPORTED
            });
            let reported = believed
                .map(|track| Reported { track: track.id, state: filter.state(&track.belief).mean.into() });
            all.push(reported.collect());
        }
        Ok(all)
    }
}

impl Recording {
    /// Scene number `run` of a scenario.
    pub fn new(scenario: &Scenario, seed: u64, run: u64) -> Self {
        let scene = scenario.scene(seed, run);
        let plots = scene.observe(seed, run);
        let measurement = |plot: &Plot| Measurement::from(plot.position);
        let scans = plots.iter().map(|scan| scan.iter().map(measurement).collect()).collect();
        Recording { scene, plots, scans, run }
    }
}
