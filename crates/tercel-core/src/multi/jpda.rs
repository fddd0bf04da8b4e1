//! Joint probabilistic data association with existence probabilities.

use crate::association::{Gate, Marginals};
use crate::error::FilterError;
use crate::filter::{Filter, Innovation};

use super::detection::Sight;
use super::individuals::Individuals;
use super::vicinity::Vicinity;
use super::{Management, Scan, Track, Tracker, TrackerError, Use, error, ln_clutter_at, places};

/// Updates each track with all measurements in its gate, each by the probability that it is the track's own, given that no
/// two tracks can have the same one; and keeps the probability that each track exists.
///
/// ## Recursion
/// For a track that exists with probability `r⁻`, is detected with `p_D` and gives measurement `j` the density `q_j`, against
/// clutter of intensity `κ`:
/// ```text
/// predict   r⁻ = p_S r
/// weigh     w_j = r⁻ p_D q_j / (κ_j (1 - r⁻ p_D))        of having j against having none, for each track
/// join      β_j, β_0 from the weights of all tracks      over the assignments without conflict
/// update    r = Σ_j β_j + β_0 r⁻ (1 - p_D) / (1 - r⁻ p_D)
///           b = merger of the beliefs updated by each j, weighted β_j, and the predicted one with the rest of r
/// ```
/// A measurement starts a tentative track in the measure in which no track claims it. A track that has come as close to a
/// stronger one as if both were one object is dropped.
///
/// With an [`Imm`](crate::filter::Imm) as the filter this is the IMM-JPDA: beliefs merge mode by mode, each with its share
/// of the probability, so the probabilities of the modes weigh the measurements as the paper has it.
///
/// ## Use it when
/// clutter is dense, or objects come close to each other for some scans: no decision has to be taken back. Objects that stay
/// side by side pull each other's tracks together; a tracker that keeps hypotheses tells them apart longer.
///
/// ## Reference
/// Fortmann, Bar-Shalom and Scheffe (1983), section III; existence after Musicki and Evans (2004), eqs. 15 to 33; with an IMM
/// Chen and Tugnait (2001), of which this is the single-scan form. The joint probabilities are those of
/// [`Marginals`]. Deviation: gates are taken as certain to hold the object's measurement.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use tercel_core::filter::Kalman;
/// use tercel_core::motion::ConstantVelocity;
/// use tercel_core::multi::{Clutter, Detection, Jpda, JpdaConfig, Scan, Status, Tracker};
/// use tercel_core::sensor::{Measurement, Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
/// let (detection, clutter) = (Detection::uniform(0.9)?, Clutter::per_scan(5.0, 1e6)?);
/// let mut tracker = Jpda::<Gaussian<4>>::new(JpdaConfig::default())?;
/// for second in 0..10 {
///     let time = f64::from(second);
///     let measurements = [Measurement::from([10.0 * time, 0.0]), [10.0 * time, 40.0].into()];
///     tracker.step(&filter, &Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter })?;
/// }
/// assert!(tracker.tracks().iter().take(2).all(|track| track.status == Status::Confirmed));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Jpda<B> {
    config: JpdaConfig,
    objects: Individuals<B>,
    time: Option<f64>,
    scratch: Scratch,
}

/// The settings of a [`Jpda`] tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JpdaConfig {
    /// Measurements outside the gate of a track do not update it.
    pub gate: Gate,
    /// Probability that an object survives one second.
    pub survival: f64,
    /// Probability that a measurement that no track claims comes from a new object, where clutter has its background intensity.
    pub birth: f64,
    /// Of two tracks closer than this squared Mahalanobis distance the one less sure to exist is dropped. Zero keeps both.
    pub merge: f64,
    /// Largest number of tracks; beyond, those that hardly exist are given up.
    pub cap: usize,
    /// When tracks are confirmed and deleted.
    pub management: Management,
}

impl Default for JpdaConfig {
    fn default() -> Self {
        JpdaConfig {
            gate: Gate::default(),
            survival: 0.99,
            birth: 0.1,
            merge: 0.5,
            cap: 10_000,
            management: Management::default(),
        }
    }
}

/// Buffers that keep their memory from scan to scan.
#[derive(Debug, Clone, Default)]
struct Scratch {
    vicinity: Vicinity,
    /// What the track that is looked at makes of the measurements near it.
    innovations: Vec<Result<Innovation, FilterError>>,
    marginals: Marginals,
    /// Track, measurement and `ln w` of the pairs in a gate, by track.
    pairs: Vec<(usize, usize, f64)>,
    /// How each track is seen.
    sights: Vec<Sight>,
    /// Logarithm of the clutter intensity at each measurement.
    ln_clutter: Vec<f64>,
    /// Probability that some track claims each measurement.
    claimed: Vec<f64>,
}

/// A share of the belief that is left out.
const NEGLIGIBLE: f64 = 1e-4;

/// Its logarithm.
const LN_NEGLIGIBLE: f64 = -9.210_340_371_976_182;

/// A measurement starts a track unless the others claim it with more than this probability.
const CLAIMED: f64 = 0.9;

impl<B> Jpda<B> {
    /// A tracker without objects.
    ///
    /// # Errors
    /// When a probability is outside its range.
    pub fn new(config: JpdaConfig) -> Result<Self, FilterError> {
        FilterError::probability("survival probability", config.survival)?;
        FilterError::probability("birth probability", config.birth)?;
        Ok(Jpda { config, objects: Individuals::default(), time: None, scratch: Scratch::default() })
    }
}

