//! A filter whose measurements may say which object they are of.

use nalgebra::Vector2;

use super::{Estimate, Filter, Innovation};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::extended::InverseWishart;

/// What an object is called: the number of a name in a list that the caller keeps. Equal numbers are equal names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Identity(pub u32);

/// A measurement, and what it says that the object is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Named<Z> {
    /// What was measured.
    pub measurement: Z,
    /// What the object is called, if the sensor says so.
    pub identity: Option<Identity>,
}

/// A belief about an object, and about what it is called.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NamedBelief<B> {
    /// What is known of the object otherwise.
    pub belief: B,
    /// Its most probable name.
    identity: Option<Identity>,
    /// How probable that is, 0 to 1.
    sure: f32,
    /// Standard deviation of a new object's speed per axis, m/s.
    pace: f32,
    /// Time since the last update, s.
    since: f32,
}

/// Weighs what sensors say of the identity of objects (MMSI, Mode S address, code, the number of a sensor's own track) beside
/// what they measure.
///
/// ## Recursion
/// An object is called `a` with probability `p`. A sensor names it rightly with probability `ρ`, its reliability; there are `K`
/// names. A measurement that names `b` has the likelihood of its position times
/// ```text
/// Λ = 1 - p + p ρ K         if b = a        the same name is evidence for,
/// Λ = 1 - p + p (1 - ρ)²    if b ≠ a        another one against,
/// Λ = 1                     without a name  none says nothing,
/// ```
/// relative to an object that was never named: a new one brings a name of its own. The posterior follows from Bayes' rule.
/// The square makes a sensor that is right 999 times in 1,000 close the gate to other names, since objects that lie side by side
/// are commoner than names that are wrong; one that is right 9 times in 10 leaves it half open. The gate opens and closes with the evidence: it is asked for `NIS - 2 ln Λ`.
///
/// Where the same name is far outside the gate, the motion model failed and the object did not: if it could have come there at
/// the speeds of its kind since it was last seen, the belief starts anew at the measurement, with probability 0.001 against a
/// motion as modelled. So a jump in a recording does not break a track, and two objects under one name far apart stay two.
///
/// ## Use it when
/// measurements bring identities. Trackers need not know: the factor is part of the likelihood that they are given. Where no
/// measurement has one the filter is the inner filter.
///
/// ## Reference
/// Attributes as a factor of the association likelihood: Bar-Shalom, Kirubarajan and Gokberk (2005), Tracking with
/// classification-aided multiframe data association. Deviation: instead of a confusion matrix over classes, one
/// reliability over open sets of names; the square and the restart are ours.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use tercel_core::filter::{Filter, Identified, Identity, Kalman, Named, NamedBelief};
/// use tercel_core::motion::ConstantVelocity;
/// use tercel_core::sensor::Position;
///
/// let filter = Identified::new(Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?), 0.999)?;
/// let report = |x: f64, name| Named { measurement: [x, 0.0].into(), identity: Some(Identity(name)) };
/// let ship: NamedBelief<Gaussian<4>> = filter.birth(&report(0.0, 7))?;
/// let same = filter.innovation(&ship, &report(1.0, 7))?.log_likelihood;
/// let other = filter.innovation(&ship, &report(1.0, 8))?.log_likelihood;
/// assert!(same > other + 15.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identified<F> {
    filter: F,
    reliability: f64,
}

/// How many times likelier a name is where it belongs than anywhere.
const NAMES: f64 = 1e6;

/// Probability that an object does what its motion model does not know, between two measurements.
const SURPRISE: f64 = 1e-3;

/// Standard deviations of the speed of its kind within which an object may have moved.
const REACH: f64 = 3.0;

/// `NIS` of one to six components that one right measurement in 100,000 exceeds: beyond, the motion model failed.
const FAILED: [f64; 6] = [19.51, 23.03, 25.90, 28.47, 30.86, 33.11];

/// A name that is less probable is not told.
const LIKELY: f32 = 0.5;

