//! Which objects have to be looked at together.

use super::chain::{Chain, NONE, Near};
use super::problem::{Pair, PathStep, Problem};
use super::relaxation::{Relaxation, Share};

/// Bounds have met when they differ by this share of `cᵖ/2` for each step of each trajectory.
const TOLERANCE: f64 = 1e-10;
/// Climbs of the prices before the linear programme is called.
const CLIMBS: usize = 400;
/// A sum below this share of the unit is too near to the smallest number to be compared.
const VANISHING: f64 = 1e-250;

/// Objects that were solved together, without a look at all others.
struct Group {
    objects: Vec<usize>,
    /// Tracks that these come near, by their number within the group.
    tracks: Vec<usize>,
    chains: Vec<Chain>,
    shares: Vec<Share>,
    gap: f64,
}

/// Objects in groups such that no two groups use a track at the same time.
///
/// Every group is at its own minimum, which is as low as it can be among all others: if the groups do not collide, their sum
/// is the minimum of the whole. At first each object is a group of its own; groups that collide are joined and solved again.
pub(super) struct Groups {
    groups: Vec<Group>,
}

impl Groups {
    pub(super) fn solve(problem: &Problem) -> Groups {
        let mut objects: Vec<usize> = problem.pairs.iter().map(|pair| pair.object).collect();
        objects.dedup();
        let groups = objects.into_iter().map(|object| Group::solve(problem, vec![object])).collect();
        let mut groups = Groups { groups };
        while groups.join_colliding(problem) {}
        groups
    }

    /// How far the sum may lie above the minimum (mᵖ).
    pub(super) fn gap(&self) -> f64 {
        self.groups.iter().map(|group| group.gap).sum()
    }

    /// Calls `each` with object, weight and steps of every path.
    pub(super) fn each_share(&self, mut each: impl FnMut(usize, f64, &[PathStep])) {
        for group in &self.groups {
            for share in &group.shares {
                let chain = &group.chains[share.object];
                let mut steps = Vec::with_capacity(share.path.len());
                chain.follow(&share.path, |k, near, changes| {
                    let track = near.map(|near| group.tracks[near.track as usize]);
                    steps.push(PathStep { step: chain.steps.start + k, track, changes });
                });
                each(group.objects[share.object], share.share, &steps);
            }
        }
    }

    /// Joins groups that use a track more than once at any step, and solves what was joined; tells whether there were any.
    fn join_colliding(&mut self, problem: &Problem) -> bool {
        let mut leaders: Vec<usize> = (0..self.groups.len()).collect();
        let mut collided = false;
        // By track and step: the first group that uses it, and how much of it is used.
        let mut used: Vec<Vec<(u32, f64)>> =
            problem.contested.iter().map(|steps| vec![(NONE, 0.0); steps.len()]).collect();
        for (number, group) in self.groups.iter().enumerate() {
            for share in &group.shares {
                let chain = &group.chains[share.object];
                chain.follow(&share.path, |k, near, _| {
                    let Some(near) = near else { return };
                    let step = chain.steps.start + k - near.first;
                    let (user, sum) = &mut used[group.tracks[near.track as usize]][step];
                    *sum += share.share;
                    if *user == NONE {
                        *user = number as u32;
                    } else if *user != number as u32 && *sum > 1.0 + 1e-9 {
                        collided = true;
                        let (a, b) = (leader(&mut leaders, number), leader(&mut leaders, *user as usize));
                        leaders[a.max(b)] = a.min(b);
                    }
                });
            }
        }
        if collided {
            self.join(problem, &mut leaders);
        }
        collided
    }

    fn join(&mut self, problem: &Problem, leaders: &mut [usize]) {
        let mut joined: Vec<Vec<Group>> = (0..self.groups.len()).map(|_| Vec::new()).collect();
        for (number, group) in std::mem::take(&mut self.groups).into_iter().enumerate() {
            joined[leader(leaders, number)].push(group);
        }
        for mut groups in joined.into_iter().filter(|groups| !groups.is_empty()) {
            if groups.len() == 1 {
                self.groups.append(&mut groups);
                continue;
            }
            let mut objects: Vec<usize> = groups.into_iter().flat_map(|group| group.objects).collect();
            objects.sort_unstable();
            self.groups.push(Group::solve(problem, objects));
        }
    }
}

