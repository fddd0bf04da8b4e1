//! Gaussian-mixture probability hypothesis density tracker.

use crate::association::{Gate, PlaceIndex};
use crate::error::FilterError;
use crate::filter::Filter;

use super::{
    Management, Scan, Status, Track, TrackId, Tracker, TrackerError, Use, birth_weight, error, ln_clutter_at,
    places, plane, ratio,
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
    components: Vec<Component<B>>,
    tracks: Vec<Track<B>>,
    uses: Vec<Use>,
    next: TrackId,
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
            cap: 500,
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

/// One term of the mixture.
#[derive(Debug, Clone)]
struct Component<B> {
    weight: f64,
    label: TrackId,
    belief: B,
    /// The measurement of this scan that updated it.
    measurement: Option<usize>,
    /// Whether the sensor could have seen it.
    in_view: bool,
}

/// Buffers that keep their memory from scan to scan.
#[derive(Debug, Clone)]
struct Scratch<B> {
    index: PlaceIndex,
    near: Vec<usize>,
    children: Vec<Component<B>>,
    /// Sum of the detection terms of each measurement, then its whole denominator, relative to its clutter.
    explained: Vec<f64>,
    taken: Vec<bool>,
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
            index: PlaceIndex::default(),
            near: Vec::new(),
            children: Vec::new(),
            explained: Vec::new(),
            taken: Vec::new(),
        };
        Ok(Phd {
            config,
            components: Vec::new(),
            tracks: Vec::new(),
            uses: Vec::new(),
            next: 1,
            time: None,
            scratch,
        })
    }

    /// Expected number of objects: the sum of the weights.
    pub fn expected_objects(&self) -> f64 {
        self.components.iter().map(|component| component.weight).sum()
    }

    fn fresh_label(next: &mut TrackId) -> TrackId {
        let label = *next;
        *next += 1;
        label
    }
}

impl<B: Clone> Phd<B> {
    fn predict<const N: usize, F>(&mut self, filter: &F, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let survival = self.config.survival.powf(dt);
        let mut beliefs: Vec<&mut B> = Vec::with_capacity(self.components.len());
        for component in &mut self.components {
            component.weight *= survival;
            beliefs.push(&mut component.belief);
        }
        filter.predict_all(&mut beliefs, dt);
    }

