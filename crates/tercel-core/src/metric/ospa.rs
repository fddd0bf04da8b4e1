//! The optimal sub-pattern assignment metric.

use super::near::pairs_within;
use super::scale::{Pair, Scale, finite};
use crate::error::FilterError;

/// Measures how far a set of estimates is from the set of true objects, per object.
///
/// ## Definition
/// With cut-off `c`, order `p`, and `n` the size of the larger set, over all assignments `θ` of the smaller set:
/// ```text
/// total = ( 1/n ( min_θ Σ_(i,j)∈θ min(d(x_i, y_j), c)ᵖ + cᵖ | |X| - |Y| | ) )^(1/p)
/// ```
/// The two terms are localisation and cardinality. Two empty sets are at distance 0.
///
/// ## Use it when
/// a result is compared with published OSPA figures. For design decisions [`Gospa`](super::Gospa) is clearer: it tells
/// missed from false objects, where OSPA lets one of each cancel.
///
/// ## Reference
/// Schuhmacher, Vo and Vo, "A consistent metric for performance evaluation of multi-object filters", IEEE TSP 56(8)
/// (2008). Agrees with Stone Soup 1.9.1 to 1e-9.
///
/// ```
/// use tercel_core::metric::Ospa;
///
/// let ospa = Ospa::new(10.0, 1.0)?;
/// let score = ospa.score(&[[0.0, 0.0], [100.0, 0.0]], &[[3.0, 4.0]])?;
/// assert_eq!(score.total, 7.5);
/// assert_eq!((score.parts.localisation, score.parts.cardinality), (2.5, 5.0));
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ospa {
    scale: Scale,
}

/// How far two sets are apart per object, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct OspaScore {
    /// The metric, in the unit of the distance (m); at most the cut-off.
    pub total: f64,
    /// What it is made of, as `p`-th powers: they sum to `total` to the power `p`.
    pub parts: OspaParts,
    /// Which estimate belongs to which object, as (object, estimate). All objects of the smaller set have a partner, even
    /// beyond the cut-off.
    pub pairs: Vec<(usize, usize)>,
}

/// Parts of [`Ospa`], as `p`-th powers (mᵖ). Where `cᵖ` is beyond the largest number a part is infinite; the total is not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OspaParts {
    /// Errors of the pairs, at most the cut-off each.
    pub localisation: f64,
    /// Price of the difference in number.
    pub cardinality: f64,
}

impl OspaParts {
    /// The sum of the parts.
    pub fn sum(&self) -> f64 {
        self.localisation + self.cardinality
    }

    /// Each part to the power `1/p`, in the unit of the distance (m). For `p = 1` these are the parts themselves; for
    /// others they do not add up.
    pub fn figures(&self, order: f64) -> OspaParts {
        let root = |x: f64| x.powf(order.recip());
        OspaParts { localisation: root(self.localisation), cardinality: root(self.cardinality) }
    }
}

impl Ospa {
    /// A metric with a cut-off (m) above zero and an order of at least 1.
    ///
    /// # Errors
    /// When one is out of range.
    pub fn new(cutoff: f64, order: f64) -> Result<Self, FilterError> {
        Ok(Ospa { scale: Scale::new(cutoff, order)? })
    }

    /// Compares positions by their Euclidean distance.
    ///
    /// # Errors
    /// When a position is not finite.
    pub fn score<const D: usize>(
        &self,
        truth: &[[f64; D]],
        estimates: &[[f64; D]],
    ) -> Result<OspaScore, FilterError> {
        finite(truth)?;
        finite(estimates)?;
        self.score_pairs(truth.len(), estimates.len(), &pairs_within(truth, estimates, self.scale.cutoff))
    }

    /// Compares `truth` objects with `estimates` by a distance of yours, called with the number of the object and that of
    /// the estimate.
    ///
    /// # Errors
    /// When a distance is negative or not a number.
    pub fn score_by(
        &self,
        truth: usize,
        estimates: usize,
        distance: impl Fn(usize, usize) -> f64,
    ) -> Result<OspaScore, FilterError> {
        self.score_pairs(truth, estimates, &self.scale.near(truth, estimates, distance)?)
    }

    /// Compares `truth` objects with `estimates` of which only these are near each other, as (object, estimate,
    /// distance): for large sets, where [`pairs_within`] finds the few pairs that matter. Pairs that are not named are
    /// at the cut-off.
    ///
    /// # Errors
    /// When a distance is negative or not a number, or a pair is of an object or estimate that there is not.
    pub fn score_pairs(
        &self,
        truth: usize,
        estimates: usize,
        near: &[(usize, usize, f64)],
    ) -> Result<OspaScore, FilterError> {
        let pairs = self.scale.join(truth, estimates, self.scale.checked(truth, estimates, near)?)?;
        Ok(self.score_joined(truth, estimates, &pairs))
    }

    fn score_joined(&self, truth: usize, estimates: usize, joined: &[Pair]) -> OspaScore {
        let share = 1.0 / truth.max(estimates).max(1) as f64;
        let (beyond, apart) = (truth.min(estimates) - joined.len(), truth.abs_diff(estimates));
        let found: f64 = joined.iter().map(|pair| self.scale.power(pair.2)).sum();
        let parts = OspaParts {
            localisation: (found + self.scale.price(beyond as f64)) * share,
            cardinality: self.scale.price(apart as f64) * share,
        };
        let alone = ((beyond + apart) as f64 * share, self.scale.cutoff);
        let total = self.scale.norm(joined.iter().map(|pair| (share, pair.2)).chain([alone]));
        OspaScore { total, parts, pairs: partners(truth, estimates, joined) }
    }
}

/// The joined pairs, and for what is left of the smaller set anything that is left of the larger one: beyond the cut-off all
/// are equally far.
fn partners(truth: usize, estimates: usize, joined: &[Pair]) -> Vec<(usize, usize)> {
    let (mut found, mut used) = (vec![false; truth], vec![false; estimates]);
    let mut pairs: Vec<(usize, usize)> = joined.iter().map(|&(i, j, _)| (i, j)).collect();
    for &(i, j) in &pairs {
        (found[i], used[j]) = (true, true);
    }
    let (rows, columns) = ((0..truth).filter(|&i| !found[i]), (0..estimates).filter(|&j| !used[j]));
    pairs.extend(rows.zip(columns));
    pairs.sort_unstable();
    pairs
}
