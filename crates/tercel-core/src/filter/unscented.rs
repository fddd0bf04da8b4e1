//! The unscented Kalman filter.

use nalgebra::{SMatrix, SVector};

use super::gaussian::gaussian_belief;
use super::sigma::{Image, Points};
use super::{Filter, Innovation, SigmaPoints};
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;
use crate::motion::Motion;
use crate::sensor::{Measurement, Reading, Sensor};

/// Estimates the state of an object whose motion or sensor bends, by sending a few points of the belief through both.
///
/// ## Recursion
/// ```text
/// predict   x⁻, P⁻ = moments of f(χ) + (0, Q)                              χ: sigma points of (x, P)
/// update    ẑ, S   = moments of h(χ) + (0, R)     C = cov(χ, h(χ))         χ: sigma points of (x⁻, P⁻), drawn anew
///           K = C S⁻¹        x = x⁻ + K (z ⊖ ẑ)        P = P⁻ - K S Kᵀ
/// ```
/// [`SigmaPoints`] says where the points lie and how their moments are taken. The mean of a periodic reading is taken on
/// the circle, through the differences from the reading of the central point.
///
/// ## Use it when
/// the curvature matters over the width of the belief: long ranges with coarse bearings, fast turns, first scans. Models
/// need no Jacobian. On linear problems it is the Kalman filter at several times its cost.
///
/// ## Reference
/// Julier and Uhlmann (2004); Wan and van der Merwe (2000), section 3, with additive noise. Deviations: `P` is computed
/// as `(X - K Z)(X - K Z)ᵀ + K R Kᵀ` from the columns `X` and `Z` of state and reading, which is the same matrix in a
/// form that cannot become indefinite, and likewise all moments (see [`SigmaPoints`]).
///
/// Validated against FilterPy 1.4.5 over 15 steps of range and bearing: states and covariances agree to 1e-9.
///
/// ```
/// use tercel_core::{belief::Gaussian, filter::{Filter, Unscented}, motion::CoordinatedTurn, sensor::RangeBearing};
///
/// let filter = Unscented::new(CoordinatedTurn::new(1.0, 1e-4), RangeBearing::new(20.0, 0.02)?);
/// let mut belief: Gaussian<5> = filter.birth(&[5_000.0, 3.14].into())?;
/// filter.predict(&mut belief, 2.0);
/// let innovation = filter.update(&mut belief, &[5_000.0, -3.14].into())?;
/// assert!(innovation.residual()[1].abs() < 0.01); // across the cut, not around the world
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unscented<T, S, const M: usize = 2> {
    /// How the object moves.
    pub motion: T,
    /// What is measured of it.
    pub sensor: S,
    /// Where the belief is sampled.
    pub points: SigmaPoints,
}

impl<T, S, const M: usize> Unscented<T, S, M> {
    /// An unscented filter of this motion and this sensor, with the default [`SigmaPoints`].
    pub fn new(motion: T, sensor: S) -> Self {
        Unscented { motion, sensor, points: SigmaPoints::default() }
    }

    /// Sets where the belief is sampled.
    pub fn with_points(self, points: SigmaPoints) -> Self {
        Unscented { points, ..self }
    }

    /// Predicts over `dt` seconds and updates with the points that were moved, instead of drawing new ones between.
    ///
    /// This saves one factorisation, and is what FilterPy does. The moved points know nothing of the process noise of
    /// this step, so the reading's spread and the gain come out too small by its share, and the filter listens less to
    /// the measurement than it should: prefer [`predict`](Filter::predict) and [`update`](Filter::update) unless the
    /// process noise of one step is small against the covariance.
    ///
    /// # Errors
    /// As [`update`](Filter::update). The belief is then unchanged, and not predicted either.
    pub fn step<const N: usize>(
        &self,
        belief: &mut Gaussian<N>,
        dt: f64,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError>
    where
        T: Motion<N>,
        S: Sensor<N, M>,
    {
        let moved = self.points.draw(belief).map(|state| self.motion.transition(state, dt));
        let noise = self.motion.noise(&belief.mean, dt);
        let comparison = Comparison::new(self, &moved, measurement)?;
        *belief = comparison.posterior(&moved.image(&self.points, |a, b| a - b), &noise)?;
        Ok(comparison.innovation)
    }
}

impl<const N: usize, const M: usize, T, S> Filter<N> for Unscented<T, S, M>
where
    T: Motion<N>,
    S: Sensor<N, M>,
{
    type Belief = Gaussian<N>;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<Gaussian<N>, FilterError> {
        self.sensor.birth(measurement, &self.motion.prior())
    }

    fn predict(&self, belief: &mut Gaussian<N>, dt: f64) {
        let noise = self.motion.noise(&belief.mean, dt);
        let moved = self.points.draw(belief).map(|state| self.motion.transition(state, dt));
        let image = moved.image(&self.points, |a, b| a - b);
        belief.mean = image.mean;
        belief.covariance = image.covariance() + noise;
    }

    fn update(
        &self,
        belief: &mut Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        let points = self.points.draw(belief);
        let comparison = Comparison::new(self, &points, measurement)?;
        *belief = comparison.posterior(&points.image(&self.points, |a, b| a - b), &SMatrix::zeros())?;
        Ok(comparison.innovation)
    }

    fn innovation(
        &self,
        belief: &Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        Ok(Comparison::new(self, &self.points.draw(belief), measurement)?.innovation)
    }

    gaussian_belief!(M);
}

/// A measurement compared with the readings of sigma points.
struct Comparison<const N: usize, const M: usize> {
    reading: Reading<M>,
    residual: SVector<f64, M>,
    image: Image<M, N>,
    factor: Cholesky<M>,
    innovation: Innovation,
}

impl<const N: usize, const M: usize> Comparison<N, M> {
    fn new<T, S: Sensor<N, M>>(
        filter: &Unscented<T, S, M>,
        points: &Points<N, N>,
        measurement: &Measurement<M>,
    ) -> Result<Self, FilterError> {
        let sensor = &filter.sensor;
        let reading = sensor.read(measurement);
        let image = points
            .map(|state| sensor.expected(state))
            .image(&filter.points, |reading, centre| sensor.difference(reading, centre));
        let residual = sensor.difference(&reading.value, &image.mean);
        if !residual.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "innovation" });
        }
        let factor = Cholesky::new(&(image.covariance() + reading.noise), "innovation covariance")?;
        let nis = factor.mahalanobis(&residual);
        let innovation = Innovation::new(&residual, nis, factor.ln_density(nis));
        Ok(Comparison { reading, residual, image, factor, innovation })
    }

    /// The belief whose sigma points have this image, with additional noise, conditioned on the measurement.
    fn posterior(&self, state: &Image<N, N>, noise: &SMatrix<f64, N, N>) -> Result<Gaussian<N>, FilterError> {
        let gain = self.factor.right_solve(&state.cross(&self.image));
        let left = state.minus(&gain, &self.image);
        let mut posterior = Gaussian {
            mean: state.mean + gain * self.residual,
            covariance: left.covariance() + noise + gain * self.reading.noise * gain.transpose(),
        };
        posterior.settle()?;
        Ok(posterior)
    }
}
