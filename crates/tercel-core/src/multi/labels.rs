//! Tracks read off a mixture whose terms carry labels.

use std::collections::BTreeMap;

use super::mixture::Term;
use super::{Management, Status, Track, TrackId, Use, plane};
use crate::filter::Filter;

/// What a term of a labelled mixture carries besides weight and belief.
#[derive(Debug, Clone, Copy)]
pub(super) struct Label {
    pub id: TrackId,
    /// The measurement of this scan that updated it.
    pub measurement: Option<usize>,
    /// Whether the sensor could have seen it.
    pub in_view: bool,
}

/// A term whose label says which object it belongs to.
pub(super) type Labelled<B> = Term<B, Label>;

/// The tracks behind the labels, and what became of the measurements.
#[derive(Debug, Clone)]
pub(super) struct Roster<B> {
    pub tracks: Vec<Track<B>>,
    pub uses: Vec<Use>,
    next: TrackId,
}

/// Terms of one label that lie together: what is known of one object.
struct Group {
    /// The heaviest term.
    lead: usize,
    members: Vec<usize>,
    weight: f64,
}

/// A group stands for one object; another half of one is more than two missed and detected versions add up to.
const FULL: f64 = 1.5;

/// Squared distance, under both covariances, of two positions that may be the same: 99.9 % of two components.
const TOGETHER: f64 = 13.8;

/// Parts of a group below this share do not change what is reported.
const NEGLIGIBLE: f64 = 0.01;

impl<B> Default for Roster<B> {
    fn default() -> Self {
        Roster { tracks: Vec::new(), uses: Vec::new(), next: 1 }
    }
}

impl<B: Clone> Roster<B> {
    /// Forgets the tracks that were deleted in the last scan, and lets time pass.
    pub fn begin(&mut self, dt: f64) {
        self.tracks.retain(|track| track.status != Status::Deleted);
        self.tracks.iter_mut().for_each(|track| track.wait(dt));
    }

    /// Raises the weights of each label, where they add up to less than its track exists at the least: see [`Management`].
    pub fn hold<'a>(
        &self,
        weights: impl Iterator<Item = (TrackId, &'a mut f64)>,
        management: &Management,
        (time, survival): (f64, f64),
    ) {
        let mut labels: BTreeMap<TrackId, Vec<&mut f64>> = BTreeMap::new();
        weights.for_each(|(label, weight)| labels.entry(label).or_default().push(weight));
        for track in &self.tracks {
            let Some(weights) = labels.get_mut(&track.id) else { continue };
            let sum: f64 = weights.iter().map(|weight| **weight).sum();
            let least = management.least(track, time, survival);
            if sum > 0.0 && sum < least {
                weights.iter_mut().for_each(|weight| **weight *= least / sum);
            }
        }
    }

    fn fresh(&mut self) -> TrackId {
        let label = self.next;
        self.next += 1;
        label
    }

    /// Starts a tentative track at a measurement, and returns its label.
    pub fn start(&mut self, belief: &B, existence: f64, measurement: usize, time: f64) -> TrackId {
        let label = self.fresh();
        self.uses[measurement] = Use::Started(label);
        self.tracks.push(Track::new(label, belief.clone(), existence, measurement, time));
        label
    }

    /// Whether the track of a label was not given up.
    pub fn lives(&self, label: TrackId) -> bool {
        let at = self.tracks.binary_search_by_key(&label, |track| track.id);
        at.is_ok_and(|at| self.tracks[at].status != Status::Deleted)
    }

