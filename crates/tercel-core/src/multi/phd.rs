//! Gaussian-mixture probability hypothesis density tracker.

use crate::association::Gate;
use crate::error::FilterError;
use crate::filter::Filter;

use super::labels::{Label, Labelled, Roster};
use super::mixture::{Reduction, Term};
use super::vicinity::Vicinity;
use super::{
    Management, Scan, Track, Tracker, TrackerError, Use, birth_weight, error, ln_clutter_at, places, ratio,
};

/// Estimates the intensity of objects over the state space, as a mixture of beliefs, without deciding which measurement
/// belongs to which object; labels on the components turn the intensity into tracks.
///
/// ## Recursion
/// With components `(w, b)`, survival `p_S`, detection `p_D`, clutter intensity `κ`, and `q(z) = p(z | b)`:
/// ```text
/// predict   w⁻ = p_S w,  b⁻ = predicted b
/// miss      w  = (1 - p_D) w⁻
/// detect    w  = p_D w⁻ q(z) / (κ(z) + Σ p_D w⁻ q(z))      for each z in the gate, with b updated by z
/// ```
/// Then components below the pruning weight go, near ones are merged around the heaviest, and only the heaviest are kept.
/// Each measurement starts a component for the next scan, with a weight in the measure in which nothing explains it.
///
/// A component keeps the label of its parent, and a merged one that of its heaviest part. A track is a label: its existence
/// is the weight of its components (at most one), its belief that of the heaviest. When one label stands for two separate
/// heavy components the lighter becomes a new track.
///
/// ## Use it when
/// clutter is dense and objects come and go, and a missed detection may cost a track a scan: the weight of an object that is
/// not seen drops at once. `B` is the belief of any filter: `Phd<Gaussian<4>>` with a
/// [`Kalman`](crate::filter::Kalman) filter, `Phd<ImmBelief<..>>` with an IMM in each component.
///
/// ## Reference
/// Vo and Ma (2006), eqs. 21 to 38 and tables I to III; labels after Panta, Clark and Vo (2009). Deviations: births come from
/// the measurements of the scan before (Ristic, Clark, Vo and Vo (2012)), in the measure in which these are unexplained;
/// merging measures distance with the covariance of the heaviest component and keeps the spread of the means.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use tercel_core::filter::Kalman;
/// use tercel_core::motion::ConstantVelocity;
/// use tercel_core::multi::{Clutter, Detection, Phd, PhdConfig, Scan, Status, Tracker};
/// use tercel_core::sensor::{Measurement, Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
/// let (detection, clutter) = (Detection::uniform(0.95)?, Clutter::per_scan(10.0, 1e6)?);
/// let mut phd = Phd::<Gaussian<4>>::new(PhdConfig::default())?;
/// for second in 0..8 {
///     let time = f64::from(second);
///     let measurements = [Measurement::from([10.0 * time, 0.0]), [500.0 - 10.0 * time, 300.0].into()];
///     phd.step(&filter, &Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter })?;
/// }
/// let confirmed = phd.tracks().iter().filter(|track| track.status == Status::Confirmed);
/// assert_eq!(confirmed.count(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Phd<B> {
    config: PhdConfig,
    terms: Vec<Labelled<B>>,
    roster: Roster<B>,
    time: Option<f64>,
    scratch: Scratch<B>,
}

/// The settings of a [`Phd`] tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhdConfig {
    /// Measurements outside the gate of a component do not update it.
    pub gate: Gate,
    /// Probability that an object survives one second.
    pub survival: f64,
    /// Expected new objects per unexplained measurement, where clutter has its background intensity. 0 to 1.
    pub birth: f64,
    /// Components of lower weight are dropped.
    pub prune: f64,
    /// Components closer than this squared Mahalanobis distance are merged.
    pub merge: f64,
    /// Largest number of components kept.
    pub cap: usize,
    /// Weight above which a component is an object: its track counts as seen, and a second such component of one label is an
    /// object of its own.
    pub extract: f64,
    /// When tracks are confirmed and deleted.
    pub management: Management,
}

impl Default for PhdConfig {
    fn default() -> Self {
        PhdConfig {
            gate: Gate::default(),
            survival: 0.99,
            birth: 0.05,
            prune: 1e-5,
            merge: 4.0,
            cap: 10_000,
            extract: 0.5,
            management: Management {
                confirm: super::Confirmation::Hits { hits: 3, scans: 4 },
                min_existence: 1e-3,
                max_misses: 2,
                ..Management::default()
            },
        }
    }
}

/// Buffers that keep their memory from scan to scan.
#[derive(Debug, Clone)]
struct Scratch<B> {
    vicinity: Vicinity,
    reduction: Reduction<B, Label>,
    children: Vec<Labelled<B>>,
    /// The term from which each child comes.
    parents: Vec<usize>,
    /// Sum of the detection terms of each measurement, then its whole denominator, relative to its clutter.
    explained: Vec<f64>,
}

