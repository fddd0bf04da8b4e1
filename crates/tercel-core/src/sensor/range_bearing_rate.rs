//! A sensor of range, bearing and range rate.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3, vector};

use super::range_bearing::{offset, polar_derivatives};
use super::{Measurement, RangeBearing, Reading, Sensor};
use crate::association::Region;
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;

/// Measures range, bearing and range rate (Doppler) from where it stands. The bearing is periodic.
///
/// The state has velocities: `x, y, vx, vy, ...`; one without stands still.
///
/// ## Model
/// With `d = p - s` and `u = v - w` for a sensor at `s` that moves with velocity `w`:
/// ```text
/// z = (|d|, atan2(dy, dx), dᵀu / |d|) + noise,        noise ~ N(0, diag(σr², σθ², σd² + σw²))
/// ```
///
/// ## Use it when
/// the radar reports Doppler: one detection then says something of the velocity, and clutter that stands still can be
/// told from objects that move.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 10.4 with the range rate added.
///
/// ```
/// use tercel_core::sensor::{RangeBearingRate, Sensor};
/// use nalgebra::vector;
///
/// let radar = RangeBearingRate::new(50.0, 0.01, 0.5)?;
/// assert_eq!(radar.expected(&vector![300.0, 400.0, 3.0, 4.0])[2], 5.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeBearingRate {
    polar: RangeBearing,
    rate: f64,
    velocity: Vector2<f64>,
    velocity_variance: f64,
    clutter_rates: f64,
}

impl RangeBearingRate {
    /// Standard deviations of range (m), bearing (rad) and range rate (m/s), for a sensor at rest at the origin.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn new(range: f64, bearing: f64, rate: f64) -> Result<Self, FilterError> {
        Ok(RangeBearingRate {
            polar: RangeBearing::new(range, bearing)?,
            rate: FilterError::positive("range rate deviation", rate)?,
            velocity: Vector2::zeros(),
            velocity_variance: 0.0,
            clutter_rates: 100.0,
        })
    }

    /// Moves the sensor to `position` (m), with `velocity` (m/s).
    pub fn at(self, position: Vector2<f64>, velocity: Vector2<f64>) -> Self {
        RangeBearingRate { polar: self.polar.at(position), velocity, ..self }
    }

    /// Says how well the sensor's own velocity is known: its standard deviation on every axis, m/s. The variance adds to that of
    /// every range rate, also of those that bring their own, for the velocity along the line of sight is what a range rate
    /// is corrected by. The default is 0.
    ///
    /// The error is common to the measurements of a scan; a filter that takes them one object at a time need not know.
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn with_velocity_deviation(self, deviation: f64) -> Result<Self, FilterError> {
        if deviation >= 0.0 && deviation.is_finite() {
            return Ok(RangeBearingRate { velocity_variance: deviation * deviation, ..self });
        }
        let (parameter, expected) =
            ("deviation of the sensor's velocity", "must be finite and not negative, m/s");
        Err(FilterError::Parameter { parameter, value: deviation, expected })
    }

    /// Sets the width of the interval over which range rates of clutter are spread evenly, m/s. The default is 100.
    pub fn with_clutter_rates(self, width: f64) -> Self {
        RangeBearingRate { clutter_rates: width, ..self }
    }

    /// From the sensor to the object: offset and relative velocity.
    fn relative<const N: usize>(&self, state: &SVector<f64, N>) -> (Vector2<f64>, Vector2<f64>) {
        let [vx, vy] = if N >= 4 { [state[2], state[3]] } else { [0.0, 0.0] };
        let velocity = vector![vx, vy] - self.velocity;
        (offset(state, &self.polar.position()), velocity)
    }

    /// Range and bearing alone, as of the moment at which they were measured.
    fn polar_part(measurement: &Measurement<3>) -> Measurement<2> {
        Measurement {
            value: vector![measurement.value[0], measurement.value[1]],
            noise: measurement.noise.map(|noise| noise.fixed_view::<2, 2>(0, 0).into_owned()),
            age: 0.0,
        }
    }
}

