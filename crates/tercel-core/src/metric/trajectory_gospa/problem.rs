//! From trajectories to pairs that come near each other, and from paths back to parts.

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use super::TrajectoryGospaParts;
use super::groups::Groups;
use crate::metric::near::pairs_within;
use crate::metric::scale::Scale;
use crate::metric::trajectory::{Trajectory, Walk};

/// The distances of an object and a track, from the first to the last step at which they are closer than the cut-off;
/// infinite where they are not.
pub(super) struct Pair {
    pub(super) object: usize,
    pub(super) track: usize,
    pub(super) first: usize,
    pub(super) distances: Vec<f64>,
}

impl Pair {
    /// The distance at a step, if the two are closer than the cut-off then.
    pub(super) fn at(&self, step: usize) -> Option<f64> {
        let distance = *self.distances.get(step.checked_sub(self.first)?)?;
        distance.is_finite().then_some(distance)
    }

    pub(super) fn steps(&self) -> Range<usize> {
        self.first..self.first + self.distances.len()
    }
}

/// Which objects and tracks exist at each step, and which of them come near each other.
pub(super) struct Problem {
    pub(super) scale: Scale,
    /// The switch penalty `γ` (m).
    pub(super) switch: f64,
    steps: Range<usize>,
    /// Numbers of objects and of tracks at each step.
    existing: Vec<(f64, f64)>,
    /// By object, then by track.
    pub(super) pairs: Vec<Pair>,
    /// For each track the steps from the first to the last at which it is near any object.
    pub(super) contested: Vec<Range<usize>>,
}

/// Parts of each step, steps of each pair, the sum of all, and how far that may lie above the minimum.
pub(super) struct Solved {
    pub(super) total: f64,
    pub(super) steps: Vec<TrajectoryGospaParts>,
    pub(super) pairs: Vec<(usize, usize, f64)>,
    pub(super) switches: f64,
    pub(super) gap: f64,
}

impl Problem {
    pub(super) fn new<const D: usize>(
        truth: &[Trajectory<D>],
        tracks: &[Trajectory<D>],
        scale: Scale,
        switch: f64,
    ) -> Self {
        let all = || truth.iter().chain(tracks).filter(|one| !one.positions.is_empty());
        let start = all().map(|one| one.start).min().unwrap_or(0);
        let end = all().map(|one| one.steps().end).max().unwrap_or(start);
        let (mut objects, mut reported) = (Walk::new(truth), Walk::new(tracks));
        let mut existing = Vec::with_capacity(end - start);
        let mut near = NearPairs::default();
        for step in start..end {
            let ((rows, there), (columns, here)) = (objects.at(step), reported.at(step));
            existing.push((rows.len() as f64, columns.len() as f64));
            for (i, j, distance) in pairs_within(&there, &here, scale.cutoff) {
                if distance < scale.cutoff {
                    near.push(rows[i], columns[j], step, distance);
                }
            }
        }
        let pairs = near.sorted();
        let mut contested = vec![0..0; tracks.len()];
        for pair in &pairs {
            let (own, steps): (&mut Range<usize>, _) = (&mut contested[pair.track], pair.steps());
            let new = own.start == own.end;
            *own = if new { steps } else { own.start.min(steps.start)..own.end.max(steps.end) };
        }
        Problem { scale, switch, steps: start..end, existing, pairs, contested }
    }

    /// The first step at which anything exists.
    pub(super) fn start(&self) -> usize {
        self.steps.start
    }

    /// The pair of an object and a track, if they come near each other.
    pub(super) fn pair(&self, object: usize, track: usize) -> Option<&Pair> {
        let found = self.pairs.binary_search_by_key(&(object, track), |pair| (pair.object, pair.track));
        found.ok().map(|place| &self.pairs[place])
    }

    /// The pairs of one object.
    pub(super) fn pairs_of(&self, object: usize) -> &[Pair] {
        let first = self.pairs.partition_point(|pair| pair.object < object);
        let last = self.pairs.partition_point(|pair| pair.object <= object);
        &self.pairs[first..last]
    }

