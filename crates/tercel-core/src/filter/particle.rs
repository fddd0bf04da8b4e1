//! The bootstrap particle filter.

use nalgebra::{SMatrix, SVector, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::correction::Comparison;
use super::{Filter, Innovation, sampling};
use crate::belief::{Cholesky, Gaussian, positive};
use crate::error::FilterError;
use crate::motion::Sampled;
use crate::sensor::{Aged, Measurement, Reading, Sensor};

/// Estimates the state of an object by many weighted guesses, for motion and sensors of any shape.
///
/// ## Recursion
/// ```text
/// birth     xᵢ ~ N(birth of the sensor)                   wᵢ = 1/n
/// predict   xᵢ ← f(xᵢ) + L εᵢ                             L Lᵀ = Q(xᵢ), εᵢ standard normal
/// update    wᵢ ← wᵢ N(z ⊖ h(xᵢ); 0, R)                    ln p(z) = ln Σ wᵢ N(..), then normalise
/// resample  systematically, when 1 / Σ wᵢ² < τ n          wᵢ = 1/n
/// ```
/// The normalised innovation squared compares the measurement with mean and covariance of the particles' readings.
///
/// ## Randomness
/// Every belief carries its generator. At birth it is seeded from the seed of the filter and the measurement, so the same
/// steps give the same result on any machine and in any order of objects. A copy of a belief continues with the same random
/// numbers as the original: two hypotheses of one object differ by what they saw, not by luck.
///
/// ## Use it when
/// beliefs are far from Gaussian: bearings only, several modes, sharp limits. It needs some thousand particles for a state of
/// four components and many more for six; with process noise that is small against the belief few particles survive the
/// first updates, and the covariance comes out too small: see [`with_smoothing`](Particle::with_smoothing).
///
/// ## Reference
/// Gordon, Salmond and Smith (1993), algorithm of section 3; systematic resampling of Kitagawa (1996), appendix.
/// Deviations: weights in the log domain; resampling only below a number of effective particles (Liu and Chen (1998)); smoothing, when asked for, as Liu and West
/// (2001), section 10.3; the Gaussian beginning, when asked for ([`with_tentative`](Particle::with_tentative)), is a step of Kotecha
/// and Djurić (2003).
///
/// ```
/// use tercel_core::{filter::{Filter, Particle}, motion::ConstantVelocity, sensor::RangeBearing};
///
/// let filter = Particle::new(ConstantVelocity::new(1.0), RangeBearing::new(20.0, 0.02)?, 1000, 7)?;
/// let mut belief = filter.birth(&[5_000.0, 0.3].into())?;
/// filter.predict(&mut belief, 2.0);
/// filter.update(&mut belief, &[5_010.0, 0.31].into())?;
/// assert_eq!(belief.states().len(), 1000);
/// # let state: tercel_core::belief::Gaussian<4> = filter.state(&belief);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Particle<T, S, const M: usize = 2> {
    /// How the object moves.
    pub motion: T,
    /// What is measured of it.
    pub sensor: S,
    count: usize,
    seed: u64,
    threshold: f64,
    smoothing: f64,
    tentative: usize,
}

/// What a [`Particle`] filter knows of one object: weighted states, and the generator that moves them on.
#[derive(Debug, PartialEq)]
pub struct Particles<const N: usize, U = ()> {
    states: Vec<SVector<f64, N>>,
    /// What the motion carries with each.
    memories: Vec<U>,
    /// Logarithms of the weights, which add up to one.
    weights: Vec<f64>,
    random: ChaCha8Rng,
    room: Room<N, U>,
}

/// Room for the next states and weights: a step does not allocate.
#[derive(Debug, PartialEq)]
struct Room<const N: usize, U> {
    states: Vec<SVector<f64, N>>,
    memories: Vec<U>,
    weights: Vec<f64>,
    /// Numbers of particles, and those that are drawn.
    numbers: Vec<usize>,
    chosen: Vec<usize>,
}

