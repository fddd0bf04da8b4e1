//! Poisson multi-Bernoulli mixture tracker.

mod cluster;
mod grow;
mod reduce;
mod undetected;
mod update;

#[cfg(test)]
mod tests;

use crate::association::clusters::Clusters;
use crate::association::{Gate, KBest};
use crate::error::FilterError;
use crate::filter::Filter;

use super::vicinity::Vicinity;
use super::{
    Confirmation, Management, Scan, Status, Track, TrackId, Tracker, TrackerError, Use, error, places,
};
use cluster::Cluster;
use undetected::Undetected;
use update::Candidate;

/// Estimates the set of objects as a mixture of hypotheses on which measurements belong together, beside a Poisson intensity
/// of the objects that were never detected: the exact form of the posterior, of which the other trackers are approximations.
///
/// ## Recursion
/// A track is a tree: it begins with a measurement, and each leaf is one way in which its later measurements may be chosen,
/// with a belief and a probability of existence `r`. A hypothesis picks at most one leaf of each tree, and has a weight. With
/// survival `p_S`, detection `p_D`, density `q(z)`, clutter intensity `κ` and undetected intensity `λ`:
/// ```text
/// predict    r⁻ = p_S r,  b⁻ = predicted b,  λ⁻ = p_S λ + births
/// missed     r  = r⁻ (1 - p_D) / (1 - r⁻ p_D)                   and the hypothesis weighs 1 - r⁻ p_D as much
/// detected   r  = 1, b updated by z                             and it weighs r⁻ p_D q(z) as much
/// new        r  = p_D λ⁻ / (κ + p_D λ⁻), b from the sensor      and it weighs κ + p_D λ⁻ as much
/// undetected λ  = (1 - p_D) λ⁻
/// ```
/// Each hypothesis is followed by its most probable assignments of the measurements to leaves or new objects, found by
/// Murty's algorithm, as many as its weight deserves. Leaves of a tree that saw the same last measurement and have come to say the
/// same are merged, and with them hypotheses that differ in nothing else; of two trees that claim one object under different hypotheses the
/// stronger gets it. Trees that share no measurement and whose choices are
/// independent are kept in clusters of their own, so the cost grows with how entangled the picture is and not with its size.
///
/// A tree is a track: its number is its label, its existence that of its leaves over all hypotheses, its belief their merger.
///
/// ## Use it when
/// tracks must not be lost or swapped in clutter and close company, and births, deaths and misses matter: it is the most accurate
/// tracker here. It costs some times as much as a [`Jpda`](super::Jpda), and needs densities of objects in place of a weight
/// for births.
///
/// ## Reference
/// García-Fernández, Williams, Granström and Svensson (2018), section III, eqs. 14 to 33 in track-oriented form (Williams (2015), eqs. 22 to
/// 48); Murty (1968). Deviations: the undetected intensity is uniform in the plane except for where sensors saw; pairs, hypotheses
/// and trees of negligible weight are dropped; choices that are independent to within 0.001 in each pair of trees are treated as
/// independent.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use tercel_core::filter::Kalman;
/// use tercel_core::motion::ConstantVelocity;
/// use tercel_core::multi::{Clutter, Detection, Pmbm, PmbmConfig, Scan, Status, Tracker};
/// use tercel_core::sensor::{Measurement, Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
/// let (detection, clutter) = (Detection::uniform(0.9)?, Clutter::per_scan(10.0, 1e6)?);
/// let mut tracker = Pmbm::<Gaussian<4>>::new(PmbmConfig::default())?;
/// for second in 0..10 {
///     let time = f64::from(second);
///     let measurements = [Measurement::from([10.0 * time, 0.0]), [10.0 * time, 40.0].into()];
///     tracker.step(&filter, &Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter })?;
/// }
/// assert_eq!(tracker.tracks().iter().filter(|track| track.status == Status::Confirmed).count(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Pmbm<B> {
    config: PmbmConfig,
    undetected: Undetected,
    clusters: Vec<Cluster<B>>,
    tracks: Vec<Track<B>>,
    uses: Vec<Use>,
    next: TrackId,
    time: Option<f64>,
    scratch: Scratch,
}

/// The settings of a [`Pmbm`] tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmbmConfig {
    /// Measurements outside the gate of a leaf do not update it.
    pub gate: Gate,
    /// Probability that an object survives one second.
    pub survival: f64,
    /// Expected objects per m² before the first scan. `None` stands for as many as there are false measurements, and for no fewer
    /// than 1e-6: so an unexplained measurement of the first scan is an object or clutter with equal probability.
    pub undetected: Option<f64>,
    /// Expected new objects per m² and second. `None` stands for one to a thousand false measurements, and for no
    /// fewer than 1e-8.
    pub birth: Option<f64>,
    /// Largest number of hypotheses of a cluster.
    pub hypotheses: usize,
    /// Hypotheses of a lower weight are dropped, and pairs that explain a measurement with a lower probability.
    pub prune: f64,
    /// Leaves of a tree with the same last measurement and closer than this squared Mahalanobis distance are merged. Zero merges
    /// none.
    pub merge: f64,
    /// Largest number of tracks.
    pub cap: usize,
    /// When tracks are confirmed and deleted.
    pub management: Management,
}

impl Default for PmbmConfig {
    fn default() -> Self {
        PmbmConfig {
            gate: Gate::default(),
            survival: 0.99,
            undetected: None,
            birth: None,
            hypotheses: 100,
            prune: 1e-4,
            merge: 0.5,
            cap: 10_000,
            management: Management {
                confirm: Confirmation::Existence(0.95),
                min_existence: 1e-4,
                ..Management::default()
            },
        }
    }
}

