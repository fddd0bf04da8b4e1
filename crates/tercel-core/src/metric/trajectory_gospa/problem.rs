//! From trajectories to clusters of paths, and back to parts.

use std::ops::Range;

use super::TrajectoryGospaParts;
use super::chain::Chain;
use super::relaxation::{Relaxation, Solution};
use crate::metric::scale::{Scale, euclidean};
use crate::metric::trajectory::Trajectory;

/// Bounds have met when they differ by this share of `cᵖ/2` for each step of each trajectory.
const TOLERANCE: f64 = 1e-10;
/// Climbs of the prices before the linear programme is called.
const CLIMBS: usize = 400;

/// What is gained at each step when a track stands for an object: `cᵖ - d(x_i, y_j)ᵖ`.
struct Pair {
    object: usize,
    track: usize,
    first: usize,
    gains: Vec<f64>,
}

/// Which objects and tracks exist at each step, and which of them come near each other.
pub(super) struct Problem {
    steps: Range<usize>,
    objects: usize,
    tracks: usize,
    /// Numbers of objects and of tracks at each step.
    existing: Vec<(f64, f64)>,
    pairs: Vec<Pair>,
    highest: f64,
}

/// Parts of each step, steps of each pair, and how far the sum may lie above the minimum.
#[derive(Default)]
pub(super) struct Solved {
    pub(super) steps: Vec<TrajectoryGospaParts>,
    pub(super) pairs: Vec<(usize, usize, f64)>,
    pub(super) gap: f64,
}

impl Problem {
    pub(super) fn new<const D: usize>(
        truth: &[Trajectory<D>],
        tracks: &[Trajectory<D>],
        scale: &Scale,
    ) -> Self {
        let all = || truth.iter().chain(tracks).filter(|one| !one.positions.is_empty());
        let start = all().map(|one| one.start).min().unwrap_or(0);
        let end = all().map(|one| one.steps().end).max().unwrap_or(start);
        let mut existing = vec![(0.0, 0.0); end - start];
        for (step, count) in (start..end).zip(&mut existing) {
            let at = |set: &[Trajectory<D>]| set.iter().filter(|one| one.at(step).is_some()).count() as f64;
            *count = (at(truth), at(tracks));
        }
        let mut pairs = Vec::new();
        for (object, x) in truth.iter().enumerate() {
            for (track, y) in tracks.iter().enumerate() {
                pairs.extend(pair(x, y, scale).map(|(first, gains)| Pair { object, track, first, gains }));
            }
        }
        let (objects, tracks) = (truth.len(), tracks.len());
        Problem { steps: start..end, objects, tracks, existing, pairs, highest: scale.highest() }
    }

    /// The first step at which anything exists.
    pub(super) fn start(&self) -> usize {
        self.steps.start
    }

    /// Finds the best weights for a price `change` of taking or leaving a track.
    pub(super) fn solve(&self, change: f64) -> Solved {
        let mut solved = Solved::default();
        solved.steps.resize(self.existing.len(), TrajectoryGospaParts::default());
        let mut found = vec![0.0; self.existing.len()];
        for cluster in self.clusters() {
            self.solve_cluster(&cluster, change, &mut solved, &mut found);
        }
        let half = 0.5 * self.highest;
        for ((parts, found), (objects, tracks)) in solved.steps.iter_mut().zip(found).zip(&self.existing) {
            parts.missed = half * (objects - found).max(0.0);
            parts.false_alarm = half * (tracks - found).max(0.0);
        }
        solved.pairs.sort_by_key(|(object, track, _)| (*object, *track));
        solved
    }

    /// Pairs whose objects or tracks are joined by others.
    fn clusters(&self) -> Vec<Vec<&Pair>> {
        let mut parents: Vec<usize> = (0..self.objects + self.tracks).collect();
        for pair in &self.pairs {
            let (a, b) = (root(&mut parents, pair.object), root(&mut parents, self.objects + pair.track));
            parents[a.max(b)] = a.min(b);
        }
        let mut clusters: Vec<Vec<&Pair>> = vec![Vec::new(); self.objects + self.tracks];
        for pair in &self.pairs {
            clusters[root(&mut parents, pair.object)].push(pair);
        }
        clusters.retain(|cluster| !cluster.is_empty());
        clusters
    }

