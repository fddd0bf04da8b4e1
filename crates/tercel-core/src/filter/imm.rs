//! The interacting multiple model filter.

mod mixing;

use nalgebra::Vector2;

use super::gaussian::{moments, settle};
use super::innovation::Blend;
use super::transition::Chain;
use super::{Estimate, Filter, Innovation, Transition};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::extended::InverseWishart;
use mixing::Origin;

/// Estimates a state whose motion changes between models, with one filter per model and their probabilities.
///
/// ## Recursion
/// With mode probabilities `μ`, the transition `Π` over the step and the likelihood `Λⱼ` of the innovation of mode `j`:
/// ```text
/// predict   cⱼ = Σᵢ μᵢ Πᵢⱼ            mode j starts from the moments of all modes under μᵢ Πᵢⱼ / cⱼ, and predicts
/// update    μⱼ = cⱼ Λⱼ / Σᵢ cᵢ Λᵢ     each mode updates
/// ```
/// The state is the moment match of the modes. [`Innovation::log_likelihood`] is that of the mixture, the residual is the
/// mean of those of the modes under `c`, and the normalised square their mean under the new `μ`.
///
/// Any filter can be a mode: a learned one keeps its memory, because mixing replaces only mean and covariance
/// ([`set_state`](Filter::set_state)). Extents of random-matrix filters are mixed to their moments, too. Filters of different types go in boxes, and a model with a smaller state in
/// [`Padded`](super::Padded).
///
/// A mode whose update fails keeps its belief, gets a vanishing probability and restarts from the others at the next mixing;
/// the update fails when all modes do. No probability falls below 1e-300, so a mode that was ruled out can return. A
/// prediction of `dt = 0` is no step: nothing mixes.
///
/// ## Use it when
/// the models are known and few enough to cover the motion: turns at some rates beside straight flight, calm beside
/// manoeuvring. A rate between the models is followed by mixing them; one outside makes the filter lag.
///
/// ## Reference
/// Blom and Bar-Shalom (1988), eqs. 3 to 9. Deviations: likelihoods in the log domain; the transition may scale with `dt`; where all
/// changes are equally probable, the modes mix with their common moments, which gives the same in a time that grows with their
/// number and not with its square.
///
/// Validated against FilterPy 1.4.5 over 30 steps of two modes: probabilities, states and covariances agree to 1e-9.
///
/// ```
/// use tercel_core::{filter::{Filter, Imm, Kalman, Transition}, motion::Turn, sensor::Position};
///
/// let radar = Position::<2>::new(5.0)?;
/// let modes = [0.0, 0.1, -0.1].map(|rate| Kalman::new(Turn::new(rate, 0.1), radar));
/// let imm = Imm::new(modes, Transition::sticky(0.95).per(1.0))?;
/// let mut belief = imm.birth(&[1000.0, 0.0].into())?;
/// for second in 1..=30 {
///     let (sine, cosine) = (0.1 * second as f64).sin_cos();
///     imm.predict(&mut belief, 1.0);
///     imm.update(&mut belief, &[1000.0 * cosine, 1000.0 * sine].into())?;
/// }
/// assert!(imm.mode_probabilities(&belief)[1] > 0.9); // turns to the left
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Imm<F> {
    filters: Vec<F>,
    chain: Chain,
    initial: Vec<f64>,
}

/// What an [`Imm`] filter knows of one object: a belief and a probability for each mode.
#[derive(Debug, PartialEq)]
pub struct ImmBelief<B, const N: usize> {
    modes: Vec<Mode<B>>,
    probabilities: Vec<f64>,
    /// Room for the transition over a step that has to be computed.
    transition: Vec<f64>,
    /// Room for where the modes start from.
    origins: Vec<Origin<N>>,
}

/// The belief of one mode, with room for a step: beliefs change in place and no step allocates.
#[derive(Debug, Clone, PartialEq)]
struct Mode<B> {
    belief: B,
    weight: f64,
}

/// Smallest probability of a mode.
const FLOOR: f64 = 1e-300;