/// Buffers that keep their memory from scan to scan.
#[derive(Debug, Clone, Default)]
struct Scratch {
    vicinity: Vicinity,
    candidates: Vec<Candidate>,
    groups: Clusters,
    k_best: KBest,
}

impl<B> Pmbm<B> {
    /// A tracker without objects.
    ///
    /// # Errors
    /// When a probability, density or weight is outside its range.
    pub fn new(config: PmbmConfig) -> Result<Self, FilterError> {
        FilterError::probability("survival probability", config.survival)?;
        FilterError::probability("pruning weight", config.prune)?;
        let undetected = Undetected::new(config.undetected, config.birth, config.survival)?;
        if config.hypotheses == 0 {
            let (parameter, expected) = ("number of hypotheses", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        Ok(Pmbm {
            config,
            undetected,
            clusters: Vec::new(),
            tracks: Vec::new(),
            uses: Vec::new(),
            next: 1,
            time: None,
            scratch: Scratch::default(),
        })
    }

    /// Expected number of objects that were detected: the sum of the existence probabilities.
    pub fn expected_objects(&self) -> f64 {
        self.tracks.iter().map(|track| track.existence).sum()
    }

    /// Number of hypotheses of each cluster.
    pub fn hypotheses(&self) -> impl ExactSizeIterator<Item = usize> {
        self.clusters.iter().map(|cluster| cluster.hypotheses.len())
    }
}

impl<B: Clone> Pmbm<B> {
    fn predict<const N: usize, F>(&mut self, filter: &F, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let survival = self.config.survival.powf(dt);
        let mut beliefs: Vec<&mut B> = Vec::new();
        let trees = self.clusters.iter_mut().flat_map(|cluster| &mut cluster.trees);
        for leaf in trees.flat_map(|tree| &mut tree.leaves) {
            leaf.existence *= survival;
            beliefs.push(&mut leaf.belief);
        }
        filter.predict_all(&mut beliefs, dt);
        self.undetected.predict(dt);
    }

    /// Says for each tree how far existence may sink in this scan: management ends confirmed tracks by counting misses.
    fn hold(&mut self, time: f64) {
        let PmbmConfig { management, survival, .. } = &self.config;
        for tree in self.clusters.iter_mut().flat_map(|cluster| &mut cluster.trees) {
            let Ok(at) = self.tracks.binary_search_by_key(&tree.label, |track| track.id) else { continue };
            let track = &self.tracks[at];
            tree.missed = management.least(track, time, *survival);
            tree.least = management.limit(track, false);
        }
    }

    /// Reads the tracks off the trees; those that management gives up take their trees with them. A track of which nothing is left
    /// is reported where it would be now.
    fn read<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>, dt: f64)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        self.uses.clear();
        self.uses.resize(scan.measurements.len(), Use::Clutter);
        let mut claims = vec![0.0; scan.measurements.len()];
        let mut fresh = Vec::new();
        for cluster in &self.clusters {
            for (number, tree) in cluster.trees.iter().enumerate() {
                let summary = cluster.summary(filter, number);
                match self.tracks.binary_search_by_key(&tree.label, |track| track.id) {
                    Ok(at) => {
                        let track = &mut self.tracks[at];
                        if summary.is_gone() {
                            filter.predict(&mut track.belief, dt);
                        }
                        summary.show(track, scan.time);
                    }
                    Err(_) => fresh.extend(summary.start(tree.label, scan.time)),
                }
            }
        }
        fresh.sort_by_key(|track: &Track<B>| track.id);
        self.tracks.append(&mut fresh);
        self.drop_weakest();
        for track in &mut self.tracks {
            track.time = scan.time;
            self.config.management.judge(track, scan.time);
            let Some(number) = track.measurement else { continue };
            if track.existence > claims[number] {
                claims[number] = track.existence;
                let started = track.started == scan.time && track.hits == 1;
                self.uses[number] = if started { Use::Started(track.id) } else { Use::Updated(track.id) };
            }
        }
        let tracks = &self.tracks;
        let lives = |label: TrackId| {
            let at = tracks.binary_search_by_key(&label, |track| track.id);
            at.is_ok_and(|at| tracks[at].status != Status::Deleted)
        };
        self.clusters.iter_mut().for_each(|cluster| cluster.keep(lives));
        self.clusters.retain(|cluster| !cluster.trees.is_empty());
    }

    /// Gives up the tracks that hardly exist while there are more than allowed.
    fn drop_weakest(&mut self) {
        let surplus = self.tracks.len().saturating_sub(self.config.cap);
        if surplus == 0 {
            return;
        }
        let mut order: Vec<usize> = (0..self.tracks.len()).collect();
        order.sort_by(|&a, &b| {
            let (a, b) = (&self.tracks[a], &self.tracks[b]);
            a.existence.total_cmp(&b.existence).then(b.id.cmp(&a.id))
        });
        for &weak in &order[..surplus] {
            self.tracks[weak].existence = 0.0;
        }
    }
}

impl<B: Clone> Tracker for Pmbm<B> {
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
        self.scratch.vicinity.build(filter, scan, &self.config.gate, &places);
        self.tracks.iter_mut().for_each(|track| track.wait(dt));
        self.predict(filter, dt);
        self.hold(scan.time);
        self.update(filter, scan, &places);
        // That nobody reported says nothing of those who were never seen.
        if !scan.detection.is_reports() {
            self.undetected.seen(scan.detection);
        }
        self.read(filter, scan, dt);
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
