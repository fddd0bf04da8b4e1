//! Recordings and reported tracks as canonical tables.

use std::sync::Arc;

use tercel_core::multi::Status;
use tercel_data::table::{Detection, Detections, Observation, Scan, Track, Tracks, Truth, Truths};

use super::{Recording, Reported};

/// Name of the sensor in the tables.
pub const SENSOR: &str = "radar";

fn name_of(object: usize) -> Arc<str> {
    format!("object {}", object + 1).into()
}

/// What the sensor saw.
pub fn detections(recording: &Recording) -> Detections {
    let sensor: Arc<str> = SENSOR.into();
    let mut id = 0;
    let mut scans = Vec::with_capacity(recording.plots.len());
    for (step, plots) in recording.plots.iter().enumerate() {
        let mut detections = Vec::with_capacity(plots.len());
        for plot in plots {
            let observation = Observation::Position { x: plot.position.x, y: plot.position.y, z: None };
            detections.push(Detection { truth: plot.object.map(name_of), ..Detection::new(id, observation) });
            id += 1;
        }
        let time = step as f64 * recording.scene.interval();
        scans.push(Scan::new(time, sensor.clone(), detections));
    }
    Detections { scans, ..Detections::default() }
}

/// Where the objects were.
pub fn truths(recording: &Recording) -> Truths {
    let mut rows = Vec::new();
    for step in 0..recording.scene.steps() {
        rows.extend(recording.scene.present(step).map(|(object, state)| Truth {
            time: step as f64 * recording.scene.interval(),
            object: name_of(object),
            position: [state[0], state[1]],
            z: None,
            velocity: Some([state[2], state[3]]),
            extent: None,
        }));
    }
    Truths { origin: None, rows }
}

/// What a method reported, with `first` as the number of its first track.
pub fn tracks(recording: &Recording, reported: &[Vec<Reported>], first: u64) -> Tracks {
    let sensor: Arc<str> = SENSOR.into();
    let mut rows = Vec::new();
    for (step, found) in reported.iter().enumerate() {
        rows.extend(found.iter().map(|track| Track {
            time: step as f64 * recording.scene.interval(),
            sensor: sensor.clone(),
            track: first + track.track,
            status: Status::Confirmed,
            existence: 1.0,
            state: track.state.to_vec(),
            covariance: Vec::new(),
            modes: Vec::new(),
            extent: None,
            altitude: None,
            identity: None,
            detection: None,
        }));
    }
    let labels = ["x", "y", "vx", "vy"].map(str::to_owned).to_vec();
    Tracks { origin: None, labels, modes: Vec::new(), rows }
}
