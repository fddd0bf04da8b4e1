//! What a filter tells its user.

use nalgebra::{SMatrix, SVector};

use crate::belief::Gaussian;

/// A belief, reduced to what is reported of an object.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate<const N: usize> {
    /// Expected state.
    pub mean: SVector<f64, N>,
    /// Its covariance.
    pub covariance: SMatrix<f64, N, N>,
    /// Probability of each motion mode; empty for filters with one.
    pub modes: Vec<f64>,
}

impl<const N: usize> From<Gaussian<N>> for Estimate<N> {
    fn from(state: Gaussian<N>) -> Self {
        Estimate { mean: state.mean, covariance: state.covariance, modes: Vec::new() }
    }
}
