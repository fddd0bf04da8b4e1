//! What a sensor would measure of an object, how accurately, and where a measurement puts an object.
//!
//! | sensor | measures |
//! |---|---|
//! | [`Position`] | Cartesian position, in the plane or in space |
//! | [`ConvertedPolar`] | range and bearing, turned into a position with a rotated, debiased covariance |
//! | [`RangeBearing`] | range and bearing |
//! | [`RangeBearingRate`] | range, bearing and range rate |
//! | [`BearingOnly`] | bearing |
//!
//! Bearings are mathematical: zero along `x`, counter-clockwise. Every sensor stands somewhere and may be moved between
//! scans: sensors are small values, so a moved one is simply a new one. Polar sensors see the plane: slant ranges of objects at a
//! height are turned into [ranges over ground](ground_range) before.

mod aged;
mod bearing_only;
mod converted_polar;
mod measurement;
mod position;
mod range_bearing;
mod range_bearing_rate;
mod slant;

use std::f64::consts::{PI, TAU};

use nalgebra::{SMatrix, SVector, Vector2};

use crate::association::Region;
use crate::belief::Gaussian;
use crate::error::FilterError;

pub use aged::Aged;
pub use bearing_only::BearingOnly;
pub use converted_polar::ConvertedPolar;
pub use measurement::{Measurement, Reading};
pub use position::Position;
pub use range_bearing::RangeBearing;
pub use range_bearing_rate::RangeBearingRate;
pub use slant::ground_range;

/// A sensor that measures `M` components of a state of `N` components.
///
/// The state begins with positions, as [`Gaussian`] says. `expected` and `jacobian` are those of a measurement
/// that was taken at the time of the state; [`Aged`] makes those of an older one of them.
pub trait Sensor<const N: usize, const M: usize> {
    /// What the sensor would read of an object in this state, without noise.
    fn expected(&self, state: &SVector<f64, N>) -> SVector<f64, M>;

    /// Derivative of [`expected`](Sensor::expected) with respect to the state.
    fn jacobian(&self, state: &SVector<f64, N>) -> SMatrix<f64, M, N>;

    /// `A Hᵀ` for a matrix `A` and the [`jacobian`](Sensor::jacobian) `H`.
    ///
    /// Sensors whose Jacobian is mostly zeros override this to save the dense product.
    #[inline]
    fn project(&self, matrix: &SMatrix<f64, N, N>, jacobian: &SMatrix<f64, M, N>) -> SMatrix<f64, N, M> {
        matrix * jacobian.transpose()
    }

    /// Covariance of the reading's error for an object whose expected reading is `expected`.
    fn noise(&self, expected: &SVector<f64, M>) -> SMatrix<f64, M, M>;

    /// A measurement as a reading. The default takes its value as it is and prefers its own noise.
    ///
    /// `expected` is what the sensor would have read of the object that the measurement is compared with. Where the noise
    /// depends on the object's place it is that of the expected one: it then does not depend on the error of this very
    /// measurement, which would bias the estimate. Without a prediction, at a birth, the measurement stands for it.
    ///
    /// # Errors
    /// When the measurement's own noise is not positive definite.
    #[inline]
    fn read(
        &self,
        measurement: &Measurement<M>,
        expected: Option<&SVector<f64, M>>,
    ) -> Result<Reading<M>, FilterError> {
        let noise = match measurement.own_noise()? {
            Some(noise) => *noise,
            None => self.noise(expected.unwrap_or(&measurement.value)),
        };
        Ok(Reading { value: measurement.value, noise })
    }

    /// Which components of a reading are angles, and so periodic.
    fn periodic(&self) -> [bool; M] {
        [false; M]
    }

    /// `reading - expected`, with angles between -π and π.
    #[inline]
    fn difference(&self, reading: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        let mut difference = reading - expected;
        for (component, periodic) in difference.iter_mut().zip(self.periodic()) {
            if periodic {
                *component = wrapped(*component);
            }
        }
        difference
    }

