//! How good tracks are against the truth.

use std::collections::BTreeMap;
use std::sync::Arc;

use tercel_core::error::FilterError;
use tercel_core::metric::{Gospa, Ospa, Trajectory, TrajectoryGospa};
use tercel_data::table::{Tracks, Truths};

use crate::report::{Chart, Form};
use crate::timeline::{self, Timeline};

/// What counts as found, and when it is looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct EvaluateOptions {
    /// Distance beyond which a track has nothing to do with an object, m: the cut-off of the set metrics, and what counts as
    /// found.
    pub cutoff: f64,
    /// Order of the set metrics.
    pub order: f64,
    /// Times to look at, s; without them every time at which a track was reported while the truth is known. Give the times
    /// of all scans where scans without any track should count as missed.
    pub times: Option<Vec<f64>>,
    /// Only false tracks within this distance of an object count in the metrics named `near`, m. Tracks within the cut-off always
    /// count.
    pub near: f64,
    /// Widest gap between rows of the truth that is bridged, s.
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
    /// Objects with a track of their own within the cut-off.
    pub covered: usize,
    /// Tracks farther than the cut-off from every object.
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
/// Each object takes the track that it had before while that is within the cut-off, the one that held its track last first;
/// then the nearest pairs are joined. A switch is counted when an object's track is not the one that it had last.
///
/// # Errors
/// When an option is out of range or a position is not finite.
pub fn evaluate(
    tracks: &Tracks,
    truths: &Truths,
    options: &EvaluateOptions,
) -> Result<Evaluation, FilterError> {
    let gospa = Gospa::new(options.cutoff, options.order)?;
    let ospa = Ospa::new(options.cutoff, options.order)?;
    let (objects, lines) = (timeline::of_truths(truths), timeline::of_tracks(tracks));
    let times = options.times.clone().unwrap_or_else(|| times_of(tracks, &objects));
    let mut holders = Holders::new(objects.len());
    let mut errors = Errors::default();
    let mut instants = Vec::with_capacity(times.len());
    for &time in &times {
        let picture = Picture::new(time, &objects, &lines, options);
        let far = picture.nearest_object();
        let within: Vec<[f64; 2]> = picture.tracks_within(options.near.max(options.cutoff));
        let score = gospa.score(&picture.objects, &picture.tracks)?;
        let (switches, covered) = holders.assign(&picture, options.cutoff);
        errors.take(&picture, options.cutoff);
        instants.push(Instant {
            time,
            gospa: score.total,
            localisation: score.parts.localisation,
            missed: score.parts.missed,
            false_alarm: score.parts.false_alarm,
            gospa_near: gospa.score(&picture.objects, &within)?.total,
            ospa: ospa.score(&picture.objects, &picture.tracks)?.total,
            objects: picture.objects.len(),
            tracks: picture.tracks.len(),
            covered,
            false_tracks: far.iter().filter(|distance| **distance > options.cutoff).count(),
            false_tracks_near: far.iter().filter(|d| **d > options.cutoff && **d <= options.near).count(),
            switches,
        });
    }
    let trajectories = trajectory_score(&times, &objects, &lines, options)?;
    let means = means(&instants, &errors, trajectories);
    Ok(Evaluation { instants, means })
}