    /// Replaces the predicted components by the missed and the detected ones, weighted and pruned.
    fn update<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { index, near, children, explained, .. } = &mut self.scratch;
        children.clear();
        explained.clear();
        explained.resize(scan.measurements.len(), 0.0);
        for component in &mut self.components {
            let reach = filter.reach(&component.belief);
            let detection = scan.detection.probability(reach.as_ref().map(|(centre, _)| centre));
            component.in_view = detection > 0.0;
            component.measurement = None;
            match reach {
                Some((centre, spread)) => index.near(&centre, &spread, self.config.gate.search_limit(), near),
                None => near.splice(.., 0..scan.measurements.len()).for_each(drop),
            }
            for &number in near.iter().filter(|_| component.in_view) {
                let mut belief = component.belief.clone();
                // A pair whose update fails numerically is a pair outside the gate.
                let Ok(innovation) = filter.update(&mut belief, &scan.measurements[number]) else { continue };
                if !self.config.gate.contains(&innovation) {
                    continue;
                }
                let ln_ratio =
                    innovation.log_likelihood - ln_clutter_at(filter, scan, &scan.measurements[number]);
                let weight = detection * component.weight * ratio(ln_ratio);
                explained[number] += weight;
                let (label, measurement) = (component.label, Some(number));
                children.push(Component { weight, label, belief, measurement, in_view: true });
            }
            component.weight *= 1.0 - detection;
        }
        // Everything is relative to the clutter at the measurement, whose own share is then one.
        explained.iter_mut().for_each(|sum| *sum += 1.0);
        self.components.append(children);
        for component in &mut self.components {
            if let Some(number) = component.measurement {
                component.weight /= explained[number];
            }
        }
        self.components.retain(|component| component.weight > self.config.prune);
    }

    /// Merges components that are near each other, heaviest first, and keeps the heaviest of the result.
    fn reduce<const N: usize, F>(&mut self, filter: &F)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        // The sort is stable and weights that tie keep their order, so the result does not depend on the platform.
        self.components.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let Scratch { index, near, children, taken, .. } = &mut self.scratch;
        let components = &self.components;
        let states: Vec<_> =
            components.iter().map(|component| plane(&filter.state(&component.belief))).collect();
        index.build(&states.iter().map(|state| state.map(|s| s.0)).collect::<Vec<_>>());
        taken.clear();
        taken.resize(components.len(), false);
        children.clear();
        for (heaviest, component) in components.iter().enumerate() {
            if taken[heaviest] {
                continue;
            }
            let mut merged = component.clone();
            match &states[heaviest] {
                Some((centre, spread)) => index.near(centre, spread, self.config.merge, near),
                None => near.splice(.., 0..components.len()).for_each(drop),
            }
            for &other in near.iter().filter(|&&other| other > heaviest) {
                let part = &components[other];
                let close = !taken[other]
                    && filter.distance(&component.belief, &part.belief, self.config.merge)
                        <= self.config.merge;
                if close {
                    taken[other] = true;
                    filter.merge(&mut merged.belief, merged.weight, &part.belief, part.weight);
                    merged.weight += part.weight;
                }
            }
            children.push(merged);
        }
        children.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        children.truncate(self.config.cap);
        std::mem::swap(&mut self.components, children);
    }

    /// Reads the tracks off the labelled components, heaviest first.
    fn label(&mut self, time: f64) {
        for track in &mut self.tracks {
            track.existence = 0.0;
            track.measurement = None;
        }
        for component in &mut self.components {
            let position = self.tracks.binary_search_by_key(&component.label, |track| track.id);
            let heaviest = position.is_ok_and(|at| self.tracks[at].existence == 0.0);
            match position {
                // The first component of a label is its heaviest.
                Ok(at) if heaviest => show(&mut self.tracks[at], component, self.config.extract, time),
                Ok(at) if component.weight < self.config.extract => {
                    let track = &mut self.tracks[at];
                    track.existence = (track.existence + component.weight).min(1.0);
                }
                _ => {
                    component.label = Phd::<B>::fresh_label(&mut self.next);
                    let (belief, number) = (component.belief.clone(), component.measurement);
                    let existence = component.weight.min(1.0);
                    let mut track =
                        Track::new(component.label, belief, existence, number.unwrap_or_default(), time);
                    track.measurement = number;
                    self.tracks.push(track);
                }
            }
        }
        for track in &mut self.tracks {
            self.config.management.judge(track, time);
        }
        // A label that management gave up takes its components with it.
        let tracks = &self.tracks;
        self.components.retain(|component| {
            let at = tracks.binary_search_by_key(&component.label, |track| track.id);
            at.is_ok_and(|at| tracks[at].status != Status::Deleted)
        });
    }

    /// Starts a component at each measurement that is not explained, for the next scan to confirm.
    fn birth<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        self.uses.clear();
        self.uses.resize(scan.measurements.len(), Use::Clutter);
        for track in self.tracks.iter().rev() {
            if let Some(number) = track.measurement {
                self.uses[number] = Use::Updated(track.id);
            }
        }
        for (number, measurement) in scan.measurements.iter().enumerate() {
            let unexplained = 1.0 / self.scratch.explained[number];
            let weight = birth_weight(self.config.birth, filter, scan, measurement) * unexplained;
            if weight <= self.config.prune || unexplained < 0.1 {
                continue;
            }
            // A measurement that cannot say where an object is starts none.
            let Ok(belief) = filter.birth(measurement) else { continue };
            let label = Phd::<B>::fresh_label(&mut self.next);
            self.uses[number] = Use::Started(label);
            self.tracks.push(Track::new(label, belief.clone(), weight, number, scan.time));
            self.components.push(Component { weight, label, belief, measurement: None, in_view: false });
        }
    }
}

/// Updates a track from the heaviest component of its label. A light component is no sighting, whatever updated it.
fn show<B: Clone>(track: &mut Track<B>, component: &Component<B>, extract: f64, time: f64) {
    track.existence = component.weight.min(1.0);
    track.belief = component.belief.clone();
    match component.measurement {
        Some(number) if component.weight >= extract => track.hit(number, time),
        _ if component.in_view => track.miss(),
        _ => track.unseen(),
    }
}

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
        self.tracks.retain(|track| track.status != Status::Deleted);
        self.scratch.index.build(&places);
        self.predict(filter, dt);
        self.update(filter, scan);
        self.reduce(filter);
        self.label(scan.time);
        self.birth(filter, scan);
        self.time = Some(scan.time);
        Ok(())
    }

    fn tracks(&self) -> &[Track<B>] {
        &self.tracks
    }

    fn uses(&self) -> &[Use] {
        &self.uses
    }

    fn time(&self) -> Option<f64> {
        self.time
    }
}
