//! How good tracks are against the truth.

mod holders;
mod picture;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use tercel_core::error::FilterError;
use tercel_core::metric::{Gospa, Ospa, TrajectoryGospa};
use tercel_data::table::{Tracks, Truths};

use self::holders::Holders;
use self::picture::{Lives, Picture, Standing};
use crate::report::{Chart, Form};
use crate::timeline::{self, Reach, Rule, SAME, Timeline};

/// What counts as found, and when it is looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluateOptions {
    /// Distance from which on a track has nothing to do with an object, m: the cut-off of the set metrics, and what counts as
    /// found. A pair at the cut-off is no pair.
    pub cutoff: f64,
    /// Order of the set metrics.
    pub order: f64,
    /// Times to look at, s; without them the [`scored_times`] of the tracks and the truth.
    pub times: Option<Vec<f64>>,
    /// Only false tracks within this distance of an object count in the metrics named `near`, m. Tracks within the cut-off always
    /// count.
    pub near: f64,
    /// Widest gap between rows of the truth that is bridged, s; or one and a half times the usual interval of its rows,
    /// if that is wider.
    pub truth_gap: f64,
    /// How long an object is taken to stay at its first and last place before and after it is known, s.
    pub truth_hold: f64,
}

impl Default for EvaluateOptions {
    /// A cut-off of 20 m, order 1; truth known at least every 10 s.
    fn default() -> Self {
        EvaluateOptions {
            cutoff: 20.0,
            order: 1.0,
            times: None,
            near: 150.0,
            truth_gap: 10.0,
            truth_hold: 0.0,
        }
    }
}

/// Longest gap between rows of a track that is bridged, and how long a track is held after its last row, s.
const TRACK_GAP: f64 = 2.5;
const TRACK_HOLD: f64 = 0.6;
/// Rows that are usually farther apart are bridged over this many of their usual intervals.
const BRIDGED: f64 = 1.5;
/// Intervals between rows of tracks that show how often a tracker reports. A few rows far apart show only that it was
/// silent in between.
const RHYTHM: usize = 10;

/// Scores at one time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Instant {
    /// The time, s.
    pub time: f64,
    /// GOSPA and its parts (`p`-th powers), m.
    pub gospa: f64,
    /// Part of the errors of found objects.
    pub localisation: f64,
    /// Part of the objects that were not found.
    pub missed: f64,
    /// Part of the tracks that belong to no object.
    pub false_alarm: f64,
    /// GOSPA with only the tracks near an object counted.
    pub gospa_near: f64,
    /// OSPA, m.
    pub ospa: f64,
    /// Objects that were there.
    pub objects: usize,
    /// Tracks that were reported.
    pub tracks: usize,
    /// Objects with a track of their own closer than the cut-off.
    pub covered: usize,
    /// Tracks that are not closer than the cut-off to any object.
    pub false_tracks: usize,
    /// Those of them that are near an object.
    pub false_tracks_near: usize,
    /// Objects whose track was another one before.
    pub switches: usize,
}

/// Scores of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Scores over time.
    pub instants: Vec<Instant>,
    /// Means by name, in the order in which they are best read; NaN where there was nothing to score. Names: `covered`, `switches`, `false_tracks`,
    /// `false_tracks_near`, `gospa`, `gospa_localisation`, `gospa_missed`, `gospa_false`, `gospa_near`, `ospa`,
    /// `rmse_pos_norm`, `rmse_pos`, `cardinality_error`, `tgospa`, `tgospa_switches`.
    pub means: Vec<(&'static str, f64)>,
}

impl Evaluation {
    /// A mean by its name.
    pub fn mean(&self, name: &str) -> Option<f64> {
        self.means.iter().find(|mean| mean.0 == name).map(|mean| mean.1)
    }
}

impl Evaluation {
    /// The parts of GOSPA over time, stacked.
    pub fn chart(&self) -> Chart {
        let column = |value: fn(&Instant) -> f64| -> Vec<f64> { self.instants.iter().map(value).collect() };
        Chart::over_time("GOSPA", "m", column(|instant| instant.time))
            .with_form(Form::Stacked)
            .with_part("localisation", column(|instant| instant.localisation))
            .with_part("missed", column(|instant| instant.missed))
            .with_part("false", column(|instant| instant.false_alarm))
    }
}

