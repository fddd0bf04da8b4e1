//! Optimal assignment of rows to columns.

mod search;
#[cfg(test)]
mod tests;

use search::{Costs, Dense, Sparse};

/// Finite costs beyond this size are refused: sums and differences of what remains cannot overflow.
const LARGEST: f64 = 1e150;

/// An assignment problem that has no answer.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum AssignmentError {
    /// The number of costs does not match the shape.
    #[error("{rows} x {columns} assignment needs {} costs and got {given}", rows * columns)]
    Shape {
        /// Rows of the problem.
        rows: usize,
        /// Columns of the problem.
        columns: usize,
        /// How many costs there are.
        given: usize,
    },
    /// A sparse entry names a row or a column that does not exist.
    #[error("entry ({row}, {column}) lies outside a {rows} x {columns} assignment")]
    Outside {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// Rows of the problem.
        rows: usize,
        /// Columns of the problem.
        columns: usize,
    },
    /// A cost is NaN, minus infinity, or finite and larger than 1e150.
    #[error(
        "cost of row {row}, column {column} is {value}; costs are numbers up to 1e150, or infinity to forbid"
    )]
    Cost {
        /// Row of the cost.
        row: usize,
        /// Column of the cost.
        column: usize,
        /// The cost.
        value: f64,
    },
    /// The cost of leaving a row unassigned is NaN, minus infinity, or finite and larger than 1e150.
    #[error(
        "cost of leaving row {row} unassigned is {value}; costs are numbers up to 1e150, or infinity to forbid"
    )]
    Miss {
        /// The row.
        row: usize,
        /// The cost.
        value: f64,
    },
    /// A row may not stay unassigned, and no column can be found for it.
    #[error("row {row} must be assigned, and the rows that must be leave no column for it")]
    Infeasible {
        /// The row.
        row: usize,
    },
}

/// Which row goes with which column, what that costs, and the dual values that prove it optimal.
///
/// With costs `c`, miss costs `m`, and duals `u` (rows) and `v` (columns), up to rounding:
/// ```text
/// u[i] + v[j] <= c[i][j]        equal where row i has column j
/// u[i] <= m[i]                  equal where row i is unassigned
/// v[j] <= 0                     equal where column j is unassigned
/// cost = Σ u + Σ v
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Assignment {
    /// Column of each row.
    pub columns: Vec<Option<usize>>,
    /// Row of each column.
    pub rows: Vec<Option<usize>>,
    /// Sum of the costs of the assigned pairs, and of the miss costs of unassigned rows where these were given.
    pub cost: f64,
    /// Dual value of each row.
    pub row_duals: Vec<f64>,
    /// Dual value of each column.
    pub column_duals: Vec<f64>,
}

impl Assignment {
    /// The assigned pairs as (row, column), by row.
    pub fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.columns.iter().enumerate().filter_map(|(row, column)| Some((row, (*column)?)))
    }

    fn reset(&mut self, rows: usize, columns: usize) {
        self.columns.clear();
        self.columns.resize(rows, None);
        self.rows.clear();
        self.rows.resize(columns, None);
        self.row_duals.clear();
        self.row_duals.resize(rows, 0.0);
        self.column_duals.clear();
        self.column_duals.resize(columns, 0.0);
        self.cost = 0.0;
    }

    fn transpose(&mut self) {
        std::mem::swap(&mut self.columns, &mut self.rows);
        std::mem::swap(&mut self.row_duals, &mut self.column_duals);
    }
}

/// Finds the assignment of rows to columns with the lowest total cost, exactly.
///
/// Each row takes at most one column and each column at most one row. A cost of [`f64::INFINITY`] forbids a pair.
/// A solver keeps its memory, so repeated calls on problems of similar size do not allocate.
///
/// ## Recursion
/// Rows are added one by one. Each follows the shortest path, in reduced costs `c[i][j] - u[i] - v[j]`, through the
/// pairs made so far, to a free column or to a row that is cheapest left unassigned; the pairs along it are exchanged
/// and the dual values move so that reduced costs stay non-negative. Time is `O(rows² columns)` at worst for a dense
/// matrix, and far less when few pairs compete.
///
/// ## Use it when
/// each measurement has one object at most and each object one measurement at most: nearest neighbour tracking,
/// set metrics, and, through the dual values, the k-best assignments of Murty's algorithm. Where most pairs are
/// forbidden use [`solve_sparse`](AssignmentSolver::solve_sparse).
///
/// ## Reference
/// Jonker and Volgenant, "A shortest augmenting path algorithm for dense and sparse linear assignment problems",
/// Computing 38 (1987); Crouse, "On implementing 2D rectangular assignment algorithms", IEEE TAES 52(4) (2016).
/// Deviations: no column reduction beforehand; a row may end unassigned at a cost of its own, which stands for a
/// private column of that row.
///
/// ```
/// use tercel_core::association::AssignmentSolver;
///
/// let mut solver = AssignmentSolver::new();
/// let costs = [
///     1.0, 2.0, 9.0, //
///     1.5, 4.0, f64::INFINITY,
/// ];
/// let best = solver.solve(&costs, 2, 3)?;
/// assert_eq!(best.columns, [Some(1), Some(0)]);
/// assert_eq!(best.cost, 3.5);
///
/// // The second row may stay alone at a cost of 0.25.
/// let best = solver.solve_or_miss(&costs, 3, &[5.0, 0.25])?;
/// assert_eq!(best.columns, [Some(0), None]);
/// assert_eq!(best.cost, 1.25);
/// # Ok::<(), tercel_core::association::AssignmentError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct AssignmentSolver {
    best: Assignment,
    search: search::Search,
    sparse: search::SparseMatrix,
    transposed: Vec<f64>,
    misses: Vec<f64>,
}