impl<F> Identified<F> {
    /// Names are right with probability `reliability`, 0 to below 1.
    ///
    /// # Errors
    /// When it is not in that range.
    pub fn new(filter: F, reliability: f64) -> Result<Self, FilterError> {
        if (0.0..1.0).contains(&reliability) {
            return Ok(Identified { filter, reliability });
        }
        let expected = "must be at least 0 and below 1";
        Err(FilterError::Parameter { parameter: "reliability of identities", value: reliability, expected })
    }
}

/// How a measurement compares with a belief.
struct Comparison {
    innovation: Innovation,
    /// The belief starts anew at the measurement.
    anew: bool,
}

impl<B> NamedBelief<B> {
    /// What the object is called, and how probable that is, 0 to 1.
    pub fn identity(&self) -> Option<(Identity, f64)> {
        self.identity.map(|identity| (identity, f64::from(self.sure)))
    }

    /// How far the object may have come since it was seen last, one standard deviation per axis, m.
    fn moved(&self) -> f64 {
        f64::from(self.pace) * f64::from(self.since)
    }

    fn shares(&self, identity: Option<Identity>) -> bool {
        identity.is_some() && self.identity == identity && self.sure > LIKELY
    }

    /// Keeps the heavier of two names, with its share in both.
    fn mix(&mut self, weight: f64, other: (Option<Identity>, f32), other_weight: f64) {
        let total = weight + other_weight;
        if total <= 0.0 || total.is_nan() {
            return;
        }
        let own = f64::from(self.sure) * weight / total;
        let others = f64::from(other.1) * other_weight / total;
        (self.identity, self.sure) = match (self.identity, other.0) {
            (Some(a), Some(b)) if a == b => (Some(a), (own + others) as f32),
            (None, name) => (name, others as f32),
            (name, Some(b)) if others > own => (Some(b).or(name), others as f32),
            (name, _) => (name, own as f32),
        };
    }
}

impl<F> Identified<F> {
    /// The factor `Λ` of a name, and the belief about the name after it.
    fn weigh<B>(
        &self,
        belief: &NamedBelief<B>,
        identity: Option<Identity>,
    ) -> (f64, (Option<Identity>, f32)) {
        let (before, p) = (belief.identity, f64::from(belief.sure));
        let Some(name) = identity else { return (1.0, (before, belief.sure)) };
        let rho = self.reliability;
        if before == Some(name) {
            let factor = 1.0 - p + p * rho * NAMES;
            // What was not yet sure is named now, too.
            let after = (p * rho * NAMES + (1.0 - p) * rho) / factor;
            return (factor, (before, after as f32));
        }
        let factor = 1.0 - p + p * (1.0 - rho).powi(2);
        let both = p * (1.0 - rho) + (1.0 - p);
        let (kept, new) = (p * (1.0 - rho) / both, (1.0 - p) * rho / both);
        let after = if new > kept || before.is_none() { (Some(name), new) } else { (before, kept) };
        (factor, (after.0, after.1 as f32))
    }

    fn compare<const N: usize>(
        &self,
        belief: &NamedBelief<F::Belief>,
        measurement: &Named<F::Measurement>,
        innovation: Result<Innovation, FilterError>,
    ) -> Result<Comparison, FilterError>
    where
        F: Filter<N>,
    {
        let innovation = innovation?;
        let failed = innovation.nis > FAILED[innovation.dof().clamp(1, FAILED.len()) - 1];
        if failed
            && belief.shares(measurement.identity)
            && let Some(innovation) = self.surprise(belief, measurement, &innovation)
        {
            return Ok(Comparison { innovation, anew: true });
        }
        if measurement.identity.is_none() {
            return Ok(Comparison { innovation, anew: false });
        }
        let ln_factor = self.weigh(belief, measurement.identity).0.ln();
        let mut weighed = innovation;
        weighed.log_likelihood += ln_factor;
        weighed.nis = (innovation.nis - 2.0 * ln_factor).max(0.0);
        Ok(Comparison { innovation: weighed, anew: false })
    }