impl<F> Imm<F> {
    /// Filters, one per mode, and how the object changes between them. All modes are equally probable at birth.
    ///
    /// # Errors
    /// When there is no filter, or the transition is not one between this many modes.
    pub fn new(filters: impl IntoIterator<Item = F>, transition: Transition) -> Result<Self, FilterError> {
        let filters: Vec<F> = filters.into_iter().collect();
        if filters.is_empty() {
            let (parameter, expected) = ("number of modes", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        let chain = transition.chain(filters.len())?;
        let initial = vec![1.0 / filters.len() as f64; filters.len()];
        Ok(Imm { filters, chain, initial })
    }

    /// Sets the mode probabilities of a new object. They are normalised.
    ///
    /// # Errors
    /// When there is not one per mode, one is not a probability, or all are zero.
    pub fn with_initial(mut self, probabilities: &[f64]) -> Result<Self, FilterError> {
        for &value in probabilities {
            FilterError::probability("initial mode probability", value)?;
        }
        let sum: f64 = probabilities.iter().sum();
        FilterError::positive("sum of the initial mode probabilities", sum)?;
        if probabilities.len() != self.filters.len() {
            let (parameter, expected) = ("number of initial mode probabilities", "must be one per mode");
            return Err(FilterError::Parameter { parameter, value: probabilities.len() as f64, expected });
        }
        self.initial = probabilities.iter().map(|p| (p / sum).max(FLOOR)).collect();
        Ok(self)
    }

    /// The filters, one per mode.
    pub fn filters(&self) -> &[F] {
        &self.filters
    }

    /// Probability of each mode, in the order of the filters.
    pub fn mode_probabilities<'a, B, const N: usize>(&self, belief: &'a ImmBelief<B, N>) -> &'a [f64] {
        &belief.probabilities
    }
}

impl<B, const N: usize> ImmBelief<B, N> {
    /// Beliefs of the modes, in the order of the filters.
    pub fn modes(&self) -> impl ExactSizeIterator<Item = &B> {
        self.modes.iter().map(|mode| &mode.belief)
    }
}

impl<B: Clone, const N: usize> Clone for ImmBelief<B, N> {
    fn clone(&self) -> Self {
        ImmBelief {
            modes: self.modes.clone(),
            probabilities: self.probabilities.clone(),
            transition: Vec::new(),
            origins: Vec::new(),
        }
    }

    // Trackers copy beliefs into buffers of the last scan; their room is used again.
    fn clone_from(&mut self, source: &Self) {
        self.probabilities.clone_from(&source.probabilities);
        self.modes.truncate(source.modes.len());
        let (head, tail) = source.modes.split_at(self.modes.len());
        for (mode, other) in self.modes.iter_mut().zip(head) {
            mode.belief.clone_from(&other.belief);
        }
        self.modes.extend_from_slice(tail);
    }
}

impl<F> Imm<F> {
    /// Moves every mode to the moments of those that may have led to it, and the probabilities over the step.
    fn mix<const N: usize>(&self, belief: &mut ImmBelief<F::Belief, N>, dt: f64)
    where
        F: Filter<N>,
    {
        let ImmBelief { modes, probabilities, transition, origins } = belief;
        origins.clear();
        let states = modes.iter().zip(&self.filters).zip(&*probabilities);
        origins.extend(states.map(|((mode, filter), weight)| {
            Origin::new(*weight, filter.state(&mode.belief), filter.extent(&mode.belief))
        }));
        self.chain.leap(dt, transition, |leap| mixing::mix(origins, &leap));
        for ((mode, filter), origin) in modes.iter_mut().zip(&self.filters).zip(&*origins) {
            // Without anything from other modes, mixing would only round.
            if origin.mixed {
                filter.set_state(&mut mode.belief, &origin.state);
                if let Some(extent) = &origin.extent {
                    filter.set_extent(&mut mode.belief, extent);
                }
            }
        }
        for (probability, origin) in probabilities.iter_mut().zip(origins) {
            *probability = origin.weight.max(FLOOR);
        }
    }
}

impl<const N: usize, F: Filter<N>> Filter<N> for Imm<F> {
    type Belief = ImmBelief<F::Belief, N>;
    type Measurement = F::Measurement;

    fn birth(&self, measurement: &F::Measurement) -> Result<Self::Belief, FilterError> {
        let modes: Result<_, FilterError> = self
            .filters
            .iter()
            .map(|filter| {
                let belief = filter.birth(measurement)?;
                Ok(Mode { belief, weight: 0.0 })
            })
            .collect();
        Ok(ImmBelief {
            modes: modes?,
            probabilities: self.initial.clone(),
            transition: Vec::new(),
            origins: Vec::new(),
        })
    }

    fn predict(&self, belief: &mut Self::Belief, dt: f64) {
        if dt != 0.0 && self.filters.len() > 1 {
            self.mix(belief, dt);
        }
        for (mode, filter) in belief.modes.iter_mut().zip(&self.filters) {
            filter.predict(&mut mode.belief, dt);
        }
    }

