//! Gaussian Wasserstein distance of two ellipses.

use nalgebra::{Matrix2, Vector2};

/// The parts of a squared Gaussian Wasserstein distance, m².
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wasserstein {
    /// Squared distance of the centres.
    pub position: f64,
    /// Squared distance of the shapes.
    pub shape: f64,
}

impl Wasserstein {
    /// The squared distance.
    pub fn total(&self) -> f64 {
        self.position + self.shape
    }
}

/// The squared Gaussian Wasserstein distance of two ellipses, given by their centres (m) and extent matrices
/// (m²).
///
/// ## Definition
/// ```text
/// |p - p̄|² + tr X + tr X̄ - 2 tr (X^½ X̄ X^½)^½
/// tr (X^½ X̄ X^½)^½ = √( tr(X X̄) + 2 √(|X| |X̄|) )          in two dimensions
/// ```
/// The matrices have the squares of the semi-axes as eigenvalues, so the shapes of two parallel ellipses are
/// as far apart as their semi-axes: `(a - ā)² + (b - b̄)²`. No root is taken, as in the tables that compare
/// extended-object trackers.
///
/// ## Use it when
/// extents are compared and should also count when they do not overlap.
///
/// ## Reference
/// Yang, Baum and Granström (2016), "Metrics for performance evaluation of elliptic extended object tracking
/// methods", eq. 12.
///
/// ```
/// use nalgebra::{matrix, vector};
/// use tercel_core::metric::wasserstein;
///
/// let distance = wasserstein(&vector![0.0, 0.0], &matrix![36.0, 0.0; 0.0, 1.0], &vector![3.0, 4.0], &matrix![25.0, 0.0; 0.0, 9.0]);
/// assert_eq!((distance.position, distance.shape), (25.0, 5.0));
/// ```
pub fn wasserstein(
    first: &Vector2<f64>,
    first_extent: &Matrix2<f64>,
    second: &Vector2<f64>,
    second_extent: &Matrix2<f64>,
) -> Wasserstein {
    let determinants = (first_extent.determinant() * second_extent.determinant()).max(0.0).sqrt();
    let cross = ((first_extent * second_extent).trace() + 2.0 * determinants).max(0.0).sqrt();
    let shape = first_extent.trace() + second_extent.trace() - 2.0 * cross;
    Wasserstein { position: (first - second).norm_squared(), shape: shape.max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extended::{Ellipse, root};
    use nalgebra::vector;

    #[test]
    fn the_closed_form_is_that_of_the_roots() {
        for turn in 0..20 {
            let turn = f64::from(turn);
            let first = Ellipse::new(vector![0.0, 0.0], vector![6.0, 1.25], 0.2 * turn).unwrap().matrix();
            let second = Ellipse::new(vector![1.0, 2.0], vector![3.0 + turn, 0.5], 1.1).unwrap().matrix();
            let half = root(&first);
            let cross = root(&(half * second * half)).trace();
            let expected = first.trace() + second.trace() - 2.0 * cross;
            let found = wasserstein(&vector![0.0, 0.0], &first, &vector![1.0, 2.0], &second);
            assert!((found.shape - expected).abs() < 1e-9 && (found.position - 5.0).abs() < 1e-12);
            assert!(wasserstein(&vector![0.0, 0.0], &first, &vector![0.0, 0.0], &first).total() < 1e-9);
        }
    }
}