    /// The innovation of a measurement of positions that the motion does not explain, if the object could have come there.
    fn surprise<const N: usize>(
        &self,
        belief: &NamedBelief<F::Belief>,
        measurement: &Named<F::Measurement>,
        innovation: &Innovation,
    ) -> Option<Innovation>
    where
        F: Filter<N>,
    {
        if N < 2 {
            return None;
        }
        let before = self.filter.state(&belief.belief);
        let after = self.filter.state(&self.filter.birth(&measurement.measurement).ok()?);
        let axes = 0..2;
        let spread: f64 = axes.clone().map(|i| before.covariance[(i, i)] + after.covariance[(i, i)]).sum();
        let variance = belief.moved().powi(2) + 0.5 * spread;
        let square = axes.map(|i| (after.mean[i] - before.mean[i]).powi(2)).sum::<f64>() / variance;
        if innovation.dof() != 2 || square > 2.0 * REACH * REACH || square.is_nan() {
            return None;
        }
        let ln_factor = self.weigh(belief, measurement.identity).0.ln();
        let ln_density = -0.5 * square - (std::f64::consts::TAU * variance).ln();
        let mut surprise = *innovation;
        surprise.log_likelihood = SURPRISE.ln() + ln_density + ln_factor;
        surprise.nis = 0.0;
        Some(surprise)
    }
}

impl<const N: usize, F: Filter<N>> Filter<N> for Identified<F> {
    type Belief = NamedBelief<F::Belief>;
    type Measurement = Named<F::Measurement>;

    fn birth(&self, measurement: &Self::Measurement) -> Result<Self::Belief, FilterError> {
        let belief = self.filter.birth(&measurement.measurement)?;
        let covariance = self.filter.state(&belief).covariance;
        let pace = if N >= 4 { (0.5 * (covariance[(2, 2)] + covariance[(3, 3)])).sqrt() } else { 0.0 };
        let identity = measurement.identity;
        let sure = if identity.is_some() { self.reliability as f32 } else { 0.0 };
        Ok(NamedBelief { belief, identity, sure, pace: pace as f32, since: 0.0 })
    }

    fn predict(&self, belief: &mut Self::Belief, dt: f64) {
        self.filter.predict(&mut belief.belief, dt);
        belief.since += dt as f32;
    }

    fn update(
        &self,
        belief: &mut Self::Belief,
        measurement: &Self::Measurement,
    ) -> Result<Innovation, FilterError> {
        let compared = if belief.shares(measurement.identity) {
            let innovation = self.filter.innovation(&belief.belief, &measurement.measurement);
            let compared = self.compare(belief, measurement, innovation)?;
            if compared.anew {
                belief.belief = self.filter.birth(&measurement.measurement)?;
            } else {
                self.filter.update(&mut belief.belief, &measurement.measurement)?;
            }
            compared
        } else {
            let innovation = self.filter.update(&mut belief.belief, &measurement.measurement);
            self.compare(belief, measurement, innovation)?
        };
        (belief.identity, belief.sure) = self.weigh(belief, measurement.identity).1;
        belief.since = 0.0;
        Ok(compared.innovation)
    }

    fn innovation(
        &self,
        belief: &Self::Belief,
        measurement: &Self::Measurement,
    ) -> Result<Innovation, FilterError> {
        let innovation = self.filter.innovation(&belief.belief, &measurement.measurement);
        Ok(self.compare(belief, measurement, innovation)?.innovation)
    }

    fn innovations(
        &self,
        belief: &Self::Belief,
        measurements: &[&Self::Measurement],
        found: &mut Vec<Result<Innovation, FilterError>>,
    ) {
        let inner: Vec<&F::Measurement> =
            measurements.iter().map(|measurement| &measurement.measurement).collect();
        self.filter.innovations(&belief.belief, &inner, found);
        for (found, measurement) in found.iter_mut().zip(measurements) {
            let innovation = std::mem::replace(found, Err(FilterError::NotFinite { what: "innovation" }));
            *found = self.compare(belief, measurement, innovation).map(|compared| compared.innovation);
        }
    }

