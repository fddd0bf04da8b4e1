//! Motion that jumps between models, drawn particle by particle.

use nalgebra::SVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::Transition;
use super::transition::Chain;
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::motion::{Motion, Noise, Sampled};

/// A motion that changes between models by a Markov chain, for particles: each carries the mode that it is in.
///
/// ## Definition
/// ```text
/// r' ~ Π(r, .) over dt        x' = f(x; r') + L ε,    L Lᵀ = Q(x; r')
/// ```
/// The first mode of a particle is any, with equal chance.
///
/// ## Use it when
/// a [`Particle`](super::Particle) filter, or a tracker with clouds of particles, is to follow manoeuvres. Where beliefs are nearly
/// Gaussian an [`Imm`](super::Imm) says the same with far less work.
///
/// ## Reference
/// McGinnity and Irwin (2000), "Multiple model bootstrap filter for maneuvering target tracking"; the jump-Markov system of
/// Punithakumar, Kirubarajan and Sinha (2008), whose multiple-model PHD filter is [`Phd`](crate::multi::Phd) with this.
///
/// ```
/// use tercel_core::filter::{Filter, JumpMarkov, Particle, Particles, Transition};
/// use tercel_core::motion::Turn;
/// use tercel_core::sensor::Position;
///
/// let turns = [0.0, 0.1, -0.1].map(|rate| Turn::new(rate, 0.1));
/// let motion = JumpMarkov::new(turns, Transition::sticky(0.95).per(1.0))?;
/// let filter = Particle::new(motion, Position::<2>::new(5.0)?, 1000, 7)?;
/// let mut belief: Particles<4, usize> = filter.birth(&[0.0, 0.0].into())?;
/// filter.predict(&mut belief, 1.0);
/// assert!(belief.memories().iter().all(|mode| *mode < 3));
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct JumpMarkov<T> {
    motions: Vec<T>,
    chain: Chain,
}

impl<T> JumpMarkov<T> {
    /// Models, one per mode, and how the object changes between them.
    ///
    /// # Errors
    /// When there is no model, or the transition is not one between this many modes.
    pub fn new(motions: impl IntoIterator<Item = T>, transition: Transition) -> Result<Self, FilterError> {
        let motions: Vec<T> = motions.into_iter().collect();
        if motions.is_empty() {
            let (parameter, expected) = ("number of modes", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        let chain = transition.chain(motions.len())?;
        Ok(JumpMarkov { motions, chain })
    }
}

impl<const N: usize, T: Motion<N>> Sampled<N> for JumpMarkov<T> {
    type Memory = usize;

    /// That of the first mode.
    fn prior(&self) -> Gaussian<N> {
        Motion::prior(&self.motions[0])
    }

    fn start(&self, random: &mut ChaCha8Rng) -> usize {
        random.random_range(0..self.motions.len())
    }

    fn sample(
        &self,
        states: &mut [SVector<f64, N>],
        memories: &mut [usize],
        dt: f64,
        random: &mut ChaCha8Rng,
    ) {
        if dt != 0.0 {
            self.chain.leap(dt, &mut Vec::new(), |leap| {
                for mode in memories.iter_mut() {
                    let value = *mode / leap.stride % leap.modes;
                    let next = drawn(&leap.probabilities[value * leap.modes..][..leap.modes], random);
                    *mode = *mode - value * leap.stride + next * leap.stride;
                }
            });
        }
        let mut noises: Vec<Noise<N>> = self.motions.iter().map(|_| Noise::default()).collect();
        for (state, mode) in states.iter_mut().zip(memories) {
            *state = noises[*mode].moved(&self.motions[*mode], state, dt, random);
        }
    }
}

/// The number of an outcome, with these probabilities.
fn drawn(probabilities: &[f64], random: &mut ChaCha8Rng) -> usize {
    let mut left: f64 = random.random();
    for (outcome, probability) in probabilities.iter().enumerate() {
        left -= probability;
        if left < 0.0 {
            return outcome;
        }
    }
    // Probabilities add up to one only up to rounding.
    probabilities.len() - 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{Filter, Particle, Particles};
    use crate::motion::Turn;
    use crate::sensor::{Measurement, Position};

    #[test]
    fn the_modes_of_the_particles_tell_the_turn() {
        let turns = [0.0, 0.15, -0.15].map(|rate| Turn::new(rate, 0.2));
        let motion = JumpMarkov::new(turns, Transition::sticky(0.95).per(1.0)).unwrap();
        let filter = Particle::new(motion, Position::<2>::new(5.0).unwrap(), 2000, 3).unwrap();
        let circle = |step: i32| {
            let (sine, cosine) = (0.15 * f64::from(step)).sin_cos();
            Measurement::from([200.0 * cosine, 200.0 * sine])
        };
        let mut belief: Particles<4, usize> = filter.birth(&circle(0)).unwrap();
        for step in 1..25 {
            filter.predict(&mut belief, 1.0);
            filter.update(&mut belief, &circle(step)).unwrap();
        }
        let left = belief.memories().iter().zip(belief.ln_weights());
        let left: f64 = left.filter(|(mode, _)| **mode == 1).map(|(_, weight)| weight.exp()).sum();
        assert!(left > 0.7, "{left}");
        let error = filter.state(&belief).mean.xy() - circle(24).value;
        assert!(error.norm() < 8.0, "{error}");
    }

    #[test]
    fn no_models_are_refused() {
        assert!(JumpMarkov::<Turn>::new([], Transition::sticky(0.9)).is_err());
    }
}