impl Group {
    /// Solves the objects together. Where everything is found and all errors vanish against the cut-off, the largest of them is
    /// the next unit.
    fn solve(problem: &Problem, objects: Vec<usize>) -> Group {
        let mut tracks: Vec<usize> =
            objects.iter().flat_map(|&object| problem.pairs_of(object)).map(|pair| pair.track).collect();
        tracks.sort_unstable();
        tracks.dedup();
        let mut group = Group { objects, tracks, chains: Vec::new(), shares: Vec::new(), gap: 0.0 };
        let mut unit = problem.scale.cutoff;
        loop {
            let cost = group.solve_in(problem, unit);
            let farthest = group.farthest(problem);
            if cost > VANISHING || farthest == 0.0 || farthest >= unit {
                return group;
            }
            unit = farthest;
        }
    }

    /// Solves with this unit of length (m) and returns the cost in its `p`-th power.
    fn solve_in(&mut self, problem: &Problem, unit: f64) -> f64 {
        let terms = Terms::new(problem, &self.objects, &self.tracks, unit);
        self.chains = self.objects.iter().map(|&object| terms.chain(object)).collect();
        let tracks = self.tracks.len();
        let steps: usize = self.chains.iter().map(|chain| chain.alone.len()).max().unwrap_or(0);
        let tolerance = TOLERANCE * 0.5 * (steps * (self.objects.len() + tracks)) as f64;
        let places = terms.places.last().copied().unwrap_or(0);
        let relaxation = Relaxation { chains: &self.chains, tracks, places, tolerance, climbs: CLIMBS };
        let solution = relaxation.solve();
        self.shares = solution.shares;
        self.gap = if solution.gap > 0.0 { solution.gap * problem.scale.power(unit) } else { 0.0 };
        solution.cost
    }

    /// The largest distance of an object from a track that stands for it.
    fn farthest(&self, problem: &Problem) -> f64 {
        let mut farthest = 0.0f64;
        for share in &self.shares {
            let chain = &self.chains[share.object];
            chain.follow(&share.path, |k, near, _| {
                let pair = near.and_then(|near| {
                    problem.pair(self.objects[share.object], self.tracks[near.track as usize])
                });
                let distance = pair.and_then(|pair| pair.at(chain.steps.start + k));
                farthest = farthest.max(distance.unwrap_or(0.0));
            });
        }
        farthest
    }
}

/// The costs of a group in the `p`-th power of a unit of length.
struct Terms<'a> {
    problem: &'a Problem,
    tracks: &'a [usize],
    /// Where the prices of each track begin, and where those of the last one end.
    places: Vec<usize>,
    unit: f64,
    /// Stands for whatever outweighs everything that a group can save.
    highest: f64,
}

impl<'a> Terms<'a> {
    fn new(problem: &'a Problem, objects: &[usize], tracks: &'a [usize], unit: f64) -> Self {
        let mut places = vec![0];
        for &track in tracks {
            places.push(places[places.len() - 1] + problem.contested[track].len());
        }
        let near = objects.iter().flat_map(|&object| problem.pairs_of(object));
        let highest = 1.0 + near.map(|pair| pair.distances.len()).sum::<usize>() as f64;
        Terms { problem, tracks, places, unit, highest }
    }

    fn power(&self, length: f64) -> f64 {
        self.problem.scale.power(length / self.unit).min(self.highest)
    }

    fn chain(&self, object: usize) -> Chain {
        let pairs = self.problem.pairs_of(object);
        let contested = |track: usize| self.problem.contested[track].clone();
        let start = pairs.iter().map(|pair| contested(pair.track).start).min().unwrap_or(0);
        let end = pairs.iter().map(|pair| contested(pair.track).end).max().unwrap_or(start);
        // Where no track is near, nothing is lost without one.
        let (missed, mut alone) = (self.power(self.problem.scale.cutoff), vec![0.0; end - start]);
        for pair in pairs {
            for step in pair.steps().filter(|&step| pair.at(step).is_some()) {
                alone[step - start] = missed;
            }
        }
        let near = |pair: &Pair| {
            let track = self.tracks.partition_point(|track| *track < pair.track);
            let steps = contested(pair.track);
            let cost = |step: usize| pair.at(step).map_or(alone[step - start], |d| self.power(d).min(missed));
            Near {
                track: track as u32,
                first: steps.start,
                place: self.places[track],
                costs: steps.map(cost).collect(),
            }
        };
        let mut near: Vec<Near> = pairs.iter().map(near).collect();
        near.sort_by_key(|near| (near.first, near.track));
        Chain { steps: start..end, alone, near, change: 0.5 * self.power(self.problem.switch) }
    }
}

fn leader(leaders: &mut [usize], mut of: usize) -> usize {
    while leaders[of] != of {
        leaders[of] = leaders[leaders[of]];
        of = leaders[of];
    }
    of
}
