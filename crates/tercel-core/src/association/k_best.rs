//! The best assignments, in order.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use super::{AssignmentError, AssignmentSolver};

/// Finds the `k` cheapest assignments of rows to columns, the cheapest first.
///
/// ## Recursion
/// The cheapest assignment is solved for. The others differ from it in some row; they are divided by the first such row: those
/// in which row 1 is other, those in which row 1 is the same and row 2 other, ... The cheapest of each part waits in a queue; the
/// cheapest of the queue is the next answer, and its part is divided in the same way. The dual values of an answer say how much more
/// each part must cost at least, so that most parts need not be solved for; and no more parts wait than are wanted.
///
/// ## Use it when
/// the most probable ways to explain a scan are wanted, and how much more probable they are than the rest: hypotheses of
/// multi-hypothesis and Poisson multi-Bernoulli mixture trackers.
///
/// ## Reference
/// Murty (1968), the partitioning procedure; for sparse costs with unassigned rows as
/// [`AssignmentSolver::solve_sparse`].
///
/// ```
/// use tercel_core::association::KBest;
///
/// let mut k_best = KBest::default();
/// let found = k_best.solve(&[(0, 0, 1.0), (0, 1, 2.0), (1, 0, 1.5)], 2, &[5.0, 4.0], 3, f64::INFINITY)?;
/// let costs: Vec<f64> = found.iter().map(|ranked| ranked.cost).collect();
/// assert_eq!(costs, [3.5, 5.0, 6.0]); // (0,1) (1,0); (0,0), 1 alone; (0,1), 1 alone
/// # Ok::<(), tercel_core::association::AssignmentError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct KBest {
    solver: AssignmentSolver,
    entries: Vec<(usize, usize, f64)>,
    misses: Vec<f64>,
    taken: Vec<bool>,
    /// How much more each row must cost if it changes.
    bounds: Vec<f64>,
    found: Vec<Ranked>,
}

/// One of the best assignments.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    /// Its cost.
    pub cost: f64,
    /// Column of each row, or none.
    pub columns: Vec<Option<usize>>,
}

/// The cheapest assignment of a part: those that agree with it in the rows before `fixed`, and do not give row `fixed` what
/// is excluded.
#[derive(Debug)]
struct Part {
    best: Ranked,
    fixed: usize,
    excluded: Vec<Option<usize>>,
    /// Parts of equal cost are taken in the order in which they were made.
    number: usize,
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        self.best.cost.total_cmp(&other.best.cost).then(self.number.cmp(&other.number))
    }
}

impl KBest {
    /// At most `k` assignments for the permitted pairs `(row, column, cost)`, none of which costs more than the best by over
    /// `excess`. Row `i` may stay alone at the cost `misses[i]`. Each pair is given once.
    ///
    /// # Errors
    /// As [`AssignmentSolver::solve_sparse`].
    pub fn solve(
        &mut self,
        pairs: &[(usize, usize, f64)],
        columns: usize,
        misses: &[f64],
        k: usize,
        excess: f64,
    ) -> Result<&[Ranked], AssignmentError> {
        self.found.clear();
        if k == 0 {
            return Ok(&self.found);
        }
        let best = self.solver.solve_sparse(pairs, columns, misses)?;
        let first = Ranked { cost: best.cost, columns: best.columns.clone() };
        let mut limit = first.cost + excess;
        let mut queue = BTreeSet::new();
        let mut number = 0;
        queue.insert(Part { best: first, fixed: 0, excluded: Vec::new(), number });
        while let Some(part) = queue.pop_first() {
            let wanted = k - self.found.len() - 1;
            if wanted > 0 {
                self.bound(pairs, columns, misses, &part);
            }
            for row in part.fixed..misses.len() {
                if wanted == 0 {
                    break;
                }
                if part.best.cost + self.bounds[row] > limit {
                    continue;
                }
                let mut excluded = if row == part.fixed { part.excluded.clone() } else { Vec::new() };
                excluded.push(part.best.columns[row]);
                let Some(best) = self.best_of(pairs, columns, misses, (&part.best, row, &excluded)) else {
                    continue;
                };
                if best.cost <= limit {
                    number += 1;
                    queue.insert(Part { best, fixed: row, excluded, number });
                }
                if queue.len() > wanted {
                    queue.pop_last();
                }
                if let (true, Some(worst)) = (queue.len() == wanted, queue.last()) {
                    limit = limit.min(worst.best.cost);
                }
            }
            self.found.push(part.best);
            if wanted == 0 {
                break;
            }
        }
        Ok(&self.found)
    }

