//! How clusters are kept small.

use std::collections::BTreeMap;

use super::cluster::{Cluster, Hypothesis, Leaf, Tree};
use crate::association::clusters::Clusters;
use crate::filter::Filter;

/// Two choices are independent when no joint probability is further than this from the product of the single ones.
const INDEPENDENT: f64 = 1e-3;

/// Leaves are alike when their probabilities of existence differ by less.
const ALIKE: f64 = 0.1;

impl<B: Clone> Cluster<B> {
    /// Forgets leaves that hardly exist, and merges those that say the same: leaves with the same last measurement and within
    /// the squared distance `limit`.
    pub fn reduce<const N: usize, F>(&mut self, filter: &F, limit: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        if limit > 0.0 {
            self.exchange(filter, limit);
        }
        for number in 0..self.trees.len() {
            let (shares, least) = (self.shares(number), self.trees[number].least);
            let mut places = merge_leaves(filter, &mut self.trees[number], &shares, limit);
            for (place, leaf) in places.iter_mut().zip(0..) {
                let home = place.unwrap_or(leaf);
                *place = (self.trees[number].leaves[home].existence >= least).then_some(home);
            }
            for hypothesis in &mut self.hypotheses {
                hypothesis.leaves[number] = hypothesis.leaves[number].and_then(|leaf| places[leaf]);
            }
        }
        self.unite();
    }

    /// Gives an object that two trees claim to one of them. Where one tree has a leaf under some hypotheses that another tree has as
    /// well under others, the hypotheses differ in nothing but which of the two tracks is the object. Under those of the weaker
    /// the two trees exchange their choices.
    fn exchange<const N: usize, F>(&mut self, filter: &F, limit: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let mut claims: BTreeMap<usize, Vec<(f64, usize, usize)>> = BTreeMap::new();
        for (number, tree) in self.trees.iter().enumerate() {
            let shares = self.shares(number);
            for (leaf, share) in shares.into_iter().enumerate() {
                if let Some(measurement) = tree.leaves[leaf].measurement {
                    claims.entry(measurement).or_default().push((share, number, leaf));
                }
            }
        }
        for claims in claims.values_mut().filter(|claims| claims.len() > 1) {
            claims.sort_by(|a, b| b.0.total_cmp(&a.0));
            let (mut share, strong, leaf) = claims[0];
            for &(other_share, weak, other) in &claims[1..] {
                let (mine, theirs) = (&self.trees[strong].leaves[leaf], &self.trees[weak].leaves[other]);
                let alike = weak != strong
                    && (mine.existence - theirs.existence).abs() < ALIKE
                    && filter.distance(&mine.belief, &theirs.belief, limit) <= limit;
                if alike {
                    let theirs = theirs.clone();
                    absorb(filter, &mut self.trees[strong].leaves[leaf], share, &theirs, other_share);
                    share += other_share;
                    self.swap((strong, leaf), (weak, other));
                }
            }
        }
    }

    /// Under the hypotheses with the weak tree's leaf, gives the strong tree its own leaf for it, and the weak tree what the
    /// strong one had.
    fn swap(&mut self, (strong, leaf): (usize, usize), (weak, other): (usize, usize)) {
        let mut copies: BTreeMap<usize, usize> = BTreeMap::new();
        for hypothesis in &mut self.hypotheses {
            if hypothesis.leaves[weak] != Some(other) {
                continue;
            }
            let before = hypothesis.leaves[strong].replace(leaf);
            hypothesis.leaves[weak] = before.map(|before| {
                *copies.entry(before).or_insert_with(|| {
                    let copy = self.trees[strong].leaves[before].clone();
                    self.trees[weak].leaves.push(copy);
                    self.trees[weak].leaves.len() - 1
                })
            });
        }
    }

    /// Makes hypotheses with the same choices one, and drops the leaves that nothing chooses.
    fn unite(&mut self) {
        let mut places: BTreeMap<Vec<Option<usize>>, usize> = BTreeMap::new();
        let mut united: Vec<Hypothesis> = Vec::with_capacity(self.hypotheses.len());
        for hypothesis in self.hypotheses.drain(..) {
            match places.get(&hypothesis.leaves) {
                Some(&place) => united[place].weight += hypothesis.weight,
                None => {
                    places.insert(hypothesis.leaves.clone(), united.len());
                    united.push(hypothesis);
                }
            }
        }
        united.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        self.hypotheses = united;
        for (number, tree) in self.trees.iter_mut().enumerate() {
            let mut moved: Vec<Option<usize>> = vec![None; tree.leaves.len()];
            for leaf in self.hypotheses.iter().filter_map(|hypothesis| hypothesis.leaves[number]) {
                moved[leaf] = Some(0);
            }
            moved.iter_mut().flatten().zip(0..).for_each(|(place, number)| *place = number);
            let mut used = moved.iter();
            tree.leaves.retain(|_| used.next().is_some_and(Option::is_some));
            for hypothesis in &mut self.hypotheses {
                hypothesis.leaves[number] = hypothesis.leaves[number].and_then(|leaf| moved[leaf]);
            }
        }
    }

