//! Global nearest neighbour tracker with existence probabilities.

use crate::association::{AssignmentSolver, Gate};
use crate::error::FilterError;
use crate::filter::Filter;

use super::detection::Sight;
use super::individuals::Individuals;
use super::vicinity::Vicinity;
use super::{Management, Scan, Track, Tracker, TrackerError, Use, error, ln_clutter_at, places, ratio};

/// Gives each track at most one measurement and each measurement to at most one track, so that the whole scan is explained
/// at the least cost, and keeps the probability that each track exists.
///
/// ## Recursion
/// For a track that exists with probability `r`, is detected with `p_D` and gives measurement `z` the density `q(z)`, against
/// clutter of intensity `κ`:
/// ```text
/// predict   r⁻ = p_S r
/// assign    minimise Σ cost:   -ln(r⁻ p_D q(z) / κ(z)) for a pair,   -ln(1 - r⁻ p_D) for a track left alone
/// paired    r = r⁻ l / (1 - r⁻ + r⁻ l),        l = 1 - p_D + p_D q(z) / κ(z), and the belief is updated by z
/// missed    r = r⁻ (1 - p_D) / (1 - r⁻ p_D)
/// ```
/// In dense clutter, or after a long time, a track of one measurement is less likely than clutter wherever it is seen next. Such a
/// track is assigned once more, among what nothing explains and as if it existed for sure: the costs are then
/// `-ln(p_D q(z) / κ(z))` and `-ln(1 - p_D)`. Its existence says how doubtful it is, and rises or sinks with each scan. (It cannot
/// be talked up by this: the expectation of `l` over clutter is at most one.) A measurement that no track takes starts a tentative one. A track whose belief has come as close to that of a stronger
/// one as if both were one object is dropped.
///
/// ## Use it when
/// objects are mostly apart against the sensor's accuracy; it is the fastest tracker here, and its decisions are easy to
/// follow. Where objects stay close for long, or clutter is dense, a tracker that weighs several associations loses fewer
/// tracks.
///
/// ## Reference
/// Blackman and Popoli (1999), section 6.4; the existence probability after Musicki, Evans and Stankovic (1994) with the
/// assigned measurement as the only one, and the costs as in the most likely hypothesis of a multi-Bernoulli filter. The second
/// assignment and the least existence of a track that coasts ([`Management`]) are ours.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use tercel_core::filter::Kalman;
/// use tercel_core::motion::ConstantVelocity;
/// use tercel_core::multi::{Clutter, Detection, NearestNeighbour, NearestNeighbourConfig, Scan, Status, Tracker};
/// use tercel_core::sensor::{Measurement, Position};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
/// let (detection, clutter) = (Detection::uniform(0.9)?, Clutter::per_scan(5.0, 1e6)?);
/// let mut tracker = NearestNeighbour::<Gaussian<4>>::new(NearestNeighbourConfig::default())?;
/// for second in 0..10 {
///     let time = f64::from(second);
///     let measurements = [Measurement::from([10.0 * time, 0.0])];
///     tracker.step(&filter, &Scan { time, measurements: &measurements, detection: &detection, clutter: &clutter })?;
/// }
/// assert_eq!(tracker.tracks()[0].status, Status::Confirmed);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct NearestNeighbour<B> {
    config: NearestNeighbourConfig,
    objects: Individuals<B>,
    time: Option<f64>,
    scratch: Scratch,
}

/// The settings of a [`NearestNeighbour`] tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestNeighbourConfig {
    /// Measurements outside the gate of a track are not paired with it.
    pub gate: Gate,
    /// Probability that an object survives one second.
    pub survival: f64,
    /// Probability that an unassigned measurement comes from a new object, where clutter has its background intensity.
    pub birth: f64,
    /// Of two tracks closer than this squared Mahalanobis distance the one less sure to exist is dropped. Zero keeps both.
    pub merge: f64,
    /// Largest number of tracks; beyond, those that hardly exist are given up.
    pub cap: usize,
    /// When tracks are confirmed and deleted.
    pub management: Management,
}

impl Default for NearestNeighbourConfig {
    fn default() -> Self {
        NearestNeighbourConfig {
            gate: Gate::default(),
            survival: 0.99,
            birth: 0.1,
            merge: 0.5,
            cap: 100_000,
            management: Management::default(),
        }
    }
}

/// Buffers that keep their memory from scan to scan.
#[derive(Debug, Clone, Default)]
struct Scratch {
    vicinity: Vicinity,
    solver: AssignmentSolver,
    /// (track, measurement, cost) of the pairs in a gate.
    pairs: Vec<(usize, usize, f64)>,
    /// Cost of leaving each track alone.
    misses: Vec<f64>,
    /// How each track is seen.
    sights: Vec<Sight>,
    /// Tracks so doubtful that no measurement, wherever it lies, is more likely theirs than clutter of the background.
    hopeless: Vec<bool>,
    columns: Vec<Option<usize>>,
}

