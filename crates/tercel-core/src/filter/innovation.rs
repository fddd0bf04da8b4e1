//! How well a measurement agreed with what was expected.

use nalgebra::SVector;

/// Components that an innovation can hold.
const CAPACITY: usize = 6;

/// The outcome of comparing a measurement with a belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// `ln p(z)`: logarithm of the density of the measurement under the belief, in the space of the measurement.
    pub log_likelihood: f64,
    /// Normalised innovation squared: `νᵀ S⁻¹ ν`, chi-square distributed with [`dof`](Innovation::dof) degrees of freedom
    /// when the filter is consistent.
    pub nis: f64,
    residual: [f64; CAPACITY],
    dof: u8,
}

impl Innovation {
    /// An innovation with this residual `ν`, its normalised square and its log-likelihood.
    ///
    /// At most six components; a longer residual does not compile.
    pub fn new<const M: usize>(residual: &SVector<f64, M>, nis: f64, log_likelihood: f64) -> Self {
        const { assert!(M <= CAPACITY, "an innovation holds at most six components") };
        let mut components = [0.0; CAPACITY];
        components[..M].copy_from_slice(residual.as_slice());
        Innovation { log_likelihood, nis, residual: components, dof: M as u8 }
    }

    /// The innovation `ν`: measured minus expected, in the components of the sensor's reading.
    pub fn residual(&self) -> &[f64] {
        &self.residual[..usize::from(self.dof)]
    }

    /// Number of components of the measurement.
    pub fn dof(&self) -> usize {
        usize::from(self.dof)
    }
}
