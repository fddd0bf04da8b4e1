//! One recording, drawn with the ellipses of every method.

use tercel_core::extended::Ellipse;
use tercel_core::metric::intersection_over_union;
use tercel_data::table::{Detections, Track, Truths};

use super::{Recording, StepEstimate, tables};
use crate::StudyError;
use crate::monte_carlo::Example;
use crate::report::{Chart, Picture};

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
    let (detections, truths) = (detections(recording), truths(recording));
    let mut all: Vec<Track> = tables::ridden(&recording.ride, 0, DRAWN).collect();
    let mut own = Vec::with_capacity(followed.len());
    for (number, (name, estimates)) in (1..).zip(followed) {
        let rows = rows(recording, estimates, number);
        all.extend(rows.iter().cloned());
        own.push(((*name).to_owned(), tables::tracks(rows)));
    }
    let mut picture = Picture::new(&detections, &tables::tracks(all), Some(&truths), &[])?
        .without_counts()
        .with_track_name(0, "truth");
    for (number, (name, _)) in (1..).zip(followed) {
        picture = picture.with_track_name(number, *name);
    }
    for chart in charts(recording, followed) {
        picture = picture.with_chart(chart);
    }
    Ok(Example { title, picture, detections, truths, tracks: own })
}

fn time(recording: &Recording, step: usize) -> f64 {
    step as f64 * recording.ride.interval()
}

fn detections(recording: &Recording) -> Detections {
    let scans = recording.scans.iter().take(DRAWN).map(|scan| scan.points());
    tables::detections(recording.ride.interval(), scans, Some(OBJECT))
}

fn truths(recording: &Recording) -> Truths {
    tables::truths([(OBJECT.to_owned(), &recording.ride)].into_iter(), DRAWN)
}

fn ellipse(estimate: &StepEstimate) -> Option<Ellipse> {
    Ellipse::from_matrix([estimate.mean.x, estimate.mean.y].into(), &estimate.extent).ok()
}

fn rows(recording: &Recording, estimates: &[StepEstimate], track: u64) -> Vec<Track> {
    let rows = estimates.iter().take(DRAWN).enumerate().map(|(step, estimate)| {
        let place = [estimate.mean.x, estimate.mean.y].into();
        tables::row(time(recording, step), track, place, ellipse(estimate).as_ref())
    });
    rows.collect()
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