/// Scores tracks against the truth.
///
/// Each object takes the track that it had before while that is closer than the cut-off, the one that held its track last
/// first; then the nearest pairs are joined. A switch is counted when an object's track is not the one that it had last.
///
/// Time and memory follow the number of rows, and of pairs that are near each other.
///
/// # Errors
/// When an option is out of range or a position is not finite.
pub fn evaluate(
    tracks: &Tracks,
    truths: &Truths,
    options: &EvaluateOptions,
) -> Result<Evaluation, FilterError> {
    let metrics = SetMetrics::new(options)?;
    let (truth_lines, track_lines) = (timeline::of_truths(truths), timeline::of_tracks(tracks));
    let mut times =
        options.times.clone().unwrap_or_else(|| scored_times(tracks.rows.iter().map(|row| row.time), truths));
    times.sort_by(f64::total_cmp);
    let (truth_reach, track_reach) = (truth_reach(&truth_lines, options), track_reach(&track_lines));
    let objects = Lives::of(truth_lines.values(), &times, Rule::Interpolate, truth_reach);
    let lines = Lives::of(track_lines.values(), &times, Rule::Extrapolate, track_reach);
    let (mut there, mut reported) = (objects.walk(), lines.walk());
    let mut holders = Holders::new(truth_lines.len());
    let mut errors = Errors::default();
    let mut instants = Vec::with_capacity(times.len());
    for (step, &time) in times.iter().enumerate() {
        let (there, here) = (objects.at(&mut there, step), lines.at(&mut reported, step));
        let picture = Picture::new(there, here, options.cutoff, options.near);
        let (switches, covered) = holders.assign(&picture);
        errors.take(&picture);
        instants.push(Instant { time, switches, covered, ..metrics.score(&picture)? });
    }
    let trajectories = trajectory_score(times.len(), &objects, &lines, options)?;
    let means = means(&instants, &errors, trajectories);
    Ok(Evaluation { instants, means })
}

/// The times to score at: those of the reports and those at which the truth is told, from the first time of the truth
/// to the last. A time of the truth at which nobody reported a track counts, so that silence is no way to a better
/// score. Without any truth these are the times of the reports.
pub fn scored_times(reports: impl IntoIterator<Item = f64>, truths: &Truths) -> Vec<f64> {
    let told = sorted(truths.rows.iter().map(|row| row.time));
    let mut times = sorted(reports.into_iter());
    let (Some(first), Some(last)) = (told.first(), told.last()) else { return times };
    times.retain(|time| (first - SAME..=last + SAME).contains(time));
    let mut times_of_truth: Vec<f64> = Vec::new();
    for time in told {
        let next = times.partition_point(|&report| report < time - SAME);
        let reported = times.get(next).is_some_and(|report| report - time <= SAME);
        if !reported && times_of_truth.last().is_none_or(|last| time - last > SAME) {
            times_of_truth.push(time);
        }
    }
    times.extend(times_of_truth);
    times.sort_by(f64::total_cmp);
    times
}

