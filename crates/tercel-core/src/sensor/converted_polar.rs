//! A polar sensor whose measurements are turned into positions.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::range_bearing::{RangeBearing, cartesian, rotated};
use super::{Measurement, Reading, Sensor, picked, placed};
use crate::association::Region;
use crate::belief::Gaussian;
use crate::error::FilterError;

/// Measures range and bearing, and reads them as a position whose covariance is turned into the line of sight.
///
/// ## Model
/// With measured range `r` and bearing `θ`, sensor position `s`:
/// ```text
/// z = s + λ⁻¹ r (cos θ, sin θ),        λ = exp(-σθ²/2)
/// R = the covariance of the error of z, rotated by θ: along the line of sight about σr², across it about r² σθ²
/// ```
/// The factor `λ⁻¹` removes the mean of the conversion, which otherwise draws far objects towards the sensor by
/// `r σθ²/2`.
///
/// `R` is evaluated where the object is predicted, for every comparison with a belief. At the measurement it would be turned
/// by the bearing's own error: measurements that err to the left would trust the directions in which that error looks small,
/// those to the right theirs, and the estimate would move outwards by much of `r σθ²` while it becomes too sure. That harm is
/// small only as long as `r σθ² / σr` is far below one (4 at 100 km with 0.02 rad and 10 m). At a birth there is no
/// prediction, and `R` is that of an object given the measurement.
///
/// ## Use it when
/// a Kalman filter or a bank of them should serve a polar radar. The alternative, an extended filter on
/// [`RangeBearing`], loses consistency when `r σθ` is large against the range accuracy.
///
/// ## Reference
/// Bordonaro, Willett and Bar-Shalom (2014), "Decorrelated unbiased converted measurement Kalman filter", for `R` at the
/// prediction; deviation: it is taken at the predicted position alone, not averaged over its error. Mo, Song, Zhou, Sun and
/// Bar-Shalom (1998), unbiased converted measurements, eqs. 10 and 12 to 14, for the value and for births.
///
/// ```
/// use tercel_core::sensor::{ConvertedPolar, Measurement, Sensor};
///
/// let radar = ConvertedPolar::new(50.0, 0.01)?;
/// let reading = Sensor::<4, 2>::read(&radar, &Measurement::from([100e3, 0.0]), None)?;
/// // 50 m along the line of sight, a kilometre across it.
/// assert!(reading.noise[(0, 0)].sqrt() < 60.0 && reading.noise[(1, 1)].sqrt() > 990.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvertedPolar {
    polar: RangeBearing,
    lag: f64,
    debiased: bool,
}

impl ConvertedPolar {
    /// Standard deviations of range (m) and bearing (rad), for a sensor at the origin.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn new(range: f64, bearing: f64) -> Result<Self, FilterError> {
        Ok(ConvertedPolar { polar: RangeBearing::new(range, bearing)?, lag: 0.0, debiased: true })
    }

    /// Moves the sensor to `position`, m.
    pub fn at(self, position: Vector2<f64>) -> Self {
        ConvertedPolar { polar: self.polar.at(position), ..self }
    }

    /// Says that measurements are `lag` seconds old when they are reported; see [`Position`](super::Position).
    pub fn with_lag(self, lag: f64) -> Self {
        ConvertedPolar { lag, ..self }
    }

    /// Converts with plain trigonometry, without the debiasing factor and with the covariance of first order at the measurement,
    /// as much older software does.
    pub fn biased(self) -> Self {
        ConvertedPolar { debiased: false, ..self }
    }

    /// A plot as a position by itself: the covariance is that of an object given this plot and nothing else.
    pub fn convert(&self, plot: &Vector2<f64>) -> Reading<2> {
        self.alone(plot, &Sensor::<2, 2>::noise(&self.polar, plot))
    }

    fn alone(&self, plot: &Vector2<f64>, noise: &Matrix2<f64>) -> Reading<2> {
        let covariance = if self.debiased { covariance_given } else { rotated };
        Reading { value: self.converted(plot, noise), noise: covariance(plot[0], plot[1], noise) }
    }

    fn lag_of<const N: usize>(&self) -> f64 {
        if N >= 4 { self.lag } else { 0.0 }
    }

    /// Covariance of polar errors: those of the measurement, or else the sensor's.
    fn polar_noise(&self, measurement: &Measurement<2>) -> Result<Matrix2<f64>, FilterError> {
        Ok(match measurement.own_noise()? {
            Some(noise) => *noise,
            None => Sensor::<2, 2>::noise(&self.polar, &measurement.value),
        })
    }

    /// A polar measurement with errors of this covariance, as a position.
    fn converted(&self, value: &Vector2<f64>, noise: &Matrix2<f64>) -> Vector2<f64> {
        let stretch = if self.debiased { (0.5 * noise[(1, 1)]).exp() } else { 1.0 };
        self.polar.position() + cartesian(stretch * value[0], value[1])
    }
}