    /// Reads the tracks off terms that are sorted by falling weight. Terms of one label that lie together are one object:
    /// its existence is the sum of their weights, its belief their merger, and it was seen when the sum reaches
    /// `extract`. Where a label stands for a second such group, that becomes a new track. Every measurement that updated
    /// a track is marked; the others count as clutter. A track that is gone is reported where it would be now, after a time `dt`.
    pub fn read<const N: usize, F>(
        &mut self,
        filter: &F,
        terms: &mut [Labelled<B>],
        measurements: usize,
        (extract, (dt, time), management): (f64, (f64, f64), &Management),
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        for track in &mut self.tracks {
            track.existence = 0.0;
            track.measurement = None;
        }
        for (label, groups) in groups(filter, terms) {
            // A label whose track is gone is a track of its own again.
            let known = self.tracks.binary_search_by_key(&label, |track| track.id).ok();
            for (place, group) in groups.iter().enumerate() {
                match known {
                    Some(at) if place == 0 => self.show(at, filter, terms, group, (extract, time)),
                    Some(at) if group.weight < extract => {
                        let track = &mut self.tracks[at];
                        track.existence = (track.existence + group.weight).min(1.0);
                    }
                    _ => self.separate(filter, terms, group, time),
                }
            }
        }
        for track in &mut self.tracks {
            if track.existence == 0.0 {
                filter.predict(&mut track.belief, dt);
            }
            track.time = time;
            management.judge(track, time);
        }
        self.uses.clear();
        self.uses.resize(measurements, Use::Clutter);
        for track in self.tracks.iter().rev() {
            if let Some(number) = track.measurement {
                self.uses[number] = Use::Updated(track.id);
            }
        }
    }

    /// Updates a track from the group of its label. A light group is no sighting, whatever updated it.
    fn show<const N: usize, F>(
        &mut self,
        at: usize,
        filter: &F,
        terms: &[Labelled<B>],
        group: &Group,
        (extract, time): (f64, f64),
    ) where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let (track, lead) = (&mut self.tracks[at], &terms[group.lead]);
        track.existence = group.weight.min(1.0);
        track.belief = group.belief(filter, terms);
        match lead.tag.measurement {
            Some(number) if group.weight >= extract => {
                track.hit(number, time);
                track.reports = !lead.tag.in_view;
            }
            _ if lead.tag.in_view => track.miss(),
            _ => track.unseen(),
        }
    }

    /// Makes a group a track of its own.
    fn separate<const N: usize, F>(&mut self, filter: &F, terms: &mut [Labelled<B>], group: &Group, time: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let label = self.fresh();
        let belief = group.belief(filter, terms);
        let number = terms[group.lead].tag.measurement;
        let existence = group.weight.min(1.0);
        let mut track = Track::new(label, belief, existence, number.unwrap_or_default(), time);
        track.measurement = number;
        self.tracks.push(track);
        for &member in &group.members {
            terms[member].tag.id = label;
        }
    }
}

impl Group {
    /// What the terms say together.
    fn belief<const N: usize, F>(&self, filter: &F, terms: &[Labelled<F::Belief>]) -> F::Belief
    where
        F: Filter<N> + ?Sized,
    {
        let mut belief = terms[self.lead].belief.clone();
        let mut weight = terms[self.lead].weight;
        for &member in self.members.iter().filter(|&&member| member != self.lead) {
            let part = &terms[member];
            if part.weight > NEGLIGIBLE * self.weight {
                filter.merge(&mut belief, weight, &part.belief, part.weight);
                weight += part.weight;
            }
        }
        belief
    }
}

/// The groups of each label, heaviest lead first.
fn groups<const N: usize, F>(filter: &F, terms: &[Labelled<F::Belief>]) -> BTreeMap<TrackId, Vec<Group>>
where
    F: Filter<N> + ?Sized,
{
    let mut all: BTreeMap<TrackId, Vec<Group>> = BTreeMap::new();
    let states: Vec<_> = terms.iter().map(|term| plane(&filter.state(&term.belief))).collect();
    let together = |a: usize, b: usize| match (&states[a], &states[b]) {
        (Some((place, spread)), Some((other, other_spread))) => {
            let offset = place - other;
            let inverse = (spread + other_spread).try_inverse();
            inverse.is_some_and(|inverse| (offset.transpose() * inverse * offset)[0] <= TOGETHER)
        }
        _ => false,
    };
    for (number, term) in terms.iter().enumerate() {
        let groups = all.entry(term.tag.id).or_default();
        let home = groups
            .iter_mut()
            .find(|group| group.weight + term.weight <= FULL && together(group.lead, number));
        match home {
            Some(group) => {
                group.members.push(number);
                group.weight += term.weight;
            }
            None => groups.push(Group { lead: number, members: vec![number], weight: term.weight }),
        }
    }
    all
}
