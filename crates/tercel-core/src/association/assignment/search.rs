//! The shortest augmenting path of one row, through a dense or a sparse matrix.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use super::{Assignment, AssignmentError};

/// A matrix that knows the cost of a pair.
pub(super) trait Costs {
    fn cost(&self, row: usize, column: usize) -> f64;
}

/// A matrix, row by row.
pub(super) struct Dense<'a> {
    pub(super) costs: &'a [f64],
    pub(super) columns: usize,
}

impl Dense<'_> {
    fn row(&self, row: usize) -> &[f64] {
        &self.costs[row * self.columns..(row + 1) * self.columns]
    }
}

impl Costs for Dense<'_> {
    fn cost(&self, row: usize, column: usize) -> f64 {
        self.row(row)[column]
    }
}

/// The permitted entries of each row, one row after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct SparseMatrix {
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl SparseMatrix {
    /// Sorts the entries by row, by counting.
    pub(super) fn fill(&mut self, entries: &[(usize, usize, f64)], rows: usize) {
        self.starts.clear();
        self.starts.resize(rows + 1, 0);
        for &(row, _, _) in entries {
            self.starts[row] += 1;
        }
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        // Filling each row from its end moves its mark to where the row starts.
        self.entries.clear();
        self.entries.resize(entries.len(), (0, f64::INFINITY));
        for &(row, column, cost) in entries.iter().rev() {
            self.starts[row] -= 1;
            self.entries[self.starts[row]] = (column, cost);
        }
    }

    fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }
}

/// A sparse matrix in use.
pub(super) struct Sparse<'a> {
    pub(super) matrix: &'a SparseMatrix,
}

impl Costs for Sparse<'_> {
    fn cost(&self, row: usize, column: usize) -> f64 {
        let entries = self.matrix.row(row).iter().filter(|entry| entry.0 == column);
        entries.map(|entry| entry.1).fold(f64::INFINITY, f64::min)
    }
}

/// A column to visit, nearest first; columns of equal distance by number, so that results do not depend on the heap.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Visit {
    distance: f64,
    column: usize,
}

impl Eq for Visit {}

impl Ord for Visit {
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance.total_cmp(&other.distance).then(self.column.cmp(&other.column))
    }
}

impl PartialOrd for Visit {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Where a path ends.
#[derive(Clone, Copy)]
enum End {
    /// At a free column.
    Column(usize),
    /// At a row that stays unassigned.
    Miss(usize),
}

/// The tree of shortest paths from one row.
#[derive(Debug, Clone, Default)]
pub(super) struct Search {
    /// Length of the shortest path known to each column.
    distances: Vec<f64>,
    /// The row from which that path enters the column.
    sources: Vec<usize>,
    /// Columns of the tree, in the order of their distance.
    visited: Vec<usize>,
    /// Columns outside the tree (dense search).
    open: Vec<usize>,
    /// Columns at the edge of the tree (sparse search).
    edge: BinaryHeap<Reverse<Visit>>,
    /// Columns whose distance was set (sparse search).
    touched: Vec<usize>,
    /// Which columns are in the tree (sparse search). Rounding may show a shorter way to one of them; to follow it
    /// would make a circle.
    closed: Vec<bool>,
}

impl Search {
    /// Adds `root` to the optimal assignment of the rows before it.
    pub(super) fn insert_dense(
        &mut self,
        matrix: &Dense<'_>,
        root: usize,
        misses: &[f64],
        best: &mut Assignment,
    ) -> Result<(), AssignmentError> {
        self.forget(matrix.columns);
        self.visited.clear();
        self.open.clear();
        self.open.extend(0..matrix.columns);
        let (mut row, mut base) = (root, 0.0);
        let mut miss = (misses[root] - best.row_duals[root], root);
        let (end, length) = loop {
            let mut nearest = (f64::INFINITY, usize::MAX);
            let costs = matrix.row(row);
            let offset = base - best.row_duals[row];
            for (place, &column) in self.open.iter().enumerate() {
                let distance = offset + (costs[column] - best.column_duals[column]);
                if distance < self.distances[column] {
                    self.distances[column] = distance;
                    self.sources[column] = row;
                }
                if self.distances[column] < nearest.0 {
                    nearest = (self.distances[column], place);
                }
            }
            if nearest.1 == usize::MAX || miss.0 < nearest.0 {
                break (End::Miss(miss.1), miss.0);
            }
            let column = self.open.swap_remove(nearest.1);
            let Some(next) = best.rows[column] else { break (End::Column(column), nearest.0) };
            self.visited.push(column);
            (row, base) = (next, nearest.0);
            let alone = base + (misses[row] - best.row_duals[row]);
            if alone < miss.0 {
                miss = (alone, row);
            }
        };
        self.finish(root, end, length, best)
    }

