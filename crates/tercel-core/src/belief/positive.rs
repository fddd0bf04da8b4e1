//! Positive definite matrices: the factor that everything else is computed from, and their repair.

use nalgebra::{SMatrix, SVector};

use crate::error::FilterError;

/// Lower Cholesky factor of a small positive definite matrix, on the stack.
///
/// Unlike a plain factorisation it says which pivot failed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cholesky<const N: usize> {
    lower: SMatrix<f64, N, N>,
    /// One over each diagonal entry: divisions are slow, and every solve needs them.
    inverse: SVector<f64, N>,
}

impl<const N: usize> Cholesky<N> {
    /// Factors `matrix`, of which only the lower triangle is read. `name` goes into the error.
    ///
    /// # Errors
    /// [`FilterError::NotPositiveDefinite`] with the first pivot that is not positive (or not a number).
    #[inline]
    pub fn new(matrix: &SMatrix<f64, N, N>, name: &'static str) -> Result<Self, FilterError> {
        let mut rest = *matrix;
        let mut lower = SMatrix::<f64, N, N>::zeros();
        let mut inverses = SVector::<f64, N>::zeros();
        for j in 0..N {
            let pivot = rest[(j, j)];
            if !(pivot > 0.0 && pivot < f64::INFINITY) {
                return Err(FilterError::NotPositiveDefinite { matrix: name, pivot: j, value: pivot });
            }
            let inverse = eliminate(&mut rest, j);
            let root = pivot.sqrt();
            lower[(j, j)] = root;
            inverses[j] = root * inverse;
            for i in j + 1..N {
                lower[(i, j)] = rest[(i, j)] * inverses[j];
            }
        }
        Ok(Cholesky { lower, inverse: inverses })
    }

    /// The factor `L` of `L Lᵀ`.
    pub fn lower(&self) -> &SMatrix<f64, N, N> {
        &self.lower
    }

    /// `L⁻¹ v`.
    #[inline]
    pub fn whiten(&self, v: &SVector<f64, N>) -> SVector<f64, N> {
        let mut out = *v;
        for i in 0..N {
            for k in 0..i {
                out[i] -= self.lower[(i, k)] * out[k];
            }
            out[i] *= self.inverse[i];
        }
        out
    }

    /// `vᵀ A⁻¹ v`, the squared Mahalanobis length of `v`.
    #[inline]
    pub fn mahalanobis(&self, v: &SVector<f64, N>) -> f64 {
        self.whiten(v).norm_squared()
    }

    /// `B A⁻¹` for a matrix `B` of `R` rows: the form in which a gain is computed.
    #[inline]
    pub fn right_solve<const R: usize>(&self, b: &SMatrix<f64, R, N>) -> SMatrix<f64, R, N> {
        let mut out = *b;
        // Solves X Lᵀ = B, then Y L = X, column by column.
        for j in 0..N {
            for k in 0..j {
                let factor = self.lower[(j, k)];
                for r in 0..R {
                    out[(r, j)] -= factor * out[(r, k)];
                }
            }
            for r in 0..R {
                out[(r, j)] *= self.inverse[j];
            }
        }
        for j in (0..N).rev() {
            for k in j + 1..N {
                let factor = self.lower[(k, j)];
                for r in 0..R {
                    out[(r, j)] -= factor * out[(r, k)];
                }
            }
            for r in 0..R {
                out[(r, j)] *= self.inverse[j];
            }
        }
        out
    }

    /// `ln |A|`.
    #[inline]
    pub fn ln_determinant(&self) -> f64 {
        let mut product = 1.0;
        for i in 0..N {
            product *= self.lower[(i, i)];
        }
        // One logarithm is enough unless the product left the range of a double.
        if product.is_normal() {
            return 2.0 * product.ln();
        }
        (0..N).map(|i| 2.0 * self.lower[(i, i)].ln()).sum()
    }

    /// `ln N(v; 0, A)`, given the squared Mahalanobis length of `v`.
    #[inline]
    pub fn ln_density(&self, mahalanobis: f64) -> f64 {
        -0.5 * (mahalanobis + self.ln_determinant() + N as f64 * std::f64::consts::TAU.ln())
    }
}

/// Largest negative eigenvalue, relative to the largest one, that rounding alone can explain.
const ROUNDING: f64 = 1e-6;

