//! Probabilities of the single pairs, over all ways to assign rows to columns.

use super::clusters::Clusters;

mod enumeration;
mod propagation;
mod subsets;
#[cfg(test)]
mod tests;

/// Finds how probable each pair of a row and a column is when all assignments count by their weight.
///
/// ## Definition
/// Each row takes one column or none, each column at most one row. With the ratio `w_ij` of having the pair to leaving row
/// `i` alone, an assignment `θ` weighs `Π w_ij` over its pairs, and
/// ```text
/// p_ij = Σ_{θ ∋ (i,j)} weight(θ) / Σ_θ weight(θ)
/// ```
/// Rows that share no column, not even through others, are told apart. In a cluster with few assignments these are
/// enumerated, but for columns that only one row wants: these stand in no other's way. In one with few contested columns all
/// assignments are summed by the sets of columns that they take. In a larger one loopy belief propagation approximates their sum: messages between rows and columns,
/// ```text
/// row to column    m_ij = w_ij / (1 + Σ_{k≠j} w_ik n_ik)
/// column to row    n_ij = 1 / (1 + Σ_{k≠i} m_kj)
/// ```
/// which always converge. Where two rows want the same two columns these messages alone err by up to 0.4. So each row is then
/// looked at together with those that compete with it most: all assignments of these few are enumerated, and only what the
/// others claim comes from messages. In a crowd of thousands the messages have to do. Where rows looked at one by one claim more
/// than the whole of a column, their claims are reduced in proportion.
///
/// ## Use it when
/// an update weighs all associations instead of deciding for one: joint probabilistic data association.
///
/// ## Reference
/// Fortmann, Bar-Shalom and Scheffe (1983), section III, for the joint events; Williams and Lau (2014), eqs. 24 to 28, for the
/// messages. The exact surroundings are a deviation; regions larger than a pair are those of Yedidia, Freeman and Weiss (2005).
///
/// ```
/// use tercel_core::association::Marginals;
///
/// // Two tracks want the same measurement; the first also has one of its own.
/// let mut marginals = Marginals::default();
/// marginals.solve(&[(0, 0, 4.0_f64.ln()), (0, 1, 0.0), (1, 0, 2.0_f64.ln())], 2, 2);
/// // Weights of the assignments: 1 none, 4, 1, 2 single, 1·2 both.
/// assert!((marginals.pairs()[0] - 4.0 / 10.0).abs() < 1e-12);
/// assert!((marginals.misses()[1] - 6.0 / 10.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone)]
pub struct Marginals {
    exact: usize,
    pairs: Vec<f64>,
    misses: Vec<f64>,
    clusters: Clusters,
    /// Places of the valid pairs, by cluster and row.
    order: Vec<usize>,
    /// Cluster of each row.
    homes: Vec<usize>,
    local: Local,
}

/// One cluster with its rows and columns counted from zero.
#[derive(Debug, Clone, Default)]
struct Local {
    rows: usize,
    columns: usize,
    /// Row, column, weight, and place in the list of the whole problem; by row.
    entries: Vec<Entry>,
    /// First entry of each row, and the end.
    starts: Vec<usize>,
    /// How many rows want each column.
    wanted: Vec<usize>,
    /// Probability of each entry.
    result: Vec<f64>,
    /// Local number of each column of the whole problem, in the cluster of this stamp.
    numbers: Vec<(usize, usize)>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    row: usize,
    column: usize,
    weight: f64,
    place: usize,
}

/// Assignments of a cluster up to which they are enumerated.
const ENUMERABLE: usize = 4096;

/// Steps of a sum over sets of columns that take as long as one assignment of those to be enumerated.
const STEPS: usize = 16;

/// Logarithms of weights are cut here: beyond, a pair is certain or impossible, and products must stay finite.
const LARGEST_LN: f64 = 60.0;

impl Default for Marginals {
    /// Is exact in clusters of up to 4096 assignments, or with up to 65,536 pairs of a row and a set of contested columns: about a
    /// dozen of these.
    fn default() -> Self {
        Marginals::with_exact(ENUMERABLE)
    }
}

