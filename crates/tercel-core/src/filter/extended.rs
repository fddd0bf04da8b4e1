//! The extended Kalman filter.

use super::correction::{self, predicted};
use super::gaussian::{gaussian_belief, linear_reach};
use super::{Filter, Innovation, one_by_one};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::motion::Motion;
use crate::sensor::{Measurement, Sensor};

/// Estimates the state of an object whose motion or sensor is smooth but not linear, by linearising both at
/// the mean.
///
/// ## Recursion
/// That of the [`Kalman`](super::Kalman) filter, with `x⁻ = f(x)`, `F = ∂f/∂x`, `ν = z ⊖ h(x⁻)` and `H =
/// ∂h/∂x` at the predicted mean; `⊖` wraps angles.
///
/// ## Use it when
/// the sensor is polar or the turn rate is estimated, and the state is known well against the curvature.
/// Bearing-only starts and wide cross-range errors call for an unscented or a particle filter.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 10.3.2 (first order), with the update in Joseph's form.
///
/// ```
/// use tercel_core::{belief::Gaussian, filter::{Extended, Filter}, motion::ConstantVelocity, sensor::RangeBearing};
///
/// let filter = Extended::new(ConstantVelocity::new(1.0), RangeBearing::new(20.0, 0.005)?);
/// let mut belief: Gaussian<4> = filter.birth(&[5_000.0, 3.14].into())?;
/// filter.predict(&mut belief, 2.0);
/// let innovation = filter.update(&mut belief, &[5_000.0, -3.14].into())?;
/// assert!(innovation.residual()[1] < 0.004); // across the cut, not around the world
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extended<T, S, const M: usize = 2> {
    /// How the object moves.
    pub motion: T,
    /// What is measured of it.
    pub sensor: S,
}

impl<T, S, const M: usize> Extended<T, S, M> {
    /// An extended Kalman filter of this motion and this sensor.
    pub fn new(motion: T, sensor: S) -> Self {
        Extended { motion, sensor }
    }
}

impl<const N: usize, const M: usize, T, S> Filter<N> for Extended<T, S, M>
where
    T: Motion<N>,
    S: Sensor<N, M>,
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