/// Smallest eigenvalue kept, relative to the largest one: a few units in the last place.
const FLOOR: f64 = 4.0 * f64::EPSILON;

/// A lower triangular `L` with `L Lᵀ = matrix` for a matrix that may be singular, such as the covariance of a noise
/// that enters in fewer directions than the state has components. Pivots that rounding explains count as zero, and
/// numbers that are not finite stay so.
#[inline]
pub(crate) fn root<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    let mut lower = SMatrix::<f64, N, N>::zeros();
    for j in 0..N {
        let mut pivot = matrix[(j, j)];
        for k in 0..j {
            pivot -= lower[(j, k)] * lower[(j, k)];
        }
        if pivot <= N as f64 * FLOOR * matrix[(j, j)] {
            continue;
        }
        let root = pivot.sqrt();
        lower[(j, j)] = root;
        for i in j + 1..N {
            let mut value = matrix[(i, j)];
            for k in 0..j {
                value -= lower[(i, k)] * lower[(j, k)];
            }
            lower[(i, j)] = value / root;
        }
    }
    lower
}

/// Makes `matrix` symmetric, and positive definite when only rounding has made it otherwise.
///
/// # Errors
/// [`FilterError::NotFinite`], or [`FilterError::NotPositiveDefinite`] when the matrix is indefinite beyond rounding.
#[inline]
pub(crate) fn settle<const N: usize>(
    matrix: &mut SMatrix<f64, N, N>,
    name: &'static str,
) -> Result<(), FilterError> {
    symmetrise(matrix);
    if is_definite(matrix) {
        return Ok(());
    }
    match Cholesky::new(matrix, name) {
        Ok(_) => Ok(()),
        Err(error) => repair(matrix, name, error),
    }
}

/// Whether the lower triangle of `matrix` is that of a matrix that is positive definite beyond rounding, by elimination
/// without roots. Then [`Cholesky::new`] succeeds.
#[inline]
pub(crate) fn is_definite<const N: usize>(matrix: &SMatrix<f64, N, N>) -> bool {
    let mut rest = *matrix;
    let mut definite = true;
    for j in 0..N {
        let pivot = rest[(j, j)];
        // A pivot of a negative diagonal entry is itself negative, so the bound must not be.
        definite &= pivot > N as f64 * FLOOR * matrix[(j, j)].abs() && pivot < f64::INFINITY;
        eliminate(&mut rest, j);
    }
    definite
}

/// Subtracts the share of row `j` from the rows below, in the lower triangle, and returns one over its pivot. A factor and
/// a verdict that both come from here agree to the last bit.
#[inline(always)]
fn eliminate<const N: usize>(rest: &mut SMatrix<f64, N, N>, j: usize) -> f64 {
    let inverse = 1.0 / rest[(j, j)];
    for i in j + 1..N {
        let share = rest[(i, j)] * inverse;
        for k in j + 1..i + 1 {
            rest[(i, k)] -= share * rest[(k, j)];
        }
    }
    inverse
}

/// Replaces both triangles by their mean.
#[inline]
pub(crate) fn symmetrise<const N: usize>(matrix: &mut SMatrix<f64, N, N>) {
    for i in 0..N {
        for j in 0..i {
            let mean = 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
            matrix[(i, j)] = mean;
            matrix[(j, i)] = mean;
        }
    }
}