impl Marginals {
    /// Enumerates the clusters that have up to `exact` assignments of the columns that several rows want (counted without their
    /// conflicts), sums by sets of such columns in those where this takes up to 16 times as many steps, and approximates the
    /// others.
    pub fn with_exact(exact: usize) -> Self {
        Marginals {
            exact,
            pairs: Vec::new(),
            misses: Vec::new(),
            clusters: Clusters::default(),
            order: Vec::new(),
            homes: Vec::new(),
            local: Local::default(),
        }
    }

    /// Finds the probabilities for the pairs `(row, column, ln w)`. Pairs whose row or column does not exist, and those whose
    /// weight is not a number, have probability zero.
    pub fn solve(&mut self, pairs: &[(usize, usize, f64)], rows: usize, columns: usize) {
        self.pairs.clear();
        self.pairs.resize(pairs.len(), 0.0);
        self.misses.clear();
        self.misses.resize(rows, 1.0);
        let valid = |place: &usize| {
            let (row, column, ln) = pairs[*place];
            row < rows && column < columns && ln > f64::NEG_INFINITY
        };
        self.order.clear();
        self.order.extend((0..pairs.len()).filter(valid));
        let pair = |place: &usize| (pairs[*place].0, pairs[*place].1);
        self.clusters.build(self.order.iter().map(pair), rows, columns);
        self.homes.clear();
        self.homes.extend((0..rows).map(|row| self.clusters.of(row)));
        let homes = &self.homes;
        self.order.sort_unstable_by_key(|place| (homes[pairs[*place].0], pairs[*place].0, *place));
        self.local.numbers.clear();
        self.local.numbers.resize(columns, (usize::MAX, 0));
        let mut first = 0;
        while first < self.order.len() {
            let cluster = self.homes[pairs[self.order[first]].0];
            let members = self.order[first..].iter();
            let count = members.take_while(|place| self.homes[pairs[**place].0] == cluster).count();
            self.local.fill(pairs, &self.order[first..first + count], cluster);
            self.solve_local();
            first += count;
        }
        for (place, probability) in self.pairs.iter().enumerate() {
            if let Some(miss) = self.misses.get_mut(pairs[place].0) {
                *miss -= probability;
            }
        }
        self.misses.iter_mut().for_each(|miss| *miss = miss.max(0.0));
    }

    fn solve_local(&mut self) {
        let local = &mut self.local;
        if local.events() <= self.exact {
            enumeration::solve(local);
        } else if subsets::steps(local) <= self.exact.saturating_mul(STEPS) {
            subsets::solve(local);
        } else {
            propagation::solve(local);
        }
        for (entry, probability) in local.entries.iter().zip(&local.result) {
            self.pairs[entry.place] = *probability;
        }
    }

    /// Probability of each pair, in the order in which they were given.
    pub fn pairs(&self) -> &[f64] {
        &self.pairs
    }

    /// Probability that each row has no column.
    pub fn misses(&self) -> &[f64] {
        &self.misses
    }
}

impl Local {
    /// Takes in the pairs at these places of the list, which are those of one cluster, by row.
    fn fill(&mut self, pairs: &[(usize, usize, f64)], places: &[usize], cluster: usize) {
        self.entries.clear();
        self.starts.clear();
        self.wanted.clear();
        (self.rows, self.columns) = (0, 0);
        let mut last = None;
        for &place in places {
            let (row, column, ln) = pairs[place];
            if last != Some(row) {
                last = Some(row);
                self.starts.push(self.entries.len());
                self.rows += 1;
            }
            if self.numbers[column].0 != cluster {
                self.numbers[column] = (cluster, self.columns);
                self.columns += 1;
                self.wanted.push(0);
            }
            self.wanted[self.numbers[column].1] += 1;
            let weight = ln.clamp(-LARGEST_LN, LARGEST_LN).exp();
            self.entries.push(Entry { row: self.rows - 1, column: self.numbers[column].1, weight, place });
        }
        self.starts.push(self.entries.len());
        self.result.clear();
        self.result.resize(self.entries.len(), 0.0);
    }
}
