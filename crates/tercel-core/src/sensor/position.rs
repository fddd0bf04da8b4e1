//! A sensor of Cartesian positions.

use nalgebra::{SMatrix, SVector, Vector2};

use super::{Measurement, Sensor, picked};
use crate::association::Region;
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;

/// Measures a position: the first `M` components of the state, in the frame of the state.
///
/// ## Model
/// ```text
/// z = p - τ v + noise,        noise ~ N(0, R)
/// ```
/// The lag `τ` is zero unless set: some radars show a picture that is seconds old, and then the position that a
/// moving object had, not the one it has.
///
/// ## Use it when
/// detections come as positions: converted radar plots, lidar clusters, satellite navigation reports. For range and
/// bearing see [`ConvertedPolar`](super::ConvertedPolar).
///
/// ```
/// use tercel_core::sensor::{Position, Sensor};
/// use nalgebra::vector;
///
/// let radar = Position::<2>::new(5.0)?.with_lag(1.5);
/// let seen = radar.expected(&vector![100.0, 0.0, 4.0, 0.0]);
/// assert_eq!(seen, vector![94.0, 0.0]);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position<const M: usize = 2> {
    noise: SMatrix<f64, M, M>,
    lag: f64,
    clutter_heights: f64,
}

/// Heights of clutter when nothing is said, m.
const CLUTTER_HEIGHTS: f64 = 10_000.0;

impl<const M: usize> Position<M> {
    /// A standard deviation of `deviation` metres on every axis.
    ///
    /// # Errors
    /// When it is not positive and finite.
    pub fn new(deviation: f64) -> Result<Self, FilterError> {
        let deviation = FilterError::positive("position deviation", deviation)?;
        Position::with_noise(SMatrix::identity() * (deviation * deviation))
    }

    /// Any noise covariance, m².
    ///
    /// # Errors
    /// When it is not positive definite.
    pub fn with_noise(noise: SMatrix<f64, M, M>) -> Result<Self, FilterError> {
        Cholesky::new(&noise, "position noise")?;
        Ok(Position { noise, lag: 0.0, clutter_heights: CLUTTER_HEIGHTS })
    }

    /// Says that positions are `lag` seconds old when they are reported. States without velocities ignore it.
    pub fn with_lag(self, lag: f64) -> Self {
        Position { lag, ..self }
    }

    /// Sets the width of the interval over which heights of clutter are spread evenly, m. The default is 10,000. It counts for
    /// positions in space alone, whose likelihoods are per m³ where [`Clutter`](crate::multi::Clutter) is per m² of the plane.
    ///
    /// # Errors
    /// When it is not positive and finite.
    pub fn with_clutter_heights(self, width: f64) -> Result<Self, FilterError> {
        let clutter_heights = FilterError::positive("width of the heights of clutter", width)?;
        Ok(Position { clutter_heights, ..self })
    }

    /// The lag, if the state has velocities to apply it to.
    fn lag_of<const N: usize>(&self) -> f64 {
        if N >= 2 * M { self.lag } else { 0.0 }
    }
}

impl<const N: usize, const M: usize> Sensor<N, M> for Position<M> {
    #[inline]
    fn expected(&self, state: &SVector<f64, N>) -> SVector<f64, M> {
        const { assert!(M <= N, "a position cannot have more components than the state") };
        let lag = self.lag_of::<N>();
        SVector::from_fn(|i, _| if lag == 0.0 { state[i] } else { state[i] - lag * state[i + M] })
    }

    #[inline]
    fn jacobian(&self, _: &SVector<f64, N>) -> SMatrix<f64, M, N> {
        let lag = self.lag_of::<N>();
        SMatrix::from_fn(|i, j| match j {
            _ if j == i => 1.0,
            _ if j == i + M => -lag,
            _ => 0.0,
        })
    }

    #[inline]
    fn project(&self, matrix: &SMatrix<f64, N, N>, _: &SMatrix<f64, M, N>) -> SMatrix<f64, N, M> {
        picked(matrix, self.lag_of::<N>())
    }

    #[inline]
    fn noise(&self, _: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        self.noise
    }

    fn birth(&self, measurement: &Measurement<M>, prior: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        measurement.check_finite()?;
        let reading = Sensor::<N, M>::read(self, measurement, None)?;
        // p = z + τ v + noise: the position inherits the prior of the velocity through the lag.
        let lag = if N >= 2 * M { self.lag + measurement.age } else { 0.0 };
        let mut spread = SMatrix::<f64, N, N>::identity();
        for i in 0..M {
            spread[(i, i)] = 0.0;
            if lag != 0.0 {
                spread[(i, i + M)] = lag;
            }
        }
        let mut belief = Gaussian {
            mean: spread * prior.mean,
            covariance: spread * prior.covariance * spread.transpose(),
        };
        for i in 0..M {
            belief.mean[i] += reading.value[i];
            for j in 0..M {
                belief.covariance[(i, j)] += reading.noise[(i, j)];
            }
        }
        belief.settle()?;
        Ok(belief)
    }

    fn axes(&self) -> usize {
        M
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        (M >= 2).then(|| Vector2::new(measurement.value[0], measurement.value[1]))
    }

    fn region(&self, expected: &SVector<f64, M>, half: &SVector<f64, M>) -> Option<Region> {
        let plane = |place: SVector<f64, M>| Vector2::new(place[0], place[1]);
        (M >= 2).then(|| Region {
            centre: plane(*expected),
            low: plane(expected - half),
            high: plane(expected + half),
        })
    }

    fn area(&self, _: &Measurement<M>) -> f64 {
        if M == 3 { 1.0 / self.clutter_heights } else { 1.0 }
    }
}
