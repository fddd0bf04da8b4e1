//! Weighted states, and what becomes of them.

use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::belief::{Cholesky, Gaussian, positive};
use crate::filter::sampling;

/// What a [`Particle`](super::Particle) filter knows of one object: weighted states, and the generator that moves them on.
#[derive(Debug, PartialEq)]
pub struct Particles<const N: usize, U = ()> {
    pub(super) states: Vec<SVector<f64, N>>,
    /// What the motion carries with each.
    pub(super) memories: Vec<U>,
    /// Logarithms of the weights, which add up to one.
    pub(super) weights: Vec<f64>,
    pub(super) random: ChaCha8Rng,
    pub(super) room: Room<N, U>,
}

/// Room for the next states and weights: a step does not allocate.
#[derive(Debug, PartialEq)]
pub(super) struct Room<const N: usize, U> {
    states: Vec<SVector<f64, N>>,
    memories: Vec<U>,
    pub(super) weights: Vec<f64>,
    /// Numbers of particles, and those that are drawn.
    numbers: Vec<usize>,
    chosen: Vec<usize>,
}

impl<const N: usize, U> Room<N, U> {
    pub(super) fn new(count: usize) -> Self {
        Room {
            states: Vec::with_capacity(count),
            memories: Vec::with_capacity(count),
            weights: Vec::with_capacity(count),
            numbers: Vec::with_capacity(count),
            chosen: Vec::with_capacity(count),
        }
    }
}

impl<const N: usize, U: Clone> Clone for Particles<N, U> {
    fn clone(&self) -> Self {
        let room = Room::new(0);
        Particles {
            states: self.states.clone(),
            memories: self.memories.clone(),
            weights: self.weights.clone(),
            random: self.random.clone(),
            room,
        }
    }

    // Trackers copy beliefs into buffers of the last scan; their room is used again.
    fn clone_from(&mut self, source: &Self) {
        self.states.clone_from(&source.states);
        self.memories.clone_from(&source.memories);
        self.weights.clone_from(&source.weights);
        self.random.clone_from(&source.random);
    }
}

impl<const N: usize, U: Clone> Particles<N, U> {
    /// What the motion carries with each particle.
    pub fn memories(&self) -> &[U] {
        &self.memories
    }

    /// The particles.
    pub fn states(&self) -> &[SVector<f64, N>] {
        &self.states
    }

    /// Natural logarithms of the weights, in the order of the particles; the weights add up to one.
    pub fn ln_weights(&self) -> &[f64] {
        &self.weights
    }

    /// Number of equally weighted particles that would say as much: `1 / Σ wᵢ²`.
    pub fn effective(&self) -> f64 {
        sampling::effective(&self.weights)
    }

    pub(super) fn weighted(&self) -> impl Iterator<Item = (f64, &SVector<f64, N>)> {
        self.weights.iter().map(|weight| weight.exp()).zip(&self.states)
    }

    /// Mean and covariance. Rounding that makes a covariance indefinite is repaired.
    pub(super) fn moments(&self) -> Gaussian<N> {
        let mut mean = SVector::zeros();
        for (weight, state) in self.weighted() {
            mean += state * weight;
        }
        let mut covariance = SMatrix::zeros();
        for (weight, state) in self.weighted() {
            let difference = state - mean;
            covariance += difference * difference.transpose() * weight;
        }
        // A cloud that has shrunk to a point has no covariance to repair, and keeps its zeros.
        let _ = positive::settle(&mut covariance, "covariance of particles");
        Gaussian { mean, covariance }
    }

    /// Draws `count` particles with a chance equal to their weight, each about as often as it should be, from these particles
    /// and those of `other`, whose weights count `other_share` against the rest.
    pub(super) fn resample(&mut self, count: usize, other: Option<(&Particles<N, U>, f64)>) {
        let share = 1.0 - other.map_or(0.0, |(_, share)| share);
        let own = self.states.len();
        let all = own + other.map_or(0, |(particles, _)| particles.states.len());
        let Room { states, memories, numbers, chosen, .. } = &mut self.room;
        // Numbers from `own` on are those of the other particles.
        numbers.clear();
        numbers.extend(0..all);
        let weights = self.weights.iter().map(|weight| share * weight.exp());
        let others = other
            .into_iter()
            .flat_map(|(particles, share)| particles.weights.iter().map(move |weight| share * weight.exp()));
        let offset = self.random.random();
        sampling::resample(weights.chain(others).zip(&*numbers), offset, count, chosen);
        states.clear();
        memories.clear();
        for &number in &*chosen {
            let (source, place) = match other {
                Some((particles, _)) if number >= own => {
                    ((&particles.states, &particles.memories), number - own)
                }
                _ => ((&self.states, &self.memories), number),
            };
            states.push(source.0[place]);
            memories.push(source.1[place].clone());
        }
        std::mem::swap(&mut self.states, states);
        std::mem::swap(&mut self.memories, memories);
        self.weights.clear();
        self.weights.resize(count, -(count as f64).ln());
    }

    /// Spreads the particles by a share of the width of the cloud, without changing its mean and covariance.
    pub(super) fn smooth(&mut self, share: f64) {
        let Gaussian { mean, covariance } = self.moments();
        let (keep, root) = ((1.0 - share * share).sqrt(), positive::root(&covariance) * share);
        for state in &mut self.states {
            *state = mean + (*state - mean) * keep + root * normal(&mut self.random);
        }
    }

    /// Moves and stretches the cloud to this mean and covariance. One that has no extent to stretch is drawn anew.
    pub(super) fn reshape(&mut self, target: &Gaussian<N>) {
        let current = self.moments();
        if let Some(from) = extent(&current) {
            let to = positive::root(&target.covariance);
            for state in &mut self.states {
                *state = target.mean + to * from.whiten(&(*state - current.mean));
            }
            return;
        }
        self.draw(target);
    }

    /// Draws all particles anew.
    pub(super) fn draw(&mut self, target: &Gaussian<N>) {
        let root = positive::root(&target.covariance);
        for state in &mut self.states {
            *state = target.mean + root * normal(&mut self.random);
        }
        let even = -(self.states.len() as f64).ln();
        self.weights.fill(even);
    }
}

/// A factor of the covariance of a cloud, if it extends in every direction by more than rounding explains.
fn extent<const N: usize>(cloud: &Gaussian<N>) -> Option<Cholesky<N>> {
    let factor = Cholesky::new(&cloud.covariance, "covariance of particles").ok()?;
    let real = |i: usize| {
        let (width, variance) = (factor.lower()[(i, i)], cloud.covariance[(i, i)]);
        width * width > 1e-12 * variance && width > 1e-12 * cloud.mean[i].abs()
    };
    (0..N).all(real).then_some(factor)
}

/// A vector of independent standard normal components.
pub(super) fn normal<const N: usize>(random: &mut ChaCha8Rng) -> SVector<f64, N> {
    SVector::from_fn(|_, _| StandardNormal.sample(random))
}