    fn associate(&self, belief: &mut Self::Belief, parts: &[(f64, &Self::Measurement)], none: f64) -> f64 {
        if parts.iter().any(|(_, measurement)| belief.shares(measurement.identity)) {
            return super::one_by_one(self, belief, parts, none);
        }
        let inner: Vec<(f64, &F::Measurement)> =
            parts.iter().map(|(weight, measurement)| (*weight, &measurement.measurement)).collect();
        let total = self.filter.associate(&mut belief.belief, &inner, none);
        if total > 0.0 {
            let names = parts.iter().map(|(weight, part)| (*weight, self.weigh(belief, part.identity).1));
            let names: Vec<_> = names.collect();
            let mut weight = none;
            for (part, name) in names {
                belief.mix(weight, name, part);
                weight += part;
            }
            belief.since *= (none / weight) as f32;
        }
        total
    }

    fn state(&self, belief: &Self::Belief) -> Gaussian<N> {
        self.filter.state(&belief.belief)
    }

    fn set_state(&self, belief: &mut Self::Belief, state: &Gaussian<N>) {
        self.filter.set_state(&mut belief.belief, state);
    }

    fn merge(&self, belief: &mut Self::Belief, weight: f64, other: &Self::Belief, other_weight: f64) {
        self.filter.merge(&mut belief.belief, weight, &other.belief, other_weight);
        belief.mix(weight, (other.identity, other.sure), other_weight);
        belief.since = belief.since.min(other.since);
    }

    /// Objects of different names are different, wherever they are.
    fn distance(&self, belief: &Self::Belief, other: &Self::Belief, limit: f64) -> f64 {
        let different = belief.identity.is_some()
            && other.identity.is_some()
            && belief.identity != other.identity
            && belief.sure.min(other.sure) > LIKELY;
        if different {
            return f64::INFINITY;
        }
        self.filter.distance(&belief.belief, &other.belief, limit)
    }

    fn extent(&self, belief: &Self::Belief) -> Option<InverseWishart> {
        self.filter.extent(&belief.belief)
    }

    fn set_extent(&self, belief: &mut Self::Belief, extent: &InverseWishart) {
        self.filter.set_extent(&mut belief.belief, extent);
    }

    fn estimate(&self, belief: &Self::Belief) -> Estimate<N> {
        self.filter.estimate(&belief.belief)
    }

    fn reach(&self, belief: &Self::Belief, search: &Search) -> Option<Region> {
        let Region { centre, low, high } = self.filter.reach(&belief.belief, search)?;
        if belief.sure <= LIKELY {
            return Some(Region { centre, low, high });
        }
        // A measurement of the same name may lie as far away as the name carries, or as the object could have come.
        let room = Vector2::repeat(2.0 * REACH * belief.moved());
        Some(Region { centre, low: low + (low - centre) - room, high: high + (high - centre) + room })
    }

    fn widen(&self, search: &mut Search, measurement: &Self::Measurement) {
        self.filter.widen(search, &measurement.measurement);
    }

    fn place(&self, measurement: &Self::Measurement) -> Option<Vector2<f64>> {
        self.filter.place(&measurement.measurement)
    }

    fn area(&self, measurement: &Self::Measurement) -> f64 {
        self.filter.area(&measurement.measurement)
    }

    fn ln_clutter(&self, measurement: &Self::Measurement, intensity: f64) -> f64 {
        self.filter.ln_clutter(&measurement.measurement, intensity)
    }

    fn predict_all(&self, beliefs: &mut [&mut Self::Belief], dt: f64) {
        let mut inner: Vec<&mut F::Belief> = Vec::with_capacity(beliefs.len());
        for belief in beliefs {
            belief.since += dt as f32;
            inner.push(&mut belief.belief);
        }
        self.filter.predict_all(&mut inner, dt);
    }

    fn identity(&self, measurement: &Self::Measurement) -> Option<Identity> {
        measurement.identity
    }

    fn called(&self, belief: &Self::Belief) -> Option<Identity> {
        belief.identity.filter(|_| belief.sure > LIKELY)
    }
}

#[cfg(test)]
mod tests;