    /// Finds the best weights and what they cost.
    pub(super) fn solve(&self) -> Solved {
        let groups = Groups::solve(self);
        let mut account = Account::new(self);
        groups.each_share(|object, share, steps| account.add(object, share, steps));
        account.close(groups.gap())
    }
}

/// The pairs while they grow, step by step.
#[derive(Default)]
struct NearPairs {
    pairs: Vec<Pair>,
    places: HashMap<(usize, usize), usize>,
}

impl NearPairs {
    fn push(&mut self, object: usize, track: usize, step: usize, distance: f64) {
        let place = *self.places.entry((object, track)).or_insert_with(|| {
            self.pairs.push(Pair { object, track, first: step, distances: Vec::new() });
            self.pairs.len() - 1
        });
        let pair = &mut self.pairs[place];
        pair.distances.resize(step - pair.first, f64::INFINITY);
        pair.distances.push(distance);
    }

    fn sorted(mut self) -> Vec<Pair> {
        self.pairs.sort_unstable_by_key(|pair| (pair.object, pair.track));
        self.pairs
    }
}

/// One step of a path: its track, if it has one, and how often a track is taken or left then.
pub(super) struct PathStep {
    pub(super) step: usize,
    pub(super) track: Option<usize>,
    pub(super) changes: f64,
}

/// What the paths cost, part by part.
struct Account<'a> {
    problem: &'a Problem,
    steps: Vec<TrajectoryGospaParts>,
    found: Vec<f64>,
    /// Weights and distances of what was found.
    localised: Vec<(f64, f64)>,
    together: BTreeMap<(usize, usize), f64>,
    switches: f64,
}

impl<'a> Account<'a> {
    fn new(problem: &'a Problem) -> Self {
        Account {
            problem,
            steps: vec![TrajectoryGospaParts::default(); problem.existing.len()],
            found: vec![0.0; problem.existing.len()],
            localised: Vec::new(),
            together: BTreeMap::new(),
            switches: 0.0,
        }
    }

    /// Adds what an object does with a share of its weight.
    fn add(&mut self, object: usize, share: f64, path: &[PathStep]) {
        let (scale, penalty) = (&self.problem.scale, self.problem.scale.power(self.problem.switch));
        let mut pair: Option<&Pair> = None;
        for &PathStep { step, track, changes } in path {
            let at = step - self.problem.steps.start;
            if changes > 0.0 {
                self.switches += 0.5 * share * changes;
                self.steps[at].switches += 0.5 * share * changes * penalty;
            }
            let Some(track) = track else { continue };
            if pair.is_none_or(|pair| pair.track != track) {
                pair = self.problem.pair(object, track);
            }
            if let Some(distance) = pair.and_then(|pair| pair.at(step)) {
                self.localised.push((share, distance));
                self.steps[at].localisation += share * scale.power(distance);
                self.found[at] += share;
                *self.together.entry((object, track)).or_default() += share;
            }
        }
    }

    fn close(mut self, gap: f64) -> Solved {
        let scale = &self.problem.scale;
        let mut alone = 0.0;
        for ((parts, found), (objects, tracks)) in
            self.steps.iter_mut().zip(&self.found).zip(&self.problem.existing)
        {
            let (missed, false_alarms) = ((objects - found).max(0.0), (tracks - found).max(0.0));
            parts.missed = scale.price(0.5 * missed);
            parts.false_alarm = scale.price(0.5 * false_alarms);
            alone += 0.5 * (missed + false_alarms);
        }
        let prices = [(alone, scale.cutoff), (self.switches, self.problem.switch)];
        let total = scale.norm(self.localised.iter().copied().chain(prices));
        let pairs =
            self.together.into_iter().map(|((object, track), steps)| (object, track, steps)).collect();
        Solved { total, steps: self.steps, pairs, switches: self.switches, gap }
    }
}
