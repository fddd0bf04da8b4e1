//! Recursions that estimate one object: predict over a time step, update with a measurement.
//!
//! | filter | belief | for |
//! |---|---|---|
//! | [`Kalman`] | Gaussian | linear motion and sensor: exact |
//! | [`Extended`] | Gaussian | smooth motion and sensor: first order |
//! | [`Unscented`] | Gaussian | bent motion and sensor: second order, no Jacobians |
//! | [`Imm`] | one belief and one probability per mode | motion that changes between models |
//! | [`Particle`] | weighted states | any motion, any sensor |
//! | [`RaoBlackwellised`] | weighted histories of the motion, a Gaussian for each | motion whose parameters jump: the limit of what can be known |
//! | [`Identified`] | that of any filter, and what the object is called | measurements that bring identities |
//! | [`Padded`] | Gaussian | a model with a smaller state beside one with a larger |

mod correction;
mod either;
mod estimate;
mod extended;
mod gaussian;
mod identified;
mod imm;
mod innovation;
mod jump_markov;
mod kalman;
mod padded;
mod particle;
mod rao_blackwell;
mod sampling;
mod sigma;
mod transition;
mod turn_bank;
mod unscented;

use nalgebra::Vector2;

use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::extended::InverseWishart;

pub(crate) use correction::{Comparison, predicted};
pub use either::Either;
pub use estimate::Estimate;
pub use extended::Extended;
pub use identified::{Identified, Identity, Named, NamedBelief};
pub use imm::{Imm, ImmBelief};
pub use innovation::Innovation;
pub use jump_markov::JumpMarkov;
pub use kalman::Kalman;
pub use padded::Padded;
pub use particle::{Particle, Particles};
pub use rao_blackwell::{Hypotheses, Hypothesis, RandomTurns, RaoBlackwellised, Regime, Turning};
pub(crate) use sampling::{resample, seed_of};
pub use sigma::SigmaPoints;
pub use transition::Transition;
pub use turn_bank::TurnBank;
pub use unscented::Unscented;

/// A recursion over a belief about one object, whose state has `N` components.
///
/// A filter holds what is known of the world (how objects move, what the sensor does); all that is known of one object
/// is in the belief. So one filter serves any number of objects, beliefs can be copied, stored and compared, and a belief
/// may be updated by different filters (a radar's, a lidar's) as long as they share its type.
///
/// Beliefs change in place, which lets filters with memories of any size work without allocating. A missing measurement
/// is a [`predict`](Filter::predict) that no [`update`](Filter::update) follows.
///
/// ```
/// use tercel_core::{belief::Gaussian, filter::{Filter, Kalman}, motion::ConstantVelocity, sensor::Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.5), Position::new(5.0)?);
/// let mut belief: Gaussian<4> = filter.birth(&[0.0, 0.0].into())?;
/// for second in 1..=10 {
///     filter.predict(&mut belief, 1.0);
///     let innovation = filter.update(&mut belief, &[12.0 * second as f64, 0.0].into())?;
///     assert!(innovation.nis < 9.21); // the 99 % gate of two components
/// }
/// assert!((belief.mean[2] - 12.0).abs() < 1.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
pub trait Filter<const N: usize> {
    /// All that is known of one object.
    type Belief: Clone;
    /// What a sensor says of one object at one time.
    type Measurement;

    /// The belief about a new object that caused this measurement.
    ///
    /// # Errors
    /// When the measurement is not finite, or does not say where the object is.
    fn birth(&self, measurement: &Self::Measurement) -> Result<Self::Belief, FilterError>;

    /// Moves the belief forward by `dt` seconds, `dt >= 0`.
    fn predict(&self, belief: &mut Self::Belief, dt: f64);

    /// Conditions the belief on a measurement, and says how well the two agreed.
    ///
    /// # Errors
    /// When the measurement is not finite or a covariance cannot be saved. The belief is then unchanged.
    fn update(
        &self,
        belief: &mut Self::Belief,
        measurement: &Self::Measurement,
    ) -> Result<Innovation, FilterError>;

    /// What [`update`](Filter::update) would return, without updating.
    ///
    /// # Errors
    /// As `update`.
    fn innovation(
        &self,
        belief: &Self::Belief,
        measurement: &Self::Measurement,
    ) -> Result<Innovation, FilterError> {
        self.update(&mut belief.clone(), measurement)
    }

