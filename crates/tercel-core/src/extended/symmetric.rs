//! Symmetric 2 × 2 matrices: roots, eigenvalues and inverses in closed form.

use nalgebra::{Matrix2, Vector2};

/// Eigenvalues of a symmetric 2 × 2 matrix, the larger first, and the angle of the larger one's direction, in
/// `(-π/2, π/2]`.
///
/// A multiple of the identity has no direction; the angle is then 0.
///
/// ```
/// use nalgebra::{matrix, vector};
/// use tercel_core::extended::eigen;
///
/// let (values, angle) = eigen(&matrix![1.0, 0.0; 0.0, 4.0]);
/// assert_eq!(values, vector![4.0, 1.0]);
/// assert!((angle - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// ```
#[inline]
pub fn eigen(matrix: &Matrix2<f64>) -> (Vector2<f64>, f64) {
    let (a, b, d) = (matrix.m11, 0.5 * (matrix.m12 + matrix.m21), matrix.m22);
    let radius = (0.5 * (a - d)).hypot(b);
    let larger = 0.5 * (a + d) + radius;
    // The smaller one from the determinant: a difference would lose the digits of a thin shape.
    let smaller = if larger > 0.0 { (a * d - b * b) / larger } else { 0.5 * (a + d) - radius };
    (Vector2::new(larger, smaller), 0.5 * (2.0 * b).atan2(a - d))
}

/// The symmetric root `A` of a positive semidefinite matrix, `A A = M`.
///
/// ## Definition
/// ```text
/// A = (M + √|M| I) / √(tr M + 2 √|M|)
/// ```
///
/// ## Use it when
/// a whitening is needed that does not turn the axes. It has no branches and is smooth, so it can be
/// differentiated.
///
/// ## Reference
/// Levinger (1980), "The square root of a 2 × 2 matrix".
///
/// ```
/// use nalgebra::matrix;
/// use tercel_core::extended::root;
///
/// let matrix = matrix![5.0, 2.0; 2.0, 3.0];
/// assert!((root(&matrix) * root(&matrix) - matrix).norm() < 1e-14);
/// ```
#[inline]
pub fn root(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    let determinant = matrix.determinant().max(0.0).sqrt();
    let length = (matrix.trace() + 2.0 * determinant).max(0.0).sqrt();
    if length == 0.0 {
        return Matrix2::zeros();
    }
    (matrix + Matrix2::from_diagonal_element(determinant)) / length
}

/// The inverse of the symmetric root of a positive definite matrix: `A M A = I`.
///
/// ```
/// use nalgebra::{Matrix2, matrix};
/// use tercel_core::extended::inverse_root;
///
/// let matrix = matrix![5.0, 2.0; 2.0, 3.0];
/// let white = inverse_root(&matrix) * matrix * inverse_root(&matrix);
/// assert!((white - Matrix2::identity()).norm() < 1e-14);
/// ```
#[inline]
pub fn inverse_root(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    inverse(&root(matrix))
}

/// The inverse, without a test: a singular matrix gives numbers that are not finite.
#[inline]
pub(crate) fn inverse(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    Matrix2::new(matrix.m22, -matrix.m12, -matrix.m21, matrix.m11) / matrix.determinant()
}

/// `A M Aᵀ`, exactly symmetric for a symmetric `M`.
#[inline]
pub(crate) fn congruent(a: &Matrix2<f64>, matrix: &Matrix2<f64>) -> Matrix2<f64> {
    symmetric(&(a * matrix * a.transpose()))
}

/// The mean of a matrix and its transpose.
#[inline]
pub(crate) fn symmetric(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    let b = 0.5 * (matrix.m12 + matrix.m21);
    Matrix2::new(matrix.m11, b, b, matrix.m22)
}

/// The matrix that turns by `angle`, counter-clockwise.
#[inline]
pub(crate) fn rotation(angle: f64) -> Matrix2<f64> {
    let (sine, cosine) = angle.sin_cos();
    Matrix2::new(cosine, -sine, sine, cosine)
}

/// The matrix with these eigenvalues, the direction of the first at `angle`.
#[inline]
pub(crate) fn composed(values: &Vector2<f64>, angle: f64) -> Matrix2<f64> {
    let (sine, cosine) = angle.sin_cos();
    let b = (values.x - values.y) * sine * cosine;
    Matrix2::new(
        values.x * cosine * cosine + values.y * sine * sine,
        b,
        b,
        values.x * sine * sine + values.y * cosine * cosine,
    )
}

/// The matrix with eigenvalues below `least` lifted to it.
#[inline]
pub(crate) fn lifted(matrix: &Matrix2<f64>, least: f64) -> Matrix2<f64> {
    let (values, angle) = eigen(matrix);
    if values.y >= least {
        return symmetric(matrix);
    }
    composed(&Vector2::new(values.x.max(least), least), angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_and_eigenvalues_of_thin_matrices_keep_their_digits() {
        for (large, small, angle) in
            [(4.0, 1.0, 0.3), (1e6, 1e-4, -1.2), (1.0, 1.0, 0.0), (1e-12, 1e-12, 0.0)]
        {
            let matrix = composed(&Vector2::new(large, small), angle);
            let (values, direction) = eigen(&matrix);
            assert!(
                (values.x / large - 1.0).abs() < 1e-12 && (values.y / small - 1.0).abs() < 1e-5,
                "{values}"
            );
            assert!((direction - angle).abs() < 1e-9);
            let root = root(&matrix);
            assert!((root * root - matrix).norm() < 1e-12 * large);
        }
        assert_eq!(root(&Matrix2::zeros()), Matrix2::zeros());
    }

    #[test]
    fn lifting_changes_only_what_is_too_small() {
        let thin = composed(&Vector2::new(9.0, -0.5), 0.4);
        let (values, angle) = eigen(&lifted(&thin, 0.25));
        assert!((values - Vector2::new(9.0, 0.25)).norm() < 1e-12 && (angle - 0.4).abs() < 1e-12);
        let sound = composed(&Vector2::new(9.0, 0.5), 0.4);
        assert_eq!(lifted(&sound, 0.25), sound);
    }
}
