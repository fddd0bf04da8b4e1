//! Motion from which a next state can be drawn.

use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Motion;
use crate::belief::{Gaussian, positive};

/// A model of how a state of `N` components moves, of which all that is asked is a random next state: what particles need.
///
/// Every [`Motion`] is one, with its mean map and Gaussian noise. Others carry a memory beside the state: the mode that a target is
/// in, or what a network remembers of it.
pub trait Sampled<const N: usize> {
    /// What a particle carries beside its state.
    type Memory: Clone;

    /// What is believed of a new object before it is measured: as [`Motion::prior`].
    fn prior(&self) -> Gaussian<N>;

    /// The memory of a new particle.
    fn start(&self, random: &mut ChaCha8Rng) -> Self::Memory;

    /// Moves particles on by `dt` seconds, each by chance. There are as many memories as states. All particles of an object
    /// come in one call, so that models which work faster on batches can.
    fn sample(
        &self,
        states: &mut [SVector<f64, N>],
        memories: &mut [Self::Memory],
        dt: f64,
        random: &mut ChaCha8Rng,
    );
}

impl<const N: usize, T: Motion<N>> Sampled<N> for T {
    type Memory = ();

    fn prior(&self) -> Gaussian<N> {
        Motion::prior(self)
    }

    fn start(&self, _: &mut ChaCha8Rng) {}

    fn sample(&self, states: &mut [SVector<f64, N>], _: &mut [()], dt: f64, random: &mut ChaCha8Rng) {
        let mut noise = Noise::default();
        for state in states {
            *state = noise.moved(self, state, dt, random);
        }
    }
}

/// The root of a process noise. Most motions have the same noise everywhere; the root is taken again only where it differs.
pub(crate) struct Noise<const N: usize> {
    covariance: SMatrix<f64, N, N>,
    root: SMatrix<f64, N, N>,
}

impl<const N: usize> Default for Noise<N> {
    fn default() -> Self {
        Noise { covariance: SMatrix::zeros(), root: SMatrix::zeros() }
    }
}

impl<const N: usize> Noise<N> {
    /// A state after `dt`, with noise.
    pub fn moved(
        &mut self,
        motion: &(impl Motion<N> + ?Sized),
        state: &SVector<f64, N>,
        dt: f64,
        random: &mut ChaCha8Rng,
    ) -> SVector<f64, N> {
        let here = motion.noise(state, dt);
        if here != self.covariance {
            (self.covariance, self.root) = (here, positive::root(&here));
        }
        let normal = SVector::<f64, N>::from_fn(|_, _| StandardNormal.sample(random));
        motion.transition(state, dt) + self.root * normal
    }
}
