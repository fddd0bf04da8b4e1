//! Recorded traffic, and what a radar would have seen of it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Matrix3, Vector2, Vector3, Vector4};
use rand::RngExt;
use rand_distr::{Distribution, Poisson, StandardNormal};
use tercel_core::sensor::Measurement;
use tercel_data::{ImportOptions, Source, import};
use tercel_sim::clutter::{Object, Plot, Scene, Sensor};
use tercel_sim::{Interval, Stream};

use crate::StudyError;
use crate::clutter::Recording;

/// Time between scans, s.
pub(super) const INTERVAL: f64 = 5.0;

/// Scans of a window: ten minutes.
pub(super) const STEPS: usize = 120;

/// Standard deviations of the radar: range (m) and bearing (rad).
pub(super) const RANGE: f64 = 50.0;
pub(super) const BEARING: f64 = 0.1 * std::f64::consts::PI / 180.0;

/// Probability that an aircraft is seen in a scan, and mean number of false plots of one.
const DETECTION: f64 = 0.9;
const CLUTTER: f64 = 50.0;

/// Half the side of the square that the radar watches, m.
const REACH: f64 = 125e3;

/// A gap between reports at which a track ends, s.
const GAP: f64 = 60.0;

/// Reports that make up a state of the truth: those at most this far from its time, s.
const AROUND: f64 = 10.0;

/// Fewest reports for a state, and fewest states for an aircraft.
const REPORTS: usize = 8;
const STATES: usize = 4;

/// A report of an aircraft's position: time (s), and place (m) in the plane around the radar.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Report {
    time: f64,
    place: Vector2<f64>,
}

/// Tracks of aircraft that reported their positions, in windows of ten minutes.
///
/// The radar stands at the median of all positions. The truth at a scan is the parabola through the reports of 20 s around
/// it: reports err by where the aircraft was up to a second ago, some 50 m, which is as much as the radar does.
#[derive(Debug, Clone, PartialEq)]
pub struct Traffic {
    tracks: Vec<Vec<Report>>,
    begin: f64,
    windows: u64,
    /// What the radar watches, along both axes.
    side: Interval,
}

impl Traffic {
    /// Reads positions that aircraft broadcast, as `tercel convert` does.
    ///
    /// # Errors
    /// When a file cannot be read, is no such table, or spans no window.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let options = ImportOptions { split_callsigns: true, ..ImportOptions::default() };
        let truths = import(Source::Adsb, &[path], &options)?.truths.unwrap_or_default();
        let mut aircraft: BTreeMap<Arc<str>, Vec<Report>> = BTreeMap::new();
        for row in truths.rows {
            let report = Report { time: row.time, place: row.position.into() };
            aircraft.entry(row.object).or_default().push(report);
        }
        let tracks: Vec<Vec<Report>> = aircraft.into_values().flat_map(unbroken).collect();
        let times = || tracks.iter().flatten().map(|report| report.time);
        let (begin, end) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
        let windows = ((end - begin) / (INTERVAL * STEPS as f64)).floor();
        if !(windows >= 1.0 && windows.is_finite()) {
            let path = path.display();
            return Err(StudyError::Option(format!("{path}: its reports span less than ten minutes")));
        }
        Ok(Traffic { tracks, begin, windows: windows as u64, side: Interval::new(-REACH, REACH)? })
    }

    /// Number of windows.
    pub fn windows(&self) -> u64 {
        self.windows
    }

    /// The window of a run, as the radar sees it. Runs beyond the last window see the first ones again, with other errors.
    pub fn recording(&self, seed: u64, run: u64) -> Recording {
        let begin = self.begin + (run % self.windows) as f64 * INTERVAL * STEPS as f64;
        let objects = self.tracks.iter().flat_map(|track| objects(track, begin)).collect();
        let sensor = Sensor { deviation: RANGE, detection: DETECTION, clutter: CLUTTER };
        let scene = Scene::recorded(objects, [self.side, self.side], sensor, STEPS, INTERVAL);
        let plots = observe(&scene, seed, run);
        let polar =
            |plot: &Plot| Measurement::from([plot.position.norm(), plot.position.y.atan2(plot.position.x)]);
        let scans = plots.iter().map(|scan| scan.iter().map(polar).collect()).collect();
        Recording { scene, plots, scans, run }
    }
}

/// The reports of an aircraft in the order of time, cut where they pause.
fn unbroken(mut reports: Vec<Report>) -> Vec<Vec<Report>> {
    reports.sort_by(|a, b| a.time.total_cmp(&b.time));
    reports.chunk_by(|a, b| b.time - a.time <= GAP).map(<[Report]>::to_vec).collect()
}

/// What an aircraft does in a window, while it is in reach: more than one object if it leaves and comes back.
fn objects(track: &[Report], begin: f64) -> Vec<Object> {
    let state = |step: usize| {
        let state = state_at(track, begin + step as f64 * INTERVAL)?;
        (state[0].abs() <= REACH && state[1].abs() <= REACH).then_some((step, state))
    };
    let states: Vec<_> = (0..STEPS).filter_map(state).collect();
    let stretches = states.chunk_by(|a, b| b.0 == a.0 + 1).filter(|stretch| stretch.len() >= STATES);
    stretches.map(|stretch| Object::recorded(stretch[0].0, stretch.iter().map(|(_, state)| *state))).collect()
}

