//! The best paths of the objects of one group that share its tracks.

use std::collections::HashMap;

use super::chain::{Chain, Memory, NONE, Path};
use super::simplex::{Optimum, Programme};
use crate::association::AssignmentSolver;

/// Rounds of the linear programme.
const ROUNDS: usize = 100;

/// The share of the cost by which bounds that have met may differ.
const RELATIVE: f64 = 1e-6;

/// A path of one object and the share that it has.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Share {
    pub(super) object: usize,
    pub(super) path: Path,
    pub(super) share: f64,
}

/// Shares of paths, their cost, and how far it may lie above the minimum.
#[derive(Debug)]
pub(super) struct Solution {
    pub(super) shares: Vec<Share>,
    pub(super) cost: f64,
    pub(super) gap: f64,
}

/// One group: its objects, and how many tracks it has.
pub(super) struct Relaxation<'a> {
    pub(super) chains: &'a [Chain],
    pub(super) tracks: usize,
    /// How many prices there are: one for each track and step at which the track is near anyone.
    pub(super) places: usize,
    /// Bounds that are this close have met, unless the cost itself is smaller still.
    pub(super) tolerance: f64,
    /// Climbs of the prices before the linear programme is called.
    pub(super) climbs: usize,
}

/// What some prices prove, and the paths that they lead to.
struct Answer {
    bound: f64,
    paths: Vec<Path>,
}

/// The search so far.
struct State {
    prices: Vec<f64>,
    bound: f64,
    paths: Vec<Path>,
    cost: f64,
    pool: Pool,
    memory: Memory,
}

/// All different paths seen, by object. The first of each object is the one without tracks.
struct Pool {
    paths: Vec<(usize, Path)>,
    known: HashMap<(usize, Path), usize>,
}

impl Pool {
    fn add(&mut self, object: usize, path: &Path) {
        let next = self.paths.len();
        let entry = self.known.entry((object, path.clone()));
        if *entry.or_insert(next) == next {
            self.paths.push((object, path.clone()));
        }
    }
}