    /// Compares the belief with several measurements: writes to `found` what [`innovation`](Filter::innovation) says of each.
    /// Filters override it that can compute once what these share.
    fn innovations(
        &self,
        belief: &Self::Belief,
        measurements: &[&Self::Measurement],
        found: &mut Vec<Result<Innovation, FilterError>>,
    ) {
        found.clear();
        found.extend(measurements.iter().map(|measurement| self.innovation(belief, measurement)));
    }

    /// Conditions the belief on a choice of measurements of which at most one is the object's own: each with the weight that
    /// it is, and `none` for the case that no one is. The belief becomes the merger of those updated by each and of the one that
    /// is left as it was. The weights need not be normalised. Measurements by which the belief cannot be updated are left out.
    ///
    /// Returns the sum of the weights of the others. If that is zero the belief is unchanged.
    fn associate(&self, belief: &mut Self::Belief, parts: &[(f64, &Self::Measurement)], none: f64) -> f64 {
        one_by_one(self, belief, parts, none)
    }

    /// Mean and covariance of the state.
    fn state(&self, belief: &Self::Belief) -> Gaussian<N>;

    /// Replaces mean and covariance of the state and leaves the rest of the belief (memories) as it is: the step by which
    /// an interacting multiple model filter mixes its modes.
    fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>);

    /// Folds `other` into `belief`, so that it has the moments of the two with these weights. The weights need not be
    /// normalised, and folding one after the other gives the moments of them all.
    fn merge(&self, belief: &mut Self::Belief, weight: f64, other: &Self::Belief, other_weight: f64);

    /// Squared Mahalanobis distance between two beliefs, with the covariance of the first; infinity stands for any
    /// distance above `limit`.
    fn distance(&self, belief: &Self::Belief, other: &Self::Belief, limit: f64) -> f64 {
        self.state(belief).mahalanobis_within(&self.state(other).mean, limit)
    }

    /// The belief about the extent, in filters that have one in this form. Together with
    /// [`set_extent`](Filter::set_extent) it lets an interacting multiple model filter mix the extents of its modes.
    fn extent(&self, _belief: &Self::Belief) -> Option<InverseWishart> {
        None
    }

    /// Replaces the belief about the extent and leaves the rest as it is. Filters without one ignore it.
    fn set_extent(&self, _belief: &mut Self::Belief, _extent: &InverseWishart) {}

    /// What a user wants to know of the object.
    fn estimate(&self, belief: &Self::Belief) -> Estimate<N> {
        self.state(belief).into()
    }

    /// The part of the plane in which measurements of this object may lie that the gate of `search` takes. No such measurement
    /// lies outside, as long as the search was [widened](Filter::widen) for it. `None` when measurements have no place, and
    /// every one must be compared.
    fn reach(&self, belief: &Self::Belief, search: &Search) -> Option<Region>;

    /// Makes a search allow for what is special about this measurement.
    fn widen(&self, search: &mut Search, measurement: &Self::Measurement);

    /// Where in the plane a measurement lies, if it says so.
    fn place(&self, measurement: &Self::Measurement) -> Option<Vector2<f64>>;

    /// Area of the plane (m²) per unit volume of the measurement space, which turns a clutter intensity per m² into one
    /// that compares with the likelihoods of this filter.
    fn area(&self, measurement: &Self::Measurement) -> f64;

    /// Logarithm of the density of clutter that looks like this measurement, where the plane holds `intensity` false points per
    /// m²: what [`Innovation::log_likelihood`] is weighed against.
    fn ln_clutter(&self, measurement: &Self::Measurement, intensity: f64) -> f64 {
        (intensity * self.area(measurement)).ln()
    }

    /// What the measurement says that its object is called, in filters that weigh [identities](Identified).
    fn identity(&self, _measurement: &Self::Measurement) -> Option<Identity> {
        None
    }

    /// What the object of this belief is called, if that is known; see [`identity`](Filter::identity).
    fn called(&self, _belief: &Self::Belief) -> Option<Identity> {
        None
    }

    /// Moves many beliefs forward. Filters that work faster on batches override it.
    fn predict_all(&self, beliefs: &mut [&mut Self::Belief], dt: f64) {
        for belief in beliefs {
            self.predict(belief, dt);
        }
    }
}

