//! How a scan changes the hypotheses.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::cluster::{Cluster, Leaf};
use super::grow::Growth;
use super::{Pmbm, Scratch};
use crate::filter::Filter;
use crate::multi::{Scan, TrackId, ln_clutter_at};

/// A leaf and a measurement in its gate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    cluster: usize,
    pub tree: usize,
    pub leaf: usize,
    pub measurement: usize,
    /// `ln` of how much heavier a hypothesis gets by having the pair than by having neither.
    pub ln_ratio: f64,
    /// The same, times the probability of the leaf.
    expected: f64,
}

/// What a measurement is if it belongs to no tree: clutter or a new object.
pub(super) struct Fresh<B> {
    /// Label and leaf of the new object, unless that is too improbable or was taken already.
    pub object: Option<(TrackId, Leaf<B>)>,
}

/// Logarithms of ratios are cut here: beyond, a pair is certain or impossible, and sums must stay finite.
const LARGEST_LN: f64 = 500.0;

/// `ln(1 - p)`, finite for a certain event too.
pub(super) fn ln_not(probability: f64) -> f64 {
    (1.0 - probability).max(f64::MIN_POSITIVE).ln()
}

impl<B: Clone> Pmbm<B> {
    /// Conditions all clusters on the scan.
    pub(super) fn update<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        places: &[Option<Vector2<f64>>],
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let (mut fresh, intensities) = self.fresh(filter, scan, places);
        self.gate(filter, scan, &intensities);
        self.drop_weak(scan.measurements.len());
        self.join(scan.measurements.len());
        let Scratch { candidates, k_best, .. } = &mut self.scratch;
        candidates.sort_by_key(|c| (c.cluster, c.measurement, c.tree, c.leaf));
        let config = &self.config;
        let mut rest = &candidates[..];
        let mut next = Vec::with_capacity(self.clusters.len() + fresh.len());
        for (number, cluster) in self.clusters.drain(..).enumerate() {
            let count = rest.iter().take_while(|candidate| candidate.cluster == number).count();
            let (own, others) = rest.split_at(count);
            rest = others;
            let growth = Growth::new(cluster, own);
            let mut grown = growth.grow(filter, scan, &mut fresh, k_best, (config.hypotheses, config.prune));
            grown.reduce(filter, config.merge);
            grown.split(&mut next);
        }
        // What no tree has in its gate is clutter or the beginning of a tree of its own.
        let alone = fresh.into_iter().filter_map(|fresh| fresh.object);
        next.extend(alone.map(|(label, leaf)| Cluster::single(label, leaf)));
        self.clusters = next;
    }

    /// For each measurement the new object that it may be, and the logarithm of the intensity of measurements that belong to no tree.
    fn fresh<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        places: &[Option<Vector2<f64>>],
    ) -> (Vec<Fresh<B>>, Vec<f64>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let mut all = Vec::with_capacity(scan.measurements.len());
        let mut ln_intensities = Vec::with_capacity(scan.measurements.len());
        let background = scan.clutter.background();
        for (number, (measurement, place)) in scan.measurements.iter().zip(places).enumerate() {
            let seen = scan.detection.probability(place.as_ref());
            let missed = if scan.detection.is_reports() { 0.0 } else { seen };
            let objects =
                seen * self.undetected.intensity(place.as_ref(), background) * filter.area(measurement);
            let ln_clutter = ln_clutter_at(filter, scan, measurement);
            let ln_intensity =
                ln_clutter.max(objects.ln()) + (-(ln_clutter - objects.ln()).abs()).exp().ln_1p();
            let existence = (objects.ln() - ln_intensity).exp();
            let enough = existence >= self.config.management.min_existence;
            // A measurement that cannot say where an object is starts none.
            let belief = enough.then(|| filter.birth(measurement).ok()).flatten();
            let object = belief.map(|belief| {
                let label = self.next;
                self.next += 1;
                (label, Leaf { existence, belief, measurement: Some(number), detection: missed })
            });
            all.push(Fresh { object });
            ln_intensities.push(ln_intensity);
        }
        (all, ln_intensities)
    }

    /// Lists the pairs of leaves and measurements within the gates.
    fn gate<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>, ln_intensities: &[f64])
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { vicinity, candidates, .. } = &mut self.scratch;
        candidates.clear();
        for (cluster, group) in self.clusters.iter_mut().enumerate() {
            for tree in 0..group.trees.len() {
                let shares = group.shares(tree);
                for (leaf, here) in group.trees[tree].leaves.iter_mut().enumerate() {
                    let (sight, near) = vicinity.look(filter, &here.belief, scan);
                    here.detection = sight.missed;
                    let ln_prior = (here.existence * sight.seen).ln() - ln_not(here.existence * sight.missed);
                    for &measurement in near {
                        // A pair that cannot be compared numerically is a pair outside the gate.
                        let Ok(innovation) = filter.innovation(&here.belief, &scan.measurements[measurement])
                        else {
                            continue;
                        };
                        let ln_ratio = ln_prior + innovation.log_likelihood - ln_intensities[measurement];
                        if !self.config.gate.contains(&innovation) || ln_ratio.is_nan() {
                            continue;
                        }
                        let ln_ratio = ln_ratio.clamp(-LARGEST_LN, LARGEST_LN);
                        let expected = shares[leaf] * ln_ratio.exp();
                        candidates.push(Candidate { cluster, tree, leaf, measurement, ln_ratio, expected });
                    }
                }
            }
        }
    }

    /// Drops the pairs that explain their measurement with less than the pruning probability: they would only entangle
    /// trees that have nothing to do with each other.
    fn drop_weak(&mut self, measurements: usize) {
        let mut totals = vec![1.0; measurements];
        for candidate in &self.scratch.candidates {
            totals[candidate.measurement] += candidate.expected;
        }
        let prune = self.config.prune;
        self.scratch.candidates.retain(|c| c.expected >= prune * totals[c.measurement]);
    }

    /// Joins the clusters that compete for measurements.
    fn join(&mut self, measurements: usize) {
        let Scratch { candidates, groups, .. } = &mut self.scratch;
        let pairs = candidates.iter().map(|candidate| (candidate.cluster, candidate.measurement));
        groups.build(pairs, self.clusters.len(), measurements);
        // Where each cluster goes, and how many trees are there before its own.
        let mut moved = Vec::with_capacity(self.clusters.len());
        let mut joined: Vec<Cluster<B>> = Vec::with_capacity(self.clusters.len());
        let mut homes: BTreeMap<usize, usize> = BTreeMap::new();
        for (number, cluster) in self.clusters.drain(..).enumerate() {
            match homes.entry(groups.of(number)) {
                std::collections::btree_map::Entry::Vacant(entry) => {
                    entry.insert(joined.len());
                    moved.push((joined.len(), 0));
                    joined.push(cluster);
                }
                std::collections::btree_map::Entry::Occupied(entry) => {
                    let home = &mut joined[*entry.get()];
                    moved.push((*entry.get(), home.trees.len()));
                    home.join(cluster, self.config.hypotheses);
                }
            }
        }
        for candidate in candidates.iter_mut() {
            let (home, before) = moved[candidate.cluster];
            (candidate.cluster, candidate.tree) = (home, candidate.tree + before);
        }
        self.clusters = joined;
    }
}
