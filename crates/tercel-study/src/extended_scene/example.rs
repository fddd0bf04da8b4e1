//! One scene, drawn with the ellipses of every method.

use std::collections::BTreeSet;

use nalgebra::Vector2;
use tercel_core::extended::Ellipse;
use tercel_data::table::Track;
use tercel_sim::extended::CrossingScene;

use super::methods::Report;
use crate::StudyError;
use crate::extended::tables;
use crate::monte_carlo::Example;
use crate::report::Picture;

/// Time between scans, s.
const INTERVAL: f64 = 1.0;

/// Numbers between the tracks of one method and those of the next.
const APART: u64 = 1_000_000;

/// Draws a scene: points, true ellipses, and those of the tracks of every method.
pub(super) fn draw(
    scene: &CrossingScene,
    title: String,
    followed: &[(&str, Vec<Vec<Report>>)],
) -> Result<Example, StudyError> {
    let steps = scene.scans.len();
    let detections = tables::detections(INTERVAL, scene.scans.iter().map(Vec::as_slice), None);
    let rides = || scene.rides.iter().enumerate();
    let truths = tables::truths(rides().map(|(object, ride)| (format!("object {object}"), ride)), steps);
    let true_tracks = rides().flat_map(|(object, ride)| tables::ridden(ride, object as u64, steps));
    let mut all: Vec<Track> = true_tracks.collect();
    let mut names: Vec<_> = rides().map(|(object, _)| (object as u64, format!("truth {object}"))).collect();
    let mut own = Vec::with_capacity(followed.len());
    for (number, (name, reports)) in (1..).zip(followed) {
        let drawn = rows(reports, number * APART);
        let tracks: BTreeSet<u64> = drawn.iter().map(|row| row.track).collect();
        names.extend(tracks.iter().map(|track| (*track, format!("{name} {}", track - number * APART))));
        all.extend(drawn);
        own.push(((*name).to_owned(), tables::tracks(rows(reports, 0))));
    }
    all.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut picture = Picture::new(&detections, &tables::tracks(all), Some(&truths), &[])?.without_counts();
    for (track, name) in names {
        picture = picture.with_track_name(track, name);
    }
    Ok(Example { title, picture, detections, truths, tracks: own })
}

fn rows(reports: &[Vec<Report>], first: u64) -> Vec<Track> {
    let scans = reports.iter().enumerate();
    let rows = scans.flat_map(|(step, found)| {
        found.iter().map(move |report| {
            let place: Vector2<f64> = report.place;
            let ellipse = report.extent.and_then(|extent| Ellipse::from_matrix(place, &extent).ok());
            tables::row(step as f64 * INTERVAL, first + report.track, place, ellipse.as_ref())
        })
    });
    rows.collect()
}