/// What [`Filter::associate`] does, with an update for each measurement.
pub(crate) fn one_by_one<const N: usize, F: Filter<N> + ?Sized>(
    filter: &F,
    belief: &mut F::Belief,
    parts: &[(f64, &F::Measurement)],
    none: f64,
) -> f64 {
    let mut merged: Option<F::Belief> = None;
    let mut total = 0.0;
    for (weight, measurement) in parts.iter().filter(|part| part.0 > 0.0) {
        let mut updated = belief.clone();
        if filter.update(&mut updated, measurement).is_err() {
            continue;
        }
        match &mut merged {
            Some(merged) => filter.merge(merged, total, &updated, *weight),
            None => merged = Some(updated),
        }
        total += weight;
    }
    if let Some(mut merged) = merged {
        if none > 0.0 {
            filter.merge(&mut merged, total, belief, none);
        }
        *belief = merged;
    }
    total
}

/// A boxed filter is a filter: filters of different types stand side by side as `Box<dyn Filter<..>>`, as long as
/// their beliefs and measurements agree.
impl<const N: usize, F: Filter<N> + ?Sized> Filter<N> for Box<F> {
    type Belief = F::Belief;
    type Measurement = F::Measurement;

    fn birth(&self, measurement: &Self::Measurement) -> Result<Self::Belief, FilterError> {
        (**self).birth(measurement)
    }
    fn predict(&self, belief: &mut Self::Belief, dt: f64) {
        (**self).predict(belief, dt);
    }
    fn update(
        &self,
        belief: &mut Self::Belief,
        measurement: &Self::Measurement,
    ) -> Result<Innovation, FilterError> {
        (**self).update(belief, measurement)
    }
    fn innovation(
        &self,
        belief: &Self::Belief,
        measurement: &Self::Measurement,
    ) -> Result<Innovation, FilterError> {
        (**self).innovation(belief, measurement)
    }
    fn innovations(
        &self,
        belief: &Self::Belief,
        measurements: &[&Self::Measurement],
        found: &mut Vec<Result<Innovation, FilterError>>,
    ) {
        (**self).innovations(belief, measurements, found);
    }
    fn associate(&self, belief: &mut Self::Belief, parts: &[(f64, &Self::Measurement)], none: f64) -> f64 {
        (**self).associate(belief, parts, none)
    }
    fn state(&self, belief: &Self::Belief) -> Gaussian<N> {
        (**self).state(belief)
    }
    fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>) {
        (**self).set_state(belief, state);
    }
    fn merge(&self, belief: &mut Self::Belief, weight: f64, other: &Self::Belief, other_weight: f64) {
        (**self).merge(belief, weight, other, other_weight);
    }
    fn distance(&self, belief: &Self::Belief, other: &Self::Belief, limit: f64) -> f64 {
        (**self).distance(belief, other, limit)
    }
    fn extent(&self, belief: &Self::Belief) -> Option<InverseWishart> {
        (**self).extent(belief)
    }
    fn set_extent(&self, belief: &mut Self::Belief, extent: &InverseWishart) {
        (**self).set_extent(belief, extent);
    }
    fn estimate(&self, belief: &Self::Belief) -> Estimate<N> {
        (**self).estimate(belief)
    }
    fn reach(&self, belief: &Self::Belief, search: &Search) -> Option<Region> {
        (**self).reach(belief, search)
    }
    fn widen(&self, search: &mut Search, measurement: &Self::Measurement) {
        (**self).widen(search, measurement);
    }
    fn place(&self, measurement: &Self::Measurement) -> Option<Vector2<f64>> {
        (**self).place(measurement)
    }
    fn area(&self, measurement: &Self::Measurement) -> f64 {
        (**self).area(measurement)
    }
    fn ln_clutter(&self, measurement: &Self::Measurement, intensity: f64) -> f64 {
        (**self).ln_clutter(measurement, intensity)
    }
    fn identity(&self, measurement: &Self::Measurement) -> Option<Identity> {
        (**self).identity(measurement)
    }
    fn called(&self, belief: &Self::Belief) -> Option<Identity> {
        (**self).called(belief)
    }
    fn predict_all(&self, beliefs: &mut [&mut Self::Belief], dt: f64) {
        (**self).predict_all(beliefs, dt);
    }
}

#[cfg(test)]
mod tests;