impl<B> NearestNeighbour<B> {
    /// A tracker without objects.
    ///
    /// # Errors
    /// When a probability is outside its range.
    pub fn new(config: NearestNeighbourConfig) -> Result<Self, FilterError> {
        FilterError::probability("survival probability", config.survival)?;
        FilterError::probability("birth probability", config.birth)?;
        Ok(NearestNeighbour {
            config,
            objects: Individuals::default(),
            time: None,
            scratch: Scratch::default(),
        })
    }
}

impl<B: Clone> NearestNeighbour<B> {
    /// Lists the pairs within the gate and their costs, and assigns.
    fn assign<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        let Scratch { vicinity, solver, pairs, misses, sights, hopeless, columns } = &mut self.scratch;
        pairs.clear();
        misses.clear();
        sights.clear();
        hopeless.clear();
        for (row, track) in self.objects.active().enumerate() {
            let (sight, near) = vicinity.look(filter, &track.belief, scan);
            sights.push(sight);
            let miss = -(1.0 - track.existence * sight.missed).max(f64::MIN_POSITIVE).ln();
            let mut least = f64::INFINITY;
            for &column in near {
                // A pair that cannot be compared numerically is a pair outside the gate.
                let Ok(innovation) = filter.innovation(&track.belief, &scan.measurements[column]) else {
                    continue;
                };
                let clutter = ln_clutter_at(filter, scan, &scan.measurements[column]);
                let cost = -(track.existence * sight.seen).ln() - innovation.log_likelihood + clutter;
                if self.config.gate.contains(&innovation) && cost.is_finite() {
                    pairs.push((row, column, cost));
                    let background = filter.ln_clutter(&scan.measurements[column], scan.clutter.background());
                    least = least.min(cost - 0.5 * innovation.nis - clutter + background);
                }
            }
            misses.push(miss);
            hopeless.push(least >= miss);
        }
        columns.clear();
        match solver.solve_sparse(pairs, scan.measurements.len(), misses) {
            Ok(best) => columns.extend_from_slice(&best.columns),
            // All costs are finite and every track may stay alone, so there is always an answer.
            Err(_) => columns.resize(self.objects.active.len(), None),
        }
    }

    /// Lets the tracks that can never be more likely than clutter go on with what the most likely explanation of the scan leaves
    /// over: each takes what it most likely is *if it exists*. Else no evidence for it could ever add up.
    fn continue_doubtful(&mut self, measurements: usize) {
        let Scratch { solver, pairs, misses, sights, hopeless, columns, .. } = &mut self.scratch;
        let mut free = vec![true; measurements];
        columns.iter().flatten().for_each(|&column| free[column] = false);
        let Individuals { tracks, active, .. } = &self.objects;
        pairs.retain(|&(row, column, _)| hopeless[row] && columns[row].is_none() && free[column]);
        if pairs.is_empty() {
            return;
        }
        for (row, miss) in misses.iter_mut().enumerate() {
            *miss = -(1.0 - sights[row].missed).max(f64::MIN_POSITIVE).ln();
        }
        pairs.iter_mut().for_each(|(row, _, cost)| *cost += tracks[active[*row]].existence.ln());
        if let Ok(best) = solver.solve_sparse(pairs, measurements, misses) {
            for (column, found) in columns.iter_mut().zip(&best.columns) {
                *column = column.or(*found);
            }
        }
    }

    /// Updates the paired tracks, and records the misses of the others.
    fn update<const N: usize, F>(&mut self, filter: &F, scan: &Scan<'_, F::Measurement>)
    where
        F: Filter<N, Belief = B> + ?Sized,
    {
        self.objects.clear_uses(scan.measurements.len());
        let Individuals { tracks, uses, active, .. } = &mut self.objects;
        for (row, &at) in active.iter().enumerate() {
            let track = &mut tracks[at];
            let (Sight { seen, missed }, r) = (self.scratch.sights[row], track.existence);
            let number = self.scratch.columns[row];
            let paired = number.and_then(|number| {
                let measurement = &scan.measurements[number];
                let innovation = filter.update(&mut track.belief, measurement).ok()?;
                let ln_ratio = innovation.log_likelihood - ln_clutter_at(filter, scan, measurement);
                Some((number, ratio(ln_ratio)))
            });
            match paired {
                Some((number, ratio)) => {
                    let l = 1.0 - missed + seen * ratio;
                    track.existence = r * l / (1.0 - r + r * l);
                    track.hit(number, scan.time);
                    track.reports = missed == 0.0;
                    uses[number] = Use::Updated(track.id);
                }
                None if missed > 0.0 => {
                    let unseen = r * (1.0 - missed) / (1.0 - r * missed).max(f64::MIN_POSITIVE);
                    track.existence =
                        unseen.max(self.config.management.least(track, scan.time, self.config.survival));
                    track.miss();
                }
                None => track.unseen(),
            }
            self.config.management.judge(track, scan.time);
        }
    }
}

impl<B: Clone> Tracker for NearestNeighbour<B> {
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
        self.assign(filter, scan);
        self.continue_doubtful(scan.measurements.len());
        self.update(filter, scan);
        self.objects.drop_doubles(filter, self.config.merge);
        self.objects.birth(filter, scan, self.config.birth, &self.config.management, |_| 1.0);
        self.objects.drop_weakest(self.config.cap);
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
