//! Motion by chance.

use nalgebra::{SMatrix, SVector};

use super::{LinearMotion, Motion};
use crate::belief::Gaussian;

/// Drifts without direction: each component gathers independent noise.
///
/// State: any components.
///
/// ## Model
/// ```text
/// x' = x        Q = q dt I
/// ```
///
/// ## Use it when
/// objects dwell or wander (animals, people indoors, drifting buoys), or for slowly varying parameters.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 6.2.1 (the Wiener process).
///
/// ```
/// use tercel_core::motion::{Motion, RandomWalk};
/// use nalgebra::vector;
///
/// let drift = RandomWalk::new(0.1);
/// assert_eq!(drift.noise(&vector![0.0, 0.0], 5.0)[(0, 0)], 0.5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomWalk {
    density: f64,
}

impl RandomWalk {
    /// Spectral density `density` of the velocity noise, m²/s per axis.
    pub fn new(density: f64) -> Self {
        RandomWalk { density }
    }
}

impl<const N: usize> Motion<N> for RandomWalk {
    fn transition(&self, state: &SVector<f64, N>, _: f64) -> SVector<f64, N> {
        *state
    }

    fn jacobian(&self, _: &SVector<f64, N>, _: f64) -> SMatrix<f64, N, N> {
        SMatrix::identity()
    }

    fn noise(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        SMatrix::identity() * (self.density * dt.abs())
    }

    fn prior(&self) -> Gaussian<N> {
        Gaussian { mean: SVector::zeros(), covariance: SMatrix::identity() }
    }

    #[inline]
    fn predict(&self, belief: &Gaussian<N>, dt: f64) -> Gaussian<N> {
        let mut next = *belief;
        for i in 0..N {
            next.covariance[(i, i)] += self.density * dt.abs();
        }
        next
    }
}

impl<const N: usize> LinearMotion<N> for RandomWalk {}