impl<B> Phd<B> {
    /// A tracker without objects.
    ///
    /// # Errors
    /// When a probability or weight is outside its range.
    pub fn new(config: PhdConfig) -> Result<Self, FilterError> {
        FilterError::probability("survival probability", config.survival)?;
        FilterError::probability("birth weight", config.birth)?;
        FilterError::probability("pruning weight", config.prune)?;
        FilterError::positive("extraction weight", config.extract)?;
        let scratch = Scratch {
            vicinity: Vicinity::default(),
            reduction: Reduction::default(),
            children: Vec::new(),
            parents: Vec::new(),
            explained: Vec::new(),
        };
        Ok(Phd { config, terms: Vec::new(), roster: Roster::default(), time: None, scratch })
    }

    /// Expected number of objects: the sum of the weights.
    pub fn expected_objects(&self) -> f64 {
        self.terms.iter().map(|term| term.weight).sum()
    }
}

impl<B: Clone> Phd<B> {
    fn predict<const N: usize, F>(&mut self, filter: &F, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let survival = self.config.survival.powf(dt);
        let mut beliefs: Vec<&mut B> = Vec::with_capacity(self.terms.len());
        for term in &mut self.terms {
            term.weight *= survival;
            beliefs.push(&mut term.belief);
        }
        filter.predict_all(&mut beliefs, dt);
    }

    /// Replaces the predicted terms by the missed and the detected ones, weighted and pruned.
    fn update<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { vicinity, children, parents, explained, .. } = &mut self.scratch;
        children.clear();
        explained.clear();
        explained.resize(scan.measurements.len(), 0.0);
        parents.clear();
        for (row, term) in self.terms.iter_mut().enumerate() {
            let (sight, near) = vicinity.look(filter, &term.belief, scan);
            term.tag = Label { id: term.tag.id, measurement: None, in_view: sight.missed > 0.0 };
            for &number in near {
                let mut belief = term.belief.clone();
                // A pair whose update fails numerically is a pair outside the gate.
                let Ok(innovation) = filter.update(&mut belief, &scan.measurements[number]) else { continue };
                if !self.config.gate.contains(&innovation) {
                    continue;
                }
                let ln_ratio =
                    innovation.log_likelihood - ln_clutter_at(filter, scan, &scan.measurements[number]);
                let weight = sight.seen * term.weight * ratio(ln_ratio);
                explained[number] += weight;
                let tag = Label { measurement: Some(number), ..term.tag };
                children.push(Term { weight, belief, tag });
                parents.push(row);
            }
            term.weight *= 1.0 - sight.missed;
        }
        // Everything is relative to the clutter at the measurement, whose own share is then one.
        explained.iter_mut().for_each(|sum| *sum += 1.0);
        for (child, &parent) in children.iter_mut().zip(&*parents) {
            if let Some(number) = child.tag.measurement {
                child.weight /= explained[number];
            }
            // An object reports or it does not: what it reported is not there a second time, unreported.
            if scan.detection.is_reports() {
                let term = &mut self.terms[parent];
                term.weight = (term.weight - child.weight).max(0.0);
            }
        }
        self.terms.append(children);
        let weights = self.terms.iter_mut().map(|term| (term.tag.id, &mut term.weight));
        self.roster.hold(weights, &self.config.management, (scan.time, self.config.survival));
        self.terms.retain(|term| term.weight > self.config.prune);
    }

    /// Reads the tracks off the terms. A label that management gave up takes its terms with it.
    fn label<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let rule = (self.config.extract, (dt, scan.time), &self.config.management);
        self.roster.read(filter, &mut self.terms, scan.measurements.len(), rule);
        let roster = &self.roster;
        self.terms.retain(|term| roster.lives(term.tag.id));
    }

    /// Starts a term at each measurement that is not explained, for the next scan to confirm.
    fn birth<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        for (number, measurement) in scan.measurements.iter().enumerate() {
            let unexplained = 1.0 / self.scratch.explained[number];
            let weight = birth_weight(self.config.birth, filter, scan, measurement) * unexplained;
            if weight <= self.config.prune || unexplained < LEAST_UNEXPLAINED {
                continue;
            }
            // A measurement that cannot say where an object is starts none.
            let Ok(belief) = filter.birth(measurement) else { continue };
            let id = self.roster.start(&belief, weight, number, scan.time);
            self.terms.push(Term { weight, belief, tag: Label { id, measurement: None, in_view: false } });
        }
    }
}

/// A measurement that is explained by more than the rest of this starts nothing.
pub(super) const LEAST_UNEXPLAINED: f64 = 0.1;

impl<B: Clone> Tracker for Phd<B> {
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
        self.update(filter, scan);
        let (merge, cap) = (self.config.merge, self.config.cap);
        self.scratch.reduction.reduce(filter, &mut self.terms, merge, cap);
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