impl<const N: usize> Sensor<N, 3> for RangeBearingRate {
    fn expected(&self, state: &SVector<f64, N>) -> Vector3<f64> {
        let (offset, velocity) = self.relative(state);
        let (along, _) = polar_derivatives(&offset);
        vector![offset.norm(), offset.y.atan2(offset.x), along.dot(&velocity)]
    }

    fn jacobian(&self, state: &SVector<f64, N>) -> SMatrix<f64, 3, N> {
        let (offset, velocity) = self.relative(state);
        let (along, turn) = polar_derivatives(&offset);
        // The range rate grows with the position as the line of sight swings towards the velocity.
        let across = vector![-along.y, along.x];
        let swing = turn * across.dot(&velocity);
        let mut jacobian = SMatrix::zeros();
        for i in 0..2 {
            jacobian[(0, i)] = along[i];
            jacobian[(1, i)] = turn[i];
            jacobian[(2, i)] = swing[i];
            if N >= 4 {
                jacobian[(2, i + 2)] = along[i];
            }
        }
        jacobian
    }

    fn noise(&self, expected: &Vector3<f64>) -> Matrix3<f64> {
        let polar: Matrix2<f64> = Sensor::<N, 2>::noise(&self.polar, &vector![expected[0], expected[1]]);
        let rate = self.rate * self.rate + self.velocity_variance;
        Matrix3::from_diagonal(&vector![polar[(0, 0)], polar[(1, 1)], rate])
    }

    fn read(
        &self,
        measurement: &Measurement<3>,
        expected: Option<&Vector3<f64>>,
    ) -> Result<Reading<3>, FilterError> {
        let value = measurement.value;
        let Some(mut noise) = measurement.own_noise()?.copied() else {
            return Ok(Reading { value, noise: Sensor::<N, 3>::noise(self, expected.unwrap_or(&value)) });
        };
        // The measurement knows nothing of how well the sensor's own velocity is known.
        noise[(2, 2)] += self.velocity_variance;
        Ok(Reading { value, noise })
    }

    fn periodic(&self) -> [bool; 3] {
        [false, true, false]
    }

    fn birth(&self, measurement: &Measurement<3>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        measurement.check_finite()?;
        let mut belief = self.polar.birth(&Self::polar_part(measurement), prior)?;
        // The range rate is linear in the velocity at the measured position: one scalar Kalman update.
        let row = Sensor::<N, 3>::jacobian(self, &belief.mean).row(2).into_owned();
        let expected = Sensor::<N, 3>::expected(self, &belief.mean)[2];
        let noise = Sensor::<N, 3>::read(self, measurement, None)?.noise[(2, 2)];
        let cross = belief.covariance * row.transpose();
        let innovation = SMatrix::<f64, 1, 1>::new((row * cross)[0] + noise);
        let gain = Cholesky::new(&innovation, "range rate innovation")?.right_solve(&cross);
        belief.mean += gain * (measurement.value[2] - expected);
        belief.covariance -= gain * cross.transpose();
        let mut belief = belief.moved_on(2, measurement.age);
        belief.settle()?;
        Ok(belief)
    }

    fn place(&self, measurement: &Measurement<3>) -> Option<Vector2<f64>> {
        Sensor::<2, 2>::place(&self.polar, &Self::polar_part(measurement))
    }

    fn region(&self, expected: &Vector3<f64>, half: &Vector3<f64>) -> Option<Region> {
        Sensor::<N, 2>::region(&self.polar, &expected.xy(), &half.xy())
    }

    fn site(&self) -> Option<Vector2<f64>> {
        Some(self.polar.position())
    }

    fn area(&self, measurement: &Measurement<3>) -> f64 {
        Sensor::<N, 2>::area(&self.polar, &Self::polar_part(measurement)) / self.clutter_rates
    }
}