    /// Forgets all distances; the sparse search then clears only those that it sets.
    pub(super) fn forget(&mut self, columns: usize) {
        self.distances.clear();
        self.distances.resize(columns, f64::INFINITY);
        self.sources.resize(columns, usize::MAX);
        self.touched.clear();
        self.closed.clear();
        self.closed.resize(columns, false);
    }

    /// Adds `root` to the optimal assignment of the rows before it.
    pub(super) fn insert_sparse(
        &mut self,
        matrix: &Sparse<'_>,
        root: usize,
        misses: &[f64],
        best: &mut Assignment,
    ) -> Result<(), AssignmentError> {
        for column in self.touched.drain(..) {
            self.distances[column] = f64::INFINITY;
            self.closed[column] = false;
        }
        self.edge.clear();
        self.visited.clear();
        let (mut row, mut base) = (root, 0.0);
        let mut miss = (misses[root] - best.row_duals[root], root);
        let (end, length) = loop {
            self.relax(matrix, row, base, best);
            let Some(Visit { distance, column }) = self.nearest() else {
                break (End::Miss(miss.1), miss.0);
            };
            if miss.0 < distance {
                break (End::Miss(miss.1), miss.0);
            }
            let Some(next) = best.rows[column] else { break (End::Column(column), distance) };
            self.visited.push(column);
            self.closed[column] = true;
            (row, base) = (next, distance);
            let alone = base + (misses[row] - best.row_duals[row]);
            if alone < miss.0 {
                miss = (alone, row);
            }
        };
        self.finish(root, end, length, best)
    }

    fn relax(&mut self, matrix: &Sparse<'_>, row: usize, base: f64, best: &Assignment) {
        let offset = base - best.row_duals[row];
        for &(column, cost) in matrix.matrix.row(row) {
            let distance = offset + (cost - best.column_duals[column]);
            if distance < self.distances[column] && !self.closed[column] {
                if self.distances[column] == f64::INFINITY {
                    self.touched.push(column);
                }
                self.distances[column] = distance;
                self.sources[column] = row;
                self.edge.push(Reverse(Visit { distance, column }));
            }
        }
    }

    /// The nearest column at the edge. What the heap still holds of columns that were reached on a shorter way since is
    /// skipped.
    fn nearest(&mut self) -> Option<Visit> {
        while let Some(Reverse(visit)) = self.edge.pop() {
            if visit.distance == self.distances[visit.column] {
                return Some(visit);
            }
        }
        None
    }

    /// Moves the dual values by what the path shows and exchanges the pairs along it.
    fn finish(
        &mut self,
        root: usize,
        end: End,
        length: f64,
        best: &mut Assignment,
    ) -> Result<(), AssignmentError> {
        if length == f64::INFINITY {
            return Err(AssignmentError::Infeasible { row: root });
        }
        best.row_duals[root] += length;
        for &column in &self.visited {
            let shift = length - self.distances[column];
            best.column_duals[column] -= shift;
            if let Some(row) = best.rows[column] {
                best.row_duals[row] += shift;
            }
        }
        let mut free = match end {
            End::Column(column) => Some(column),
            End::Miss(row) => best.columns[row].take(),
        };
        while let Some(column) = free {
            let row = self.sources[column];
            best.rows[column] = Some(row);
            free = best.columns[row].replace(column);
        }
        Ok(())
    }
}
