//! A model of a smaller state beside models of a larger one.

use nalgebra::{SMatrix, SVector};

use super::{LinearMotion, Motion};
use crate::belief::Gaussian;

/// Moves the first `K` components of a state as a model of that size says, and holds the others at zero.
///
/// ## Model
/// ```text
/// x' = (f(x_K), 0)        with noise covariance diag(Q_K, σ² I)
/// ```
///
/// ## Use it when
/// modes of an IMM have states of different length, and their filters take a motion:
/// [`filter::Padded`](crate::filter::Padded) does the same for a whole filter with a Gaussian belief. The
/// deviation says how far the missing components may be from zero while this mode holds.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 11.6.7, on models of different dimension.
///
/// ```
/// use nalgebra::{SVector, vector};
/// use tercel_core::motion::{ConstantVelocity, Motion, PaddedMotion};
///
/// let straight = PaddedMotion::<_, 4>::new(ConstantVelocity::new(0.1), 2.0);
/// let after: SVector<f64, 6> = straight.transition(&vector![0.0, 0.0, 3.0, 1.0, 9.0, 9.0], 2.0);
/// assert_eq!(after, vector![6.0, 2.0, 3.0, 1.0, 0.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaddedMotion<T, const K: usize> {
    motion: T,
    variance: f64,
}

impl<T, const K: usize> PaddedMotion<T, K> {
    /// A model of the first `K` components, and the standard deviation of each missing one, in its own unit.
    pub fn new(motion: T, deviation: f64) -> Self {
        PaddedMotion { motion, variance: deviation * deviation }
    }

    /// A matrix with this leading block, and this value on the rest of the diagonal.
    fn whole<const N: usize>(block: &SMatrix<f64, K, K>, rest: f64) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|i, j| match (i < K && j < K, i == j) {
            (true, _) => block[(i, j)],
            (false, true) => rest,
            (false, false) => 0.0,
        })
    }
}

fn leading<const N: usize, const K: usize>(state: &SVector<f64, N>) -> SVector<f64, K> {
    const { assert!(K <= N, "the state of a padded model cannot be longer than the whole") };
    SVector::from_fn(|i, _| state[i])
}

impl<const N: usize, const K: usize, T: Motion<K>> Motion<N> for PaddedMotion<T, K> {
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N> {
        if dt == 0.0 {
            return *state;
        }
        let moved = self.motion.transition(&leading(state), dt);
        SVector::from_fn(|i, _| if i < K { moved[i] } else { 0.0 })
    }

    fn jacobian(&self, state: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        let rest = if dt == 0.0 { 1.0 } else { 0.0 };
        PaddedMotion::<T, K>::whole(&self.motion.jacobian(&leading(state), dt), rest)
    }

    fn noise(&self, state: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        let rest = if dt == 0.0 { 0.0 } else { self.variance };
        PaddedMotion::<T, K>::whole(&self.motion.noise(&leading(state), dt), rest)
    }

    fn prior(&self) -> Gaussian<N> {
        let Gaussian { mean, covariance } = self.motion.prior();
        Gaussian {
            mean: SVector::from_fn(|i, _| if i < K { mean[i] } else { 0.0 }),
            covariance: PaddedMotion::<T, K>::whole(&covariance, self.variance),
        }
    }
}

impl<const N: usize, const K: usize, T: LinearMotion<K>> LinearMotion<N> for PaddedMotion<T, K> {}
