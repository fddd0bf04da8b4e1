//! The Rao-Blackwellised particle filter for motion whose parameters jump.

mod belief;
mod random_turns;
mod regime;

use nalgebra::Vector2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::correction::{self, predicted};
use super::gaussian::linear_reach;
use super::innovation::Blend;
use super::{Estimate, Filter, Innovation, sampling};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::motion::Motion;
use crate::sensor::{Measurement, Sensor};

pub use belief::{Hypotheses, Hypothesis};
pub use random_turns::{RandomTurns, Turning};
pub use regime::Regime;

/// Estimates a state whose motion has parameters that jump at random, with many guesses at the parameters and a Kalman
/// filter for each: exact given the parameters when the sensor is linear, of first order otherwise.
///
/// ## Recursion
/// With `θᵢ` the parameters of particle `i`, drawn and moved by a [`Regime`], and `mᵢ, Pᵢ` the state given their history:
/// ```text
/// birth     θᵢ ~ p(θ)                          mᵢ, Pᵢ from the sensor       wᵢ = 1/n
/// predict   θᵢ ~ p(θ | θᵢ, dt)                 mᵢ, Pᵢ by a Kalman prediction with F(θᵢ), Q(θᵢ)
/// update    wᵢ ← wᵢ N(νᵢ; 0, Sᵢ)               mᵢ, Pᵢ by a Kalman update, νᵢ = z - H mᵢ; then normalise
/// resample  systematically, when 1 / Σ wᵢ² < τ n
/// ```
/// State and covariance are the moments of the mixture, mode probabilities the weights gathered by mode.
/// [`Innovation::log_likelihood`] is that of the mixture `ln Σ wᵢ N(νᵢ; 0, Sᵢ)`, the residual the mean of those of the
/// particles before the measurement, and the normalised square their mean after it, as in an [`Imm`](super::Imm).
///
/// Only the parameters are sampled, so the particles cover a space of one or two components where those of a
/// [`Particle`](super::Particle) filter must cover the state as well. Every belief carries its generator, as there: the same
/// steps give the same result on any machine. Particles that [`merge`](Filter::merge) from two beliefs, or whose state is
/// replaced, are moved together so that mean and covariance of the mixture are what they should be.
///
/// A particle whose update fails keeps its state and loses its weight; the update fails when all do.
///
/// ## Use it when
/// one wants to know how well any filter could do: with the regime from which objects are truly drawn the estimate tends to
/// the mean given all measurements so far, which no filter beats. Some thousand particles do, at a fifth of a microsecond
/// each and step. It is also a filter for real use where a grid of modes would be too large, as for turn rates and noise
/// levels that are both unknown.
///
/// A parameter that never changes is only thinned out: after many resamplings few of its values are left. Give it a small
/// chance of a change when an object is followed for thousands of steps.
///
/// ## Reference
/// Doucet, Gordon and Krishnamurthy (2001), for jump Markov linear systems, with the regime's own jumps as the importance
/// distribution; Doucet, de Freitas, Murphy and Russell (2000) in general. Deviations: weights in the log domain; resampling
/// below a number of effective particles (Liu and Chen (1998)), systematically (Kitagawa (1996), appendix).
///
/// ```
/// use tercel_core::{filter::{Filter, RandomTurns, RaoBlackwellised}, sensor::ConvertedPolar};
///
/// let radar = ConvertedPolar::new(50.0, 0.005)?;
/// // A new turn every 40 s, of up to 12 degrees a second, and accelerations of 5 to 20 m/s².
/// let turns = RandomTurns::new(1.0 / 40.0, 0.21, 5.0..=20.0)?.with_speed(200.0)?;
/// let filter = RaoBlackwellised::new(turns, radar, 1000, 7)?;
/// let mut belief = filter.birth(&[100e3, 0.5].into())?;
/// for second in 1..=5 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &[100e3 - 200.0 * second as f64, 0.5].into())?;
/// }
/// let [straight, left, right] = filter.estimate(&belief).modes[..] else { unreachable!() };
/// assert!((straight + left + right - 1.0).abs() < 1e-9);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaoBlackwellised<J, S, const M: usize = 2> {
    /// How the parameters of the motion are drawn, and how they jump.
    pub regime: J,
    /// What is measured of the object.
    pub sensor: S,
    count: usize,
    seed: u64,
    threshold: f64,
}

