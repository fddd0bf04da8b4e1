//! Trees whose choices depend on each other, and the hypotheses over them.

use crate::filter::Filter;
use crate::multi::{Track, TrackId};

/// Trees and the hypotheses over them.
#[derive(Debug, Clone)]
pub(super) struct Cluster<B> {
    pub trees: Vec<Tree<B>>,
    /// By falling weight; the weights add up to one.
    pub hypotheses: Vec<Hypothesis>,
}

/// All that one track may be.
#[derive(Debug, Clone)]
pub(super) struct Tree<B> {
    pub label: TrackId,
    pub leaves: Vec<Leaf<B>>,
    /// Existence that a leaf keeps however often it is missed.
    pub missed: f64,
    /// Leaves that exist less are forgotten.
    pub least: f64,
}

impl<B> Tree<B> {
    /// A tree that begins with this leaf.
    pub fn new(label: TrackId, leaf: Leaf<B>) -> Self {
        Tree { label, leaves: vec![leaf], missed: 0.0, least: 0.0 }
    }
}

/// One way in which a track's measurements may be chosen.
#[derive(Debug, Clone)]
pub(super) struct Leaf<B> {
    pub existence: f64,
    pub belief: B,
    /// The measurement of the last scan that it took.
    pub measurement: Option<usize>,
    /// How likely the sensor of the last scan would have seen it.
    pub detection: f64,
}

/// A choice of one leaf, or none, of each tree.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hypothesis {
    pub weight: f64,
    pub leaves: Vec<Option<usize>>,
}

/// What a cluster says of one of its trees.
pub(super) struct Summary<B> {
    existence: f64,
    belief: Option<B>,
    measurement: Option<usize>,
    in_view: bool,
}

/// Leaves with less of the tree's existence do not change what is reported.
const NEGLIGIBLE: f64 = 1e-3;

impl<B> Cluster<B> {
    /// A single tree with one leaf.
    pub fn single(label: TrackId, leaf: Leaf<B>) -> Self {
        let hypotheses = vec![Hypothesis { weight: 1.0, leaves: vec![Some(0)] }];
        Cluster { trees: vec![Tree::new(label, leaf)], hypotheses }
    }

    /// Probability of each leaf of a tree.
    pub fn shares(&self, tree: usize) -> Vec<f64> {
        let mut shares = vec![0.0; self.trees[tree].leaves.len()];
        for hypothesis in &self.hypotheses {
            if let Some(leaf) = hypothesis.leaves[tree] {
                shares[leaf] += hypothesis.weight;
            }
        }
        shares
    }

    /// Takes in another cluster. Each hypothesis of one goes with each of the other; the `cap` heaviest pairs are kept.
    pub fn join(&mut self, other: Cluster<B>, cap: usize) {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (i, mine) in self.hypotheses.iter().enumerate() {
            // Of falling weights, the pair (i, j) is behind (i + 1)(j + 1) - 1 others.
            let theirs = other.hypotheses.iter().take(cap.div_ceil(i + 1)).enumerate();
            pairs.extend(theirs.map(|(j, theirs)| (mine.weight * theirs.weight, i, j)));
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        pairs.truncate(cap);
        let joined = pairs.iter().map(|&(weight, i, j)| {
            let (mine, theirs) = (&self.hypotheses[i].leaves, &other.hypotheses[j].leaves);
            Hypothesis { weight, leaves: mine.iter().chain(theirs).copied().collect() }
        });
        self.hypotheses = joined.collect();
        self.normalise();
        self.trees.extend(other.trees);
    }

    /// Scales the weights so that they add up to one.
    pub fn normalise(&mut self) {
        let sum: f64 = self.hypotheses.iter().map(|hypothesis| hypothesis.weight).sum();
        self.hypotheses.iter_mut().for_each(|hypothesis| hypothesis.weight /= sum);
    }

    /// Drops the trees whose label is not to be kept.
    pub fn keep(&mut self, lives: impl Fn(TrackId) -> bool) {
        let kept: Vec<usize> = (0..self.trees.len()).filter(|&tree| lives(self.trees[tree].label)).collect();
        if kept.len() == self.trees.len() {
            return;
        }
        for hypothesis in &mut self.hypotheses {
            hypothesis.leaves = kept.iter().map(|&tree| hypothesis.leaves[tree]).collect();
        }
        self.trees.retain(|tree| lives(tree.label));
    }

    /// What the hypotheses say of a tree.
    pub fn summary<const N: usize, F>(&self, filter: &F, tree: usize) -> Summary<B>
    where
        B: Clone,
        F: Filter<N, Belief = B> + ?Sized,
    {
        let shares = self.shares(tree);
        let leaves = || {
            self.trees[tree].leaves.iter().zip(&shares).map(|(leaf, share)| (leaf, share * leaf.existence))
        };
        let existence = leaves().map(|(_, part)| part).fold(0.0, |sum, part| sum + part);
        let mut belief: Option<B> = None;
        let (mut weight, mut seen) = (0.0, 0.0);
        let mut heaviest = (0.0, None);
        for (leaf, part) in leaves().filter(|(_, part)| *part > NEGLIGIBLE * existence) {
            match &mut belief {
                Some(belief) => filter.merge(belief, weight, &leaf.belief, part),
                None => belief = Some(leaf.belief.clone()),
            }
            weight += part;
            if leaf.measurement.is_some() {
                seen += part;
                if part > heaviest.0 {
                    heaviest = (part, leaf.measurement);
                }
            }
        }
        // Seen means: more likely seen than not, if it is there at all.
        let measurement = heaviest.1.filter(|_| seen >= 0.5 * existence);
        let in_view = self.trees[tree].leaves.iter().any(|leaf| leaf.detection > 0.0);
        Summary { existence: existence.min(1.0), belief, measurement, in_view }
    }
}

impl<B> Summary<B> {
    /// Whether no hypothesis knows of the object.
    pub fn is_gone(&self) -> bool {
        self.belief.is_none()
    }

    /// Updates the track of the tree.
    pub fn show(self, track: &mut Track<B>, time: f64) {
        track.existence = self.existence;
        if let Some(belief) = self.belief {
            track.belief = belief;
        }
        match self.measurement {
            Some(number) => {
                track.hit(number, time);
                track.reports = !self.in_view;
            }
            None if self.in_view => track.miss(),
            None => track.unseen(),
        }
    }

    /// The track of a new tree.
    pub fn start(self, label: TrackId, time: f64) -> Option<Track<B>> {
        Some(Track::new(label, self.belief?, self.existence, self.measurement?, time))
    }
}