    /// What is believed of a new object that caused this measurement, given what was believed of any new object:
    /// its position comes from the measurement, the rest from `prior`. It holds at the time of the scan: the position of an
    /// aged measurement is [moved on](Gaussian::moved_on) by the velocity, with the covariance that goes with it.
    ///
    /// # Errors
    /// [`FilterError::NotInvertible`] when the measurement does not say where the object is.
    fn birth(&self, measurement: &Measurement<M>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError>;

    /// Where in the plane (`x, y`) the object was when it was measured, if the measurement says so.
    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>>;

    /// The region of the plane that holds the [`place`](Sensor::place) of every measurement whose reading differs from
    /// `expected` by at most `half` in each component. Gates are searched in it before readings are compared.
    ///
    /// `None` for sensors that do not say where an object is.
    fn region(&self, expected: &SVector<f64, M>, half: &SVector<f64, M>) -> Option<Region>;

    /// Number of positions at the beginning of the state, which as many velocities follow: what an
    /// [age](Measurement::age) is applied to. The default is 2, the plane.
    fn axes(&self) -> usize {
        2
    }

    /// Where in the plane the sensor stands, if the direction from there to the object matters to what it reads. The default is
    /// none: it does not.
    fn site(&self) -> Option<Vector2<f64>> {
        None
    }

    /// Area of the plane (m²) that one unit of volume of the reading's space covers near a measurement, so that a
    /// clutter intensity given per m² becomes one per unit of the reading.
    fn area(&self, _: &Measurement<M>) -> f64 {
        1.0
    }
}

/// A sensor whose [`jacobian`](Sensor::jacobian) does not depend on the state and whose readings are not periodic, which
/// makes the Kalman filter exact.
pub trait LinearSensor<const N: usize, const M: usize>: Sensor<N, M> {}

impl<const N: usize, const M: usize> LinearSensor<N, M> for Position<M> {}
impl<const N: usize> LinearSensor<N, 2> for ConvertedPolar {}

/// A borrowed sensor is a sensor.
impl<const N: usize, const M: usize, S: Sensor<N, M> + ?Sized> Sensor<N, M> for &S {
    fn expected(&self, state: &SVector<f64, N>) -> SVector<f64, M> {
        (**self).expected(state)
    }
    fn jacobian(&self, state: &SVector<f64, N>) -> SMatrix<f64, M, N> {
        (**self).jacobian(state)
    }
    fn noise(&self, expected: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        (**self).noise(expected)
    }
    fn read(
        &self,
        measurement: &Measurement<M>,
        expected: Option<&SVector<f64, M>>,
    ) -> Result<Reading<M>, FilterError> {
        (**self).read(measurement, expected)
    }
    fn periodic(&self) -> [bool; M] {
        (**self).periodic()
    }
    fn difference(&self, reading: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        (**self).difference(reading, expected)
    }
    fn birth(&self, measurement: &Measurement<M>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        (**self).birth(measurement, prior)
    }
    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        (**self).place(measurement)
    }
    fn region(&self, expected: &SVector<f64, M>, half: &SVector<f64, M>) -> Option<Region> {
        (**self).region(expected, half)
    }
    fn axes(&self) -> usize {
        (**self).axes()
    }
    fn site(&self) -> Option<Vector2<f64>> {
        (**self).site()
    }
    fn area(&self, measurement: &Measurement<M>) -> f64 {
        (**self).area(measurement)
    }
}

impl<const N: usize, const M: usize, S: LinearSensor<N, M> + ?Sized> LinearSensor<N, M> for &S {}

/// The angle between -π and π that differs from `angle` by whole turns.
#[inline]
pub fn wrapped(angle: f64) -> f64 {
    if angle.abs() <= PI {
        return angle;
    }
    let turned = (angle + PI).rem_euclid(TAU) - PI;
    // Rounding in the remainder may leave the interval by one unit in the last place.
    turned.clamp(-PI, PI)
}

/// `A Hᵀ` for a sensor that picks the first `M` components, less `lag` times the `M` after them.
#[inline]
fn picked<const N: usize, const M: usize>(matrix: &SMatrix<f64, N, N>, lag: f64) -> SMatrix<f64, N, M> {
    if lag == 0.0 {
        return matrix.fixed_columns::<M>(0).into_owned();
    }
    SMatrix::from_fn(|i, j| matrix[(i, j)] - lag * matrix[(i, j + M)])
}

/// A birth with the position part of `prior` replaced by a position in the plane and its covariance, and everything
/// else independent of it.
fn placed<const N: usize>(
    prior: &Gaussian<N>,
    place: &Vector2<f64>,
    covariance: &SMatrix<f64, 2, 2>,
) -> Gaussian<N> {
    let mut belief = *prior;
    for i in 0..2 {
        belief.mean[i] = place[i];
        for j in 0..N {
            belief.covariance[(i, j)] = if j < 2 { covariance[(i, j)] } else { 0.0 };
            belief.covariance[(j, i)] = belief.covariance[(i, j)];
        }
    }
    belief
}

#[cfg(test)]
mod tests;
