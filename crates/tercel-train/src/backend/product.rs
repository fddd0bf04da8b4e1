//! Matrix products on slices in row-major order.
//!
//! `nalgebra` wraps the kernels of `matrixmultiply`, which choose their instructions at run time, behind
//! views that check their bounds. A matrix in rows is its transpose in columns, so the transposed product is
//! computed, with a result in the layout that `nalgebra` expects: for products with a dimension of five or
//! fewer, its own loops write past the end of a result that is laid out otherwise (0.35). Those loops are
//! slow for rows in memory too, so such products have loops here.

use nalgebra::{Dyn, MatrixView, MatrixViewMut};

use super::vector::vectorised;

type View<'a> = MatrixView<'a, f32, Dyn, Dyn, Dyn, Dyn>;
type ViewMut<'a> = MatrixViewMut<'a, f32, Dyn, Dyn, Dyn, Dyn>;

/// Largest dimension that goes to the loops of this module.
const NARROW: usize = 5;

/// The transpose of a matrix in rows.
fn transposed(values: &[f32], rows: usize, columns: usize) -> View<'_> {
    View::from_slice_with_strides_generic(values, Dyn(columns), Dyn(rows), Dyn(1), Dyn(columns))
}

/// A matrix in rows.
fn plain(values: &[f32], rows: usize, columns: usize) -> View<'_> {
    View::from_slice_with_strides_generic(values, Dyn(rows), Dyn(columns), Dyn(columns), Dyn(1))
}

/// Adds the product of two transposes to a result in rows of `m x n`: `(a b)^T = b^T a^T`.
fn add_transposes(out: &mut [f32], b: &View<'_>, a: &View<'_>, [m, n]: [usize; 2]) {
    let mut out = ViewMut::from_slice_with_strides_generic(out, Dyn(n), Dyn(m), Dyn(1), Dyn(n));
    out.gemm(1.0, b, a, 1.0);
}

/// Adds `a b` to `out`, with `a` of `m x k` and `b` of `k x n`.
pub fn add_product(out: &mut [f32], a: &[f32], b: &[f32], [m, k, n]: [usize; 3]) {
    if m.min(k).min(n) > NARROW {
        add_transposes(out, &transposed(b, k, n), &transposed(a, m, k), [m, n]);
    } else if n <= NARROW {
        let columns = transpose(b, k, n);
        add_dots(out, a, &columns, [k, n]);
    } else {
        add_scaled_rows(out, a, b, [k, n]);
    }
}

/// Adds `a b^T` to `out`, with `a` of `m x k` and `b` of `n x k`: the gradient of the left factor of a
/// product.
pub fn add_product_transposed(out: &mut [f32], a: &[f32], b: &[f32], [m, k, n]: [usize; 3]) {
    if m.min(k).min(n) > NARROW {
        add_transposes(out, &plain(b, n, k), &transposed(a, m, k), [m, n]);
    } else if n <= NARROW {
        add_dots(out, a, b, [k, n]);
    } else {
        let rows = transpose(b, n, k);
        add_product(out, a, &rows, [m, k, n]);
    }
}

/// Adds `a^T b` to `out`, with `a` of `k x m` and `b` of `k x n`: the gradient of the right factor of a
/// product.
pub fn add_transposed_product(out: &mut [f32], a: &[f32], b: &[f32], [m, k, n]: [usize; 3]) {
    if m.min(k).min(n) > NARROW {
        add_transposes(out, &transposed(b, k, n), &plain(a, k, m), [m, n]);
    } else if n < m {
        // The wider of the two is that along which the inner loop runs.
        let mut turned = vec![0.0; n * m];
        add_outer_products(&mut turned, b, a, [n, m]);
        for (row, out) in out.chunks_exact_mut(n).enumerate() {
            for (column, out) in out.iter_mut().enumerate() {
                *out += turned[column * m + row];
            }
        }
    } else {
        add_outer_products(out, a, b, [m, n]);
    }
}

vectorised! {
    /// Adds to each row the rows of `b`, scaled by that of `a`.
    fn add_scaled_rows<'a>(out: &'a mut [f32], a: &'a [f32], b: &'a [f32], sizes: [usize; 2]) {
        let [k, n] = sizes;
        for (out, a) in out.chunks_exact_mut(n).zip(a.chunks_exact(k)) {
            for (&factor, b) in a.iter().zip(b.chunks_exact(n)) {
                add_scaled(out, factor, b);
            }
        }
    }
}

vectorised! {
    /// Adds the outer products of the rows of `a` with those of `b`.
    fn add_outer_products<'a>(out: &'a mut [f32], a: &'a [f32], b: &'a [f32], sizes: [usize; 2]) {
        let [m, n] = sizes;
        for (a, b) in a.chunks_exact(m).zip(b.chunks_exact(n)) {
            for (&factor, out) in a.iter().zip(out.chunks_exact_mut(n)) {
                add_scaled(out, factor, b);
            }
        }
    }
}

#[inline(always)]
fn add_scaled(out: &mut [f32], factor: f32, values: &[f32]) {
    for (out, value) in out.iter_mut().zip(values) {
        *out += factor * value;
    }
}

vectorised! {
    /// Adds the inner products of the rows of `a` with those of `b`.
    fn add_dots<'a>(out: &'a mut [f32], a: &'a [f32], b: &'a [f32], sizes: [usize; 2]) {
        let [k, n] = sizes;
        for (out, a) in out.chunks_exact_mut(n).zip(a.chunks_exact(k)) {
            for (out, b) in out.iter_mut().zip(b.chunks_exact(k)) {
                *out += dot(a, b);
            }
        }
    }
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    // Eight sums side by side, as a vector has them; one sum could not be vectorised without changing its
    // rounding.
    let mut sums = [0.0_f32; 8];
    let (a_whole, a_rest) = a.as_chunks::<8>();
    let (b_whole, b_rest) = b.as_chunks::<8>();
    for (a, b) in a_whole.iter().zip(b_whole) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

fn transpose(values: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    let mut out = vec![0.0; rows * columns];
    for (row, values) in values.chunks_exact(columns).enumerate() {
        for (column, value) in values.iter().enumerate() {
            out[column * rows + row] = *value;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, salt: usize) -> Vec<f32> {
        (0..count).map(|i| (((i * 7919 + salt * 104_729) % 1009) as f32 - 504.0) / 504.0).collect()
    }

    #[test]
    fn products_of_all_shapes_equal_the_sum_over_the_inner_dimension() {
        for m in [1, 4, 6, 17] {
            for k in [1, 3, 8, 21] {
                for n in [1, 2, 5, 7, 40] {
                    let (a, b) = (numbers(m * k, 1), numbers(k * n, 2));
                    let start = numbers(m * n, 3);
                    let mut expected = start.clone();
                    for i in 0..m {
                        for j in 0..n {
                            expected[i * n + j] += (0..k).map(|l| a[i * k + l] * b[l * n + j]).sum::<f32>();
                        }
                    }
                    let (at, bt) = (transpose(&a, m, k), transpose(&b, k, n));
                    let mut found = [start.clone(), start.clone(), start];
                    add_product(&mut found[0], &a, &b, [m, k, n]);
                    add_product_transposed(&mut found[1], &a, &bt, [m, k, n]);
                    add_transposed_product(&mut found[2], &at, &b, [m, k, n]);
                    for found in &found {
                        for (found, expected) in found.iter().zip(&expected) {
                            assert!(
                                (found - expected).abs() < 1e-5,
                                "{m} x {k} x {n}: {found} for {expected}"
                            );
                        }
                    }
                }
            }
        }
    }
}