/// In rising order, each once.
fn sorted(times: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// A truth that is told seldom is bridged as far as its rows usually are apart.
fn truth_reach(lines: &BTreeMap<Arc<str>, Timeline>, options: &EvaluateOptions) -> Reach {
    let usual = timeline::usual_interval(lines.values(), 1).unwrap_or(0.0);
    Reach { gap: options.truth_gap.max(BRIDGED * usual), hold: options.truth_hold }
}

/// Tracks that are reported seldom are bridged as far as their rows usually are apart, and held for half of that.
fn track_reach(lines: &BTreeMap<u64, Timeline>) -> Reach {
    let usual = timeline::usual_interval(lines.values(), RHYTHM).unwrap_or(0.0);
    Reach { gap: TRACK_GAP.max(BRIDGED * usual), hold: TRACK_HOLD.max(0.5 * usual) }
}

/// The metrics of one time.
struct SetMetrics {
    gospa: Gospa,
    ospa: Ospa,
}

impl SetMetrics {
    fn new(options: &EvaluateOptions) -> Result<Self, FilterError> {
        let (cutoff, order) = (options.cutoff, options.order);
        Ok(SetMetrics { gospa: Gospa::new(cutoff, order)?, ospa: Ospa::new(cutoff, order)? })
    }

    /// All but the time and what depends on times before.
    fn score(&self, picture: &Picture) -> Result<Instant, FilterError> {
        let (objects, tracks) = (picture.object_ids.len(), picture.track_ids.len());
        let score = self.gospa.score_pairs(objects, tracks, &picture.near)?;
        let far = picture.count(Standing::Far);
        Ok(Instant {
            gospa: score.total,
            localisation: score.parts.localisation,
            missed: score.parts.missed,
            false_alarm: score.parts.false_alarm,
            gospa_near: if far == 0 { score.total } else { self.without_far(picture)? },
            ospa: self.ospa.score_pairs(objects, tracks, &picture.near)?.total,
            objects,
            tracks,
            false_tracks: far + picture.count(Standing::Near),
            false_tracks_near: picture.count(Standing::Near),
            ..Instant::default()
        })
    }

    /// GOSPA as though the tracks far from all objects were not there.
    fn without_far(&self, picture: &Picture) -> Result<f64, FilterError> {
        let mut kept = 0;
        let numbers: Vec<usize> = picture
            .standing
            .iter()
            .map(|standing| {
                kept += usize::from(*standing != Standing::Far);
                kept.saturating_sub(1)
            })
            .collect();
        let near: Vec<_> =
            picture.near.iter().map(|&(object, track, d)| (object, numbers[track], d)).collect();
        Ok(self.gospa.score_pairs(picture.object_ids.len(), kept, &near)?.total)
    }
}

/// Errors of the found objects against the nearest track.
#[derive(Default)]
struct Errors {
    squares: f64,
    count: usize,
}

impl Errors {
    fn take(&mut self, picture: &Picture) {
        for distance in picture.nearest_track() {
            self.squares += distance * distance;
            self.count += 1;
        }
    }
}

/// Trajectory GOSPA per time, with a switch penalty of half the cut-off, and its number of switches.
fn trajectory_score(
    times: usize,
    objects: &Lives,
    lines: &Lives,
    options: &EvaluateOptions,
) -> Result<(f64, f64), FilterError> {
    let metric = TrajectoryGospa::new(options.cutoff, options.order, 0.5 * options.cutoff)?;
    let score = metric.score(&objects.pieces, &lines.pieces)?;
    // The p-th root of the mean over the times of the p-th powers.
    Ok((score.total / (times as f64).powf(options.order.recip()), score.switches))
}

fn means(
    instants: &[Instant],
    errors: &Errors,
    (tgospa, tgospa_switches): (f64, f64),
) -> Vec<(&'static str, f64)> {
    // Without a time in common there is no figure: not a number, rather than a perfect score.
    let count = instants.len() as f64;
    let mean = |value: fn(&Instant) -> f64| instants.iter().map(value).sum::<f64>() / count;
    let objects: usize = instants.iter().map(|instant| instant.objects).sum();
    let covered: usize = instants.iter().map(|instant| instant.covered).sum();
    let rmse = (errors.squares / errors.count as f64).sqrt();
    vec![
        ("covered", covered as f64 / objects as f64),
        ("switches", instants.iter().map(|instant| instant.switches).sum::<usize>() as f64),
        ("false_tracks", mean(|instant| instant.false_tracks as f64)),
        ("false_tracks_near", mean(|instant| instant.false_tracks_near as f64)),
        ("gospa", mean(|instant| instant.gospa)),
        ("gospa_localisation", mean(|instant| instant.localisation)),
        ("gospa_missed", mean(|instant| instant.missed)),
        ("gospa_false", mean(|instant| instant.false_alarm)),
        ("gospa_near", mean(|instant| instant.gospa_near)),
        ("ospa", mean(|instant| instant.ospa)),
        ("rmse_pos_norm", rmse),
        ("rmse_pos", rmse / std::f64::consts::SQRT_2),
        ("cardinality_error", mean(|instant| (instant.tracks as f64 - instant.objects as f64).abs())),
        ("tgospa", tgospa),
        ("tgospa_switches", tgospa_switches),
    ]
}
