//! Scans, truth and estimates of extended objects as tables that a picture draws.

use std::sync::Arc;

use nalgebra::Vector2;
use tercel_core::extended::Ellipse;
use tercel_core::multi::Status;
use tercel_data::table::{Detection, Detections, Observation, Scan, Track, Tracks, Truth, Truths};
use tercel_sim::extended::Ride;

/// Name of the sensor in the tables.
const SENSOR: &str = "sensor";

/// Every point is a detection of its own. `object` is the name of the object behind all points, if one is.
pub(crate) fn detections<'a>(
    interval: f64,
    scans: impl Iterator<Item = &'a [Vector2<f64>]>,
    object: Option<&str>,
) -> Detections {
    let sensor: Arc<str> = SENSOR.into();
    let object: Option<Arc<str>> = object.map(Into::into);
    let mut ids = 0..;
    let scans = scans.enumerate().map(|(step, points)| {
        let detections = points.iter().zip(&mut ids).map(|(point, id)| Detection {
            truth: object.clone(),
            ..Detection::new(id, Observation::Position { x: point.x, y: point.y, z: None })
        });
        let detections = detections.collect();
        Scan::new(step as f64 * interval, sensor.clone(), detections)
    });
    Detections { scans: scans.collect(), ..Detections::default() }
}

/// The first steps of rides, each with a name.
pub(crate) fn truths<'a>(rides: impl Iterator<Item = (String, &'a Ride)>, steps: usize) -> Truths {
    let mut rows: Vec<Truth> = rides.flat_map(|(name, ride)| true_rows(name.into(), ride, steps)).collect();
    rows.sort_by(|a, b| a.time.total_cmp(&b.time));
    Truths { origin: None, rows }
}

fn true_rows(object: Arc<str>, ride: &Ride, steps: usize) -> impl Iterator<Item = Truth> {
    ride.states().iter().take(steps).enumerate().map(move |(step, state)| Truth {
        time: step as f64 * ride.interval(),
        object: object.clone(),
        position: [state.x, state.y],
        z: None,
        velocity: Some([state.z, state.w]),
        extent: Some(extent(&ride.ellipse(step))),
    })
}

/// The first steps of a ride as a track, because a picture draws the ellipses of tracks.
pub(crate) fn ridden(ride: &Ride, track: u64, steps: usize) -> impl Iterator<Item = Track> {
    let steps = steps.min(ride.states().len());
    (0..steps).map(move |step| {
        let ellipse = ride.ellipse(step);
        row(step as f64 * ride.interval(), track, ellipse.center, Some(&ellipse))
    })
}

/// One row of a track: a place, and an ellipse if there is one.
pub(crate) fn row(time: f64, track: u64, place: Vector2<f64>, ellipse: Option<&Ellipse>) -> Track {
    Track {
        time,
        sensor: SENSOR.into(),
        track,
        status: Status::Confirmed,
        existence: 1.0,
        state: place.iter().copied().collect(),
        covariance: Vec::new(),
        modes: Vec::new(),
        extent: ellipse.map(extent),
        altitude: None,
        identity: None,
        detection: None,
    }
}

/// Tracks of positions.
pub(crate) fn tracks(rows: Vec<Track>) -> Tracks {
    Tracks { labels: ["x", "y"].map(str::to_owned).to_vec(), rows, ..Tracks::default() }
}

fn extent(ellipse: &Ellipse) -> [f64; 3] {
    [ellipse.axes.x, ellipse.axes.y, ellipse.angle]
}
