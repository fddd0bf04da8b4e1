//! The bootstrap particle filter.

mod belief;

use nalgebra::{SMatrix, SVector, Vector2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::correction::{self, near};
use super::gaussian::{linear_reach, searched};
use super::{Filter, Innovation, sampling};
use crate::association::{Region, Search};
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;
use crate::motion::Sampled;
use crate::sensor::{Aged, Measurement, Reading, Sensor};
pub use belief::Particles;
use belief::{Room, normal};

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
/// first updates, which is why those that do are spread: see [`with_smoothing`](Particle::with_smoothing).
///
/// ## Reference
/// Gordon, Salmond and Smith (1993), algorithm of section 3; systematic resampling of Kitagawa (1996), appendix.
/// Deviations: weights in the log domain; resampling only below a number of effective particles (Liu and Chen (1998)); smoothing, unless it is turned off, as Liu and West
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

/// Share by which resampled particles are spread when nothing is said.
const SMOOTHING: f64 = 0.35;

/// Effective particles for each component of the state, below which they no longer say how wide the cloud is.
const FEW_PER_COMPONENT: f64 = 2.0;

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
        Ok(Particle { motion, sensor, count, seed, threshold: 0.5, smoothing: SMOOTHING, tentative: count })
    }

    /// Sets the share of effective particles below which they are resampled; 0 never does, 1 always. The default is 0.5.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn with_threshold(self, threshold: f64) -> Result<Self, FilterError> {
        Ok(Particle { threshold: FilterError::probability("resampling threshold", threshold)?, ..self })
    }

    /// Spreads the copies that resampling makes: each moves by a normal error of this share of the cloud's width, and the cloud
    /// shrinks by as much, so that its mean and covariance stay. The default is 0.35; 0 is the plain filter.
    ///
    /// Particles then cannot run out when the process noise is small, at the price of blurring what the cloud's shape has finer
    /// than this share; 0.2 to 0.35 suits most problems. The plain filter collapses there without a word: after some updates all
    /// particles are copies of one, with a covariance of zero. Where a measurement leaves fewer than two effective particles for each
    /// component of the state there is no width to spread them by: all are then drawn anew from the Gaussian that the moments of
    /// the cloud and the measurement make, as in an extended Kalman filter. On a vague birth followed by accurate positions, 6,000 particles with 0.35
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

    /// Draws all particles anew, from the Gaussian that their moments and the measurement make.
    fn begin_anew<const N: usize, U: Clone>(
        &self,
        belief: &mut Particles<N, U>,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError>
    where
        S: Sensor<N, M>,
    {
        let mut state = belief.moments();
        let innovation = correction::update(&self.sensor, &mut state, measurement)?;
        belief.resample(self.count, None);
        belief.draw(&state);
        Ok(innovation)
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
        let (mut mean, mut square) = (SVector::<f64, M>::zeros(), SMatrix::<f64, M, M>::zeros());
        let (mut top, mut sum) = (f64::NEG_INFINITY, 0.0);
        // The moments of the readings are taken around the first: their squares do not drown their width, and angles do not
        // fall apart where the measurement lies opposite.
        let mut origin = None;
        let mut measured = SVector::zeros();
        let mut noises = Noises::new();
        for ((weight, state), ln_weight) in belief.weighted().zip(&belief.weights) {
            let expected = sensor.expected(state);
            let Reading { value, noise } = sensor.read(measurement, Some(&expected))?;
            let (factor, ln_peak) = noises.add(weight, &noise)?;
            let residual = sensor.difference(&value, &expected);
            let ln = ln_weight + ln_peak - 0.5 * factor.mahalanobis(&residual);
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
            measured = value;
            let offset = sensor.difference(&expected, origin.get_or_insert(expected));
            mean += offset * weight;
            square += offset * offset.transpose() * weight;
        }
        if top == f64::NEG_INFINITY {
            return Err(FilterError::NotFinite { what: "likelihood of every particle" });
        }
        let covariance = square - mean * mean.transpose() + noises.mean;
        let residual = sensor.difference(&measured, &(origin.unwrap_or_else(SVector::zeros) + mean));
        let nis = near(Cholesky::new(&covariance, "innovation covariance")?.mahalanobis(&residual))?;
        Ok(Innovation::new(&residual, nis, top + sum.ln()))
    }
}

/// The noises of one measurement at the places of particles, which are mostly all the same.
struct Noises<const M: usize> {
    /// The first with its density.
    first: Option<(SMatrix<f64, M, M>, Density<M>)>,
    /// The weighted mean of those added.
    mean: SMatrix<f64, M, M>,
}

/// The factor of a covariance, and the logarithm of its density at zero.
type Density<const M: usize> = (Cholesky<M>, f64);

impl<const M: usize> Noises<M> {
    fn new() -> Self {
        Noises { first: None, mean: SMatrix::zeros() }
    }

    /// Takes in the noise at a particle of this weight; the weights add up to one.
    #[inline]
    fn add(&mut self, weight: f64, noise: &SMatrix<f64, M, M>) -> Result<Density<M>, FilterError> {
        match &self.first {
            Some((first, density)) if noise == first => return Ok(*density),
            Some((first, _)) => self.mean += (noise - first) * weight,
            None => self.mean = *noise,
        }
        let factor = Cholesky::new(noise, "noise of the measurement")?;
        let density = (factor, factor.ln_density(0.0));
        self.first.get_or_insert((*noise, density));
        Ok(density)
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
            return self.begin_anew(belief, measurement);
        }
        let mut weights = std::mem::take(&mut belief.room.weights);
        weights.clear();
        let innovation = self.compare(belief, measurement, |ln| weights.push(ln));
        let mut spent = false;
        if let Ok(innovation) = innovation {
            weights.iter_mut().for_each(|weight| *weight -= innovation.log_likelihood);
            let few = sampling::effective(&weights) < FEW_PER_COMPONENT * N as f64;
            spent = self.smoothing > 0.0 && few && self.begin_anew(belief, measurement).is_ok();
            if !spent {
                std::mem::swap(&mut belief.weights, &mut weights);
            }
        }
        belief.room.weights = weights;
        let innovation = innovation?;
        if spent {
            return Ok(innovation);
        }
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
            return correction::innovation(&self.sensor, &belief.moments(), measurement);
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

    fn reach(&self, belief: &Particles<N, T::Memory>, search: &Search) -> Option<Region> {
        let moments = belief.moments();
        if self.is_tentative(belief) {
            return linear_reach(&self.sensor, &moments, search);
        }
        searched(&self.sensor, search, &moments.mean, |sensor, probe| {
            let origin = sensor.expected(&belief.states[0]);
            let (mut mean, mut square) = (SVector::<f64, M>::zeros(), SVector::<f64, M>::zeros());
            let mut noise = SVector::<f64, M>::zeros();
            for (weight, state) in belief.weighted() {
                let expected = sensor.expected(state);
                let offset = sensor.difference(&expected, &origin);
                mean += offset * weight;
                square += offset.component_mul(&offset) * weight;
                noise += sensor.read(probe, Some(&expected))?.noise.diagonal() * weight;
            }
            Ok((origin + mean, square - mean.component_mul(&mean) + noise))
        })
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<M>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn area(&self, measurement: &Measurement<M>) -> f64 {
        self.sensor.area(measurement)
    }
}

#[cfg(test)]
mod tests;
