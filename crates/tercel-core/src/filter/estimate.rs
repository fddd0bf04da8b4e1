//! What a filter tells its user.

use nalgebra::{Matrix2, SMatrix, SVector};

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
    /// Extent matrix (m²) of an extended object: its eigenvalues are the squares of the semi-axes. `None` for filters of points.
    pub extent: Option<Matrix2<f64>>,
}

impl<const N: usize> From<Gaussian<N>> for Estimate<N> {
    fn from(state: Gaussian<N>) -> Self {
        Estimate { mean: state.mean, covariance: state.covariance, modes: Vec::new(), extent: None }
    }
}
