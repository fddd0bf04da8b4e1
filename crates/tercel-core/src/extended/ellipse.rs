//! The ellipse that stands for the extent of an object.

use nalgebra::{Matrix2, Vector2};

use super::symmetric::{composed, eigen};
use crate::error::FilterError;

/// An ellipse in the plane, given by its centre, its semi-axes and the direction of the first.
///
/// ## Definition
/// ```text
/// { z : (z - c)ᵀ X⁻¹ (z - c) ≤ 1 },      X = R(θ) diag(a², b²) R(θ)ᵀ
/// ```
/// `X` is the *extent matrix*: its eigenvalues are the squares of the semi-axes (half the length, half the
/// width).
///
/// ```
/// use nalgebra::vector;
/// use tercel_core::extended::Ellipse;
///
/// let ship = Ellipse::new(vector![100.0, 50.0], vector![60.0, 9.0], 0.3)?; // 120 m by 18 m
/// let again = Ellipse::from_matrix(ship.center, &ship.matrix())?;
/// assert!((again.axes - ship.axes).norm() < 1e-9 && (again.angle - 0.3).abs() < 1e-12);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Centre, m.
    pub center: Vector2<f64>,
    /// Semi-axes, m: along the direction of `angle`, and across it.
    pub axes: Vector2<f64>,
    /// Direction of the first semi-axis, rad.
    pub angle: f64,
}

impl Ellipse {
    /// An ellipse with these semi-axes (m) and this direction of the first (rad).
    ///
    /// # Errors
    /// When a number is not finite or an axis is negative. An axis of zero is a line.
    pub fn new(center: Vector2<f64>, axes: Vector2<f64>, angle: f64) -> Result<Self, FilterError> {
        if !(center.iter().all(|x| x.is_finite()) && angle.is_finite()) {
            return Err(FilterError::NotFinite { what: "centre or angle of an ellipse" });
        }
        for value in axes.iter().copied() {
            if !(value >= 0.0 && value.is_finite()) {
                let (parameter, expected) = ("semi-axis", "must be finite and not negative");
                return Err(FilterError::Parameter { parameter, value, expected });
            }
        }
        Ok(Ellipse { center, axes, angle })
    }

    /// The ellipse of an extent matrix (m²), the longer axis first.
    ///
    /// # Errors
    /// When a number is not finite or the matrix has a negative eigenvalue.
    pub fn from_matrix(center: Vector2<f64>, matrix: &Matrix2<f64>) -> Result<Self, FilterError> {
        if !(matrix.iter().chain(center.iter()).all(|x| x.is_finite())) {
            return Err(FilterError::NotFinite { what: "extent matrix" });
        }
        let (values, angle) = eigen(matrix);
        if values.y < 0.0 {
            let matrix = "extent matrix";
            return Err(FilterError::NotPositiveDefinite { matrix, pivot: 1, value: values.y });
        }
        Ellipse::new(center, values.map(f64::sqrt), angle)
    }

    /// The extent matrix, m².
    pub fn matrix(&self) -> Matrix2<f64> {
        composed(&self.axes.component_mul(&self.axes), self.angle)
    }

    /// Its area, m².
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.axes.x * self.axes.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn what_is_no_ellipse_is_refused() {
        let center = vector![0.0, 0.0];
        assert!(Ellipse::new(center, vector![1.0, -1.0], 0.0).is_err());
        assert!(Ellipse::new(center, vector![1.0, f64::NAN], 0.0).is_err());
        assert!(Ellipse::new(vector![f64::INFINITY, 0.0], vector![1.0, 1.0], 0.0).is_err());
        assert!(Ellipse::from_matrix(center, &matrix![1.0, 2.0; 2.0, 1.0]).is_err());
        assert!(Ellipse::from_matrix(center, &matrix![f64::NAN, 0.0; 0.0, 1.0]).is_err());
    }

    #[test]
    fn swapped_axes_are_the_same_ellipse_a_quarter_turn_away() {
        let long = Ellipse::new(vector![1.0, 2.0], vector![6.0, 1.25], 0.2).unwrap();
        let wide = Ellipse { axes: vector![1.25, 6.0], angle: 0.2 + std::f64::consts::FRAC_PI_2, ..long };
        assert!((long.matrix() - wide.matrix()).norm() < 1e-13);
        assert_eq!(long.area(), wide.area());
    }
}
