//! A sensor of range and bearing.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, matrix, vector};

use super::{Measurement, Sensor, finite, placed};
use crate::belief::Gaussian;
use crate::error::FilterError;

/// Measures range and bearing from where it stands. The bearing is periodic.
///
/// ## Model
/// ```text
/// z = (|p - s|, atan2(py - sy, px - sx)) + noise,        noise ~ N(0, diag(σr², σθ²))
/// ```
///
/// ## Use it when
/// a radar or sonar gives polar plots and the filter is extended, unscented or a particle filter. When the cross-range
/// error is small against the range, [`ConvertedPolar`](super::ConvertedPolar) lets a Kalman filter do the same work.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 10.4.
///
/// ```
/// use tercel_core::sensor::{RangeBearing, Sensor};
/// use nalgebra::vector;
///
/// let radar = RangeBearing::new(50.0, 0.01)?.at(vector![1000.0, 0.0]);
/// assert_eq!(radar.expected(&vector![1000.0, 500.0]), vector![500.0, std::f64::consts::FRAC_PI_2]);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeBearing {
    range: f64,
    bearing: f64,
    position: Vector2<f64>,
}

impl RangeBearing {
    /// Standard deviations of range (m) and bearing (rad), for a sensor at the origin.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn new(range: f64, bearing: f64) -> Result<Self, FilterError> {
        Ok(RangeBearing {
            range: FilterError::positive("range deviation", range)?,
            bearing: FilterError::positive("bearing deviation", bearing)?,
            position: Vector2::zeros(),
        })
    }

    /// Moves the sensor to `position`, m.
    pub fn at(self, position: Vector2<f64>) -> Self {
        RangeBearing { position, ..self }
    }

    /// Where the sensor stands, m.
    pub fn position(&self) -> Vector2<f64> {
        self.position
    }
}

impl<const N: usize> Sensor<N, 2> for RangeBearing {
    #[inline]
    fn expected(&self, state: &SVector<f64, N>) -> Vector2<f64> {
        let offset = offset(state, &self.position);
        vector![offset.norm(), offset.y.atan2(offset.x)]
    }

    #[inline]
    fn jacobian(&self, state: &SVector<f64, N>) -> SMatrix<f64, 2, N> {
        let offset = offset(state, &self.position);
        let (along, turn) = polar_derivatives(&offset);
        let mut jacobian = SMatrix::zeros();
        for i in 0..2 {
            jacobian[(0, i)] = along[i];
            jacobian[(1, i)] = turn[i];
        }
        jacobian
    }

    #[inline]
    fn noise(&self, _: &Vector2<f64>) -> Matrix2<f64> {
        Matrix2::from_diagonal(&vector![self.range * self.range, self.bearing * self.bearing])
    }

    fn periodic(&self) -> [bool; 2] {
        [false, true]
    }

    fn birth(&self, measurement: &Measurement<2>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        finite(measurement)?;
        let noise = Sensor::<N, 2>::read(self, measurement).noise;
        let (range, bearing) = (measurement.value[0], measurement.value[1]);
        let place = self.position + cartesian(range, bearing);
        Ok(placed(prior, &place, &rotated(range, bearing, &noise)).moved_on(2, measurement.age))
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        Some(self.position + cartesian(measurement.value[0], measurement.value[1]))
    }

    fn footprint(&self, state: &SVector<f64, N>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let expected: Vector2<f64> = Sensor::<N, 2>::expected(self, state);
        let noise = Sensor::<N, 2>::noise(self, &expected);
        Some((vector![state[0], state[1]], rotated(expected[0], expected[1], &noise)))
    }

    fn area(&self, measurement: &Measurement<2>) -> f64 {
        measurement.value[0].abs()
    }
}

/// From the sensor to the object, in the plane.
#[inline]
pub(super) fn offset<const N: usize>(state: &SVector<f64, N>, sensor: &Vector2<f64>) -> Vector2<f64> {
    const { assert!(N >= 2, "a bearing needs a position in the plane") };
    vector![state[0] - sensor.x, state[1] - sensor.y]
}

/// Derivatives of range and of bearing with respect to the position. An object on top of the sensor has none; a range
/// of a micrometre stands in, so that the filter sees a bearing that says nothing instead of a division by zero.
#[inline]
pub(super) fn polar_derivatives(offset: &Vector2<f64>) -> (Vector2<f64>, Vector2<f64>) {
    let range = offset.norm().max(1e-6);
    let along = offset / range;
    (along, vector![-along.y, along.x] / range)
}

#[inline]
pub(super) fn cartesian(range: f64, bearing: f64) -> Vector2<f64> {
    let (sine, cosine) = bearing.sin_cos();
    vector![range * cosine, range * sine]
}

/// The covariance in the plane of a polar measurement with covariance `noise`, to first order.
#[inline]
pub(super) fn rotated(range: f64, bearing: f64, noise: &Matrix2<f64>) -> Matrix2<f64> {
    let (sine, cosine) = bearing.sin_cos();
    let turn = matrix![cosine, -range * sine; sine, range * cosine];
    turn * noise * turn.transpose()
}
