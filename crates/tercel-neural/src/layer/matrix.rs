//! Weight matrices, packed for products with a few rows.

use super::dispatch::{Arithmetic, LANES};

/// Weights that are used together: eight vectors of eight, which is what the registers hold as running sums.
const CHUNK: usize = 8 * LANES;

#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
struct Chunk([f32; CHUNK]);

/// A matrix `[rows, columns]` that multiplies row vectors from the right.
///
/// The columns are cut into panels of 64, 32, 16 or 8. A panel of width `w` is stored as chunks of `64 / w` rows, so that
/// the product streams through memory and always has eight independent sums in flight, however narrow the matrix is. Missing
/// rows and columns are zeros.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matrix {
    rows: usize,
    columns: usize,
    panels: Vec<Panel>,
    chunks: Vec<Chunk>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Panel {
    width: usize,
    /// First column.
    column: usize,
    /// Columns in use, at most `width`.
    used: usize,
    /// First chunk.
    chunk: usize,
}

/// The width of the next panel when this many columns are left: as wide as possible, with little waste.
fn next_width(left: usize) -> usize {
    match left {
        0..=8 => 8,
        9..=24 => 16,
        25..=63 => 32,
        _ => 64,
    }
}

impl Matrix {
    /// Packs the values of `[rows, columns]`, row by row.
    pub fn new(rows: usize, columns: usize, values: &[f32]) -> Self {
        assert_eq!(values.len(), rows * columns, "values of a matrix of {rows} by {columns}");
        let (mut panels, mut chunks, mut column) = (Vec::new(), Vec::new(), 0);
        while column < columns {
            let width = next_width(columns - column);
            let used = width.min(columns - column);
            panels.push(Panel { width, column, used, chunk: chunks.len() });
            for first in (0..rows).step_by(CHUNK / width) {
                let mut chunk = Chunk([0.0; CHUNK]);
                for (row, to) in (first..rows).zip(chunk.0.chunks_exact_mut(width)) {
                    to[..used].copy_from_slice(&values[row * columns + column..][..used]);
                }
                chunks.push(chunk);
            }
            column += used;
        }
        Matrix { rows, columns, panels, chunks }
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Adds `x W` to `output`, for each row of `input` and `output`.
    ///
    /// The sums of a row do not depend on what other rows there are.
    #[inline(always)]
    pub fn add_product<A: Arithmetic>(&self, machine: A, input: &[f32], output: &mut [f32]) {
        for panel in &self.panels {
            let depth = CHUNK / panel.width;
            let chunks = &self.chunks[panel.chunk..][..self.rows.div_ceil(depth)];
            for (x, y) in input.chunks_exact(self.rows).zip(output.chunks_exact_mut(self.columns)) {
                let y = &mut y[panel.column..][..panel.used];
                match panel.width {
                    64 => accumulate::<A, 64, 1>(machine, x, chunks, y),
                    32 => accumulate::<A, 32, 2>(machine, x, chunks, y),
                    16 => accumulate::<A, 16, 4>(machine, x, chunks, y),
                    _ => accumulate::<A, 8, 8>(machine, x, chunks, y),
                }
            }
        }
    }
}

/// Adds the product of `x` with a panel of `WIDTH` columns, stored `DEPTH` rows to a chunk, to `y`.
#[inline(always)]
fn accumulate<A: Arithmetic, const WIDTH: usize, const DEPTH: usize>(
    machine: A,
    x: &[f32],
    chunks: &[Chunk],
    y: &mut [f32],
) {
    let mut sums = [machine.splat(0.0); CHUNK / LANES];
    let (whole, rest) = x.as_chunks::<DEPTH>();
    for (x, chunk) in whole.iter().zip(chunks) {
        gather::<A, WIDTH, DEPTH>(machine, x, chunk, &mut sums);
    }
    if let (false, Some(chunk)) = (rest.is_empty(), chunks.last()) {
        let mut padded = [0.0; DEPTH];
        padded[..rest.len()].copy_from_slice(rest);
        gather::<A, WIDTH, DEPTH>(machine, &padded, chunk, &mut sums);
    }
    let mut totals = [0.0; WIDTH];
    for (vector, to) in sums.into_iter().zip((0..WIDTH).step_by(LANES).cycle()) {
        let to = &mut totals[to..to + LANES];
        for (total, sum) in to.iter_mut().zip(machine.numbers(vector)) {
            *total += sum;
        }
    }
    // A length that the compiler knows makes this a few vector instructions.
    match y.as_mut_array::<WIDTH>() {
        Some(y) => add(y, &totals),
        None => add(y, &totals),
    }
}

#[inline(always)]
fn add(to: &mut [f32], terms: &[f32]) {
    for (to, term) in to.iter_mut().zip(terms) {
        *to += term;
    }
}

/// Adds the products of `DEPTH` numbers with the rows of a chunk.
#[inline(always)]
fn gather<A: Arithmetic, const WIDTH: usize, const DEPTH: usize>(
    machine: A,
    x: &[f32; DEPTH],
    chunk: &Chunk,
    sums: &mut [A::Vector; CHUNK / LANES],
) {
    let weights = chunk.0.as_chunks::<LANES>().0;
    for (index, (sum, weights)) in sums.iter_mut().zip(weights).enumerate() {
        let x = machine.splat(x[index * LANES / WIDTH]);
        *sum = machine.gather(x, weights, *sum);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layer::dispatch::{Kernel, dispatch, plainly};

    struct Product<'a>(&'a Matrix, &'a [f32], &'a mut [f32]);

    impl Kernel for Product<'_> {
        #[inline(always)]
        fn run<A: Arithmetic>(self, machine: A) {
            self.0.add_product(machine, self.1, self.2);
        }
    }

