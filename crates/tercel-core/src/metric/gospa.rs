//! The generalised optimal sub-pattern assignment metric.

use super::near::pairs_within;
use super::scale::{Pair, Scale, finite};
use crate::error::FilterError;

/// Measures how far a set of estimates is from the set of true objects: the errors of those found, plus a price for each
/// that was missed and each that does not exist.
///
/// ## Definition
/// With cut-off `c`, order `p` and `α = 2`, over all assignments `θ` of estimates `y` to objects `x`:
/// ```text
/// total = min_θ ( Σ_(i,j)∈θ d(x_i, y_j)ᵖ + cᵖ/2 (|X| - |θ|) + cᵖ/2 (|Y| - |θ|) )^(1/p)
/// ```
/// The three terms are localisation, missed and false. A pair at `c` or further is no pair: it counts as one missed and
/// one false object. Two empty sets are at distance 0.
///
/// ## Use it when
/// tracks are compared with truth at one time. Unlike [`Ospa`](super::Ospa) it is not divided by the number of objects,
/// so that a false track costs the same in a full scene and in an empty one. It does not see identities: use
/// [`TrajectoryGospa`](super::TrajectoryGospa) for switches.
///
/// ## Reference
/// Rahmathullah, García-Fernández and Svensson, "Generalized optimal sub-pattern assignment metric", Fusion 2017,
/// definition 1 and proposition 1. Total and parts agree with Stone Soup 1.9.1 to 1e-9; like there, parts are `p`-th
/// powers. Deviation from Stone Soup: two empty sets have the distance that the definition gives them.
///
/// ```
/// use tercel_core::metric::Gospa;
///
/// let gospa = Gospa::new(20.0, 1.0)?;
/// let truth = [[0.0, 0.0], [100.0, 0.0]];
/// let estimates = [[3.0, 4.0], [500.0, 0.0], [600.0, 0.0]];
/// let score = gospa.score(&truth, &estimates)?;
/// assert_eq!(score.pairs, [(0, 0)]);
/// assert_eq!((score.parts.localisation, score.parts.missed, score.parts.false_alarm), (5.0, 10.0, 20.0));
/// assert_eq!(score.total, 35.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gospa {
    scale: Scale,
}

/// How far two sets are apart, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct GospaScore {
    /// The metric, in the unit of the distance (m).
    pub total: f64,
    /// What it is made of, as `p`-th powers: they sum to `total` to the power `p`.
    pub parts: GospaParts,
    /// Which estimate belongs to which object, as (object, estimate), by object.
    pub pairs: Vec<(usize, usize)>,
    /// How many objects have no estimate.
    pub missed: usize,
    /// How many estimates have no object.
    pub false_alarms: usize,
}

/// Parts of [`Gospa`], as `p`-th powers (mᵖ): [`figures`](GospaParts::figures) gives metres. Where `cᵖ` is beyond the largest
/// number a part is infinite; the total is not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GospaParts {
    /// Errors of the objects that were found.
    pub localisation: f64,
    /// Price of the objects that were not found.
    pub missed: f64,
    /// Price of the estimates that belong to no object.
    pub false_alarm: f64,
}

impl GospaParts {
    /// The sum of the parts.
    pub fn sum(&self) -> f64 {
        self.localisation + self.missed + self.false_alarm
    }

    /// Each part to the power `1/p`, in the unit of the distance (m). For `p = 1` these are the parts themselves; for
    /// others they do not add up.
    pub fn figures(&self, order: f64) -> GospaParts {
        let root = |x: f64| x.powf(order.recip());
        GospaParts {
            localisation: root(self.localisation),
            missed: root(self.missed),
            false_alarm: root(self.false_alarm),
        }
    }
}

impl Gospa {
    /// A metric with a cut-off (m) above zero and an order of at least 1.
    ///
    /// # Errors
    /// When one is out of range.
    pub fn new(cutoff: f64, order: f64) -> Result<Self, FilterError> {
        Ok(Gospa { scale: Scale::new(cutoff, order)? })
    }

    /// The distance beyond which an estimate has nothing to do with an object.
    pub fn cutoff(&self) -> f64 {
        self.scale.cutoff
    }

    /// The order `p`.
    pub fn order(&self) -> f64 {
        self.scale.order
    }

    /// Compares positions by their Euclidean distance.
    ///
    /// # Errors
    /// When a position is not finite.
    pub fn score<const D: usize>(
        &self,
        truth: &[[f64; D]],
        estimates: &[[f64; D]],
    ) -> Result<GospaScore, FilterError> {
        finite(truth)?;
        finite(estimates)?;
        self.score_pairs(truth.len(), estimates.len(), &pairs_within(truth, estimates, self.scale.cutoff))
    }

