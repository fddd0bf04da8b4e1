//! One scene, drawn with what every method made of it.

use std::collections::BTreeSet;

use tercel_data::table::Tracks;

use super::{Recording, Reported, tables};
use crate::StudyError;
use crate::monte_carlo::Example;
use crate::report::Picture;

/// Numbers between the tracks of one method and those of the next.
const APART: u64 = 1_000_000;

/// Draws a scene: the plan with the tracks of every method.
pub(super) fn draw(
    recording: &Recording,
    title: String,
    followed: &[(&str, Vec<Vec<Reported>>)],
) -> Result<Example, StudyError> {
    let detections = tables::detections(recording);
    let truths = tables::truths(recording);
    let labels = ["x", "y", "vx", "vy"].map(str::to_owned).to_vec();
    let mut all = Tracks { labels, ..Tracks::default() };
    let mut names = Vec::new();
    let mut tracks = Vec::with_capacity(followed.len());
    for (number, (name, reported)) in (0..).zip(followed) {
        let table = tables::tracks(recording, reported, number * APART);
        let own: BTreeSet<u64> = table.rows.iter().map(|row| row.track).collect();
        names.extend(own.iter().map(|track| (*track, format!("{name} {}", track - number * APART))));
        all.rows.extend(table.rows.iter().cloned());
        tracks.push(((*name).to_owned(), tables::tracks(recording, reported, 0)));
    }
    all.rows.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut picture = Picture::new(&detections, &all, Some(&truths), &[])?.without_counts();
    for (track, name) in names {
        picture = picture.with_track_name(track, name);
    }
    Ok(Example { title, picture, detections, truths, tracks })
}