impl<const N: usize, U> Room<N, U> {
    fn new(count: usize) -> Self {
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

    fn weighted(&self) -> impl Iterator<Item = (f64, &SVector<f64, N>)> {
        self.weights.iter().map(|weight| weight.exp()).zip(&self.states)
    }

    /// Mean and covariance. Rounding that makes a covariance indefinite is repaired.
    fn moments(&self) -> Gaussian<N> {
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
    fn resample(&mut self, count: usize, other: Option<(&Particles<N, U>, f64)>) {
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
    fn smooth(&mut self, share: f64) {
        let Gaussian { mean, covariance } = self.moments();
        let (keep, root) = ((1.0 - share * share).sqrt(), positive::root(&covariance) * share);
        for state in &mut self.states {
            *state = mean + (*state - mean) * keep + root * normal(&mut self.random);
        }
    }

    /// Moves and stretches the cloud to this mean and covariance. One that has no extent to stretch is drawn anew.
    fn reshape(&mut self, target: &Gaussian<N>) {
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
    fn draw(&mut self, target: &Gaussian<N>) {
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

/// Fewest particles of a filter.
const FEWEST: usize = 10;

impl<T, S, const M: usize> Particle<T, S, M> {
    /// A filter of `count` particles per object, with this seed for its random numbers.
    ///
    /// # Errors
    /// When `count` is below 10.
    pub fn new(motion: T, sensor: S, count: usize, seed: u64) -> Result<Self, FilterError> {
        if count < FEWEST {
            let (parameter, expected) = ("number of particles", "must be at least 10");
            return Err(FilterError::Parameter { parameter, value: count as f64, expected });
        }
        Ok(Particle { motion, sensor, count, seed, threshold: 0.5, smoothing: 0.0, tentative: count })
    }

    /// Sets the share of effective particles below which they are resampled; 0 never does, 1 always. The default is 0.5.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn with_threshold(self, threshold: f64) -> Result<Self, FilterError> {
        Ok(Particle { threshold: FilterError::probability("resampling threshold", threshold)?, ..self })
    }

    /// Spreads the copies that resampling makes: each moves by a normal error of this share of the cloud's width, and the cloud
    /// shrinks by as much, so that its mean and covariance stay. The default is 0, the plain filter.
    ///
    /// Particles then cannot run out when the process noise is small, at the price of blurring what the cloud's shape has finer
    /// than this share; 0.2 to 0.35 suits most problems. On a vague birth followed by accurate positions, 6,000 particles with 0.35
    /// are consistent (NEES inside its 99 % bounds) where 12,000 plain ones are too sure by half.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn with_smoothing(self, share: f64) -> Result<Self, FilterError> {
        Ok(Particle { smoothing: FilterError::probability("smoothing of particles", share)?, ..self })
    }

    /// Sets the number of particles before the second measurement of an object, whose first one its birth is. The default is that
    /// of all.
    ///
    /// Nearly all objects that a tracker starts in clutter are never measured again, and need no more than some dozens of particles
    /// to be so. For there is no other shape yet than the Gaussian of the birth, moved a few steps: the few particles have exactly
    /// its moments, the second measurement updates these as in an extended Kalman filter, and all particles are drawn from the
    /// result. That places more of them where they count than weighing the first ones would, too. Where the motion, or a sensor
    /// such as a bearing, bends a new object's belief out of that shape, leave the default.
    ///
    /// # Errors
    /// Unless it lies between 10 and the number of particles.
    pub fn with_tentative(self, count: usize) -> Result<Self, FilterError> {
        if !(FEWEST..=self.count).contains(&count) {
            let parameter = "number of particles before the second measurement";
            let expected = "must be between 10 and the number of particles";
            return Err(FilterError::Parameter { parameter, value: count as f64, expected });
        }
        Ok(Particle { tentative: count, ..self })
    }

    /// Whether there was no measurement after the first.
    fn is_tentative<const N: usize, U>(&self, belief: &Particles<N, U>) -> bool {
        belief.states.len() < self.count
    }

    /// How the measurement compares with each particle: the innovation, after `each` has seen the logarithms of the
    /// particles' new weights before they are normalised.
    fn compare<const N: usize, U: Clone>(
        &self,
        belief: &Particles<N, U>,
        measurement: &Measurement<M>,
        mut each: impl FnMut(f64),
    ) -> Result<Innovation, FilterError>
    where
        S: Sensor<N, M>,
    {
        let sensor = Aged::new(&self.sensor, measurement.age);
        let Reading { value, noise } = sensor.read(measurement);
        let factor = Cholesky::new(&noise, "noise of the measurement")?;
        let residual_of = |state| sensor.difference(&value, &sensor.expected(state));
        let (mut mean, mut square) = (SVector::<f64, M>::zeros(), SMatrix::<f64, M, M>::zeros());
        let (mut top, mut sum) = (f64::NEG_INFINITY, 0.0);
        let mut origin = None;
        for ((weight, state), ln_weight) in belief.weighted().zip(&belief.weights) {
            let residual = residual_of(state);
            let ln = ln_weight + factor.ln_density(factor.mahalanobis(&residual));
            if ln.is_nan() || ln == f64::INFINITY {
                return Err(FilterError::NotFinite { what: "innovation" });
            }
            if ln > top {
                sum = sum * (top - ln).exp() + 1.0;
                top = ln;
            } else if ln > f64::NEG_INFINITY {
                sum += (ln - top).exp();
            }
            each(ln);
            // Moments around the first residual: its square does not drown their width.
            let offset = residual - *origin.get_or_insert(residual);
            mean += offset * weight;
            square += offset * offset.transpose() * weight;
        }
        if top == f64::NEG_INFINITY {
            return Err(FilterError::NotFinite { what: "likelihood of every particle" });
        }
        let covariance = square - mean * mean.transpose() + noise;
        let residual = origin.unwrap_or_else(SVector::zeros) + mean;
        let nis = Cholesky::new(&covariance, "innovation covariance")?.mahalanobis(&residual);
        Ok(Innovation::new(&residual, nis, top + sum.ln()))
    }
}

impl<const N: usize, const M: usize, T, S> Filter<N> for Particle<T, S, M>
where
    T: Sampled<N>,
    S: Sensor<N, M>,
{
    type Belief = Particles<N, T::Memory>;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<Particles<N, T::Memory>, FilterError> {
        let start = self.sensor.birth(measurement, &self.motion.prior())?;
        let lower = *Cholesky::new(&start.covariance, "state covariance")?.lower();
        let mut random = ChaCha8Rng::seed_from_u64(sampling::seed_of(self.seed, measurement));
        let count = self.tentative;
        let states: Vec<_> = (0..count).map(|_| start.mean + lower * normal(&mut random)).collect();
        let weights = vec![-(count as f64).ln(); count];
        let memories = (0..count).map(|_| self.motion.start(&mut random)).collect();
        let mut belief = Particles { states, memories, weights, random, room: Room::new(count) };
        if self.is_tentative(&belief) {
            belief.reshape(&start);
        }
        Ok(belief)
    }

    fn predict(&self, belief: &mut Particles<N, T::Memory>, dt: f64) {
        let Particles { states, memories, random, .. } = belief;
        self.motion.sample(states, memories, dt, random);
    }

    fn update(
        &self,
        belief: &mut Particles<N, T::Memory>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        if self.is_tentative(belief) {
            let mut state = belief.moments();
            let comparison = Comparison::new(&self.sensor, &state, measurement)?;
            comparison.condition(&self.sensor, &mut state)?;
            belief.resample(self.count, None);
            belief.draw(&state);
            return Ok(comparison.innovation);
        }
        let mut weights = std::mem::take(&mut belief.room.weights);
        weights.clear();
        let innovation = self.compare(belief, measurement, |ln| weights.push(ln));
        if let Ok(innovation) = innovation {
            weights.iter_mut().for_each(|weight| *weight -= innovation.log_likelihood);
            std::mem::swap(&mut belief.weights, &mut weights);
        }
        belief.room.weights = weights;
        let innovation = innovation?;
        if belief.effective() < self.threshold * belief.states.len() as f64 {
            belief.resample(self.count, None);
            if self.smoothing > 0.0 {
                belief.smooth(self.smoothing);
            }
        }
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &Particles<N, T::Memory>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        if self.is_tentative(belief) {
            return Ok(Comparison::new(&self.sensor, &belief.moments(), measurement)?.innovation);
        }
        self.compare(belief, measurement, |_| ())
    }

    fn state(&self, belief: &Particles<N, T::Memory>) -> Gaussian<N> {
        belief.moments()
    }

    /// Moves and stretches the cloud, which keeps its shape and weights.
    fn set_state(&self, belief: &mut Particles<N, T::Memory>, state: &Gaussian<N>) {
        belief.reshape(state);
    }

    /// Resamples both clouds as one. The result is stretched to the moments of the two, which resampling alone would only
    /// meet on average.
    fn merge(
        &self,
        belief: &mut Particles<N, T::Memory>,
        weight: f64,
        other: &Particles<N, T::Memory>,
        other_weight: f64,
    ) {
        let total = weight + other_weight;
        if total <= 0.0 || other_weight <= 0.0 {
            return;
        }
        let mut target = belief.moments();
        target.merge(weight, &other.moments(), other_weight);
        let count = belief.states.len().max(other.states.len());
        belief.resample(count, Some((other, other_weight / total)));
        belief.reshape(&target);
    }

    fn reach(&self, belief: &Particles<N, T::Memory>) -> Option<(Vector2<f64>, SMatrix<f64, 2, 2>)> {
        super::gaussian::reach(&self.sensor, &belief.moments())
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn area(&self, measurement: &Measurement<M>) -> f64 {
        self.sensor.area(measurement)
    }
}

/// A vector of independent standard normal components.
fn normal<const N: usize>(random: &mut ChaCha8Rng) -> SVector<f64, N> {
    SVector::from_fn(|_, _| StandardNormal.sample(random))
}

#[cfg(test)]
mod tests;