    /// Compares `truth` objects with `estimates` by a distance of yours, called with the number of the object and that of
    /// the estimate. Infinity says that the two cannot be the same.
    ///
    /// # Errors
    /// When a distance is negative or not a number.
    pub fn score_by(
        &self,
        truth: usize,
        estimates: usize,
        distance: impl Fn(usize, usize) -> f64,
    ) -> Result<GospaScore, FilterError> {
        self.score_pairs(truth, estimates, &self.scale.near(truth, estimates, distance)?)
    }

    /// Compares `truth` objects with `estimates` of which only these are near each other, as (object, estimate,
    /// distance): for large sets, where [`pairs_within`] finds the few pairs that matter. Pairs that are not named
    /// cannot be the same.
    ///
    /// # Errors
    /// When a distance is negative or not a number, or a pair is of an object or estimate that there is not.
    pub fn score_pairs(
        &self,
        truth: usize,
        estimates: usize,
        near: &[(usize, usize, f64)],
    ) -> Result<GospaScore, FilterError> {
        let pairs = self.scale.join(truth, estimates, self.scale.checked(truth, estimates, near)?)?;
        Ok(self.score_joined(truth, estimates, &pairs))
    }

    fn score_joined(&self, truth: usize, estimates: usize, joined: &[Pair]) -> GospaScore {
        let (missed, false_alarms) = (truth - joined.len(), estimates - joined.len());
        let parts = GospaParts {
            // A sum over nothing is -0, which adding 0 makes 0.
            localisation: joined.iter().map(|pair| self.scale.power(pair.2)).sum::<f64>() + 0.0,
            missed: self.scale.price(0.5 * missed as f64),
            false_alarm: self.scale.price(0.5 * false_alarms as f64),
        };
        let alone = (0.5 * (missed + false_alarms) as f64, self.scale.cutoff);
        let total = self.scale.norm(joined.iter().map(|pair| (1.0, pair.2)).chain([alone]));
        let pairs = joined.iter().map(|&(i, j, _)| (i, j)).collect();
        GospaScore { total, parts, pairs, missed, false_alarms }
    }
}

/// Averages GOSPA over steps and runs.
///
/// The mean of the totals and the mean of the parts (`p`-th powers) are kept apart, because for `p > 1` the root of the
/// mean is not the mean of the roots; both are metrics of their own.
///
/// ```
/// use tercel_core::metric::{Gospa, GospaAverage};
///
/// let gospa = Gospa::new(10.0, 2.0)?;
/// let mut average = GospaAverage::new(2.0);
/// average.push(&gospa.score(&[[0.0]], &[[3.0]])?);
/// average.push(&gospa.score(&[[0.0]], &[[4.0]])?);
/// assert_eq!(average.mean(), Some(3.5));
/// assert_eq!(average.root_mean(), Some(12.5_f64.sqrt()));
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GospaAverage {
    order: f64,
    count: u64,
    total: f64,
    parts: GospaParts,
}

impl GospaAverage {
    /// An average of nothing yet, for scores of this order.
    pub fn new(order: f64) -> Self {
        GospaAverage { order, count: 0, total: 0.0, parts: GospaParts::default() }
    }

    /// Takes one more score.
    pub fn push(&mut self, score: &GospaScore) {
        self.count += 1;
        self.total += score.total;
        self.add(&score.parts);
    }

    /// Takes all scores of another average.
    pub fn merge(&mut self, other: &GospaAverage) {
        self.count += other.count;
        self.total += other.total;
        self.add(&other.parts);
    }

    fn add(&mut self, parts: &GospaParts) {
        self.parts.localisation += parts.localisation;
        self.parts.missed += parts.missed;
        self.parts.false_alarm += parts.false_alarm;
    }

    /// How many scores were taken.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of the totals; `None` before the first score.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.total / self.count as f64)
    }

    /// The `p`-th root of the mean of the `p`-th powers; `None` before the first score.
    pub fn root_mean(&self) -> Option<f64> {
        self.parts().map(|parts| parts.sum().powf(self.order.recip()))
    }

    /// Mean of each part, as `p`-th powers; `None` before the first score.
    pub fn parts(&self) -> Option<GospaParts> {
        let share = 1.0 / self.count as f64;
        (self.count > 0).then_some(GospaParts {
            localisation: self.parts.localisation * share,
            missed: self.parts.missed * share,
            false_alarm: self.parts.false_alarm * share,
        })
    }
}
