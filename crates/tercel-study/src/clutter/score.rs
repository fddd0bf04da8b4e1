//! How good the tracks of a scene are.

use std::collections::BTreeMap;

use tercel_core::error::FilterError;
use tercel_core::metric::{Gospa, Trajectory, TrajectoryGospa};
use tercel_core::multi::TrackId;

use super::{Recording, Reported};
use crate::monte_carlo::Outcome;

/// Distance beyond which a track has nothing to do with an object, m.
pub const CUTOFF: f64 = 100.0;

/// The scan from which on `gospa_settled` counts.
pub(super) const SETTLED: usize = 40;

/// What one run of one method is scored by: name, unit, and whether the printed table shows it.
pub const METRICS: [(&str, &str, bool); 10] = [
    ("gospa", "m", true),
    ("gospa_localisation", "m", true),
    ("gospa_missed", "m", true),
    ("gospa_false", "m", true),
    ("gospa_settled", "m", true),
    ("trajectory_gospa", "m", true),
    ("switches", "", true),
    ("cardinality_error", "", true),
    ("cardinality_bias", "", false),
    ("tracks", "", false),
];

/// What is drawn over time, in this order.
pub(super) const CURVES: [(&str, &str); 5] = [
    ("GOSPA over time", "m"),
    ("Localisation part over time", "m"),
    ("Missed part over time", "m"),
    ("False part over time", "m"),
    ("Number of objects over time", ""),
];

/// Scores what a method reported, with this cut-off (m), which is also the price of a switch of tracks.
pub fn score(recording: &Recording, reported: &[Vec<Reported>], cutoff: f64) -> Result<Outcome, String> {
    figures(recording, reported, cutoff).map_err(|error| error.to_string())
}

fn figures(recording: &Recording, reported: &[Vec<Reported>], cutoff: f64) -> Result<Outcome, FilterError> {
    let metric = Gospa::new(cutoff, 1.0)?;
    let mut curves = vec![Vec::with_capacity(reported.len()); CURVES.len()];
    let (mut errors, mut bias) = (0.0, 0.0);
    for (step, found) in reported.iter().enumerate() {
        let truth: Vec<[f64; 2]> =
            recording.scene.present(step).map(|(_, state)| [state[0], state[1]]).collect();
        let places: Vec<[f64; 2]> = found.iter().map(|track| [track.state[0], track.state[1]]).collect();
        let score = metric.score(&truth, &places)?;
        let surplus = places.len() as f64 - truth.len() as f64;
        errors += surplus.abs();
        bias += surplus;
        let parts = [
            score.total,
            score.parts.localisation,
            score.parts.missed,
            score.parts.false_alarm,
            places.len() as f64,
        ];
        curves.iter_mut().zip(parts).for_each(|(curve, part)| curve.push(part));
    }
    let scans = reported.len().max(1) as f64;
    let mean = |curve: &[f64]| curve.iter().sum::<f64>() / curve.len().max(1) as f64;
    let trajectories =
        TrajectoryGospa::new(cutoff, 1.0, cutoff)?.score(&truths(recording), &tracks(reported))?;
    let metrics = vec![
        mean(&curves[0]),
        mean(&curves[1]),
        mean(&curves[2]),
        mean(&curves[3]),
        mean(curves[0].get(SETTLED..).unwrap_or_default()),
        trajectories.total / scans,
        trajectories.switches,
        errors / scans,
        bias / scans,
        mean(&curves[4]),
    ];
    Ok(Outcome { metrics, curves })
}

fn truths(recording: &Recording) -> Vec<Trajectory<2>> {
    let objects = recording.scene.objects().iter();
    objects
        .map(|object| Trajectory::new(object.first(), object.states().iter().map(|s| [s[0], s[1]])))
        .collect()
}

fn tracks(reported: &[Vec<Reported>]) -> Vec<Trajectory<2>> {
    let mut all: BTreeMap<TrackId, Trajectory<2>> = BTreeMap::new();
    for (step, found) in reported.iter().enumerate() {
        for track in found {
            let trajectory =
                all.entry(track.track).or_insert_with(|| Trajectory { start: step, positions: Vec::new() });
            trajectory.positions.resize(step - trajectory.start, None);
            trajectory.positions.push(Some([track.state[0], track.state[1]]));
        }
    }
    all.into_values().collect()
}