    fn value(i: usize) -> f32 {
        ((i * 7919 % 1000) as f32 / 500.0) - 1.0
    }

    #[test]
    fn products_of_all_sizes_equal_those_in_double_precision() {
        for rows in [1, 2, 3, 7, 8, 9, 16, 33, 800] {
            for columns in [1, 4, 8, 9, 16, 17, 20, 24, 25, 32, 36, 48, 63, 64, 65, 100, 256] {
                let weights: Vec<f32> = (0..rows * columns).map(value).collect();
                let input: Vec<f32> = (0..3 * rows).map(|i| value(i + 13)).collect();
                let matrix = Matrix::new(rows, columns, &weights);
                let (mut wide, mut plain) = (vec![0.5; 3 * columns], vec![0.5; 3 * columns]);
                dispatch(Product(&matrix, &input, &mut wide));
                plainly(Product(&matrix, &input, &mut plain));
                for (batch, column) in (0..3).flat_map(|b| (0..columns).map(move |c| (b, c))) {
                    let exact = 0.5
                        + (0..rows)
                            .map(|r| {
                                f64::from(input[batch * rows + r]) * f64::from(weights[r * columns + column])
                            })
                            .sum::<f64>();
                    for got in [wide[batch * columns + column], plain[batch * columns + column]] {
                        let error = (f64::from(got) - exact).abs();
                        assert!(error < 2e-6 * (rows as f64).sqrt() + 2e-6, "{rows}x{columns}: {error:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_row_gives_the_same_alone_and_in_a_batch() {
        let (rows, columns) = (37, 45);
        let weights: Vec<f32> = (0..rows * columns).map(value).collect();
        let matrix = Matrix::new(rows, columns, &weights);
        let input: Vec<f32> = (0..5 * rows).map(value).collect();
        let mut together = vec![0.0; 5 * columns];
        dispatch(Product(&matrix, &input, &mut together));
        for (x, y) in input.chunks(rows).zip(together.chunks(columns)) {
            let mut alone = vec![0.0; columns];
            dispatch(Product(&matrix, x, &mut alone));
            assert_eq!(alone, y);
        }
    }
}
