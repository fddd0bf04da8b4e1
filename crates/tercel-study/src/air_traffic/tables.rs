//! Recordings and estimates as canonical tables.

use std::sync::Arc;

use tercel_core::multi::Status;
use tercel_data::table::{Detection, Detections, Noise, Observation, Scan, Track, Tracks, Truth, Truths};

use super::{Recording, StepEstimate};

/// Name of the radar in the tables.
pub const SENSOR: &str = "radar";

/// Name of the aircraft in the tables.
pub const OBJECT: &str = "aircraft";

/// Names of the manoeuvres, in the order of [`StepEstimate::manoeuvres`].
pub const MANOEUVRES: [&str; 3] = ["straight", "left", "right"];

/// What the radar saw: a scan for each step, empty where it missed, with the accuracy that it states.
pub fn detections(recording: &Recording) -> Detections {
    let (sensor, object): (Arc<str>, Arc<str>) = (SENSOR.into(), OBJECT.into());
    let noise = Noise {
        range: Some(recording.radar.range()),
        bearing: Some(recording.radar.bearing()),
        ..Noise::default()
    };
    let scan = |(step, plot): (usize, &Option<nalgebra::Vector2<f64>>)| {
        let detection = |plot: &nalgebra::Vector2<f64>| Detection {
            noise,
            truth: Some(object.clone()),
            ..Detection::new(
                step as u64,
                Observation::Polar { range: Some(plot.x), bearing: plot.y, range_rate: None, z: None },
            )
        };
        Scan {
            time: step as f64 * recording.flight.interval(),
            sensor: sensor.clone(),
            position: Some([0.0; 3]),
            velocity: None,
            detections: plot.as_ref().map(detection).into_iter().collect(),
        }
    };
    Detections { scans: recording.plots.iter().enumerate().map(scan).collect(), ..Detections::default() }
}

/// Where the aircraft was.
pub fn truths(recording: &Recording) -> Truths {
    let object: Arc<str> = OBJECT.into();
    let row = |(step, state): (usize, &nalgebra::Vector4<f64>)| Truth {
        time: step as f64 * recording.flight.interval(),
        object: object.clone(),
        position: [state.x, state.y],
        z: None,
        velocity: Some([state.z, state.w]),
        extent: None,
    };
    Truths { origin: None, rows: recording.flight.states().iter().enumerate().map(row).collect() }
}

/// The estimates of one method as track number `track`: with velocities, covariances and manoeuvres where they are told.
pub fn tracks(recording: &Recording, estimates: &[StepEstimate], track: u64) -> Tracks {
    let whole = estimates.iter().all(|estimate| estimate.mean.iter().all(|value| value.is_finite()));
    let size = if whole { 4 } else { 2 };
    let told = estimates.iter().all(|estimate| estimate.manoeuvres.is_some());
    let sensor: Arc<str> = SENSOR.into();
    let row = |(step, (estimate, plot)): (usize, (&StepEstimate, &Option<_>))| {
        let upper = |covariance: &nalgebra::Matrix4<f64>| {
            (0..size).flat_map(|i| (i..size).map(move |j| (i, j))).map(|at| covariance[at]).collect()
        };
        Track {
            time: step as f64 * recording.flight.interval(),
            sensor: sensor.clone(),
            track,
            status: if plot.is_some() { Status::Confirmed } else { Status::Coasted },
            existence: 1.0,
            state: estimate.mean.iter().copied().take(size).collect(),
            covariance: estimate.covariance.as_ref().map(upper).unwrap_or_default(),
            modes: estimate.manoeuvres.filter(|_| told).map_or(Vec::new(), |chances| chances.to_vec()),
            extent: None,
            altitude: None,
            identity: None,
            detection: plot.is_some().then_some(step as u64),
        }
    };
    Tracks {
        origin: None,
        labels: ["x", "y", "vx", "vy"][..size].iter().map(|label| (*label).to_owned()).collect(),
        modes: if told { MANOEUVRES.map(str::to_owned).to_vec() } else { Vec::new() },
        rows: estimates.iter().zip(&recording.plots).enumerate().map(row).collect(),
    }
}
