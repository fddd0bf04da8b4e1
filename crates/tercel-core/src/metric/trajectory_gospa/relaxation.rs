//! The best paths of the objects of one cluster that share its tracks.

use std::collections::HashMap;

use super::chain::{Chain, Memory, NONE, Path, Prices};
use super::simplex::{Optimum, Programme};
use crate::association::AssignmentSolver;

/// Rounds of the linear programme.
const ROUNDS: usize = 100;

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
    pub(super) gap: f64,
}

/// One cluster: its objects, and how many tracks and steps it has.
pub(super) struct Relaxation<'a> {
    pub(super) chains: &'a [Chain],
    pub(super) tracks: usize,
    pub(super) steps: usize,
    /// Bounds that are this close have met.
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
    prices: Prices,
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
        let mut state = State {
            prices: Prices::new(self.tracks, self.steps),
            bound: f64::NEG_INFINITY,
            paths: vec![vec![NONE; self.steps]; self.chains.len()],
            cost: 0.0,
            pool: Pool { paths: Vec::new(), known: HashMap::new() },
            memory: Memory::default(),
        };
        let none = vec![NONE; self.steps];
        (0..self.chains.len()).for_each(|object| state.pool.add(object, &none));
        let start = state.prices.clone();
        self.answer(&start, &mut state);
        if !self.met(&state) {
            let start = self.single_steps();
            self.answer(&start, &mut state);
            self.repair(&mut state);
            self.climb(&mut state);
        }
        if self.met(&state) { state.whole() } else { self.generate(state) }
    }

    fn met(&self, state: &State) -> bool {
        state.cost - state.bound <= self.tolerance
    }

    /// Finds the cheapest paths under these prices, and keeps what is better than before: the bound that they prove, and the
    /// paths if they do not collide.
    fn answer(&self, prices: &Prices, state: &mut State) -> Answer {
        let mut bound = -prices.sum();
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
        if self.uses(prices, &paths).iter().all(|uses| *uses <= 1) {
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

    fn uses(&self, prices: &Prices, paths: &[Path]) -> Vec<u32> {
        let mut uses = vec![0; self.tracks * self.steps];
        for path in paths {
            for (step, &track) in path.iter().enumerate().filter(|(_, track)| **track != NONE) {
                uses[prices.place(track, step)] += 1;
            }
        }
        uses
    }

    /// The prices at which each single step, without the cost of changes, has its best assignment.
    fn single_steps(&self) -> Prices {
        let mut prices = Prices::new(self.tracks, self.steps);
        let mut solver = AssignmentSolver::new();
        let (mut entries, misses) = (Vec::new(), vec![0.0; self.chains.len()]);
        for step in 0..self.steps {
            entries.clear();
            for (object, chain) in self.chains.iter().enumerate() {
                let gains = chain.gains.iter().filter(|(_, gains)| gains[step] > 0.0);
                entries.extend(gains.map(|(track, gains)| (object, *track as usize, -gains[step])));
            }
            // Gains are finite, so that no problem is refused; without prices the climb starts lower.
            if let Ok(best) = solver.solve_sparse(&entries, self.tracks, &misses) {
                for (track, dual) in best.column_duals.iter().enumerate() {
                    let place = prices.place(track as u32, step);
                    prices.values[place] = (-dual).max(0.0);
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
            let mut paths = vec![vec![NONE; self.steps]; self.chains.len()];
            let prices = state.prices.clone();
            self.sweep(&prices, &order, &mut paths, &mut state.memory);
            let free = Prices::new(self.tracks, self.steps);
            let mut cost = self.cost(&paths);
            loop {
                self.sweep(&free, &order, &mut paths, &mut state.memory);
                let next = self.cost(&paths);
                if next >= cost - self.tolerance {
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

    fn sweep(&self, prices: &Prices, order: &[usize], paths: &mut [Path], memory: &mut Memory) {
        let mut blocked = prices.clone();
        paths.iter().for_each(|path| block(&mut blocked, prices, path, true));
        for &object in order {
            block(&mut blocked, prices, &paths[object], false);
            paths[object] = self.chains[object].best(&blocked, memory).1;
            block(&mut blocked, prices, &paths[object], true);
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
                self.uses(&prices, &answer.paths).iter().map(|uses| f64::from(*uses) - 1.0).collect();
            for (slope, price) in slopes.iter_mut().zip(&prices.values) {
                *slope = if *price > 0.0 { *slope } else { slope.max(0.0) };
            }
            let square: f64 = slopes.iter().map(|slope| slope * slope).sum();
            if square == 0.0 {
                return;
            }
            let step = length * (state.cost - answer.bound) / square;
            for (price, slope) in prices.values.iter_mut().zip(&slopes) {
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
            between.values.iter_mut().zip(&state.prices.values).for_each(|(x, y)| *x = 0.5 * (*x + y));
            let (known, cost) = (state.pool.paths.len(), optimum.cost);
            for prices in [&between, &exact, &even] {
                self.answer(prices, &mut state);
            }
            mixture = Some(optimum);
            // Shares of the first paths stay valid when more are added. No new path can only mean rounding.
            let done = cost - state.bound <= self.tolerance || self.met(&state);
            if done || state.pool.paths.len() == known {
                break;
            }
        }
        match mixture {
            Some(optimum) if optimum.cost < state.cost - self.tolerance => {
                let shares = optimum.shares.iter().zip(state.pool.paths).filter(|(share, _)| **share > 0.0);
                let shares = shares.map(|(share, (object, path))| Share { object, path, share: *share });
                Solution { shares: shares.collect(), gap: (optimum.cost - state.bound).max(0.0) }
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
            let cost = self.chains[*object].cost(path) + state.prices.along(path);
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
        let mut users: Vec<Vec<usize>> = vec![Vec::new(); self.tracks * self.steps];
        for (number, (_, path)) in pool.paths.iter().enumerate() {
            for (step, &track) in path.iter().enumerate().filter(|(_, track)| **track != NONE) {
                users[track as usize * self.steps + step].push(number);
            }
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
        model: Option<&Prices>,
    ) -> Prices {
        let mut prices = Prices::new(self.tracks, self.steps);
        for ((_, places), price) in groups.iter().zip(&optimum.prices) {
            let weight = |place: &usize| model.map_or(1.0, |model| model.values[*place]);
            let total: f64 = places.iter().map(weight).sum();
            for place in places {
                let part = if total > 0.0 { weight(place) / total } else { 1.0 / places.len() as f64 };
                prices.values[*place] = price * part;
            }
        }
        prices
    }
}

impl State {
    fn whole(self) -> Solution {
        let paths = self.paths.into_iter().enumerate();
        let shares = paths.map(|(object, path)| Share { object, path, share: 1.0 }).collect();
        Solution { shares, gap: (self.cost - self.bound).max(0.0) }
    }
}

/// Takes the uses of a path out of reach, or gives them their price again.
fn block(blocked: &mut Prices, prices: &Prices, path: &Path, taken: bool) {
    for (step, &track) in path.iter().enumerate().filter(|(_, track)| **track != NONE) {
        let place = prices.place(track, step);
        blocked.values[place] = if taken { f64::INFINITY } else { prices.values[place] };
    }
}