impl<B: Clone> Jpda<B> {
    /// Weighs the pairs within the gates, and finds how probable each is.
    fn associate<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { vicinity, innovations, marginals, pairs, sights, ln_clutter, claimed } =
            &mut self.scratch;
        pairs.clear();
        sights.clear();
        ln_clutter.clear();
        ln_clutter
            .extend(scan.measurements.iter().map(|measurement| ln_clutter_at(filter, scan, measurement)));
        let mut compared: Vec<&F::Measurement> = Vec::new();
        for (row, track) in self.objects.active().enumerate() {
            let (sight, near) = vicinity.look(filter, &track.belief, scan);
            sights.push(sight);
            let prior = (track.existence * sight.seen).ln() - (1.0 - track.existence * sight.missed).ln();
            compared.clear();
            compared.extend(near.iter().map(|&column| &scan.measurements[column]));
            filter.innovations(&track.belief, &compared, innovations);
            for (&column, innovation) in near.iter().zip(&*innovations) {
                // A pair that cannot be compared numerically is a pair outside the gate.
                let Ok(innovation) = innovation else { continue };
                let weight = prior + innovation.log_likelihood - ln_clutter[column];
                // No pair is more probable than its weight. One that is not a number does not count.
                if self.config.gate.contains(innovation) && weight >= LN_NEGLIGIBLE {
                    pairs.push((row, column, weight));
                }
            }
        }
        marginals.solve(pairs, self.objects.active.len(), scan.measurements.len());
        claimed.clear();
        claimed.resize(scan.measurements.len(), 0.0);
        for (pair, probability) in pairs.iter().zip(marginals.pairs()) {
            claimed[pair.1] += probability;
        }
    }

    /// Merges into each track what its measurements say, and judges it.
    fn update<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        self.objects.clear_uses(scan.measurements.len());
        let Scratch { marginals, pairs, sights, .. } = &self.scratch;
        // How probable the pair is for which each measurement counts as used.
        let mut best_use = vec![0.0; scan.measurements.len()];
        let mut parts: Vec<(f64, &F::Measurement)> = Vec::new();
        let mut first = 0;
        let Individuals { tracks, uses, active, .. } = &mut self.objects;
        for (row, &at) in active.iter().enumerate() {
            let track = &mut tracks[at];
            let count = pairs[first..].iter().take_while(|pair| pair.0 == row).count();
            let range = first..first + count;
            first = range.end;
            let (Sight { missed: telling, .. }, r) = (sights[row], track.existence);
            let missed =
                marginals.misses()[row] * r * (1.0 - telling) / (1.0 - r * telling).max(f64::MIN_POSITIVE);
            let mut heaviest = (0.0, None);
            parts.clear();
            for (&(_, column, _), &probability) in pairs[range.clone()].iter().zip(&marginals.pairs()[range])
            {
                if probability >= NEGLIGIBLE {
                    parts.push((probability, &scan.measurements[column]));
                }
                if probability > heaviest.0 {
                    heaviest = (probability, Some(column));
                }
            }
            let weight = filter.associate(&mut track.belief, &parts, missed);
            track.existence = (weight + missed).min(1.0);
            match heaviest.1 {
                // Seen means: more likely seen than not, if it is there at all.
                Some(column) if weight > 0.0 && weight >= 0.5 * track.existence => {
                    track.hit(column, scan.time);
                    track.reports = telling == 0.0;
                    if heaviest.0 > best_use[column] {
                        best_use[column] = heaviest.0;
                        uses[column] = Use::Updated(track.id);
                    }
                }
                _ if telling > 0.0 => {
                    let least = self.config.management.least(track, scan.time, self.config.survival);
                    track.existence = track.existence.max(least);
                    track.miss();
                }
                _ => track.unseen(),
            }
            self.config.management.judge(track, scan.time);
        }
    }

    fn birth<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let claimed = &self.scratch.claimed;
        let unexplained = |number: usize| {
            let rest: f64 = 1.0 - claimed[number];
            if rest < 1.0 - CLAIMED { 0.0 } else { rest }
        };
        self.objects.birth(filter, scan, self.config.birth, &self.config.management, unexplained);
        self.objects.drop_weakest(self.config.cap);
    }
}

impl<B: Clone> Tracker for Jpda<B> {
    type Belief = B;

    fn step<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
    ) -> Result<(), TrackerError>
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        error::step(scan.time, self.time)?;
        let places = places(filter, scan)?;
        self.scratch.vicinity.build(filter, scan, &self.config.gate, &places);
        self.objects.predict(filter, scan, self.config.survival, &self.config.management);
        self.associate(filter, scan);
        self.update(filter, scan);
        self.objects.drop_doubles(filter, self.config.merge);
        self.birth(filter, scan);
        self.objects.name(filter);
        self.time = Some(scan.time);
        Ok(())
    }

    fn tracks(&self) -> &[Track<B>] {
        &self.objects.tracks
    }

    fn active(&self) -> Option<&[usize]> {
        Some(&self.objects.active)
    }

    fn uses(&self) -> &[Use] {
        &self.objects.uses
    }

    fn time(&self) -> Option<f64> {
        self.time
    }
}
