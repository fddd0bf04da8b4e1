//! The Kalman filter.

use super::correction::{self, predicted};
use super::gaussian::{gaussian_belief, linear_reach};
use super::{Filter, Innovation, one_by_one};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::motion::LinearMotion;
use crate::sensor::{LinearSensor, Measurement};

/// Estimates the state of an object whose motion and sensor are linear with Gaussian noise: the exact answer then.
///
/// ## Recursion
/// ```text
/// predict   x⁻ = F x                    P⁻ = F P Fᵀ + Q
/// update    ν = z - H x⁻                S = H P⁻ Hᵀ + R        K = P⁻ Hᵀ S⁻¹
///           x = x⁻ + K ν                P = (I - K H) P⁻ (I - K H)ᵀ + K R Kᵀ
/// ```
///
/// ## Use it when
/// positions are measured and motion is straight or follows a known turn. With a polar sensor use
/// [`ConvertedPolar`](crate::sensor::ConvertedPolar), or an [`Extended`](super::Extended) filter.
///
/// ## Reference
/// Kalman (1960); the covariance in the form of Joseph (Bar-Shalom, Li and Kirubarajan (2001), eq. 5.2.3-18), which stays
/// positive definite for any gain. Rounding that breaks it all the same is repaired, and an indefinite covariance beyond
/// that is an error.
///
/// Validated against FilterPy 1.4.5 over 20 steps: states, covariances and log-likelihoods agree to 1e-9.
///
/// ```
/// use tercel_core::{belief::Gaussian, filter::{Filter, Kalman}, motion::ConstantVelocity, sensor::Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(2.0)?);
/// let mut belief: Gaussian<4> = filter.birth(&[10.0, 20.0].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[13.0, 19.0].into())?;
/// assert!(belief.covariance[(0, 0)] < 4.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kalman<T, S, const M: usize = 2> {
    /// How the object moves.
    pub motion: T,
    /// What is measured of it.
    pub sensor: S,
}

impl<T, S, const M: usize> Kalman<T, S, M> {
    /// A Kalman filter of this motion and this sensor.
    pub fn new(motion: T, sensor: S) -> Self {
        Kalman { motion, sensor }
    }
}

impl<const N: usize, const M: usize, T, S> Filter<N> for Kalman<T, S, M>
where
    T: LinearMotion<N>,
    S: LinearSensor<N, M>,
{
    type Belief = Gaussian<N>;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<Gaussian<N>, FilterError> {
        self.sensor.birth(measurement, &self.motion.prior())
    }

    #[inline]
    fn predict(&self, belief: &mut Gaussian<N>, dt: f64) {
        *belief = predicted(&self.motion, belief, dt);
    }

    #[inline]
    fn update(
        &self,
        belief: &mut Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        correction::update(&self.sensor, belief, measurement)
    }

    #[inline]
    fn innovation(
        &self,
        belief: &Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        correction::innovation(&self.sensor, belief, measurement)
    }

    fn innovations(
        &self,
        belief: &Gaussian<N>,
        measurements: &[&Measurement<M>],
        found: &mut Vec<Result<Innovation, FilterError>>,
    ) {
        correction::compare_all(&self.sensor, belief, measurements, found);
    }

    fn associate(&self, belief: &mut Gaussian<N>, parts: &[(f64, &Measurement<M>)], none: f64) -> f64 {
        correction::associate(&self.sensor, belief, parts, none)
            .unwrap_or_else(|| one_by_one(self, belief, parts, none))
    }

    fn reach(&self, belief: &Gaussian<N>, search: &Search) -> Option<Region> {
        linear_reach(&self.sensor, belief, search)
    }

    gaussian_belief!(M);
}
