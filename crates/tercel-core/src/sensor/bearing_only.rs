//! A sensor of bearings.

use nalgebra::{Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2, vector};

use super::range_bearing::{cartesian, offset, polar_derivatives, rotated};
use super::{Measurement, Sensor, placed};
use crate::association::Region;
use crate::belief::Gaussian;
use crate::error::FilterError;

/// Measures the bearing to an object from where it stands. The bearing is periodic.
///
/// ## Model
/// ```text
/// z = atan2(py - sy, px - sx) + noise,        noise ~ N(0, σθ²)
/// ```
///
/// ## Use it when
/// the sensor is passive: cameras, direction finders, towed arrays. One bearing does not say where an object is, so
/// objects start either from another sensor or, with [`with_range`](BearingOnly::with_range), from a guess of the range.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 3.7.2.
///
/// ```
/// use tercel_core::sensor::{BearingOnly, Sensor};
/// use nalgebra::vector;
///
/// let camera = BearingOnly::new(0.005)?.at(vector![10.0, 10.0]);
/// assert_eq!(camera.expected(&vector![10.0, 60.0])[0], std::f64::consts::FRAC_PI_2);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BearingOnly {
    bearing: f64,
    position: Vector2<f64>,
    range: Option<(f64, f64)>,
}

impl BearingOnly {
    /// Standard deviation of the bearing (rad), for a sensor at the origin.
    ///
    /// # Errors
    /// When it is not positive and finite.
    pub fn new(bearing: f64) -> Result<Self, FilterError> {
        let bearing = FilterError::positive("bearing deviation", bearing)?;
        Ok(BearingOnly { bearing, position: Vector2::zeros(), range: None })
    }

    /// Moves the sensor to `position`, m.
    pub fn at(self, position: Vector2<f64>) -> Self {
        BearingOnly { position, ..self }
    }

    /// Lets objects start from one bearing, at a range of this mean and standard deviation, m.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn with_range(self, mean: f64, deviation: f64) -> Result<Self, FilterError> {
        let mean = FilterError::positive("range", mean)?;
        let deviation = FilterError::positive("range deviation", deviation)?;
        Ok(BearingOnly { range: Some((mean, deviation)), ..self })
    }
}

impl<const N: usize> Sensor<N, 1> for BearingOnly {
    fn expected(&self, state: &SVector<f64, N>) -> Vector1<f64> {
        let offset = offset(state, &self.position);
        vector![offset.y.atan2(offset.x)]
    }

    fn jacobian(&self, state: &SVector<f64, N>) -> SMatrix<f64, 1, N> {
        let (_, turn) = polar_derivatives(&offset(state, &self.position));
        SMatrix::from_fn(|_, j| if j < 2 { turn[j] } else { 0.0 })
    }

    fn noise(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(self.bearing * self.bearing)
    }

    fn periodic(&self) -> [bool; 1] {
        [true]
    }

    fn birth(&self, measurement: &Measurement<1>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        measurement.check_finite()?;
        let (range, deviation) = self.range.ok_or(FilterError::NotInvertible {
            sensor: "bearing",
            reason: "there is no range; give one with its deviation, or start objects from another sensor",
        })?;
        let noise = Sensor::<N, 1>::read(self, measurement, None)?.noise[(0, 0)];
        let bearing = measurement.value[0];
        let polar = Matrix2::from_diagonal(&vector![deviation * deviation, noise]);
        let place = self.position + cartesian(range, bearing);
        Ok(placed(prior, &place, &rotated(range, bearing, &polar)).moved_on(2, measurement.age))
    }

    fn place(&self, _: &Measurement<1>) -> Option<Vector2<f64>> {
        None
    }

    fn site(&self) -> Option<Vector2<f64>> {
        Some(self.position)
    }

    fn region(&self, _: &Vector1<f64>, _: &Vector1<f64>) -> Option<Region> {
        None
    }
}
