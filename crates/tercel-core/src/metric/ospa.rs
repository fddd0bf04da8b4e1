//! The optimal sub-pattern assignment metric.

use super::scale::{Scale, euclidean, finite};
use crate::association::AssignmentSolver;
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

/// Parts of [`Ospa`], as `p`-th powers (mᵖ).
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
        self.score_by(truth.len(), estimates.len(), |i, j| euclidean(&truth[i], &estimates[j]))
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
        let mut costs = Vec::with_capacity(truth * estimates);
        for i in 0..truth {
            for j in 0..estimates {
                costs.push(self.scale.cut(distance(i, j))?);
            }
        }
        let mut solver = AssignmentSolver::new();
        let best = solver
            .solve(&costs, truth, estimates)
            .map_err(|_| FilterError::NotFinite { what: "distance to the power of the order" })?;
        let share = 1.0 / truth.max(estimates).max(1) as f64;
        let parts = OspaParts {
            localisation: best.cost * share,
            cardinality: self.scale.highest() * truth.abs_diff(estimates) as f64 * share,
        };
        Ok(OspaScore { total: self.scale.root(parts.sum()), parts, pairs: best.pairs().collect() })
    }
}
