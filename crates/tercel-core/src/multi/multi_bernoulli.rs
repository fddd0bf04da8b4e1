//! Cardinality-balanced multi-target multi-Bernoulli tracker.

use crate::association::Gate;
use crate::error::FilterError;
use crate::filter::Filter;

use super::labels::{Label, Roster};
use super::mixture::{Reduction, Term};
use super::phd::LEAST_UNEXPLAINED;
use super::vicinity::Vicinity;
use super::{
    Management, Scan, Track, Tracker, TrackerError, Use, birth_weight, error, ln_clutter_at, places, ratio,
};

/// Estimates a set of objects, each of which exists with a probability of its own and has a mixture of beliefs, without
/// deciding which measurement belongs to which.
///
/// ## Recursion
/// With objects `(r, Σ w b)`, survival `p_S`, detection `p_D`, clutter intensity `κ`, and `ρ_i(z) = p_D Σ w q(z)` over the
/// beliefs of object `i`:
/// ```text
/// predict    r⁻ = p_S r,  b⁻ = predicted b
/// legacy     r  = r⁻ (1 - p_D) / (1 - r⁻ p_D)                        for each object, with its beliefs as they were
/// measured   r  = Σ_i r_i (1 - r_i) ρ_i(z) / (1 - r_i p_D)²
///                 / (κ(z) + Σ_i r_i ρ_i(z) / (1 - r_i p_D))           for each z, with the beliefs of all objects
///            w  ∝ r_i / (1 - r_i) p_D w q(z)                          updated by it
/// ```
/// The sum of the probabilities is then the number of objects without bias. Within each object near beliefs are merged and
/// light ones go; objects that hardly exist go. Each measurement starts an object for the next scan, in the measure in which
/// nothing explains it.
///
/// A legacy object keeps its label; a measured one has that of the object whose belief gave most to it. Tracks are labels, read as
/// in [`Phd`](super::Phd), where the terms are the objects.
///
/// ## Use it when
/// objects are seen nearly always (`p_D` of 0.9 and more), and particles would be too many for a PHD: each object has its own
/// cloud and no clustering is needed. Where `p_D` is lower the approximation behind the measured objects is poor. With
/// [`Particle`](crate::filter::Particle) as the filter this is the SMC-CB-MeMBer.
///
/// ## Reference
/// Vo, Vo and Cantoni (2009), eqs. 15 to 22 and the Gaussian mixture of section IV; births as in [`Phd`](super::Phd). Existence is
/// kept between 0.001 below one and the pruning limit, as the weights of the measured objects divide by `1 - r`.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use tercel_core::filter::Kalman;
/// use tercel_core::motion::ConstantVelocity;
/// use tercel_core::multi::{Clutter, Detection, MultiBernoulli, MultiBernoulliConfig, Scan, Status, Tracker};
/// use tercel_core::sensor::{Measurement, Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
/// let (detection, clutter) = (Detection::uniform(0.95)?, Clutter::per_scan(10.0, 1e6)?);
/// let mut tracker = MultiBernoulli::<Gaussian<4>>::new(MultiBernoulliConfig::default())?;
/// for second in 0..8 {
///     let time = f64::from(second);
///     let measurements = [Measurement::from([10.0 * time, 0.0]), [500.0 - 10.0 * time, 300.0].into()];
///     tracker.step(&filter, &Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter })?;
/// }
/// assert!((tracker.expected_objects() - 2.0).abs() < 0.1);
/// assert_eq!(tracker.tracks().iter().filter(|track| track.status == Status::Confirmed).count(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct MultiBernoulli<B> {
    config: MultiBernoulliConfig,
    objects: Vec<Bernoulli<B>>,
    roster: Roster<B>,
    time: Option<f64>,
    scratch: Scratch<B>,
}

/// The settings of a [`MultiBernoulli`] tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MultiBernoulliConfig {
    /// Measurements outside the gate of a belief do not update it.
    pub gate: Gate,
    /// Probability that an object survives one second.
    pub survival: f64,
    /// Probability that an unexplained measurement comes from a new object, where clutter has its background intensity. 0 to 1.
    pub birth: f64,
    /// Objects of lower existence are dropped.
    pub prune: f64,
    /// Beliefs of one object closer than this squared Mahalanobis distance are merged.
    pub merge: f64,
    /// Largest number of objects kept.
    pub cap: usize,
    /// Largest number of beliefs of an object.
    pub beliefs: usize,
    /// Existence above which an object's track counts as seen.
    pub extract: f64,
    /// When tracks are confirmed and deleted.
    pub management: Management,
}

impl Default for MultiBernoulliConfig {
    fn default() -> Self {
        MultiBernoulliConfig {
            gate: Gate::default(),
            survival: 0.99,
            birth: 0.05,
            prune: 1e-3,
            merge: 4.0,
            cap: 10_000,
            beliefs: 20,
            extract: 0.5,
            management: super::PhdConfig::default().management,
        }
    }
}