impl AssignmentSolver {
    /// A solver without memory yet; it grows with the problems it sees.
    pub fn new() -> Self {
        Self::default()
    }

    /// Assigns as many rows as possible, and among all ways to do so finds the cheapest.
    ///
    /// `costs` holds the matrix row by row. Where every row can be assigned the dual values satisfy what
    /// [`Assignment`] states without the conditions on misses; with more rows than columns, `u <= 0` takes the place
    /// of `v <= 0`. Rows (or, with more rows than columns, columns) that must stay alone because their pairs are
    /// forbidden carry a penalty above any sum of costs in their dual value, and then `cost` is not the sum of the
    /// duals.
    ///
    /// # Errors
    /// When the shape does not match or a cost is not a number; see [`AssignmentError`].
    pub fn solve(
        &mut self,
        costs: &[f64],
        rows: usize,
        columns: usize,
    ) -> Result<&Assignment, AssignmentError> {
        check(costs, rows, columns)?;
        // Only forbidden pairs keep a row of the smaller side alone, so the penalty below, which costs digits, enters
        // the dual values only where the problem needs it.
        let turned = rows > columns;
        let (few, many) = if turned { (columns, rows) } else { (rows, columns) };
        self.misses.clear();
        self.misses.resize(few, penalty(costs, few));
        if turned {
            self.transposed.clear();
            self.transposed.extend((0..few * many).map(|k| costs[(k % many) * columns + k / many]));
        }
        let matrix = Dense { costs: if turned { &self.transposed } else { costs }, columns: many };
        self.best.reset(few, many);
        for row in 0..few {
            self.search.insert_dense(&matrix, row, &self.misses, &mut self.best)?;
        }
        self.best.cost = self.best.pairs().map(|(row, column)| matrix.cost(row, column)).sum();
        if turned {
            self.best.transpose();
        }
        Ok(&self.best)
    }

    /// Finds the cheapest assignment in which row `i` may stay unassigned at the cost `misses[i]`; infinity says that
    /// it must not. There are as many rows as `misses`.
    ///
    /// # Errors
    /// When the shape does not match, a cost is not a number, or a row that must be assigned cannot be.
    pub fn solve_or_miss(
        &mut self,
        costs: &[f64],
        columns: usize,
        misses: &[f64],
    ) -> Result<&Assignment, AssignmentError> {
        check(costs, misses.len(), columns)?;
        check_misses(misses)?;
        let matrix = Dense { costs, columns };
        self.best.reset(misses.len(), columns);
        for row in 0..misses.len() {
            self.search.insert_dense(&matrix, row, misses, &mut self.best)?;
        }
        self.best.cost = total(&matrix, &self.best, misses);
        Ok(&self.best)
    }

    /// As [`solve_or_miss`](AssignmentSolver::solve_or_miss), for a matrix of which only some entries
    /// `(row, column, cost)` are permitted. Entries come in any order; of two for the same pair the cheaper counts.
    ///
    /// # Errors
    /// When an entry lies outside the matrix, a cost is not a number, or a row that must be assigned cannot be.
    pub fn solve_sparse(
        &mut self,
        entries: &[(usize, usize, f64)],
        columns: usize,
        misses: &[f64],
    ) -> Result<&Assignment, AssignmentError> {
        let rows = misses.len();
        check_misses(misses)?;
        for &(row, column, value) in entries {
            if row >= rows || column >= columns {
                return Err(AssignmentError::Outside { row, column, rows, columns });
            }
            if !valid(value) {
                return Err(AssignmentError::Cost { row, column, value });
            }
        }
        self.sparse.fill(entries, rows);
        let matrix = Sparse { matrix: &self.sparse };
        self.best.reset(rows, columns);
        self.search.forget(columns);
        for row in 0..rows {
            self.search.insert_sparse(&matrix, row, misses, &mut self.best)?;
        }
        self.best.cost = total(&matrix, &self.best, misses);
        Ok(&self.best)
    }
}

fn total(matrix: &impl Costs, best: &Assignment, misses: &[f64]) -> f64 {
    let parts = best.columns.iter().zip(misses).enumerate();
    parts.map(|(row, (column, miss))| column.map_or(*miss, |column| matrix.cost(row, column))).sum()
}

/// A cost of leaving a row alone that no saving on other rows outweighs.
fn penalty(costs: &[f64], rows: usize) -> f64 {
    let permitted = || costs.iter().copied().filter(|cost| cost.is_finite());
    let highest = permitted().fold(f64::NEG_INFINITY, f64::max);
    let lowest = permitted().fold(f64::INFINITY, f64::min);
    if highest < lowest {
        return 1.0;
    }
    let size = highest.abs().max(lowest.abs());
    highest + (rows + 1) as f64 * (highest - lowest) + if size > 0.0 { size } else { 1.0 }
}

fn valid(cost: f64) -> bool {
    cost.abs() <= LARGEST || cost == f64::INFINITY
}

fn check(costs: &[f64], rows: usize, columns: usize) -> Result<(), AssignmentError> {
    if rows.checked_mul(columns) != Some(costs.len()) {
        return Err(AssignmentError::Shape { rows, columns, given: costs.len() });
    }
    match costs.iter().position(|cost| !valid(*cost)) {
        None => Ok(()),
        Some(k) => Err(AssignmentError::Cost { row: k / columns, column: k % columns, value: costs[k] }),
    }
}

fn check_misses(misses: &[f64]) -> Result<(), AssignmentError> {
    match misses.iter().position(|cost| !valid(*cost)) {
        None => Ok(()),
        Some(row) => Err(AssignmentError::Miss { row, value: misses[row] }),
    }
}
