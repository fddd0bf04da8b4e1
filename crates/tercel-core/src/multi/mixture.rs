//! Mixtures of beliefs, and how they are kept small.

use super::plane;
use crate::association::PlaceIndex;
use crate::filter::Filter;

/// One term of a mixture. What the tag says belongs to the term, and to a merged one what the heaviest part's tag says.
#[derive(Debug, Clone)]
pub(super) struct Term<B, T> {
    pub weight: f64,
    pub belief: B,
    pub tag: T,
}

/// Merges terms that are near each other. Its buffers serve again and again.
#[derive(Debug, Clone)]
pub(super) struct Reduction<B, T> {
    index: PlaceIndex,
    near: Vec<usize>,
    taken: Vec<bool>,
    merged: Vec<Term<B, T>>,
}

impl<B, T> Default for Reduction<B, T> {
    fn default() -> Self {
        Reduction { index: PlaceIndex::default(), near: Vec::new(), taken: Vec::new(), merged: Vec::new() }
    }
}

impl<B: Clone, T: Clone> Reduction<B, T> {
    /// Merges, heaviest first, the terms within a squared Mahalanobis distance of `limit` under the covariance of the
    /// heaviest, and keeps the `cap` heaviest of the result, in the order of their weights.
    pub fn reduce<const N: usize, F>(
        &mut self,
        filter: &F,
        terms: &mut Vec<Term<B, T>>,
        limit: f64,
        cap: usize,
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        // The sort is stable and weights that tie keep their order, so the result does not depend on the platform.
        terms.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        if terms.len() < 2 || limit <= 0.0 {
            terms.truncate(cap);
            return;
        }
        let Reduction { index, near, taken, merged } = self;
        let states: Vec<_> = terms.iter().map(|term| plane(&filter.state(&term.belief))).collect();
        index.build(&states.iter().map(|state| state.map(|s| s.0)).collect::<Vec<_>>());
        taken.clear();
        taken.resize(terms.len(), false);
        merged.clear();
        for (heaviest, term) in terms.iter().enumerate() {
            if taken[heaviest] {
                continue;
            }
            let mut whole = term.clone();
            match &states[heaviest] {
                Some((centre, spread)) => index.near(centre, spread, limit, near),
                None => near.splice(.., 0..terms.len()).for_each(drop),
            }
            for &other in near.iter().filter(|&&other| other > heaviest) {
                let part = &terms[other];
                if !taken[other] && filter.distance(&term.belief, &part.belief, limit) <= limit {
                    taken[other] = true;
                    filter.merge(&mut whole.belief, whole.weight, &part.belief, part.weight);
                    whole.weight += part.weight;
                }
            }
            merged.push(whole);
        }
        merged.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        merged.truncate(cap);
        std::mem::swap(terms, merged);
    }
}
