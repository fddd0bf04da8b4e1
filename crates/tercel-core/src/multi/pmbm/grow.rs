//! How one cluster goes through a scan.

use std::collections::BTreeMap;

use super::cluster::{Cluster, Hypothesis, Leaf, Tree};
use super::update::{Candidate, Fresh, ln_not};
use crate::association::{KBest, Ranked};
use crate::filter::Filter;
use crate::multi::Scan;

/// Hypotheses of a cluster, times its measurements, times its pairs: what following them all may cost. A crowd beyond, hundreds of
/// measurements in one place, is no picture of objects and is followed by fewer hypotheses.
const WORK: usize = 20_000_000;

/// A cluster and what it may do with the measurements in its gates.
pub(super) struct Growth<'a, B> {
    cluster: Cluster<B>,
    /// By measurement.
    candidates: &'a [Candidate],
    /// The measurements in its gates, by rising number.
    measurements: Vec<usize>,
}

/// A hypothesis before its leaves are made.
struct Child {
    ln_weight: f64,
    parent: usize,
    /// The tree that each measurement belongs to.
    trees: Vec<Option<usize>>,
}

/// The leaves that a tree gets: which of its old ones, with which measurement (by its place in the cluster's list).
type Offspring = BTreeMap<(usize, Option<usize>), usize>;

impl<'a, B: Clone> Growth<'a, B> {
    pub fn new(cluster: Cluster<B>, candidates: &'a [Candidate]) -> Self {
        let mut measurements: Vec<usize> = candidates.iter().map(|candidate| candidate.measurement).collect();
        measurements.dedup();
        Growth { cluster, candidates, measurements }
    }

    /// The cluster after the scan, with at most `cap` hypotheses, none lighter than `prune`. New objects behind its
    /// measurements are taken from `fresh`.
    pub fn grow<const N: usize, F>(
        self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        fresh: &mut [Fresh<B>],
        k_best: &mut KBest,
        (cap, prune): (usize, f64),
    ) -> Cluster<B>
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let children = self.children(k_best, cap, prune);
        let old = self.cluster.trees.len();
        let mut offspring: Vec<Offspring> = vec![Offspring::new(); old];
        // Rows of the measurements that may be new objects.
        let rows: Vec<usize> = (0..self.measurements.len())
            .filter(|&row| fresh[self.measurements[row]].object.is_some())
            .collect();
        let mut hypotheses = Vec::with_capacity(children.len());
        for child in &children {
            let parent = &self.cluster.hypotheses[child.parent];
            let mut taken = vec![None; old];
            for (row, tree) in child.trees.iter().enumerate() {
                if let Some(tree) = tree {
                    taken[*tree] = Some(row);
                }
            }
            let chosen = parent.leaves.iter().zip(&taken).zip(&mut offspring);
            let mut leaves: Vec<Option<usize>> = chosen
                .map(|((leaf, row), offspring)| {
                    let next = offspring.len();
                    leaf.map(|leaf| *offspring.entry((leaf, *row)).or_insert(next))
                })
                .collect();
            leaves.extend(rows.iter().map(|&row| child.trees[row].is_none().then_some(0)));
            hypotheses.push(Hypothesis { weight: child.ln_weight.exp(), leaves });
        }
        let Growth { cluster, measurements, .. } = self;
        let old_trees = cluster.trees.into_iter().zip(offspring);
        let mut trees: Vec<Tree<B>> = old_trees
            .map(|(tree, offspring)| branch(filter, scan, &measurements, tree, &offspring))
            .collect();
        let new = rows.iter().filter_map(|&row| fresh[measurements[row]].object.take());
        trees.extend(new.map(|(label, leaf)| Tree::new(label, leaf)));
        let mut grown = Cluster { trees, hypotheses };
        grown.normalise();
        grown
    }

    /// The heaviest hypotheses after the scan, relative to the heaviest.
    fn children(&self, k_best: &mut KBest, cap: usize, prune: f64) -> Vec<Child> {
        let misses = vec![0.0; self.measurements.len()];
        let mut affordable = WORK / (self.measurements.len() * self.candidates.len()).max(1);
        let mut children = Vec::new();
        let mut pairs = Vec::new();
        for (parent, hypothesis) in self.cluster.hypotheses.iter().enumerate() {
            let leaves = || hypothesis.leaves.iter().zip(&self.cluster.trees);
            let missed: f64 = leaves()
                .filter_map(|(leaf, tree)| Some(&tree.leaves[(*leaf)?]))
                .map(|leaf| ln_not(leaf.existence * leaf.detection))
                .sum();
            let ln_parent = hypothesis.weight.ln() + missed;
            pairs.clear();
            let own = self.candidates.iter().filter(|c| hypothesis.leaves[c.tree] == Some(c.leaf));
            pairs.extend(own.map(|c| (self.row(c.measurement), c.tree, -c.ln_ratio)));
            let wanted = ((hypothesis.weight * cap as f64).ceil() as usize).min(affordable).max(1);
            // All costs are finite and every measurement may stay alone, so there is always an answer.
            let Ok(found) = k_best.solve(&pairs, self.cluster.trees.len(), &misses, wanted, -prune.ln())
            else {
                continue;
            };
            affordable = affordable.saturating_sub(found.len());
            children.extend(found.iter().map(|Ranked { cost, columns }| Child {
                ln_weight: ln_parent - cost,
                parent,
                trees: columns.clone(),
            }));
        }
        children.sort_by(|a, b| b.ln_weight.total_cmp(&a.ln_weight));
        children.truncate(cap);
        let top = children.first().map_or(0.0, |child| child.ln_weight);
        children.iter_mut().for_each(|child| child.ln_weight -= top);
        let sum: f64 = children.iter().map(|child| child.ln_weight.exp()).sum();
        let least = (prune * sum).ln();
        children.retain(|child| child.ln_weight >= least || child.ln_weight == 0.0);
        children
    }

    fn row(&self, measurement: usize) -> usize {
        self.measurements.partition_point(|&other| other < measurement)
    }
}

/// The tree with its new leaves.
fn branch<const N: usize, F>(
    filter: &F,
    scan: &Scan<'_, F::Measurement>,
    measurements: &[usize],
    tree: Tree<F::Belief>,
    offspring: &Offspring,
) -> Tree<F::Belief>
where
    F: Filter<N> + ?Sized,
{
    let mut order: Vec<((usize, Option<usize>), usize)> =
        offspring.iter().map(|(choice, &number)| (*choice, number)).collect();
    order.sort_by_key(|(_, number)| *number);
    let leaf = |(old, row): (usize, Option<usize>)| {
        let parent = &tree.leaves[old];
        let detected = row.and_then(|row| {
            let mut belief = parent.belief.clone();
            let number = measurements[row];
            filter.update(&mut belief, &scan.measurements[number]).ok()?;
            Some(Leaf { existence: 1.0, belief, measurement: Some(number), detection: parent.detection })
        });
        detected.unwrap_or_else(|| {
            let (r, seen) = (parent.existence, parent.detection);
            let missed = r * (1.0 - seen) / (1.0 - r * seen).max(f64::MIN_POSITIVE);
            let existence = if seen > 0.0 { missed.max(tree.missed) } else { missed };
            Leaf { existence, belief: parent.belief.clone(), measurement: None, detection: seen }
        })
    };
    let leaves = order.into_iter().map(|(choice, _)| leaf(choice)).collect();
    Tree { leaves, ..tree }
}