impl<J, S, const M: usize> RaoBlackwellised<J, S, M> {
    /// A filter of `count` particles per object, with this seed for its random numbers.
    ///
    /// # Errors
    /// When `count` is zero.
    pub fn new(regime: J, sensor: S, count: usize, seed: u64) -> Result<Self, FilterError> {
        if count == 0 {
            let (parameter, expected) = ("number of particles", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        Ok(RaoBlackwellised { regime, sensor, count, seed, threshold: 0.5 })
    }

    /// Sets the share of effective particles below which they are resampled; 0 never does, 1 always. The default is 0.5.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn with_threshold(self, threshold: f64) -> Result<Self, FilterError> {
        let threshold = FilterError::probability("resampling threshold", threshold)?;
        Ok(RaoBlackwellised { threshold, ..self })
    }

    /// Probability of each mode of the regime.
    pub fn mode_probabilities<const N: usize>(&self, belief: &Hypotheses<J::Parameters, N>) -> Vec<f64>
    where
        J: Regime<N>,
    {
        let mut probabilities = vec![0.0; self.regime.modes()];
        for (weight, hypothesis) in belief.weighted() {
            if let Some(probability) = probabilities.get_mut(self.regime.mode(&hypothesis.parameters)) {
                *probability += weight;
            }
        }
        probabilities
    }
}

impl<const N: usize, const M: usize, J, S> Filter<N> for RaoBlackwellised<J, S, M>
where
    J: Regime<N>,
    S: Sensor<N, M>,
{
    type Belief = Hypotheses<J::Parameters, N>;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<Self::Belief, FilterError> {
        let mut random = ChaCha8Rng::seed_from_u64(sampling::seed_of(self.seed, measurement));
        let born = |_| {
            let parameters = self.regime.draw(&mut random);
            let prior = self.regime.motion(&parameters).prior();
            let state = self.sensor.birth(measurement, &prior)?;
            Ok(Hypothesis { parameters, state })
        };
        let particles: Result<Vec<_>, FilterError> = (0..self.count).map(born).collect();
        Ok(Hypotheses::even(particles?, random))
    }

    fn predict(&self, belief: &mut Self::Belief, dt: f64) {
        let (particles, random) = belief.moving();
        for Hypothesis { parameters, state } in particles {
            if dt != 0.0 {
                self.regime.jump(parameters, dt, random);
            }
            *state = predicted(&self.regime.motion(parameters), state, dt);
        }
    }

    fn update(
        &self,
        belief: &mut Self::Belief,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        let mut blend = Blend::default();
        let mut failure = None;
        belief.correct(|ln_weight, state| match correction::update(&self.sensor, state, measurement) {
            Ok(innovation) => blend.add_weighted(ln_weight.exp(), ln_weight, &innovation),
            Err(error) => {
                failure.get_or_insert(error);
                f64::NEG_INFINITY
            }
        });
        let innovation = blend.finish().ok_or_else(|| nothing_updated(failure))?;
        // A measurement that no particle can explain says nothing about which one is right.
        if innovation.log_likelihood.is_finite() {
            belief.accept(innovation.log_likelihood);
            if belief.effective() < self.threshold * belief.particles().len() as f64 {
                belief.resample(self.count, None);
            }
        }
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &Self::Belief,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        let mut blend = Blend::default();
        let mut failure = None;
        for (hypothesis, &ln_weight) in belief.particles().iter().zip(belief.ln_weights()) {
            match correction::innovation(&self.sensor, &hypothesis.state, measurement) {
                Ok(innovation) => {
                    blend.add_weighted(ln_weight.exp(), ln_weight, &innovation);
                }
                Err(error) => {
                    failure.get_or_insert(error);
                }
            }
        }
        blend.finish().ok_or_else(|| nothing_updated(failure))
    }

    fn state(&self, belief: &Self::Belief) -> Gaussian<N> {
        belief.moments()
    }

    /// Moves and stretches the mixture; parameters and weights stay.
    fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>) {
        belief.reshape(state);
    }

    /// Resamples both sets of particles as one. The result is stretched to the moments of the two, which resampling alone would
    /// only meet on average.
    fn merge(&self, belief: &mut Self::Belief, weight: f64, other: &Self::Belief, other_weight: f64) {
        let total = weight + other_weight;
        if total <= 0.0 || other_weight <= 0.0 {
            return;
        }
        let mut target = belief.moments();
        target.merge(weight, &other.moments(), other_weight);
        belief.resample(self.count, Some((other, other_weight / total)));
        belief.reshape(&target);
    }

    fn estimate(&self, belief: &Self::Belief) -> Estimate<N> {
        let Gaussian { mean, covariance } = belief.moments();
        let modes = if self.regime.modes() > 1 { self.mode_probabilities(belief) } else { Vec::new() };
        Estimate { mean, covariance, modes, extent: None }
    }

    /// That of all particles: the normalised square of the mixture is at least the least of theirs.
    fn reach(&self, belief: &Self::Belief, search: &Search) -> Option<Region> {
        Region::mixture(
            belief.weighted().map(|(weight, particle)| {
                Some((weight, linear_reach(&self.sensor, &particle.state, search)?))
            }),
        )
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

/// The error of a step in which no particle could be updated.
fn nothing_updated(failure: Option<FilterError>) -> FilterError {
    failure.unwrap_or(FilterError::NotFinite { what: "likelihood of every particle" })
}

#[cfg(test)]
mod tests;