    /// Finds how much more a part's assignment must cost if a row changes, from the dual values: the least reduced cost of
    /// the row's other choices. Rounding is allowed for.
    fn bound(&mut self, pairs: &[(usize, usize, f64)], columns: usize, misses: &[f64], part: &Part) {
        self.bounds.clear();
        self.bounds.resize(misses.len(), f64::INFINITY);
        let fixed = part.fixed;
        self.restrict(pairs, columns, misses, (&part.best, fixed, &part.excluded));
        let Ok(rest) = self.solver.solve_sparse(&self.entries, columns, &self.misses) else {
            self.bounds.fill(0.0);
            return;
        };
        for &(row, column, cost) in &self.entries {
            if rest.columns[row] != Some(column) {
                let more = cost - rest.row_duals[row] - rest.column_duals[column];
                self.bounds[row + fixed] = self.bounds[row + fixed].min(more);
            }
        }
        for (row, miss) in self.misses.iter().enumerate() {
            if rest.columns[row].is_some() {
                self.bounds[row + fixed] = self.bounds[row + fixed].min(miss - rest.row_duals[row]);
            }
        }
        let slack = 1e-9 * (1.0 + part.best.cost.abs());
        self.bounds.iter_mut().for_each(|bound| *bound -= slack);
    }

    /// Leaves of the problem what is open: the rows from `fixed` on, counted from zero, without the columns that the rows
    /// before have in the model, and without what row `fixed` must not take. Returns the cost of the rows before.
    fn restrict(
        &mut self,
        pairs: &[(usize, usize, f64)],
        columns: usize,
        misses: &[f64],
        (model, fixed, excluded): (&Ranked, usize, &[Option<usize>]),
    ) -> f64 {
        self.taken.clear();
        self.taken.resize(columns, false);
        model.columns[..fixed].iter().flatten().for_each(|&column| self.taken[column] = true);
        self.entries.clear();
        let mut settled = 0.0;
        for &(row, column, cost) in pairs {
            if row < fixed {
                settled += if model.columns[row] == Some(column) { cost } else { 0.0 };
            } else if !(self.taken[column] || row == fixed && excluded.contains(&Some(column))) {
                self.entries.push((row - fixed, column, cost));
            }
        }
        let alone = misses[..fixed].iter().zip(&model.columns).filter(|(_, column)| column.is_none());
        settled += alone.map(|(miss, _)| miss).sum::<f64>();
        self.misses.clear();
        self.misses.extend_from_slice(&misses[fixed..]);
        if excluded.contains(&None) {
            self.misses[0] = f64::INFINITY;
        }
        settled
    }

    /// The cheapest assignment that has the columns of another in the rows before `fixed`, and gives row `fixed` none of what
    /// is excluded; `None` if there is none.
    fn best_of(
        &mut self,
        pairs: &[(usize, usize, f64)],
        columns: usize,
        misses: &[f64],
        (model, fixed, excluded): (&Ranked, usize, &[Option<usize>]),
    ) -> Option<Ranked> {
        let settled = self.restrict(pairs, columns, misses, (model, fixed, excluded));
        let rest = self.solver.solve_sparse(&self.entries, columns, &self.misses).ok()?;
        let mut found = model.columns[..fixed].to_vec();
        found.extend_from_slice(&rest.columns);
        Some(Ranked { cost: settled + rest.cost, columns: found })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Costs of all assignments, cheapest first.
    fn all(pairs: &[(usize, usize, f64)], misses: &[f64], row: usize, taken: &mut Vec<usize>) -> Vec<f64> {
        if row == misses.len() {
            return vec![0.0];
        }
        let mut costs: Vec<f64> =
            all(pairs, misses, row + 1, taken).iter().map(|cost| cost + misses[row]).collect();
        for &(_, column, cost) in pairs.iter().filter(|pair| pair.0 == row) {
            if !taken.contains(&column) {
                taken.push(column);
                costs.extend(all(pairs, misses, row + 1, taken).iter().map(|rest| rest + cost));
                taken.pop();
            }
        }
        costs.retain(|cost| cost.is_finite());
        costs.sort_by(f64::total_cmp);
        costs
    }

    proptest! {
        #[test]
        fn the_best_are_those_of_a_search_through_all(
            pairs in prop::collection::btree_map((0..4_usize, 0..4_usize), -5.0..5.0_f64, 0..12),
            misses in prop::collection::vec(-5.0..5.0_f64, 4),
            k in 1..30_usize,
        ) {
            let pairs: Vec<_> = pairs.into_iter().map(|((row, column), cost)| (row, column, cost)).collect();
            let expected = all(&pairs, &misses, 0, &mut Vec::new());
            let mut k_best = KBest::default();
            let found = k_best.solve(&pairs, 4, &misses, k, f64::INFINITY).unwrap();
            prop_assert_eq!(found.len(), k.min(expected.len()));
            for (ranked, cost) in found.iter().zip(&expected) {
                prop_assert!((ranked.cost - cost).abs() < 1e-9, "{} {}", ranked.cost, cost);
            }
            for (place, ranked) in found.iter().enumerate() {
                prop_assert!(found[..place].iter().all(|other| other.columns != ranked.columns));
            }
        }
    }

    #[test]
    fn what_costs_too_much_more_is_left_out() {
        let mut k_best = KBest::default();
        let found = k_best.solve(&[(0, 0, 0.0), (1, 1, 0.0)], 2, &[1.0, 3.0], 100, 3.5).unwrap();
        assert_eq!(found.iter().map(|ranked| ranked.cost).collect::<Vec<_>>(), [0.0, 1.0, 3.0]);
        assert!(k_best.solve(&[], 0, &[], 5, 1.0).unwrap().len() == 1);
    }
}