    fn update(
        &self,
        belief: &mut Self::Belief,
        measurement: &F::Measurement,
    ) -> Result<Innovation, FilterError> {
        let mut blend = Blend::default();
        let mut failure = None;
        for ((mode, filter), probability) in
            belief.modes.iter_mut().zip(&self.filters).zip(&belief.probabilities)
        {
            mode.weight = match filter.update(&mut mode.belief, measurement) {
                Ok(innovation) => blend.add(*probability, &innovation),
                Err(error) => {
                    failure.get_or_insert(error);
                    f64::NEG_INFINITY
                }
            };
        }
        let innovation = blend.finish().ok_or_else(|| nothing_updated(failure))?;
        // A measurement that no mode can explain says nothing about which one it is.
        if innovation.log_likelihood.is_finite() {
            for (probability, mode) in belief.probabilities.iter_mut().zip(&belief.modes) {
                *probability = (mode.weight - innovation.log_likelihood).exp().max(FLOOR);
            }
        }
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &Self::Belief,
        measurement: &F::Measurement,
    ) -> Result<Innovation, FilterError> {
        let mut blend = Blend::default();
        let mut failure = None;
        for ((mode, filter), probability) in belief.modes.iter().zip(&self.filters).zip(&belief.probabilities)
        {
            match filter.innovation(&mode.belief, measurement) {
                Ok(innovation) => {
                    blend.add(*probability, &innovation);
                }
                Err(error) => {
                    failure.get_or_insert(error);
                }
            }
        }
        blend.finish().ok_or_else(|| nothing_updated(failure))
    }

    fn innovations(
        &self,
        belief: &Self::Belief,
        measurements: &[&F::Measurement],
        found: &mut Vec<Result<Innovation, FilterError>>,
    ) {
        let mut blends: Vec<(Blend, Option<FilterError>)> = Vec::new();
        blends.resize_with(measurements.len(), Default::default);
        for ((mode, filter), probability) in belief.modes.iter().zip(&self.filters).zip(&belief.probabilities)
        {
            let ln_probability = probability.ln();
            filter.innovations(&mode.belief, measurements, found);
            for ((blend, failure), innovation) in blends.iter_mut().zip(found.drain(..)) {
                match innovation {
                    Ok(innovation) => {
                        blend.add_weighted(*probability, ln_probability, &innovation);
                    }
                    Err(error) => {
                        failure.get_or_insert(error);
                    }
                }
            }
        }
        let finish = |(blend, failure): (Blend, _)| blend.finish().ok_or_else(|| nothing_updated(failure));
        found.extend(blends.into_iter().map(finish));
    }

    /// Each mode with the shares that it has in the measurements, so that no update is made for itself alone.
    fn associate(&self, belief: &mut Self::Belief, parts: &[(f64, &F::Measurement)], none: f64) -> f64 {
        let shares = self.shares(belief, parts);
        let weight: f64 =
            parts.iter().zip(&shares.explained).filter(|(_, ok)| **ok).map(|(part, _)| part.0).sum();
        if weight <= 0.0 {
            return 0.0;
        }
        let mut own = Vec::with_capacity(parts.len());
        let modes = belief.modes.iter_mut().zip(&mut belief.probabilities);
        for (((mode, probability), filter), shares) in
            modes.zip(&self.filters).zip(shares.of_modes.chunks(parts.len()))
        {
            own.clear();
            own.extend(
                parts.iter().zip(shares).map(|((weight, measurement), share)| (weight * share, *measurement)),
            );
            let missed = none * *probability;
            let updated = filter.associate(&mut mode.belief, &own, missed);
            *probability = ((updated + missed) / (weight + none)).max(FLOOR);
        }
        weight
    }

    fn state(&self, belief: &Self::Belief) -> Gaussian<N> {
        let states = belief.modes.iter().zip(&self.filters).zip(&belief.probabilities);
        moments(states.map(|((mode, filter), probability)| (*probability, filter.state(&mode.belief))))
    }

