//! One recording, drawn with the ellipses of every method.

use std::sync::Arc;

use tercel_core::extended::Ellipse;
use tercel_core::metric::intersection_over_union;
use tercel_core::multi::Status;
use tercel_data::table::{Detection, Detections, Noise, Observation, Scan, Track, Tracks, Truth, Truths};

use super::{Recording, StepEstimate};
use crate::StudyError;
use crate::monte_carlo::Example;
use crate::report::{Chart, Picture};

/// Name of the sensor in the tables.
const SENSOR: &str = "sensor";

/// Name of the object in the tables.
const OBJECT: &str = "object";

/// Steps that are drawn: more would hide the ellipses.
const DRAWN: usize = 200;

/// Draws the beginning of a recording: ellipses of the truth and of every method, points, and errors over
/// time.
pub(super) fn draw(
    recording: &Recording,
    title: String,
    followed: &[(&str, Vec<StepEstimate>)],
) -> Result<Example, StudyError> {
    let detections = detections(recording);
    let truths = truths(recording);
    let mut all = true_track(recording);
    let mut tracks = Vec::with_capacity(followed.len());
    for (number, (name, estimates)) in (1..).zip(followed) {
        let table = tracks_of(recording, estimates, number);
        all.rows.extend(table.rows.iter().cloned());
        tracks.push(((*name).to_owned(), table));
    }
    let mut picture = Picture::new(&detections, &all, Some(&truths), &[])?.with_track_name(0, "truth");
    for (number, (name, _)) in (1..).zip(followed) {
        picture = picture.with_track_name(number, *name);
    }
    for chart in charts(recording, followed) {
        picture = picture.with_chart(chart);
    }
    Ok(Example { title, picture, detections, truths, tracks })
}

fn time(recording: &Recording, step: usize) -> f64 {
    step as f64 * recording.ride.interval()
}

/// Every point is a detection of its own.
fn detections(recording: &Recording) -> Detections {
    let (sensor, object): (Arc<str>, Arc<str>) = (SENSOR.into(), OBJECT.into());
    let mut id = 0;
    let scans = recording.scans.iter().take(DRAWN).enumerate().map(|(step, scan)| {
        let detections = scan.points().iter().map(|point| {
            id += 1;
            Detection {
                id: id - 1,
                observation: Observation::Position { x: point.x, y: point.y, z: None },
                noise: Noise::default(),
                truth: Some(object.clone()),
            }
        });
        let detections = detections.collect();
        Scan { time: time(recording, step), sensor: sensor.clone(), position: None, detections }
    });
    Detections { origin: None, scans: scans.collect() }
}

fn extent_of(ellipse: &Ellipse) -> [f64; 3] {
    [ellipse.axes.x, ellipse.axes.y, ellipse.angle]
}

fn truths(recording: &Recording) -> Truths {
    let object: Arc<str> = OBJECT.into();
    let row = |(step, state): (usize, &nalgebra::Vector4<f64>)| Truth {
        time: time(recording, step),
        object: object.clone(),
        position: [state.x, state.y],
        z: None,
        velocity: Some([state.z, state.w]),
        extent: Some(extent_of(&recording.ride.ellipse(step))),
    };
    Truths { origin: None, rows: recording.ride.states().iter().take(DRAWN).enumerate().map(row).collect() }
}

fn row(recording: &Recording, step: usize, track: u64, place: [f64; 2], extent: Option<[f64; 3]>) -> Track {
    Track {
        time: time(recording, step),
        sensor: SENSOR.into(),
        track,
        status: Status::Confirmed,
        existence: 1.0,
        state: place.to_vec(),
        covariance: Vec::new(),
        modes: Vec::new(),
        extent,
        detection: None,
    }
}

fn table(rows: Vec<Track>) -> Tracks {
    Tracks { labels: ["x", "y"].map(str::to_owned).to_vec(), rows, ..Tracks::default() }
}

/// The truth as a track: the picture draws the ellipses of tracks.
fn true_track(recording: &Recording) -> Tracks {
    let states = recording.ride.states().iter().take(DRAWN).enumerate();
    let rows = states.map(|(step, state)| {
        row(recording, step, 0, [state.x, state.y], Some(extent_of(&recording.ride.ellipse(step))))
    });
    table(rows.collect())
}

fn ellipse(estimate: &StepEstimate) -> Option<Ellipse> {
    Ellipse::from_matrix([estimate.mean.x, estimate.mean.y].into(), &estimate.extent).ok()
}

fn tracks_of(recording: &Recording, estimates: &[StepEstimate], track: u64) -> Tracks {
    let rows = estimates.iter().take(DRAWN).enumerate().map(|(step, estimate)| {
        let extent = ellipse(estimate).as_ref().map(extent_of);
        row(recording, step, track, [estimate.mean.x, estimate.mean.y], extent)
    });
    table(rows.collect())
}

fn charts(recording: &Recording, followed: &[(&str, Vec<StepEstimate>)]) -> Vec<Chart> {
    let steps = recording.scans.len().min(DRAWN);
    let times: Vec<f64> = (0..steps).map(|step| time(recording, step)).collect();
    let mut error = Chart::over_time("Distance from the truth", "m", times.clone());
    let mut overlap = Chart::over_time("Intersection over union", "", times);
    for (name, estimates) in followed {
        let pairs = || estimates.iter().take(steps).enumerate();
        let distances = pairs().map(|(step, estimate)| {
            let state = &recording.ride.states()[step];
            (estimate.mean.x - state.x).hypot(estimate.mean.y - state.y)
        });
        error = error.with_part(*name, distances.collect());
        let overlaps = pairs().map(|(step, estimate)| {
            let truth = recording.ride.ellipse(step);
            ellipse(estimate).map_or(f64::NAN, |found| intersection_over_union(&found, &truth))
        });
        overlap = overlap.with_part(*name, overlaps.collect());
    }
    vec![error, overlap]
}
