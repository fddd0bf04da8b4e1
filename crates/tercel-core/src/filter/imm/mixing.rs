//! Where each mode starts from, when modes may have changed.

use super::{blended, moments, settle};
use crate::belief::Gaussian;
use crate::extended::InverseWishart;
use crate::filter::transition::Leap;

/// Where a mode starts from: the moments of all modes that may have led to it, and their probability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Origin<const N: usize> {
    pub weight: f64,
    pub state: Gaussian<N>,
    /// In filters that have one.
    pub extent: Option<InverseWishart>,
    /// Whether anything of other modes is in it.
    pub mixed: bool,
    /// Probability, state and extent before the link that is being followed.
    before: (f64, Gaussian<N>, Option<InverseWishart>),
}

impl<const N: usize> Origin<N> {
    /// A mode that has not changed.
    pub fn new(weight: f64, state: Gaussian<N>, extent: Option<InverseWishart>) -> Self {
        Origin { weight, state, extent, mixed: false, before: (weight, state, extent) }
    }
}

/// Follows one link of the chain. Moments of mixtures of mixtures are those of the whole, so links are followed one by one.
pub(super) fn mix<const N: usize>(origins: &mut [Origin<N>], leap: &Leap<'_>) {
    for first in leap.groups(origins.len()) {
        let group = || (first..).step_by(leap.stride).take(leap.modes);
        match leap.even {
            Some([stay, change]) if stay >= change => {
                mix_evenly(origins, group, [stay - change, change]);
            }
            _ => {
                group().for_each(|i| {
                    origins[i].before = (origins[i].weight, origins[i].state, origins[i].extent)
                });
                for (j, to) in group().enumerate() {
                    mix_into(origins, group, leap, j, to);
                }
            }
        }
    }
}

/// Every mode keeps a share of its own, and gets an equal share of all modes together.
fn mix_evenly<const N: usize, I: Iterator<Item = usize> + Clone>(
    origins: &mut [Origin<N>],
    group: impl Fn() -> I,
    [own, common]: [f64; 2],
) {
    let total: f64 = group().map(|i| origins[i].weight).sum();
    let parts = group().filter(|i| origins[*i].weight > 0.0).map(|i| (origins[i].weight, &origins[i].state));
    let together = moments(parts);
    let extents = blended(group().map(|i| (origins[i].weight, origins[i].extent)));
    for i in group() {
        let Origin { weight, state, extent, mixed, .. } = &mut origins[i];
        // Without anything from others, merging would only round.
        if common * (total - *weight) > 0.0 {
            state.merge(own * *weight, &together, common * total);
            settle(state);
            if let (Some(extent), Some(extents)) = (extent, &extents) {
                extent.merge(own * *weight, extents, common * total);
            }
            *mixed = true;
        }
        *weight = own * *weight + common * total;
    }
}

/// The mode `to`, which is value `j` of the link, gets what flows from each mode of its group.
fn mix_into<const N: usize, I: Iterator<Item = usize> + Clone>(
    origins: &mut [Origin<N>],
    group: impl Fn() -> I,
    leap: &Leap<'_>,
    j: usize,
    to: usize,
) {
    let flow = |i: usize, weight: f64| weight * leap.probabilities[i * leap.modes + j];
    let total: f64 = group().enumerate().map(|(i, from)| flow(i, origins[from].before.0)).sum();
    let own = flow(j, origins[to].before.0);
    if total > own {
        let parts = group().enumerate().filter_map(|(i, from)| {
            let (weight, state, _) = &origins[from].before;
            let flow = flow(i, *weight);
            (flow > 0.0).then_some((flow / total, state))
        });
        let state = moments(parts);
        let extents = group().enumerate().map(|(i, from)| {
            let (weight, _, extent) = &origins[from].before;
            (flow(i, *weight), *extent)
        });
        let extent = blended(extents);
        (origins[to].state, origins[to].extent, origins[to].mixed) = (state, extent, true);
    }
    origins[to].weight = total;
}