    /// Every mode gets this state; the probabilities stay.
    fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>) {
        for (mode, filter) in belief.modes.iter_mut().zip(&self.filters) {
            filter.set_state(&mut mode.belief, state);
        }
    }

    /// Mode by mode, each with its share of the probabilities.
    fn merge(&self, belief: &mut Self::Belief, weight: f64, other: &Self::Belief, other_weight: f64) {
        let total = weight + other_weight;
        if total <= 0.0 {
            return;
        }
        for (j, filter) in self.filters.iter().enumerate() {
            let (mine, theirs) = (weight * belief.probabilities[j], other_weight * other.probabilities[j]);
            filter.merge(&mut belief.modes[j].belief, mine, &other.modes[j].belief, theirs);
            belief.probabilities[j] = ((mine + theirs) / total).max(FLOOR);
        }
    }

    fn estimate(&self, belief: &Self::Belief) -> Estimate<N> {
        let state = self.state(belief);
        let parts = || belief.modes.iter().zip(&self.filters).zip(&belief.probabilities);
        let total: f64 = belief.probabilities.iter().sum();
        let share = |((mode, filter), probability): ((&Mode<_>, &F), &f64)| {
            Some(filter.estimate(&mode.belief).extent? * (probability / total))
        };
        let extent = parts().map(share).sum::<Option<_>>().filter(|_| !self.filters.is_empty());
        Estimate { modes: belief.probabilities.clone(), extent, ..state.into() }
    }

    fn extent(&self, belief: &Self::Belief) -> Option<InverseWishart> {
        let modes = belief.modes.iter().zip(&self.filters).zip(&belief.probabilities);
        blended(modes.map(|((mode, filter), probability)| (*probability, filter.extent(&mode.belief))))
    }

    /// Every mode gets this extent.
    fn set_extent(&self, belief: &mut Self::Belief, extent: &InverseWishart) {
        for (mode, filter) in belief.modes.iter_mut().zip(&self.filters) {
            filter.set_extent(&mut mode.belief, extent);
        }
    }

    /// That of all modes: the normalised square of the mixture is at least the least of theirs.
    fn reach(&self, belief: &Self::Belief, search: &Search) -> Option<Region> {
        let modes = belief.modes.iter().zip(&self.filters).zip(&belief.probabilities);
        Region::mixture(
            modes.map(|((mode, filter), probability)| {
                Some((*probability, filter.reach(&mode.belief, search)?))
            }),
        )
    }

    fn widen(&self, search: &mut Search, measurement: &F::Measurement) {
        self.filters.iter().for_each(|filter| filter.widen(search, measurement));
    }

    fn place(&self, measurement: &F::Measurement) -> Option<Vector2<f64>> {
        self.filters.first()?.place(measurement)
    }

    fn area(&self, measurement: &F::Measurement) -> f64 {
        self.filters.first().map_or(1.0, |filter| filter.area(measurement))
    }

    fn ln_clutter(&self, measurement: &F::Measurement, intensity: f64) -> f64 {
        self.filters.first().map_or(0.0, |filter| filter.ln_clutter(measurement, intensity))
    }
}

/// How the modes share in measurements.
struct Shares {
    /// Probability of each mode given each measurement; a row for each mode.
    of_modes: Vec<f64>,
    /// Whether any mode can be updated by each measurement.
    explained: Vec<bool>,
}

impl<F> Imm<F> {
    fn shares<const N: usize>(
        &self,
        belief: &ImmBelief<F::Belief, N>,
        parts: &[(f64, &F::Measurement)],
    ) -> Shares
    where
        F: Filter<N>,
    {
        let count = parts.len();
        let measurements: Vec<&F::Measurement> = parts.iter().map(|part| part.1).collect();
        let mut of_modes = Vec::with_capacity(count * self.filters.len());
        let mut found = Vec::with_capacity(count);
        let mut explained = vec![false; count];
        for ((mode, filter), probability) in belief.modes.iter().zip(&self.filters).zip(&belief.probabilities)
        {
            let ln_probability = probability.ln();
            filter.innovations(&mode.belief, &measurements, &mut found);
            for (innovation, explained) in found.drain(..).zip(&mut explained) {
                *explained |= innovation.is_ok();
                let weight = innovation.map_or(f64::NEG_INFINITY, |one| ln_probability + one.log_likelihood);
                // A likelihood that overflowed or is not a number counts as zero.
                of_modes.push(if weight < f64::INFINITY { weight } else { f64::NEG_INFINITY });
            }
        }
        for column in 0..count {
            let rows = || (column..of_modes.len()).step_by(count);
            let top = rows().map(|place| of_modes[place]).fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = rows().map(|place| (of_modes[place] - top).exp()).sum();
            for (place, probability) in (column..of_modes.len()).step_by(count).zip(&belief.probabilities) {
                // A measurement that no mode can explain says nothing about which one it is.
                let known = top > f64::NEG_INFINITY;
                of_modes[place] = if known { (of_modes[place] - top).exp() / sum } else { *probability };
            }
        }
        Shares { of_modes, explained }
    }
}

/// The extent with the moments of a mixture; none unless every part has one.
fn blended(parts: impl Iterator<Item = (f64, Option<InverseWishart>)>) -> Option<InverseWishart> {
    let mut merged: Option<InverseWishart> = None;
    let mut total = 0.0;
    for (weight, extent) in parts {
        let extent = extent?;
        match &mut merged {
            Some(merged) => merged.merge(total, &extent, weight),
            None => merged = Some(extent),
        }
        total += weight;
    }
    merged
}

/// The error of a step in which no mode could be updated.
fn nothing_updated(failure: Option<FilterError>) -> FilterError {
    failure.unwrap_or(FilterError::NotFinite { what: "likelihood of every mode" })
}

#[cfg(test)]
mod tests;
