//! The steps that Kalman and extended filters share.

use nalgebra::{SMatrix, SVector};

use super::Innovation;
use crate::belief::{Cholesky, Gaussian, positive};
use crate::error::FilterError;
use crate::motion::Motion;
use crate::sensor::{Measurement, Reading, Sensor};

/// A measurement compared with a Gaussian belief through a linearised sensor.
pub(crate) struct Comparison<const N: usize, const M: usize> {
    residual: SVector<f64, M>,
    noise: SMatrix<f64, M, M>,
    jacobian: SMatrix<f64, M, N>,
    /// `P Hᵀ`, the covariance of state and reading.
    cross: SMatrix<f64, N, M>,
    factor: Cholesky<M>,
    pub innovation: Innovation,
}

impl<const N: usize, const M: usize> Comparison<N, M> {
    /// Compares `measurement` with what `sensor` would read of `belief`.
    // Inlined by force, as `condition` is: the parts would otherwise travel through memory, a quarter of the time of a step.
    #[inline(always)]
    pub fn new(
        sensor: &impl Sensor<N, M>,
        belief: &Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Self, FilterError> {
        Comparison::of_reading(sensor, belief, &sensor.read(measurement))
    }

    /// Compares a reading that was taken before, when many beliefs are compared with one measurement.
    #[inline(always)]
    pub fn of_reading(
        sensor: &impl Sensor<N, M>,
        belief: &Gaussian<N>,
        reading: &Reading<M>,
    ) -> Result<Self, FilterError> {
        let residual = sensor.difference(&reading.value, &sensor.expected(&belief.mean));
        if !residual.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "innovation" });
        }
        let jacobian = sensor.jacobian(&belief.mean);
        let cross = sensor.project(&belief.covariance, &jacobian);
        let factor = Cholesky::new(&(jacobian * cross + reading.noise), "innovation covariance")?;
        let nis = factor.mahalanobis(&residual);
        let innovation = Innovation::new(&residual, nis, factor.ln_density(nis));
        Ok(Comparison { residual, noise: reading.noise, jacobian, cross, factor, innovation })
    }

    /// Conditions the belief on the measurement, with the covariance in Joseph's form. On an error it stays as it was.
    #[inline(always)]
    pub fn condition(&self, sensor: &impl Sensor<N, M>, belief: &mut Gaussian<N>) -> Result<(), FilterError> {
        let gain = self.factor.right_solve(&self.cross);
        // (I - K H) P (I - K H)ᵀ + K R Kᵀ, with A = (I - K H) P = P - K (P Hᵀ)ᵀ computed once.
        let shrunk = belief.covariance - gain * self.cross.transpose();
        let mut covariance =
            shrunk - (sensor.project(&shrunk, &self.jacobian) - gain * self.noise) * gain.transpose();
        positive::symmetrise(&mut covariance);
        let mean = belief.mean + gain * self.residual;
        if !positive::is_definite(&covariance) {
            covariance = self.factored(belief, &gain)?;
        }
        if !mean.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "state mean" });
        }
        *belief = Gaussian { mean, covariance };
        Ok(())
    }

    /// The same covariance from a factor `L` of the old one, `(L - K H L)(L - K H L)ᵀ + K R Kᵀ`. Slower, but cancels only
    /// half as many digits, which saves a belief that was vague beside the measurement.
    #[cold]
    fn factored(
        &self,
        belief: &Gaussian<N>,
        gain: &SMatrix<f64, N, M>,
    ) -> Result<SMatrix<f64, N, N>, FilterError> {
        let lower = positive::root(&belief.covariance);
        let left = lower - gain * (self.jacobian * lower);
        let mut covariance = left * left.transpose() + gain * self.noise * gain.transpose();
        positive::settle(&mut covariance, "state covariance")?;
        Ok(covariance)
    }
}

/// The belief after `dt` by a motion, to first order.
#[inline(always)]
pub(crate) fn predicted<const N: usize>(
    motion: &impl Motion<N>,
    belief: &Gaussian<N>,
    dt: f64,
) -> Gaussian<N> {
    let mut next = motion.predict(belief, dt);
    positive::symmetrise(&mut next.covariance);
    if !positive::is_definite(&next.covariance) {
        next.covariance = spread(motion, belief, dt);
    }
    next
}

/// The predicted covariance from a factor of the old one, when a long step has left it singular up to rounding. What is not
/// finite stays so, for the next update to report.
#[cold]
fn spread<const N: usize>(motion: &impl Motion<N>, belief: &Gaussian<N>, dt: f64) -> SMatrix<f64, N, N> {
    let moved = motion.jacobian(&belief.mean, dt) * positive::root(&belief.covariance);
    let mut covariance = moved * moved.transpose() + motion.noise(&belief.mean, dt);
    let _ = positive::settle(&mut covariance, "state covariance");
    covariance
}