impl Relaxation<'_> {
    pub(super) fn solve(&self) -> Solution {
        let paths: Vec<Path> = self.alone();
        let mut state = State {
            prices: vec![0.0; self.places],
            bound: f64::NEG_INFINITY,
            cost: self.cost(&paths),
            paths,
            pool: Pool { paths: Vec::new(), known: HashMap::new() },
            memory: Memory::default(),
        };
        state.paths.iter().enumerate().for_each(|(object, path)| state.pool.add(object, path));
        let start = state.prices.clone();
        self.answer(&start, &mut state);
        if !self.met(&state) {
            let start = self.single_steps();
            self.answer(&start, &mut state);
            self.repair(&mut state);
            self.climb(&mut state);
        }
        let prices: f64 = state.prices.iter().sum();
        let (steps, cost) = (self.chains.iter().map(|chain| chain.alone.len()).sum::<usize>(), state.cost);
        let mut solution = if self.met(&state) { state.whole() } else { self.generate(state) };
        // What the sums of both bounds may have lost.
        solution.gap += f64::EPSILON * steps as f64 * (cost + prices);
        solution
    }

    /// The paths without any track.
    fn alone(&self) -> Vec<Path> {
        self.chains.iter().map(|chain| vec![NONE; chain.alone.len()]).collect()
    }

    fn met(&self, state: &State) -> bool {
        state.cost - state.bound <= self.tolerance(state.cost)
    }

    fn tolerance(&self, cost: f64) -> f64 {
        self.tolerance.min(RELATIVE * cost.abs())
    }

    /// Finds the cheapest paths under these prices, and keeps what is better than before: the bound that they prove, and the
    /// paths if they do not collide.
    fn answer(&self, prices: &Vec<f64>, state: &mut State) -> Answer {
        let mut bound = -prices.iter().sum::<f64>();
        let mut paths = Vec::with_capacity(self.chains.len());
        for (object, chain) in self.chains.iter().enumerate() {
            let (cost, path) = chain.best(prices, &mut state.memory);
            bound += cost;
            state.pool.add(object, &path);
            paths.push(path);
        }
        if bound > state.bound {
            state.bound = bound;
            state.prices.clone_from(prices);
        }
        if self.uses(&paths).iter().all(|uses| *uses <= 1) {
            let cost = self.cost(&paths);
            if cost < state.cost {
                state.cost = cost;
                state.paths.clone_from(&paths);
            }
        }
        Answer { bound, paths }
    }

    fn cost(&self, paths: &[Path]) -> f64 {
        self.chains.iter().zip(paths).map(|(chain, path)| chain.cost(path)).sum()
    }

    fn uses(&self, paths: &[Path]) -> Vec<u32> {
        let mut uses = vec![0; self.places];
        for (chain, path) in self.chains.iter().zip(paths) {
            chain.uses(path).into_iter().for_each(|place| uses[place] += 1);
        }
        uses
    }

    /// The prices at which each single step, without the cost of changes, has its best assignment.
    fn single_steps(&self) -> Vec<f64> {
        let first = self.chains.iter().map(|chain| chain.steps.start).min().unwrap_or(0);
        let last = self.chains.iter().map(|chain| chain.steps.end).max().unwrap_or(first);
        // Object, track, what it saves, and its place, for each step.
        let mut steps: Vec<Vec<(usize, usize, f64, usize)>> = vec![Vec::new(); last - first];
        for (object, chain) in self.chains.iter().enumerate() {
            for near in &chain.near {
                for (i, cost) in near.costs.iter().enumerate() {
                    let step = near.first + i;
                    let saved = chain.alone[step - chain.steps.start] - cost;
                    if saved > 0.0 {
                        steps[step - first].push((object, near.track as usize, saved, near.place + i));
                    }
                }
            }
        }
        let mut prices = vec![0.0; self.places];
        let mut solver = AssignmentSolver::new();
        let misses = vec![0.0; self.chains.len()];
        for entries in steps.iter().filter(|entries| entries.len() > 1) {
            let costs: Vec<_> = entries.iter().map(|entry| (entry.0, entry.1, -entry.2)).collect();
            // Costs are finite, so that no problem is refused; without prices the climb starts lower.
            if let Ok(best) = solver.solve_sparse(&costs, self.tracks, &misses) {
                for (_, track, _, place) in entries {
                    prices[*place] = (-best.column_duals[*track]).max(0.0);
                }
            }
        }
        prices
    }

    /// Makes paths that do not collide: one object after the other takes the cheapest path through what is free, first under
    /// the prices, then without, until none gains by a change.
    fn repair(&self, state: &mut State) {
        let order: Vec<usize> = (0..self.chains.len()).collect();
        let back: Vec<usize> = order.iter().rev().copied().collect();
        for order in [order, back] {
            let mut paths = self.alone();
            let prices = state.prices.clone();
            self.sweep(&prices, &order, &mut paths, &mut state.memory);
            let free = vec![0.0; self.places];
            let mut cost = self.cost(&paths);
            loop {
                self.sweep(&free, &order, &mut paths, &mut state.memory);
                let next = self.cost(&paths);
                if next >= cost - self.tolerance(cost) {
                    break;
                }
                cost = next;
            }
            let cost = self.cost(&paths);
            if cost < state.cost {
                (state.cost, state.paths) = (cost, paths);
            }
        }
        for (object, path) in state.paths.iter().enumerate() {
            state.pool.add(object, path);
        }
    }

    fn sweep(&self, prices: &[f64], order: &[usize], paths: &mut [Path], memory: &mut Memory) {
        let mut blocked = prices.to_vec();
        let block = |blocked: &mut Vec<f64>, object: usize, path: &Path, taken: bool| {
            for place in self.chains[object].uses(path) {
                blocked[place] = if taken { f64::INFINITY } else { prices[place] };
            }
        };
        paths.iter().enumerate().for_each(|(object, path)| block(&mut blocked, object, path, true));
        for &object in order {
            block(&mut blocked, object, &paths[object], false);
            paths[object] = self.chains[object].best(&blocked, memory).1;
            block(&mut blocked, object, &paths[object], true);
        }
    }

    /// Raises the prices where objects collide and lowers them where nobody comes, by steps that would close the gap if
    /// the bound were straight (Polyak's subgradient method).
    fn climb(&self, state: &mut State) {
        let mut prices = state.prices.clone();
        let (mut length, mut idle) = (1.0, 0);
        for climb in 0..self.climbs {
            if self.met(state) {
                return;
            }
            let before = state.bound;
            let answer = self.answer(&prices, state);
            idle = if answer.bound > before { 0 } else { idle + 1 };
            if idle == 10 {
                (length, idle) = (0.5 * length, 0);
                prices.clone_from(&state.prices);
                continue;
            }
            if climb % 20 == 10 {
                self.repair(state);
            }
            let mut slopes: Vec<f64> =
                self.uses(&answer.paths).iter().map(|uses| f64::from(*uses) - 1.0).collect();
            for (slope, price) in slopes.iter_mut().zip(&prices) {
                *slope = if *price > 0.0 { *slope } else { slope.max(0.0) };
            }
            let square: f64 = slopes.iter().map(|slope| slope * slope).sum();
            if square == 0.0 {
                return;
            }
            let step = length * (state.cost - answer.bound) / square;
            for (price, slope) in prices.iter_mut().zip(&slopes) {
                *price = (*price + step * slope).max(0.0);
            }
        }
    }

    /// Column generation: the best mixture of the paths seen gives prices, which lead to new paths, until these are no better.
    fn generate(&self, mut state: State) -> Solution {
        let mut mixture = None;
        self.forget_dear_paths(&mut state);
        for _ in 0..ROUNDS {
            let groups = self.groups(&state.pool);
            let optimum = self.mix(&groups, &state.pool);
            // What rounding spoiled proves nothing; the paths and the bound so far still hold.
            if !self.is_mixture(&optimum, &groups, &state.pool) {
                break;
            }
            let exact = self.spread(&groups, &optimum, Some(&state.prices));
            let even = self.spread(&groups, &optimum, None);
            let mut between = exact.clone();
            between.iter_mut().zip(&state.prices).for_each(|(x, y)| *x = 0.5 * (*x + y));
            let (known, cost) = (state.pool.paths.len(), optimum.cost);
            for prices in [&between, &exact, &even] {
                self.answer(prices, &mut state);
            }
            mixture = Some(optimum);
            // Shares of the first paths stay valid when more are added. No new path can only mean rounding.
            let done = cost - state.bound <= self.tolerance(cost) || self.met(&state);
            if done || state.pool.paths.len() == known {
                break;
            }
        }
        match mixture {
            Some(optimum) if optimum.cost < state.cost - self.tolerance(state.cost) => {
                let shares = optimum.shares.iter().zip(state.pool.paths).filter(|(share, _)| **share > 0.0);
                let shares = shares.map(|(share, (object, path))| Share { object, path, share: *share });
                let (cost, gap) = (optimum.cost, (optimum.cost - state.bound).max(0.0));
                Solution { shares: shares.collect(), cost, gap }
            }
            _ => state.whole(),
        }
    }

    /// Keeps the paths that may matter: under the best prices they cost no more above the cheapest of their object than the bounds
    /// are apart. A path forgotten in error is found again.
    fn forget_dear_paths(&self, state: &mut State) {
        let limit = 2.0 * (state.cost - state.bound);
        let cheapest: Vec<f64> =
            self.chains.iter().map(|chain| chain.best(&state.prices, &mut state.memory).0).collect();
        let mut pool = Pool { paths: Vec::new(), known: HashMap::new() };
        for (number, (object, path)) in state.pool.paths.iter().enumerate() {
            let chain = &self.chains[*object];
            let paid: f64 = chain.uses(path).into_iter().map(|place| state.prices[place]).sum();
            let cost = chain.cost(path) + paid;
            if number < self.chains.len()
                || cost - cheapest[*object] <= limit
                || *path == state.paths[*object]
            {
                pool.add(*object, path);
            }
        }
        state.pool = pool;
    }

    /// Whether the shares of every object sum to 1 and no group is taken more than once.
    fn is_mixture(&self, optimum: &Optimum, groups: &[(Vec<usize>, Vec<usize>)], pool: &Pool) -> bool {
        let mut sums = vec![0.0; self.chains.len()];
        for (share, (object, _)) in optimum.shares.iter().zip(&pool.paths) {
            sums[*object] += share;
        }
        let taken = |users: &[usize]| users.iter().map(|user| optimum.shares[*user]).sum::<f64>();
        sums.iter().all(|sum| (sum - 1.0).abs() < 1e-9)
            && groups.iter().all(|(users, _)| taken(users) < 1.0 + 1e-9)
    }

    /// Uses of a track at a step that the same paths make, as places of their prices: one condition stands for all. Uses by one
    /// object alone need none.
    fn groups(&self, pool: &Pool) -> Vec<(Vec<usize>, Vec<usize>)> {
        let mut users: Vec<Vec<usize>> = vec![Vec::new(); self.places];
        for (number, (object, path)) in pool.paths.iter().enumerate() {
            self.chains[*object].uses(path).into_iter().for_each(|place| users[place].push(number));
        }
        let mut groups: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        let mut known: HashMap<Vec<usize>, usize> = HashMap::new();
        for (place, users) in users.into_iter().enumerate() {
            let contested = users.iter().any(|user| pool.paths[*user].0 != pool.paths[users[0]].0);
            if !contested {
                continue;
            }
            let next = groups.len();
            match *known.entry(users.clone()).or_insert(next) {
                group if group == next => groups.push((users, vec![place])),
                group => groups[group].1.push(place),
            }
        }
        groups
    }

    fn mix(&self, groups: &[(Vec<usize>, Vec<usize>)], pool: &Pool) -> Optimum {
        let mut columns: Vec<(f64, usize, Vec<usize>)> = Vec::with_capacity(pool.paths.len());
        for (object, path) in &pool.paths {
            columns.push((self.chains[*object].cost(path), *object, Vec::new()));
        }
        for (group, (users, _)) in groups.iter().enumerate() {
            users.iter().for_each(|user| columns[*user].2.push(group));
        }
        Programme { objects: self.chains.len(), groups: groups.len(), columns }.solve()
    }

    /// Spreads the price of a group over its uses: like `model` if given, evenly where that has no price.
    fn spread(
        &self,
        groups: &[(Vec<usize>, Vec<usize>)],
        optimum: &Optimum,
        model: Option<&Vec<f64>>,
    ) -> Vec<f64> {
        let mut prices = vec![0.0; self.places];
        for ((_, places), price) in groups.iter().zip(&optimum.prices) {
            let weight = |place: &usize| model.map_or(1.0, |model| model[*place]);
            let total: f64 = places.iter().map(weight).sum();
            for place in places {
                let part = if total > 0.0 { weight(place) / total } else { 1.0 / places.len() as f64 };
                prices[*place] = price * part;
            }
        }
        prices
    }
}

impl State {
    fn whole(self) -> Solution {
        let paths = self.paths.into_iter().enumerate();
        let shares = paths.map(|(object, path)| Share { object, path, share: 1.0 }).collect();
        Solution { shares, cost: self.cost, gap: (self.cost - self.bound).max(0.0) }
    }
}
