//! A sensor of range and bearing.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, matrix, vector};

use super::{Measurement, Sensor, placed};
use crate::association::Region;
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
/// a radar or sonar gives polar plots and the filter is extended, unscented or a particle filter. Where `r σθ² / σr` is below
/// about one, [`ConvertedPolar`](super::ConvertedPolar) lets a Kalman filter do the same work.
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
        measurement.check_finite()?;
        let noise = Sensor::<N, 2>::read(self, measurement, None)?.noise;
        let (range, bearing) = (measurement.value[0], measurement.value[1]);
        let place = self.position + cartesian(range, bearing);
        Ok(placed(prior, &place, &rotated(range, bearing, &noise)).moved_on(2, measurement.age))
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        Some(self.position + cartesian(measurement.value[0], measurement.value[1]))
    }

    fn region(&self, expected: &Vector2<f64>, half: &Vector2<f64>) -> Option<Region> {
        let Region { centre, low, high } = sector(expected, half);
        Some(Region { centre: self.position + centre, low: self.position + low, high: self.position + high })
    }

    fn site(&self) -> Option<Vector2<f64>> {
        Some(self.position)
    }

    /// That at the measured range, or where this is less than its error at a range of its deviation.
    fn area(&self, measurement: &Measurement<2>) -> f64 {
        let own = measurement.noise.map_or(self.range, |noise| noise[(0, 0)].max(0.0).sqrt());
        measurement.value[0].abs().max(own)
    }
}

/// The region that holds all points whose range and bearing differ from `centre` by at most `half`: the box around a sector of
/// a ring, whatever its direction.
fn sector(centre: &Vector2<f64>, half: &Vector2<f64>) -> Region {
    let (near, far) = (centre[0] - half[0], centre[0] + half[0]);
    let (first, last) = (centre[1] - half[1], centre[1] + half[1]);
    let place = cartesian(centre[0], centre[1]);
    // A range below zero lies opposite.
    if near < 0.0 || half[1] >= PI {
        let reach = Vector2::repeat(far.max(-near));
        return Region { centre: place, low: -reach, high: reach };
    }
    let corners = [(near, first), (near, last), (far, first), (far, last)];
    // Between the corners the outer arc is farthest out where it crosses an axis.
    let crossings = (0..4).map(|i| f64::from(i) * FRAC_PI_2).filter(|axis| {
        let ahead = (axis - first).rem_euclid(TAU);
        ahead <= last - first
    });
    let points = corners.into_iter().chain(crossings.map(|axis| (far, axis)));
    points.map(|(range, bearing)| cartesian(range, bearing)).fold(
        Region { centre: place, low: place, high: place },
        |region, point| Region { low: region.low.inf(&point), high: region.high.sup(&point), ..region },
    )
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
