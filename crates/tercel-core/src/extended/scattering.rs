//! How the points of an object spread around its centre.

use nalgebra::{Matrix2, Vector2};

use super::symmetric::lifted;
use crate::error::FilterError;

/// The spread of points over an extent, and the noise of the sensor on top.
///
/// ## Definition
/// A point is `z = p + y + e` with `y` spread over the ellipse of the extent matrix `X` and `e` of covariance
/// `R`:
/// ```text
/// Cov(z - p) = s X + R
/// ```
/// `s` is 1/4 for points spread evenly over the ellipse, and 1/2 for points on its rim.
///
/// ```
/// use nalgebra::{Matrix2, matrix};
/// use tercel_core::extended::Scattering;
///
/// let lidar = Scattering::uniform(Matrix2::identity() * 0.01)?;
/// let spread = lidar.spread(&matrix![4.0, 0.0; 0.0, 1.0]);
/// assert_eq!(spread, matrix![1.01, 0.0; 0.0, 0.26]);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scattering {
    scale: f64,
    noise: Matrix2<f64>,
}

/// Share of the squared larger axis below which an extent that was read off a spread is lifted.
const THINNEST: f64 = 1e-4;

impl Scattering {
    /// A spread of `scale` times the extent matrix, and sensor noise (m²), which may be zero.
    ///
    /// # Errors
    /// When the scale is not positive, or the noise is not finite or has a negative eigenvalue.
    pub fn new(scale: f64, noise: Matrix2<f64>) -> Result<Self, FilterError> {
        FilterError::positive("scale of a spread", scale)?;
        if !noise.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "noise of points" });
        }
        let value = super::symmetric::eigen(&noise).0.y;
        // An eigenvalue of zero may come out a little below it.
        if value < -1e-12 * noise.trace() {
            return Err(FilterError::NotPositiveDefinite { matrix: "noise of points", pivot: 1, value });
        }
        Ok(Scattering { scale, noise: super::symmetric::symmetric(&noise) })
    }

    /// Points spread evenly over the ellipse, with this sensor noise (m²).
    ///
    /// # Errors
    /// As [`new`](Scattering::new).
    pub fn uniform(noise: Matrix2<f64>) -> Result<Self, FilterError> {
        Scattering::new(0.25, noise)
    }

    /// An extent matrix that is itself the covariance of the points: no scale, no noise.
    pub fn direct() -> Self {
        Scattering { scale: 1.0, noise: Matrix2::zeros() }
    }

    /// Share of the extent matrix in the covariance of the points.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Covariance of the sensor noise, m².
    pub fn noise(&self) -> Matrix2<f64> {
        self.noise
    }

    /// Covariance of the points of this extent around its centre, m².
    #[inline]
    pub fn spread(&self, extent: &Matrix2<f64>) -> Matrix2<f64> {
        extent * self.scale + self.noise
    }

    /// The extent matrix (m²) whose points have this covariance. What is thinner than the sensor resolves is
    /// taken to be as thick as its noise: semi-axes are not below the least deviation of the noise, or 1 % of
    /// the spread.
    pub fn extent(&self, spread: &Matrix2<f64>) -> Matrix2<f64> {
        let extent = (spread - self.noise) / self.scale;
        let resolved = super::symmetric::eigen(&self.noise).0.y;
        let least = resolved.max(THINNEST * spread.trace() / self.scale).max(f64::MIN_POSITIVE);
        lifted(&extent, least)
    }

    /// Covariance of the points of an ellipse with these squared semi-axes (m²) at an angle.
    #[inline]
    pub(crate) fn spread_at(&self, squares: &Vector2<f64>, angle: f64) -> Matrix2<f64> {
        self.spread(&super::symmetric::composed(squares, angle))
    }
}