/// The times at which tracks were reported while the truth is known.
fn times_of(tracks: &Tracks, objects: &BTreeMap<Arc<str>, Timeline>) -> Vec<f64> {
    let mut times: Vec<f64> = tracks.rows.iter().map(|row| row.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let first = objects.values().map(|line| line.span().0).fold(f64::INFINITY, f64::min);
    let last = objects.values().map(|line| line.span().1).fold(f64::NEG_INFINITY, f64::max);
    times.retain(|time| (first..=last).contains(time));
    times
}

/// Who was where at one time.
struct Picture {
    /// Numbers and places of the objects that were there.
    object_ids: Vec<usize>,
    objects: Vec<[f64; 2]>,
    track_ids: Vec<u64>,
    tracks: Vec<[f64; 2]>,
}

impl Picture {
    fn new(
        time: f64,
        objects: &BTreeMap<Arc<str>, Timeline>,
        lines: &BTreeMap<u64, Timeline>,
        options: &EvaluateOptions,
    ) -> Self {
        let there = objects.values().enumerate().filter_map(|(id, line)| {
            Some((id, line.interpolate(time, options.truth_gap, options.truth_hold)?))
        });
        let reported =
            lines.iter().filter_map(|(id, line)| Some((*id, line.extrapolate(time, TRACK_GAP, TRACK_HOLD)?)));
        let (object_ids, objects) = there.unzip();
        let (track_ids, tracks) = reported.unzip();
        Picture { object_ids, objects, track_ids, tracks }
    }

    fn distance(&self, object: usize, track: usize) -> f64 {
        let (a, b) = (self.objects[object], self.tracks[track]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// Distance of each track from the nearest object.
    fn nearest_object(&self) -> Vec<f64> {
        let nearest = |track| {
            (0..self.objects.len()).map(|object| self.distance(object, track)).fold(f64::INFINITY, f64::min)
        };
        (0..self.tracks.len()).map(nearest).collect()
    }

    fn tracks_within(&self, near: f64) -> Vec<[f64; 2]> {
        let distances = self.nearest_object();
        (0..self.tracks.len())
            .filter(|&track| distances[track] <= near)
            .map(|track| self.tracks[track])
            .collect()
    }
}

/// Which track each object had last.
struct Holders {
    last: Vec<Option<u64>>,
    when: Vec<usize>,
    instants: usize,
}

impl Holders {
    fn new(objects: usize) -> Self {
        Holders { last: vec![None; objects], when: vec![0; objects], instants: 0 }
    }

    /// Joins objects and tracks at the next time; returns the number of switches and of joined objects.
    fn assign(&mut self, picture: &Picture, cutoff: f64) -> (usize, usize) {
        self.instants += 1;
        let mut free: Vec<bool> = vec![true; picture.tracks.len()];
        let mut joined: Vec<Option<usize>> = vec![None; picture.objects.len()];
        let mut order: Vec<usize> = (0..picture.objects.len()).collect();
        order.sort_by_key(|&object| std::cmp::Reverse(self.when[picture.object_ids[object]]));
        for object in order {
            let held = self.last[picture.object_ids[object]];
            let track = held.and_then(|id| picture.track_ids.iter().position(|&track| track == id));
            if let Some(track) =
                track.filter(|&track| free[track] && picture.distance(object, track) <= cutoff)
            {
                joined[object] = Some(track);
                free[track] = false;
            }
        }
        while let Some((object, track)) = nearest_pair(picture, cutoff, &joined, &free) {
            joined[object] = Some(track);
            free[track] = false;
        }
        let mut switches = 0;
        for (object, track) in
            joined.iter().enumerate().filter_map(|(object, track)| Some((object, (*track)?)))
        {
            let (id, track) = (picture.object_ids[object], picture.track_ids[track]);
            switches += usize::from(self.last[id].is_some_and(|last| last != track));
            self.last[id] = Some(track);
            self.when[id] = self.instants;
        }
        (switches, joined.iter().flatten().count())
    }
}

/// The closest object and track that are both free and within the cut-off.
fn nearest_pair(
    picture: &Picture,
    cutoff: f64,
    joined: &[Option<usize>],
    free: &[bool],
) -> Option<(usize, usize)> {
    let objects = (0..joined.len()).filter(|&object| joined[object].is_none());
    let pairs =
        objects.flat_map(|object| (0..free.len()).filter(|&t| free[t]).map(move |track| (object, track)));
    pairs
        .map(|(object, track)| (picture.distance(object, track), object, track))
        .filter(|pair| pair.0 <= cutoff)
        .min_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))))
        .map(|(_, object, track)| (object, track))
}

/// Errors of the found objects against the nearest track.
#[derive(Default)]
struct Errors {
    squares: f64,
    count: usize,
}

impl Errors {
    fn take(&mut self, picture: &Picture, cutoff: f64) {
        for object in 0..picture.objects.len() {
            let distances = (0..picture.tracks.len()).map(|track| picture.distance(object, track));
            let nearest = distances.fold(f64::INFINITY, f64::min);
            if nearest <= cutoff {
                self.squares += nearest * nearest;
                self.count += 1;
            }
        }
    }
}

/// Trajectory GOSPA per time, with a switch penalty of half the cut-off, and its number of switches.
fn trajectory_score(
    times: &[f64],
    objects: &BTreeMap<Arc<str>, Timeline>,
    lines: &BTreeMap<u64, Timeline>,
    options: &EvaluateOptions,
) -> Result<(f64, f64), FilterError> {
    let truth: Vec<Trajectory<2>> = objects
        .values()
        .flat_map(|line| pieces(times, |time| line.interpolate(time, options.truth_gap, options.truth_hold)))
        .collect();
    let tracks: Vec<Trajectory<2>> = lines
        .values()
        .flat_map(|line| pieces(times, |time| line.extrapolate(time, TRACK_GAP, TRACK_HOLD)))
        .collect();
    let metric = TrajectoryGospa::new(options.cutoff, options.order, 0.5 * options.cutoff)?;
    let score = metric.score(&truth, &tracks)?;
    Ok((score.parts.sum() / times.len() as f64, score.switches))
}

/// The unbroken pieces of a trajectory over these times.
fn pieces(times: &[f64], at: impl Fn(f64) -> Option<[f64; 2]>) -> Vec<Trajectory<2>> {
    let mut pieces: Vec<(usize, Vec<[f64; 2]>)> = Vec::new();
    let mut broken = true;
    for (step, &time) in times.iter().enumerate() {
        match (at(time), pieces.last_mut()) {
            (Some(position), Some(piece)) if !broken => piece.1.push(position),
            (Some(position), _) => pieces.push((step, vec![position])),
            (None, _) => {}
        }
        broken = at(time).is_none();
    }
    pieces.into_iter().map(|(start, positions)| Trajectory::new(start, positions)).collect()
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
