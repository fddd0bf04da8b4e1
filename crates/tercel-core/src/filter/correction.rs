//! The update that Kalman and extended filters share.

use nalgebra::{SMatrix, SVector};

use super::Innovation;
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;
use crate::sensor::{Measurement, Sensor};

/// A measurement compared with a Gaussian belief through a linearised sensor.
pub(super) struct Comparison<const N: usize, const M: usize> {
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
    #[inline]
    pub fn new(
        sensor: &impl Sensor<N, M>,
        belief: &Gaussian<N>,
        measurement: &Measurement<M>,
    ) -> Result<Self, FilterError> {
        let reading = sensor.read(measurement);
        let residual = sensor.difference(&reading.value, &sensor.expected(&belief.mean));
        if !residual.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "innovation" });
        }
        let jacobian = sensor.jacobian(&belief.mean);
        let cross = belief.covariance * jacobian.transpose();
        let factor = Cholesky::new(&(jacobian * cross + reading.noise), "innovation covariance")?;
        let nis = factor.mahalanobis(&residual);
        let innovation = Innovation::new(&residual, nis, factor.ln_density(nis));
        Ok(Comparison { residual, noise: reading.noise, jacobian, cross, factor, innovation })
    }

    /// The belief conditioned on the measurement, with the covariance in Joseph's form.
    #[inline]
    pub fn posterior(&self, belief: &Gaussian<N>) -> Result<Gaussian<N>, FilterError> {
        let gain = self.factor.right_solve(&self.cross);
        // (I - K H) P (I - K H)ᵀ + K R Kᵀ, with A = (I - K H) P = P - K (P Hᵀ)ᵀ computed once.
        let shrunk = belief.covariance - gain * self.cross.transpose();
        let covariance = shrunk - (shrunk * self.jacobian.transpose() - gain * self.noise) * gain.transpose();
        let mut posterior = Gaussian { mean: belief.mean + gain * self.residual, covariance };
        posterior.settle()?;
        Ok(posterior)
    }
}