/// An object that exists with a probability.
#[derive(Debug, Clone)]
struct Bernoulli<B> {
    existence: f64,
    label: Label,
    /// Weights add up to one.
    beliefs: Vec<Term<B, ()>>,
}

/// Buffers that keep their memory from scan to scan.
#[derive(Debug, Clone)]
struct Scratch<B> {
    vicinity: Vicinity,
    reduction: Reduction<B, ()>,
    measured: Vec<Measured<B>>,
    /// Of reports: object, measurement, and the object's part in it.
    claims: Vec<(usize, usize, f64)>,
    /// How far nothing explains each measurement, 0 to 1.
    unexplained: Vec<f64>,
}

/// What all objects make of one measurement.
#[derive(Debug, Clone)]
struct Measured<B> {
    numerator: f64,
    denominator: f64,
    /// Label of the object whose belief gave most, and how much that was.
    label: Option<(f64, Label)>,
    beliefs: Vec<Term<B, ()>>,
}

/// Existence is never surer than this.
const SUREST: f64 = 0.999;

/// Beliefs with less of their object's weight are dropped.
const LIGHTEST: f64 = 1e-5;

impl<B> MultiBernoulli<B> {
    /// A tracker without objects.
    ///
    /// # Errors
    /// When a probability is outside its range.
    pub fn new(config: MultiBernoulliConfig) -> Result<Self, FilterError> {
        FilterError::probability("survival probability", config.survival)?;
        FilterError::probability("birth probability", config.birth)?;
        FilterError::probability("pruning existence", config.prune)?;
        FilterError::positive("extraction existence", config.extract)?;
        let scratch = Scratch {
            vicinity: Vicinity::default(),
            reduction: Reduction::default(),
            measured: Vec::new(),
            claims: Vec::new(),
            unexplained: Vec::new(),
        };
        Ok(MultiBernoulli { config, objects: Vec::new(), roster: Roster::default(), time: None, scratch })
    }

    /// Expected number of objects: the sum of the existence probabilities.
    pub fn expected_objects(&self) -> f64 {
        self.objects.iter().map(|object| object.existence).sum()
    }
}

impl<B: Clone> MultiBernoulli<B> {
    fn predict<const N: usize, F>(&mut self, filter: &F, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let survival = self.config.survival.powf(dt);
        let mut beliefs: Vec<&mut B> = Vec::new();
        for object in &mut self.objects {
            object.existence = (object.existence * survival).min(SUREST);
            beliefs.extend(object.beliefs.iter_mut().map(|term| &mut term.belief));
        }
        filter.predict_all(&mut beliefs, dt);
    }