/// Place and velocity at a time, by the parabola that fits the reports around it best. `None` where there are too few, or
/// none on one side.
fn state_at(track: &[Report], time: f64) -> Option<Vector4<f64>> {
    let first = track.partition_point(|report| report.time < time - AROUND);
    let last = track.partition_point(|report| report.time <= time + AROUND);
    let near = &track[first..last];
    if near.len() < REPORTS || near[0].time > time || near[near.len() - 1].time < time {
        return None;
    }
    let (mut normal, mut sums) = (Matrix3::zeros(), [Vector3::zeros(); 2]);
    for report in near {
        // Times in units of the window keep the matrix well conditioned.
        let t = (report.time - time) / AROUND;
        let powers = Vector3::new(1.0, t, t * t);
        normal += powers * powers.transpose();
        sums[0] += powers * report.place.x;
        sums[1] += powers * report.place.y;
    }
    let inverse = normal.try_inverse()?;
    let [x, y] = sums.map(|sum| inverse * sum);
    Some(Vector4::new(x[0], y[0], x[1] / AROUND, y[1] / AROUND))
}

/// What the radar sees in each scan, from left to right: the order says nothing of what is true.
fn observe(scene: &Scene, seed: u64, run: u64) -> Vec<Vec<Plot>> {
    let mut noise = Stream::Noise { realisation: 0 }.of(seed, run);
    let mut chance = Stream::Detection { realisation: 0 }.of(seed, run);
    let mut clutter = Stream::Clutter { realisation: 0 }.of(seed, run);
    let count = Poisson::new(CLUTTER).ok();
    let mut scan = |step: usize| {
        let mut plots = Vec::new();
        for (number, state) in scene.present(step) {
            let mut error = || -> f64 { StandardNormal.sample(&mut noise) };
            let range = (state.xy().norm() + RANGE * error()).max(0.0);
            let (sine, cosine) = (state[1].atan2(state[0]) + BEARING * error()).sin_cos();
            if chance.random::<f64>() < DETECTION {
                plots.push(Plot { position: Vector2::new(cosine, sine) * range, object: Some(number) });
            }
        }
        let extra = count.as_ref().map_or(0, |count| count.sample(&mut clutter) as usize);
        let mut side = || clutter.random_range(-REACH..=REACH);
        plots.extend((0..extra).map(|_| Plot { position: Vector2::new(side(), side()), object: None }));
        plots.sort_by(|a: &Plot, b: &Plot| a.position.x.total_cmp(&b.position.x));
        plots
    };
    (0..STEPS).map(&mut scan).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An aircraft on a wide circle that reports once a second, with a pause.
    fn track() -> Vec<Report> {
        let report = |second: u32| {
            let (sine, cosine) = (0.005 * f64::from(second)).sin_cos();
            Report { time: f64::from(second), place: Vector2::new(40e3 * cosine, 40e3 * sine) }
        };
        (0..300).chain(400..700).map(report).collect()
    }

    #[test]
    fn the_truth_follows_the_reports_and_ends_where_they_do() {
        let tracks = unbroken(track());
        assert_eq!(tracks.len(), 2);
        let state = state_at(&tracks[0], 100.0).unwrap();
        let (sine, cosine) = 0.5_f64.sin_cos();
        assert!((state.xy() - Vector2::new(40e3 * cosine, 40e3 * sine)).norm() < 1.0);
        let velocity = Vector2::new(state[2], state[3]);
        assert!((velocity - Vector2::new(-200.0 * sine, 200.0 * cosine)).norm() < 0.2, "{velocity}");
        assert!(state_at(&tracks[0], 305.0).is_none() && state_at(&tracks[1], 350.0).is_none());
    }

    #[test]
    fn a_window_holds_what_flies_in_it_and_the_same_run_is_the_same() {
        let traffic = Traffic {
            tracks: unbroken(track()),
            begin: 0.0,
            windows: 1,
            side: Interval::new(-REACH, REACH).unwrap(),
        };
        let recording = traffic.recording(3, 0);
        assert_eq!(recording.scene.objects().len(), 2);
        assert_eq!(recording.scans.len(), STEPS);
        let seen = recording.plots.iter().flatten().filter(|plot| plot.object.is_some()).count();
        let there: usize = (0..STEPS).map(|step| recording.scene.present(step).count()).sum();
        assert!((seen as f64 / there as f64 - DETECTION).abs() < 0.08, "{seen} of {there}");
        assert_eq!(recording, traffic.recording(3, 0));
        // The same window with other errors.
        let other = traffic.recording(3, 1);
        assert_eq!(other.scene, recording.scene);
        assert_ne!(other.plots, recording.plots);
    }
}