/// Lifts eigenvalues that rounding has pushed to zero or below. The matrix is scaled to unit diagonal first, so
/// that a component in radians beside one in kilometres is not mistaken for rounding.
#[cold]
fn repair<const N: usize>(
    matrix: &mut SMatrix<f64, N, N>,
    name: &'static str,
    error: FilterError,
) -> Result<(), FilterError> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return Err(FilterError::NotFinite { what: name });
    }
    let largest = (0..N).map(|i| matrix[(i, i)]).fold(0.0, f64::max);
    let scale =
        SVector::<f64, N>::from_fn(|i, _| matrix[(i, i)].max(largest * f64::EPSILON * f64::EPSILON).sqrt());
    if largest <= 0.0 {
        return Err(error);
    }
    let unit = nalgebra::DMatrix::from_fn(N, N, |i, j| matrix[(i, j)] / (scale[i] * scale[j]));
    let mut eigen = unit.symmetric_eigen();
    let top = eigen.eigenvalues.max();
    let (pivot, bottom) = eigen.eigenvalues.argmin();
    if bottom < -ROUNDING * top {
        return Err(FilterError::NotPositiveDefinite { matrix: name, pivot, value: bottom });
    }
    let mut floor = FLOOR * top;
    // Recomposition rounds too, so the floor grows until the factor exists; a few doublings are enough.
    for _ in 0..8 {
        eigen.eigenvalues.apply(|value| *value = value.max(floor));
        let whole = eigen.recompose();
        let lifted = SMatrix::<f64, N, N>::from_fn(|i, j| {
            0.5 * (whole[(i, j)] + whole[(j, i)]) * (scale[i] * scale[j])
        });
        if Cholesky::new(&lifted, name).is_ok() {
            *matrix = lifted;
            return Ok(());
        }
        floor *= 8.0;
    }
    Err(error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn the_error_names_the_failing_pivot() {
        let indefinite = matrix![4.0, 0.0, 0.0; 0.0, 1.0, 2.0; 0.0, 2.0, 1.0];
        let error = Cholesky::new(&indefinite, "test matrix").unwrap_err();
        assert_eq!(error, FilterError::NotPositiveDefinite { matrix: "test matrix", pivot: 2, value: -3.0 });
    }

    #[test]
    fn solves_agree_with_the_inverse() {
        let a = matrix![4.0, 1.0, 0.5; 1.0, 3.0, 0.2; 0.5, 0.2, 2.0];
        let b = matrix![1.0, 2.0, 3.0; -1.0, 0.5, 0.25];
        let factor = Cholesky::new(&a, "a").unwrap();
        let inverse = a.try_inverse().unwrap();
        assert!((factor.right_solve(&b) - b * inverse).norm() < 1e-14);
        let v = vector![1.0, -2.0, 0.5];
        assert!((factor.mahalanobis(&v) - (v.transpose() * inverse * v)[0]).abs() < 1e-14);
        assert!((factor.ln_determinant() - a.determinant().ln()).abs() < 1e-14);
    }

    #[test]
    fn a_singular_matrix_has_a_root() {
        let (p, v) = (0.5, 1.0);
        let rank_one = matrix![p * p, p * v, 0.0; p * v, v * v, 0.0; 0.0, 0.0, 0.0];
        let lower = root(&rank_one);
        assert!((lower * lower.transpose() - rank_one).norm() < 1e-15);
        assert_eq!(lower.column(1).norm() + lower.column(2).norm(), 0.0);
        assert!(root(&matrix![f64::NAN, 0.0; 0.0, 1.0])[(0, 0)].is_nan());
    }

    #[test]
    #[allow(clippy::excessive_precision)]
    fn a_matrix_at_the_edge_of_rounding_gets_one_verdict() {
        // The covariance of means that lie 1e14 apart: the order of operations decides whether it has a factor.
        let mut edge = matrix![
            15434362484293055e6, -10392508982060797e6, 30868759118044496e9, -20784968263855770e9;
            -10392508982060797e6, 6997648466999197e6, -20785040957437733e9, 13995263468480726e9;
            30868759118044496e9, -20785040957437733e9, 61737586535447210e12, -41569982513725070e12;
            -20784968263855770e9, 13995263468480726e9, -41569982513725070e12, 27990460009930357e12
        ];
        settle(&mut edge, "covariance").unwrap();
        assert!(Cholesky::new(&edge, "covariance").is_ok());
    }

    #[test]
    fn rounding_is_repaired_and_indefiniteness_is_not() {
        let mut rounded = matrix![1.0, 1.0 + 1e-15; 1.0 + 1e-15, 1.0];
        settle(&mut rounded, "covariance").unwrap();
        assert!(Cholesky::new(&rounded, "covariance").is_ok());
        let mut indefinite = matrix![1.0, 2.0; 2.0, 1.0];
        assert!(settle(&mut indefinite, "covariance").is_err());
        let mut broken = matrix![f64::NAN, 0.0; 0.0, 1.0];
        assert_eq!(settle(&mut broken, "covariance"), Err(FilterError::NotFinite { what: "covariance" }));
    }
}