    /// Lets every object contribute to the measurements, and turns it into what remains of it when it was not measured.
    fn contribute<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { vicinity, measured, claims, .. } = &mut self.scratch;
        measured.clear();
        claims.clear();
        let reports = scan.detection.is_reports();
        let empty = || Measured { numerator: 0.0, denominator: 0.0, label: None, beliefs: Vec::new() };
        measured.resize_with(scan.measurements.len(), empty);
        for (at, object) in self.objects.iter_mut().enumerate() {
            let r = object.existence;
            let mut pairs: Vec<(usize, Term<B, ()>)> = Vec::new();
            let mut detected = 0.0;
            for term in &mut object.beliefs {
                let (sight, near) = vicinity.look(filter, &term.belief, scan);
                detected += term.weight * sight.missed;
                for &number in near {
                    let mut belief = term.belief.clone();
                    // A pair whose update fails numerically is a pair outside the gate.
                    let Ok(innovation) = filter.update(&mut belief, &scan.measurements[number]) else {
                        continue;
                    };
                    let ln_clutter = ln_clutter_at(filter, scan, &scan.measurements[number]);
                    let weight = sight.seen * term.weight * ratio(innovation.log_likelihood - ln_clutter);
                    if self.config.gate.contains(&innovation) && weight.is_finite() {
                        pairs.push((number, Term { weight, belief, tag: () }));
                    }
                }
                term.weight *= 1.0 - sight.missed;
            }
            let left = 1.0 - r * detected;
            object.label = Label { id: object.label.id, measurement: None, in_view: detected > 0.0 };
            for (number, mut term) in pairs {
                let pool = &mut measured[number];
                let part = r * term.weight / left;
                pool.denominator += part;
                // An object reports or it does not: what it reported is not there a second time, unreported.
                pool.numerator += if reports { part } else { part * (1.0 - r) / left };
                if reports {
                    claims.push((at, number, part));
                }
                term.weight *= r / (1.0 - r);
                pool.claim(term.weight, &object.label);
                pool.beliefs.push(term);
            }
            object.existence = r * (1.0 - detected) / left;
            normalise(&mut object.beliefs);
        }
    }

    /// Adds the measured objects to the legacy ones, and drops what hardly exists.
    fn collect<const N: usize, F>(&mut self, filter: &F, time: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { reduction, measured, claims, unexplained, .. } = &mut self.scratch;
        for &(object, number, part) in &*claims {
            let object = &mut self.objects[object];
            object.existence = (object.existence - part / (1.0 + measured[number].denominator)).max(0.0);
        }
        unexplained.clear();
        for (number, mut pool) in measured.drain(..).enumerate() {
            // Relative to the clutter at the measurement, whose own share is then one.
            let total = 1.0 + pool.denominator;
            unexplained.push(1.0 / total);
            let Some((_, label)) = pool.label else { continue };
            let existence = (pool.numerator / total).min(SUREST);
            normalise(&mut pool.beliefs);
            let label = Label { measurement: Some(number), ..label };
            self.objects.push(Bernoulli { existence, label, beliefs: pool.beliefs });
        }
        let weights = self.objects.iter_mut().map(|object| (object.label.id, &mut object.existence));
        self.roster.hold(weights, &self.config.management, (time, self.config.survival));
        let (prune, merge, cap) = (self.config.prune, self.config.merge, self.config.beliefs);
        self.objects.retain(|object| object.existence > prune && !object.beliefs.is_empty());
        for object in &mut self.objects {
            object.beliefs.retain(|term| term.weight > LIGHTEST);
            reduction.reduce(filter, &mut object.beliefs, merge, cap);
            normalise(&mut object.beliefs);
        }
        self.objects.sort_by(|a, b| b.existence.total_cmp(&a.existence));
        self.objects.truncate(self.config.cap);
    }

    /// Reads the tracks off the objects. A label that management gave up takes its objects with it.
    fn label<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let whole = |object: &Bernoulli<B>| {
            let mut belief = object.beliefs[0].belief.clone();
            let mut weight = object.beliefs[0].weight;
            for term in &object.beliefs[1..] {
                filter.merge(&mut belief, weight, &term.belief, term.weight);
                weight += term.weight;
            }
            Term { weight: object.existence, belief, tag: object.label }
        };
        let mut terms: Vec<Term<B, Label>> = self.objects.iter().map(whole).collect();
        let rule = (self.config.extract, (dt, scan.time), &self.config.management);
        self.roster.read(filter, &mut terms, scan.measurements.len(), rule);
        for (object, term) in self.objects.iter_mut().zip(&terms) {
            object.label = term.tag;
        }
        let roster = &self.roster;
        self.objects.retain(|object| roster.lives(object.label.id));
    }

    /// Starts an object at each measurement that is not explained, for the next scan to confirm.
    fn birth<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        for (number, measurement) in scan.measurements.iter().enumerate() {
            let unexplained = self.scratch.unexplained[number];
            let existence = birth_weight(self.config.birth, filter, scan, measurement) * unexplained;
            if existence <= self.config.prune || unexplained < LEAST_UNEXPLAINED {
                continue;
            }
            // A measurement that cannot say where an object is starts none.
            let Ok(belief) = filter.birth(measurement) else { continue };
            let id = self.roster.start(&belief, existence, number, scan.time);
            let label = Label { id, measurement: None, in_view: false };
            self.objects.push(Bernoulli {
                existence,
                label,
                beliefs: vec![Term { weight: 1.0, belief, tag: () }],
            });
        }
    }
}

impl<B> Measured<B> {
    /// Takes the label of an object if the part of its belief is the largest so far.
    fn claim(&mut self, part: f64, label: &Label) {
        if self.label.is_none_or(|(largest, _)| part > largest) {
            self.label = Some((part, *label));
        }
    }
}

/// Scales weights so that they add up to one. Where all vanished there is nothing left to weigh.
fn normalise<B>(terms: &mut Vec<Term<B, ()>>) {
    let sum: f64 = terms.iter().map(|term| term.weight).sum();
    if sum > 0.0 && sum.is_finite() {
        terms.iter_mut().for_each(|term| term.weight /= sum);
    } else {
        terms.clear();
    }
}

impl<B: Clone> Tracker for MultiBernoulli<B> {
    type Belief = B;

    fn step<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
    ) -> Result<(), TrackerError>
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let dt = error::step(scan.time, self.time)?;
        let places = places(filter, scan)?;
        self.roster.begin(dt);
        self.scratch.vicinity.build(filter, scan, &self.config.gate, &places);
        self.predict(filter, dt);
        self.contribute(filter, scan);
        self.collect(filter, scan.time);
        self.label(filter, scan, dt);
        self.birth(filter, scan);
        self.time = Some(scan.time);
        Ok(())
    }

    fn tracks(&self) -> &[Track<B>] {
        &self.roster.tracks
    }

    fn uses(&self) -> &[Use] {
        &self.roster.uses
    }

    fn time(&self) -> Option<f64> {
        self.time
    }
}