    fn solve_cluster(&self, cluster: &[&Pair], change: f64, solved: &mut Solved, found: &mut [f64]) {
        let start = cluster.iter().map(|pair| pair.first).min().unwrap_or(0);
        let end = cluster.iter().map(|pair| pair.first + pair.gains.len()).max().unwrap_or(start);
        let steps = end - start;
        let objects = numbers(cluster.iter().map(|pair| pair.object));
        let tracks = numbers(cluster.iter().map(|pair| pair.track));
        let mut chains = vec![Chain { gains: Vec::new(), change, steps }; objects.len()];
        for pair in cluster {
            let mut gains = vec![0.0; steps];
            gains[pair.first - start..][..pair.gains.len()].copy_from_slice(&pair.gains);
            let track = place(&tracks, pair.track) as u32;
            chains[place(&objects, pair.object)].gains.push((track, gains));
        }
        let tolerance = TOLERANCE * 0.5 * self.highest * (steps * (objects.len() + tracks.len())) as f64;
        let relaxation =
            Relaxation { chains: &chains, tracks: tracks.len(), steps, tolerance, climbs: CLIMBS };
        let solution = relaxation.solve();
        solved.gap += solution.gap;
        let first = start - self.steps.start;
        let (parts, found) = (&mut solved.steps[first..][..steps], &mut found[first..][..steps]);
        for (object, chain) in chains.iter().enumerate() {
            for (track, gains) in &chain.gains {
                let weights = weights(&solution, object, *track, steps);
                let together = self.account(&weights, gains, change, parts, found);
                if together > 0.0 {
                    solved.pairs.push((objects[object], tracks[*track as usize], together));
                }
            }
        }
    }

    /// Adds localisation, switches and what was found of one pair; returns for how many steps the two were together.
    fn account(
        &self,
        weights: &[f64],
        gains: &[f64],
        change: f64,
        parts: &mut [TrajectoryGospaParts],
        found: &mut [f64],
    ) -> f64 {
        let mut together = 0.0;
        for (step, (&weight, &gain)) in weights.iter().zip(gains).enumerate() {
            if gain > 0.0 {
                parts[step].localisation += weight * (self.highest - gain);
                found[step] += weight;
                together += weight;
            }
            if step > 0 {
                parts[step].switches += change * (weight - weights[step - 1]).abs();
            }
        }
        together
    }
}

/// How much of an object a track stands for at each step.
fn weights(solution: &Solution, object: usize, track: u32, steps: usize) -> Vec<f64> {
    let mut weights = vec![0.0; steps];
    for share in solution.shares.iter().filter(|share| share.object == object) {
        for (weight, own) in weights.iter_mut().zip(&share.path) {
            if *own == track {
                *weight += share.share;
            }
        }
    }
    weights
}

/// First step and gains of the time between the first and the last at which the two are closer than the cut-off.
fn pair<const D: usize>(x: &Trajectory<D>, y: &Trajectory<D>, scale: &Scale) -> Option<(usize, Vec<f64>)> {
    let highest = scale.highest();
    let gain = |step: usize| match (x.at(step), y.at(step)) {
        (Some(x), Some(y)) => highest - scale.power(euclidean(x, y).min(scale.cutoff)),
        _ => 0.0,
    };
    let mut common = x.start.max(y.start)..x.steps().end.min(y.steps().end);
    let first = common.find(|step| gain(*step) > 0.0)?;
    let last = common.rfind(|step| gain(*step) > 0.0).unwrap_or(first);
    Some((first, (first..=last).map(gain).collect()))
}

fn root(parents: &mut [usize], mut of: usize) -> usize {
    while parents[of] != of {
        parents[of] = parents[parents[of]];
        of = parents[of];
    }
    of
}

/// Sorted, each once.
fn numbers(all: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut numbers: Vec<usize> = all.collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

fn place(numbers: &[usize], number: usize) -> usize {
    numbers.partition_point(|other| *other < number)
}
