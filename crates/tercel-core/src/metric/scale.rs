//! What the set metrics share: a cut-off and an order.

use crate::association::AssignmentSolver;
use crate::error::FilterError;

/// A cut-off `c` (m) and an order `p`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) cutoff: f64,
    pub(super) order: f64,
}

/// A pair of the two sets and its distance (m).
pub(super) type Pair = (usize, usize, f64);

/// Powers below this share of the unit are too near to the smallest number to be compared.
const VANISHING: f64 = 1e-250;

impl Scale {
    pub(super) fn new(cutoff: f64, order: f64) -> Result<Self, FilterError> {
        FilterError::positive("cut-off", cutoff)?;
        if !(order >= 1.0 && order.is_finite()) {
            let expected = "must be finite and at least 1";
            return Err(FilterError::Parameter { parameter: "order", value: order, expected });
        }
        Ok(Scale { cutoff, order })
    }

    /// `xᵖ`
    #[inline]
    pub(super) fn power(&self, x: f64) -> f64 {
        if self.order == 1.0 {
            x
        } else if self.order == 2.0 {
            x * x
        } else {
            x.powf(self.order)
        }
    }

    /// `x^(1/p)`
    #[inline]
    pub(super) fn root(&self, x: f64) -> f64 {
        if self.order == 1.0 {
            x
        } else if self.order == 2.0 {
            x.sqrt()
        } else {
            x.powf(self.order.recip())
        }
    }

    /// `cᵖ`
    pub(super) fn highest(&self) -> f64 {
        self.power(self.cutoff)
    }

    /// `count cᵖ`: nothing for none, whatever the power.
    pub(super) fn price(&self, count: f64) -> f64 {
        if count == 0.0 { 0.0 } else { count * self.highest() }
    }

    /// `(Σ w xᵖ)^(1/p)` over weights and lengths, right even where the powers overflow or vanish.
    pub(super) fn norm(&self, terms: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
        let terms = terms.filter(|(weight, length)| *weight > 0.0 && *length > 0.0);
        let sum: f64 = terms.clone().map(|(weight, length)| weight * self.power(length)).sum();
        if sum.is_normal() {
            return self.root(sum);
        }
        let longest = terms.clone().map(|term| term.1).fold(0.0, f64::max);
        if longest == 0.0 {
            return 0.0;
        }
        longest * self.root(terms.map(|(weight, length)| weight * self.power(length / longest)).sum())
    }

    /// `distance`, or nothing when it is none.
    #[inline]
    pub(super) fn distance(&self, distance: f64) -> Result<f64, FilterError> {
        if distance >= 0.0 {
            return Ok(distance);
        }
        if distance.is_nan() {
            return Err(FilterError::NotFinite { what: "distance" });
        }
        let expected = "must not be negative";
        Err(FilterError::Parameter { parameter: "distance", value: distance, expected })
    }

    /// The pairs closer than the cut-off, by the distance of each.
    pub(super) fn near(
        &self,
        rows: usize,
        columns: usize,
        distance: impl Fn(usize, usize) -> f64,
    ) -> Result<Vec<Pair>, FilterError> {
        let mut near = Vec::new();
        for i in 0..rows {
            for j in 0..columns {
                let distance = self.distance(distance(i, j))?;
                if distance < self.cutoff {
                    near.push((i, j, distance));
                }
            }
        }
        Ok(near)
    }

    /// `near`, if it holds distances of pairs that there are.
    pub(super) fn checked<'a>(
        &self,
        rows: usize,
        columns: usize,
        near: &'a [Pair],
    ) -> Result<&'a [Pair], FilterError> {
        for &(i, j, distance) in near {
            self.distance(distance)?;
            let expected = "must be below the number of objects or estimates";
            let outside = |value: usize| FilterError::Parameter {
                parameter: "member of a pair",
                value: value as f64,
                expected,
            };
            if i >= rows || j >= columns {
                return Err(outside(if i >= rows { i } else { j }));
            }
        }
        Ok(near)
    }

    /// Joins rows and columns so that the sum of `dᵖ` over the pairs and of `cᵖ` for each pair that could be but is not, is
    /// least; by row. Only pairs of `near` can be joined, and only closer than the cut-off.
    ///
    /// The same pairs are the best for GOSPA and for OSPA, whose sums differ by what is the same for all joins.
    pub(super) fn join(&self, rows: usize, columns: usize, near: &[Pair]) -> Result<Vec<Pair>, FilterError> {
        let mut solver = AssignmentSolver::new();
        let mut unit = self.cutoff;
        let mut miss = 1.0;
        loop {
            let power = |distance: f64| self.power(distance / unit);
            let permitted = near.iter().filter(|pair| pair.2 < self.cutoff && power(pair.2) <= miss);
            let entries: Vec<Pair> = permitted.map(|&(i, j, distance)| (i, j, power(distance))).collect();
            let best = solver
                .solve_sparse(&entries, columns, &vec![miss; rows])
                .map_err(|_| FilterError::NotFinite { what: "distance to the power of the order" })?;
            let mut joined: Vec<Pair> =
                near.iter().filter(|pair| best.columns[pair.0] == Some(pair.1)).copied().collect();
            joined.sort_unstable_by_key(|pair| pair.0);
            // A pair named twice counts once.
            joined.dedup_by_key(|pair| pair.0);
            let farthest = joined.iter().map(|pair| pair.2).fold(0.0, f64::max);
            // What is left alone outweighs all pairs. Without it the pairs may all have vanished against the unit: the
            // farthest is the next one. No pair of the best join has more than that of all of these together.
            let complete = joined.len() == rows && rows == columns;
            if !complete || farthest == 0.0 || power(farthest) > VANISHING || farthest >= unit {
                return Ok(joined);
            }
            (unit, miss) = (farthest, (rows + 1) as f64);
        }
    }
}

/// Euclidean distance of two points.
#[inline]
pub(super) fn euclidean<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let square = (0..D).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum::<f64>();
    if square.is_normal() {
        return square.sqrt();
    }
    // Squares of very large or very small differences overflow or vanish.
    let longest = (0..D).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
    if longest == 0.0 || !longest.is_finite() {
        return (0..D).map(|i| (a[i] - b[i]).abs()).sum();
    }
    let share = |i: usize| (a[i] - b[i]) / longest;
    longest * (0..D).map(|i| share(i) * share(i)).sum::<f64>().sqrt()
}

/// Refuses points that are not finite.
pub(super) fn finite<const D: usize>(points: &[[f64; D]]) -> Result<(), FilterError> {
    if points.iter().flatten().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(FilterError::NotFinite { what: "position" })
}