    /// Divides the cluster into those of its trees whose choices depend on each other.
    pub fn split(self, into: &mut Vec<Cluster<B>>) {
        let count = self.trees.len();
        if count < 2 {
            into.push(self);
            return;
        }
        let varies = |tree: &usize| {
            let first = self.hypotheses[0].leaves[*tree];
            self.hypotheses.iter().any(|hypothesis| hypothesis.leaves[*tree] != first)
        };
        let varying: Vec<usize> = (0..count).filter(varies).collect();
        let mut groups = Clusters::default();
        groups.build(std::iter::empty(), count, 0);
        for (place, &a) in varying.iter().enumerate() {
            for &b in &varying[place + 1..] {
                if groups.of(a) != groups.of(b) && !self.independent(a, b) {
                    groups.join(a, b);
                }
            }
        }
        let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for tree in 0..count {
            members.entry(groups.of(tree)).or_default().push(tree);
        }
        if members.len() == 1 {
            into.push(self);
            return;
        }
        let mut trees: Vec<Option<Tree<B>>> = self.trees.into_iter().map(Some).collect();
        for group in members.values() {
            let own = |hypothesis: &Hypothesis| Hypothesis {
                weight: hypothesis.weight,
                leaves: group.iter().map(|&tree| hypothesis.leaves[tree]).collect(),
            };
            let mut part = Cluster {
                trees: group.iter().filter_map(|&tree| trees[tree].take()).collect(),
                hypotheses: self.hypotheses.iter().map(own).collect(),
            };
            part.unite();
            into.push(part);
        }
    }

    /// Whether the choices of two trees are nearly independent.
    fn independent(&self, a: usize, b: usize) -> bool {
        let (rows, columns) = (self.trees[a].leaves.len() + 1, self.trees[b].leaves.len() + 1);
        let mut joint = vec![0.0; rows * columns];
        let (mut of_a, mut of_b) = (vec![0.0; rows], vec![0.0; columns]);
        for hypothesis in &self.hypotheses {
            // Place zero is the choice of none.
            let row = hypothesis.leaves[a].map_or(0, |leaf| leaf + 1);
            let column = hypothesis.leaves[b].map_or(0, |leaf| leaf + 1);
            joint[row * columns + column] += hypothesis.weight;
            of_a[row] += hypothesis.weight;
            of_b[column] += hypothesis.weight;
        }
        joint.iter().enumerate().all(|(place, joint)| {
            (joint - of_a[place / columns] * of_b[place % columns]).abs() <= INDEPENDENT
        })
    }
}

/// Merges the leaves of a tree that are alike, and says into which each went.
fn merge_leaves<const N: usize, F>(
    filter: &F,
    tree: &mut Tree<F::Belief>,
    shares: &[f64],
    limit: f64,
) -> Vec<Option<usize>>
where
    F: Filter<N> + ?Sized,
{
    let mut homes: Vec<Option<usize>> = vec![None; tree.leaves.len()];
    if limit <= 0.0 {
        return homes;
    }
    let mut weights = shares.to_vec();
    let mut order: Vec<usize> = (0..tree.leaves.len()).collect();
    order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]));
    for (place, &home) in order.iter().enumerate() {
        if homes[home].is_some() {
            continue;
        }
        for &other in &order[place + 1..] {
            let (leaf, part) = (&tree.leaves[home], &tree.leaves[other]);
            let alike = homes[other].is_none()
                && leaf.measurement == part.measurement
                && (leaf.existence - part.existence).abs() < ALIKE
                && filter.distance(&leaf.belief, &part.belief, limit) <= limit;
            if alike {
                let part = part.clone();
                absorb(filter, &mut tree.leaves[home], weights[home], &part, weights[other]);
                weights[home] += weights[other];
                homes[other] = Some(home);
            }
        }
    }
    homes
}

/// Folds one leaf into another, so that both together expect as many objects as before.
fn absorb<const N: usize, F>(
    filter: &F,
    leaf: &mut Leaf<F::Belief>,
    weight: f64,
    part: &Leaf<F::Belief>,
    part_weight: f64,
) where
    F: Filter<N> + ?Sized,
{
    let (mine, theirs) = (weight * leaf.existence, part_weight * part.existence);
    filter.merge(&mut leaf.belief, mine, &part.belief, theirs);
    if weight + part_weight > 0.0 {
        leaf.existence = (mine + theirs) / (weight + part_weight);
    }
}
