//! A polar sensor whose measurements are turned into positions.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2, vector};

use super::range_bearing::{RangeBearing, cartesian, rotated};
use super::{Measurement, Reading, Sensor, finite, picked, placed};
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
/// `r σθ²/2`. `R` is the unbiased one, evaluated at the measurement.
///
/// ## Use it when
/// a Kalman filter or a bank of them should serve a polar radar. The alternative, an extended filter on
/// [`RangeBearing`], loses consistency when `r σθ` is large against the range accuracy.
///
/// ## Reference
/// Mo, Song, Zhou, Sun and Bar-Shalom (1998), unbiased converted measurements, eqs. 10 and 12 to 14.
///
/// ```
/// use tercel_core::sensor::{ConvertedPolar, Measurement, Sensor};
///
/// let radar = ConvertedPolar::new(50.0, 0.01)?;
/// let reading = Sensor::<4, 2>::read(&radar, &Measurement::from([100e3, 0.0]));
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

    /// Converts with plain trigonometry, without the debiasing factor, as much older software does.
    pub fn biased(self) -> Self {
        ConvertedPolar { debiased: false, ..self }
    }

    fn lag_of<const N: usize>(&self) -> f64 {
        if N >= 4 { self.lag } else { 0.0 }
    }

    /// A polar measurement with polar noise covariance, as a position.
    fn convert(&self, value: &Vector2<f64>, noise: &Matrix2<f64>) -> Reading<2> {
        let (range, bearing) = (value[0], value[1]);
        let plain = self.polar.position() + cartesian(range, bearing);
        if !self.debiased {
            return Reading { value: plain, noise: rotated(range, bearing, noise) };
        }
        let lambda = (-0.5 * noise[(1, 1)]).exp();
        let value = self.polar.position() + cartesian(range / lambda, bearing);
        Reading { value, noise: unbiased_covariance(range, bearing, noise, lambda) }
    }
}

/// Covariance of the unbiased conversion given the measurement. For a range error that correlates with the bearing
/// error, the cross term enters to first order.
fn unbiased_covariance(range: f64, bearing: f64, noise: &Matrix2<f64>, lambda: f64) -> Matrix2<f64> {
    let (variance, turn) = (noise[(0, 0)], noise[(1, 1)]);
    let lambda4 = (-2.0 * turn).exp();
    let (sine, cosine) = bearing.sin_cos();
    let double = vector![cosine * cosine - sine * sine, 2.0 * sine * cosine];
    // E[x²], E[y²], E[xy] of the true position given the measurement, minus the converted position's moments.
    let bracket = (1.0 / (lambda * lambda) - 2.0) * range * range;
    let second = 0.5 * (range * range + variance);
    let xx = bracket * cosine * cosine + second * (1.0 + lambda4 * double[0]);
    let yy = bracket * sine * sine + second * (1.0 - lambda4 * double[0]);
    let xy = bracket * sine * cosine + second * lambda4 * double[1];
    let cross = rotated(range, bearing, &Matrix2::new(0.0, noise[(0, 1)], noise[(1, 0)], 0.0));
    Matrix2::new(xx, xy, xy, yy) + cross
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
        self.convert(&polar, &Sensor::<2, 2>::noise(&self.polar, &polar)).noise
    }

    fn read(&self, measurement: &Measurement<2>) -> Reading<2> {
        let noise = match measurement.noise {
            Some(noise) => noise,
            None => Sensor::<2, 2>::noise(&self.polar, &measurement.value),
        };
        self.convert(&measurement.value, &noise)
    }

    fn birth(&self, measurement: &Measurement<2>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        finite(measurement)?;
        let reading = Sensor::<N, 2>::read(self, measurement);
        let lag = self.lag_of::<N>() + measurement.age;
        let mut belief = placed(prior, &reading.value, &reading.noise).moved_on(2, lag);
        belief.settle()?;
        Ok(belief)
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        Some(Sensor::<2, 2>::read(self, measurement).value)
    }

    fn footprint(&self, state: &SVector<f64, N>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let expected = Sensor::<N, 2>::expected(self, state);
        Some((expected, Sensor::<N, 2>::noise(self, &expected)))
    }
}
