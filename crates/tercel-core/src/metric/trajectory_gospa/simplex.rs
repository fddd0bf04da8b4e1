//! A dense simplex method for the small linear programme over paths.

/// Chooses a mixture of paths for each object so that no group of uses is taken more than once:
/// ```text
/// min Σ_p c_p x_p    where Σ_(p of object i) x_p = 1,  Σ_(p in group g) x_p <= 1,  x >= 0
/// ```
/// The first column of each object is a path that is in no group, so that taking these first columns is a feasible start and
/// no other phase is needed. Coefficients are 0 and 1 and the tableau stays close to whole numbers.
#[derive(Debug)]
pub(super) struct Programme {
    pub(super) objects: usize,
    pub(super) groups: usize,
    /// Cost, object and groups of each path.
    pub(super) columns: Vec<(f64, usize, Vec<usize>)>,
}

/// The optimum of a [`Programme`].
#[derive(Debug)]
pub(super) struct Optimum {
    /// Share of each path.
    pub(super) shares: Vec<f64>,
    /// Price of each group, not negative.
    pub(super) prices: Vec<f64>,
    pub(super) cost: f64,
}

/// A reduced cost or pivot below this is rounding; costs are scaled to about 1.
const ROUNDING: f64 = 1e-11;

struct Tableau {
    width: usize,
    /// Rows of the tableau, the right side last in each; the reduced costs are the last row.
    cells: Vec<f64>,
    basis: Vec<usize>,
}

impl Programme {
    /// Solves the programme; columns `columns.len()..` of the tableau are the slacks of the groups.
    pub(super) fn solve(&self) -> Optimum {
        let scale = self.columns.iter().map(|column| column.0.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let mut tableau = self.tableau(scale);
        tableau.improve();
        let mut shares = vec![0.0; self.columns.len()];
        for (row, &column) in tableau.basis.iter().enumerate() {
            if let Some(share) = shares.get_mut(column) {
                *share = tableau.cells[row * tableau.width + tableau.width - 1].max(0.0);
            }
        }
        let bottom = tableau.basis.len() * tableau.width;
        let slacks = bottom + self.columns.len();
        let prices = tableau.cells[slacks..slacks + self.groups].iter().map(|price| price.max(0.0) * scale);
        let cost = shares.iter().zip(&self.columns).map(|(share, column)| share * column.0).sum();
        Optimum { shares, prices: prices.collect(), cost }
    }

    fn tableau(&self, scale: f64) -> Tableau {
        let rows = self.objects + self.groups;
        let width = self.columns.len() + self.groups + 1;
        let mut cells = vec![0.0; (rows + 1) * width];
        let mut basis = vec![usize::MAX; rows];
        for (column, (cost, object, groups)) in self.columns.iter().enumerate() {
            cells[object * width + column] = 1.0;
            groups.iter().for_each(|group| cells[(self.objects + group) * width + column] = 1.0);
            cells[rows * width + column] = cost / scale;
            if basis[*object] == usize::MAX {
                basis[*object] = column;
            }
        }
        for group in 0..self.groups {
            let column = self.columns.len() + group;
            cells[(self.objects + group) * width + column] = 1.0;
            basis[self.objects + group] = column;
        }
        (0..rows).for_each(|row| cells[row * width + width - 1] = 1.0);
        let mut tableau = Tableau { width, cells, basis };
        (0..self.objects).for_each(|row| tableau.clear_cost(row));
        tableau
    }
}

impl Tableau {
    fn rows(&self) -> usize {
        self.basis.len()
    }

    /// Pivots until no reduced cost is negative. The steepest column enters; after a run of pivots that gain nothing, the
    /// first one does (Bland's rule), which cannot go in circles.
    fn improve(&mut self) {
        let mut idle = 0;
        // The bound stands far above what programmes of this kind take, and keeps rounding from holding up the caller,
        // who checks what comes back.
        for _ in 0..50 * (self.rows() + self.width) {
            let stuck = idle > 50;
            let Some(column) = self.entering(stuck) else { return };
            let Some(row) = self.leaving(column, stuck) else { return };
            let gains = self.cells[row * self.width + self.width - 1] > ROUNDING;
            idle = if gains { 0 } else { idle + 1 };
            self.pivot(row, column);
        }
    }

    fn entering(&self, first: bool) -> Option<usize> {
        let start = self.rows() * self.width;
        let costs = &self.cells[start..start + self.width - 1];
        if first {
            return costs.iter().position(|cost| *cost < -ROUNDING);
        }
        let steepest = costs.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
        (*steepest.1 < -ROUNDING).then_some(steepest.0)
    }

    /// The row that limits the entering column. Of several, that of the largest pivot, which keeps rounding small, or that of
    /// the lowest basic column (Bland's rule).
    fn leaving(&self, column: usize, first: bool) -> Option<usize> {
        let cell = |row: usize, column: usize| self.cells[row * self.width + column];
        let ratio = |row: usize| cell(row, self.width - 1) / cell(row, column);
        let rows = || (0..self.rows()).filter(|row| cell(*row, column) > 1e-7);
        let limit = rows().map(ratio).min_by(f64::total_cmp)? + ROUNDING;
        let limiting = rows().filter(|row| ratio(*row) <= limit);
        if first {
            return limiting.min_by_key(|row| self.basis[*row]);
        }
        limiting.max_by(|a, b| cell(*a, column).total_cmp(&cell(*b, column)))
    }

    fn pivot(&mut self, row: usize, column: usize) {
        let width = self.width;
        let inverse = 1.0 / self.cells[row * width + column];
        let pivot: Vec<f64> =
            self.cells[row * width..(row + 1) * width].iter().map(|x| x * inverse).collect();
        for (other, cells) in self.cells.chunks_exact_mut(width).enumerate() {
            let factor = cells[column];
            if other == row {
                cells.copy_from_slice(&pivot);
            } else if factor != 0.0 {
                cells.iter_mut().zip(&pivot).for_each(|(cell, x)| *cell = settled(*cell - factor * x));
                cells[column] = 0.0;
            }
        }
        self.basis[row] = column;
    }

    /// Makes the reduced cost of the basic column of `row` zero.
    fn clear_cost(&mut self, row: usize) {
        let width = self.width;
        let (rows, bottom) = self.cells.split_at_mut(self.basis.len() * width);
        let factor = bottom[self.basis[row]];
        let cells = &rows[row * width..(row + 1) * width];
        bottom.iter_mut().zip(cells).for_each(|(cost, x)| *cost -= factor * x);
    }
}

/// A cell that differs from zero by rounding only is zero: cells are near whole numbers or small fractions, and what is left of
/// a cancellation must not become a pivot later.
#[inline]
fn settled(cell: f64) -> f64 {
    if cell.abs() < 1e-13 { 0.0 } else { cell }
}