/// Covariance of the unbiased conversion's error for an object at this range and bearing. As below, a range error that
/// correlates with the bearing error enters to first order.
fn covariance_at(range: f64, bearing: f64, noise: &Matrix2<f64>) -> Matrix2<f64> {
    let (variance, turn) = (noise[(0, 0)], noise[(1, 1)]);
    let bow = range * (0.5 * turn).sinh();
    let along = 2.0 * bow * bow + variance * turn.cosh();
    let across = (range * range + variance) * turn.sinh();
    let cross = range * noise[(0, 1)];
    rotated(1.0, bearing, &Matrix2::new(along, cross, cross, across))
}

/// Covariance of the unbiased conversion's error given that this range and bearing were measured.
fn covariance_given(range: f64, bearing: f64, noise: &Matrix2<f64>) -> Matrix2<f64> {
    let (variance, turn) = (noise[(0, 0)], noise[(1, 1)]);
    let bow = turn.exp_m1() + 0.5 * (-2.0 * turn).exp_m1();
    let along = range * range * bow + 0.5 * variance * (1.0 + (-2.0 * turn).exp());
    let across = -0.5 * (range * range + variance) * (-2.0 * turn).exp_m1();
    let cross = range * noise[(0, 1)];
    rotated(1.0, bearing, &Matrix2::new(along, cross, cross, across))
}

impl<const N: usize> Sensor<N, 2> for ConvertedPolar {
    #[inline]
    fn expected(&self, state: &SVector<f64, N>) -> Vector2<f64> {
        const { assert!(N >= 2, "a bearing needs a position in the plane") };
        let lag = self.lag_of::<N>();
        SVector::from_fn(|i, _| if lag == 0.0 { state[i] } else { state[i] - lag * state[i + 2] })
    }

    #[inline]
    fn jacobian(&self, _: &SVector<f64, N>) -> SMatrix<f64, 2, N> {
        let lag = self.lag_of::<N>();
        SMatrix::from_fn(|i, j| match j {
            _ if j == i => 1.0,
            _ if j == i + 2 => -lag,
            _ => 0.0,
        })
    }

    #[inline]
    fn project(&self, matrix: &SMatrix<f64, N, N>, _: &SMatrix<f64, 2, N>) -> SMatrix<f64, N, 2> {
        picked(matrix, self.lag_of::<N>())
    }

    fn noise(&self, expected: &Vector2<f64>) -> Matrix2<f64> {
        let polar: Vector2<f64> = Sensor::<2, 2>::expected(&self.polar, expected);
        let noise = Sensor::<2, 2>::noise(&self.polar, &polar);
        match self.debiased {
            true => covariance_at(polar[0], polar[1], &noise),
            false => rotated(polar[0], polar[1], &noise),
        }
    }

    fn read(
        &self,
        measurement: &Measurement<2>,
        expected: Option<&Vector2<f64>>,
    ) -> Result<Reading<2>, FilterError> {
        let noise = self.polar_noise(measurement)?;
        let Some(expected) = expected.filter(|_| self.debiased) else {
            return Ok(self.alone(&measurement.value, &noise));
        };
        let polar: Vector2<f64> = Sensor::<2, 2>::expected(&self.polar, expected);
        Ok(Reading {
            value: self.converted(&measurement.value, &noise),
            noise: covariance_at(polar[0], polar[1], &noise),
        })
    }

    fn birth(&self, measurement: &Measurement<2>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        measurement.check_finite()?;
        let reading = Sensor::<N, 2>::read(self, measurement, None)?;
        let lag = self.lag_of::<N>() + measurement.age;
        let mut belief = placed(prior, &reading.value, &reading.noise).moved_on(2, lag);
        belief.settle()?;
        Ok(belief)
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        let noise = self.polar_noise(measurement).ok()?;
        Some(self.converted(&measurement.value, &noise))
    }

    fn site(&self) -> Option<Vector2<f64>> {
        Some(self.polar.position())
    }

    fn region(&self, expected: &Vector2<f64>, half: &Vector2<f64>) -> Option<Region> {
        Some(Region { centre: *expected, low: expected - half, high: expected + half })
    }
}
