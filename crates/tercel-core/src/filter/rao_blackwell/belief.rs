//! Weighted histories of motion, each with the state that follows from it.

use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::sampling;
use crate::belief::{Cholesky, Gaussian, positive};

/// One guess at how an object has moved so far, and its state if the guess is right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hypothesis<P, const N: usize> {
    /// Parameters of the motion now.
    pub parameters: P,
    /// The state, given the whole history of these parameters and all measurements.
    pub state: Gaussian<N>,
}

/// What a [`RaoBlackwellised`](super::RaoBlackwellised) filter knows of one object: weighted guesses at the parameters of its
/// motion, a Gaussian for each, and the generator that moves them on.
#[derive(Debug, PartialEq)]
pub struct Hypotheses<P, const N: usize> {
    particles: Vec<Hypothesis<P, N>>,
    /// Logarithms of the weights, which add up to one.
    weights: Vec<f64>,
    random: ChaCha8Rng,
    room: Room<P, N>,
}

/// Room for the next particles and weights: a step does not allocate.
#[derive(Debug, PartialEq)]
struct Room<P, const N: usize> {
    particles: Vec<Hypothesis<P, N>>,
    weights: Vec<f64>,
}

impl<P: Clone, const N: usize> Clone for Hypotheses<P, N> {
    fn clone(&self) -> Self {
        Hypotheses {
            particles: self.particles.clone(),
            weights: self.weights.clone(),
            random: self.random.clone(),
            room: Room { particles: Vec::new(), weights: Vec::new() },
        }
    }

    // Trackers copy beliefs into buffers of the last scan; their room is used again.
    fn clone_from(&mut self, source: &Self) {
        self.particles.clone_from(&source.particles);
        self.weights.clone_from(&source.weights);
        self.random.clone_from(&source.random);
    }
}

impl<P, const N: usize> Hypotheses<P, N> {
    /// The particles.
    pub fn particles(&self) -> &[Hypothesis<P, N>] {
        &self.particles
    }

    /// Natural logarithms of the weights, in the order of the particles; the weights add up to one.
    pub fn ln_weights(&self) -> &[f64] {
        &self.weights
    }

    /// The particles with their weights.
    pub fn weighted(&self) -> impl Iterator<Item = (f64, &Hypothesis<P, N>)> {
        self.weights.iter().map(|weight| weight.exp()).zip(&self.particles)
    }

    /// Number of equally weighted particles that would say as much: `1 / Σ wᵢ²`.
    pub fn effective(&self) -> f64 {
        sampling::effective(&self.weights)
    }

    /// Equally weighted particles.
    pub(super) fn even(particles: Vec<Hypothesis<P, N>>, random: ChaCha8Rng) -> Self {
        let count = particles.len();
        let room = Room { particles: Vec::with_capacity(count), weights: Vec::with_capacity(count) };
        Hypotheses { particles, weights: vec![-(count as f64).ln(); count], random, room }
    }

    /// The particles and the generator, to move them on.
    pub(super) fn moving(&mut self) -> (&mut [Hypothesis<P, N>], &mut ChaCha8Rng) {
        (&mut self.particles, &mut self.random)
    }

    /// Lets `each` correct every state and say the logarithm of its new weight. The weights are kept aside until they are
    /// [accepted](Self::accept).
    pub(super) fn correct(&mut self, mut each: impl FnMut(f64, &mut Gaussian<N>) -> f64) {
        self.room.weights.clear();
        let particles = self.particles.iter_mut().zip(&self.weights);
        self.room.weights.extend(particles.map(|(particle, weight)| each(*weight, &mut particle.state)));
    }

    /// Takes the weights of the last correction, divided by their sum.
    pub(super) fn accept(&mut self, ln_sum: f64) {
        std::mem::swap(&mut self.weights, &mut self.room.weights);
        self.weights.iter_mut().for_each(|weight| *weight -= ln_sum);
    }

    /// Mean and covariance of the mixture. Rounding that makes a covariance indefinite is repaired.
    pub(super) fn moments(&self) -> Gaussian<N> {
        // Means are taken around the first: nothing is lost when they hardly differ.
        let origin = self.particles.first().map_or_else(SVector::zeros, |first| first.state.mean);
        let (mut shift, mut total) = (SVector::<f64, N>::zeros(), 0.0);
        for (weight, particle) in self.weighted() {
            shift += (particle.state.mean - origin) * weight;
            total += weight;
        }
        shift /= total;
        let mut covariance = SMatrix::zeros();
        for (weight, particle) in self.weighted() {
            let difference = particle.state.mean - origin - shift;
            let share = weight / total;
            covariance += particle.state.covariance * share + difference * (difference * share).transpose();
        }
        // What is not finite stays so, for the next update to report.
        let _ = positive::settle(&mut covariance, "covariance of particles");
        Gaussian { mean: origin + shift, covariance }
    }

    /// Moves and stretches the mixture to this mean and covariance. One that has no extent to stretch collapses to it.
    pub(super) fn reshape(&mut self, target: &Gaussian<N>) {
        let current = self.moments();
        let to = positive::root(&target.covariance);
        let Ok(from) = Cholesky::new(&current.covariance, "covariance of particles") else {
            self.particles.iter_mut().for_each(|particle| particle.state = *target);
            return;
        };
        for Hypothesis { state, .. } in &mut self.particles {
            state.mean = target.mean + to * from.whiten(&(state.mean - current.mean));
            let old = positive::root(&state.covariance);
            let mut root = SMatrix::<f64, N, N>::zeros();
            for j in 0..N {
                root.set_column(j, &(to * from.whiten(&old.column(j).into_owned())));
            }
            state.covariance = root * root.transpose();
            let _ = positive::settle(&mut state.covariance, "state covariance");
        }
    }
}

impl<P: Clone, const N: usize> Hypotheses<P, N> {
    /// Draws `count` particles with a chance equal to their weight, from these particles and those of another belief, whose
    /// weights count this share against the rest.
    pub(super) fn resample(&mut self, count: usize, other: Option<(&Self, f64)>) {
        let share = 1.0 - other.map_or(0.0, |(_, share)| share);
        let others = other.into_iter().flat_map(|(belief, share)| {
            belief.weighted().map(move |(weight, particle)| (share * weight, particle))
        });
        let own = self.weights.iter().map(|weight| share * weight.exp()).zip(&self.particles);
        let offset = self.random.random();
        sampling::resample(own.chain(others), offset, count, &mut self.room.particles);
        std::mem::swap(&mut self.particles, &mut self.room.particles);
        self.weights.clear();
        self.weights.resize(count, -(count as f64).ln());
    }
}
