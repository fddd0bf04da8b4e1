//! A sensor as it was some seconds before the scan.

use nalgebra::{SMatrix, SVector, Vector2};

use super::{Measurement, Reading, Sensor};
use crate::association::Region;
use crate::belief::Gaussian;
use crate::error::FilterError;

/// A sensor that saw an object some seconds before the time of its state.
///
/// ## Definition
/// With the age `a`, the state `(p, v, ..)` and the sensor's expected reading `h`:
/// ```text
/// h'(p, v, ..) = h(p - a v, v, ..)        H' = H J,    J = ∂(p - a v, v, ..) / ∂(p, v, ..)
/// ```
/// An age of zero is the sensor itself, to the last bit. The age adds to a lag that the sensor has of its own. States
/// that have no velocities ignore it.
///
/// ## Use it when
/// a filter of your own compares a [`Measurement`] with what was expected: filters of this crate wrap their sensor in
/// this for each measurement. It is first order: the object's turn within the age, and the noise of its motion, are left
/// out, as they are for a lag.
///
/// ```
/// use tercel_core::sensor::{Aged, Position, Sensor};
/// use nalgebra::vector;
///
/// let radar = Position::<2>::new(5.0)?;
/// let seen = Aged::new(&radar, 2.0).expected(&vector![100.0, 0.0, 4.0, 0.0]);
/// assert_eq!(seen, vector![92.0, 0.0]);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aged<'a, S: ?Sized> {
    sensor: &'a S,
    age: f64,
}

impl<'a, S: ?Sized> Aged<'a, S> {
    /// The sensor as it was `age` seconds before the time of the state.
    #[inline]
    pub fn new(sensor: &'a S, age: f64) -> Self {
        Aged { sensor, age }
    }

    /// The state that the sensor saw.
    // Out of line, so that the common case stays small.
    #[cold]
    pub(crate) fn seen<const N: usize, const M: usize>(&self, state: &SVector<f64, N>) -> SVector<f64, N>
    where
        S: Sensor<N, M>,
    {
        let axes = self.sensor.axes();
        SVector::from_fn(|i, _| match i < axes && N >= 2 * axes {
            true => state[i] - self.age * state[i + axes],
            false => state[i],
        })
    }

    #[cold]
    fn older_jacobian<const N: usize, const M: usize>(&self, state: &SVector<f64, N>) -> SMatrix<f64, M, N>
    where
        S: Sensor<N, M>,
    {
        let axes = self.sensor.axes();
        let jacobian = self.sensor.jacobian(&self.seen(state));
        SMatrix::from_fn(|i, j| match N >= 2 * axes && (axes..2 * axes).contains(&j) {
            true => jacobian[(i, j)] - self.age * jacobian[(i, j - axes)],
            false => jacobian[(i, j)],
        })
    }
}

impl<const N: usize, const M: usize, S: Sensor<N, M> + ?Sized> Sensor<N, M> for Aged<'_, S> {
    #[inline]
    fn expected(&self, state: &SVector<f64, N>) -> SVector<f64, M> {
        if self.age == 0.0 { self.sensor.expected(state) } else { self.sensor.expected(&self.seen(state)) }
    }

    #[inline]
    fn jacobian(&self, state: &SVector<f64, N>) -> SMatrix<f64, M, N> {
        if self.age == 0.0 { self.sensor.jacobian(state) } else { self.older_jacobian(state) }
    }

    #[inline]
    fn project(&self, matrix: &SMatrix<f64, N, N>, jacobian: &SMatrix<f64, M, N>) -> SMatrix<f64, N, M> {
        // A sensor's shortcut holds for its own Jacobian alone.
        if self.age == 0.0 { self.sensor.project(matrix, jacobian) } else { matrix * jacobian.transpose() }
    }

    #[inline]
    fn noise(&self, expected: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        self.sensor.noise(expected)
    }

    #[inline]
    fn read(
        &self,
        measurement: &Measurement<M>,
        expected: Option<&SVector<f64, M>>,
    ) -> Result<Reading<M>, FilterError> {
        self.sensor.read(measurement, expected)
    }

    #[inline]
    fn periodic(&self) -> [bool; M] {
        self.sensor.periodic()
    }

    #[inline]
    fn difference(&self, reading: &SVector<f64, M>, expected: &SVector<f64, M>) -> SVector<f64, M> {
        self.sensor.difference(reading, expected)
    }

    /// That of the sensor: the measurement brings its own age.
    fn birth(&self, measurement: &Measurement<M>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        self.sensor.birth(measurement, prior)
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn region(&self, expected: &SVector<f64, M>, half: &SVector<f64, M>) -> Option<Region> {
        self.sensor.region(expected, half)
    }

    fn axes(&self) -> usize {
        self.sensor.axes()
    }

    fn site(&self) -> Option<Vector2<f64>> {
        self.sensor.site()
    }

    fn area(&self, measurement: &Measurement<M>) -> f64 {
        self.sensor.area(measurement)
    }
}
