//! The points that a sensor sees of one extended object in one scan.

use nalgebra::{Matrix2, Vector2};

use crate::error::FilterError;

/// A set of points, possibly empty, with its count, mean and scatter.
///
/// ## Definition
/// ```text
/// n,    z̄ = 1/n Σ z_j,    Z = Σ (z_j - z̄)(z_j - z̄)ᵀ
/// ```
/// The moments are taken once: they are all that random-matrix filters need of a scan, however many points it
/// has. Without points, mean and scatter are zero.
///
/// ```
/// use nalgebra::vector;
/// use tercel_core::extended::Points;
///
/// let points = Points::from(vec![vector![1.0, 0.0], vector![3.0, 0.0]]);
/// assert_eq!((points.count(), points.mean()), (2, vector![2.0, 0.0]));
/// assert_eq!(points.scatter()[(0, 0)], 2.0);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Points {
    points: Vec<Vector2<f64>>,
    mean: Vector2<f64>,
    scatter: Matrix2<f64>,
}

impl Points {
    /// The points, m.
    pub fn points(&self) -> &[Vector2<f64>] {
        &self.points
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Their mean, m; zero without points.
    pub fn mean(&self) -> Vector2<f64> {
        self.mean
    }

    /// Sum of the squared deviations from the mean, m²; zero for fewer than two points.
    pub fn scatter(&self) -> Matrix2<f64> {
        self.scatter
    }

    /// # Errors
    /// When a point, or the square of its distance from the others, is not finite.
    pub(crate) fn check(&self) -> Result<(), FilterError> {
        // A coordinate that is not finite makes the moments so.
        if self.mean.iter().chain(self.scatter.iter()).all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(FilterError::NotFinite { what: "a point of the measurement" })
    }

    /// # Errors
    /// When there is no point, or one is not finite: then nothing says where an object is.
    pub(crate) fn check_birth(&self) -> Result<(), FilterError> {
        self.check()?;
        if self.is_empty() {
            let reason = "the scan has no points; start the object at the first one that has";
            return Err(FilterError::NotInvertible { sensor: "empty", reason });
        }
        Ok(())
    }
}

impl From<Vec<Vector2<f64>>> for Points {
    fn from(points: Vec<Vector2<f64>>) -> Self {
        let Some(&first) = points.first() else { return Points::default() };
        let count = points.len() as f64;
        // Relative to the first point: a mean far from the origin keeps its digits.
        let mean = first + points.iter().map(|point| point - first).sum::<Vector2<f64>>() / count;
        let mut scatter = Matrix2::zeros();
        for point in &points {
            let offset = point - mean;
            scatter += offset * offset.transpose();
        }
        Points { points, mean, scatter }
    }
}

impl FromIterator<Vector2<f64>> for Points {
    fn from_iter<I: IntoIterator<Item = Vector2<f64>>>(points: I) -> Self {
        points.into_iter().collect::<Vec<_>>().into()
    }
}

impl FromIterator<[f64; 2]> for Points {
    fn from_iter<I: IntoIterator<Item = [f64; 2]>>(points: I) -> Self {
        points.into_iter().map(Vector2::from).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn coincident_points_have_no_scatter_however_far_away_they_are() {
        let points = Points::from(vec![vector![1e9 + 0.1, -3e8]; 1000]);
        assert_eq!(points.scatter(), Matrix2::zeros());
        assert_eq!(points.mean(), vector![1e9 + 0.1, -3e8]);
    }

    #[test]
    fn a_point_that_is_not_finite_is_found_wherever_it_stands() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for place in 0..3 {
                let mut points = vec![vector![1.0, 2.0]; 3];
                points[place].y = bad;
                assert!(Points::from(points).check().is_err(), "{bad} at {place}");
            }
            assert!(Points::from(vec![vector![bad, 0.0]]).check().is_err());
        }
        assert!(Points::default().check().is_ok() && Points::default().check_birth().is_err());
    }
}
