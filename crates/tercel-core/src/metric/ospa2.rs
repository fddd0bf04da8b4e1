//! OSPA of trajectories over a window.

use std::ops::Range;

use super::ospa::{Ospa, OspaScore};
use super::scale::euclidean;
use super::trajectory::Trajectory;
use crate::error::FilterError;

/// Measures how far a set of tracks is from the set of true trajectories, per trajectory, over a window of steps.
///
/// ## Definition
/// The distance of two trajectories is their OSPA averaged over the steps of the window at which one of them exists:
/// ```text
/// d(f, g) = 1/|T| Σ_(t∈T) d_t,       T = steps at which f or g exists
/// d_t     = min(|f(t) - g(t)|, c)    where both exist, c where only one does
/// ```
/// and OSPA(2) is the [`Ospa`] of the two sets of trajectories that exist in the window, with `d` in place of the distance
/// of points, the same cut-off and the order `p`.
///
/// ## Use it when
/// identities matter and the figure should stay bounded by the cut-off: a track that changes its object half-way, or
/// breaks in two, costs. A long window asks for long-lived tracks, a window of one step gives plain OSPA.
///
/// ## Reference
/// Beard, Vo and Vo, "OSPA(2): Using the OSPA metric to evaluate multi-target tracking performance", ICCAIS 2017, and "A
/// solution for large-scale multi-object tracking", IEEE TSP 68 (2020). Choice: equal weights for all steps, and
/// order 1 within a trajectory.
///
/// ```
/// use tercel_core::metric::{Ospa2, Trajectory};
///
/// let ospa2 = Ospa2::new(10.0, 1.0)?;
/// let truth = [Trajectory::new(0, (0..10).map(|t| [t as f64, 0.0]))];
/// // Found late, and one metre off: five steps of the cut-off and five of one metre.
/// let tracks = [Trajectory::new(5, (5..10).map(|t| [t as f64, 1.0]))];
/// assert_eq!(ospa2.score(&truth, &tracks, 0..10)?.total, 5.5);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ospa2 {
    ospa: Ospa,
    cutoff: f64,
}

impl Ospa2 {
    /// A metric with a cut-off (m) above zero and an order of at least 1.
    ///
    /// # Errors
    /// When one is out of range.
    pub fn new(cutoff: f64, order: f64) -> Result<Self, FilterError> {
        Ok(Ospa2 { ospa: Ospa::new(cutoff, order)?, cutoff })
    }

    /// Compares the trajectories that exist within `window`. The pairs of the score number all trajectories given.
    ///
    /// # Errors
    /// When a position is not finite.
    pub fn score<const D: usize>(
        &self,
        truth: &[Trajectory<D>],
        tracks: &[Trajectory<D>],
        window: Range<usize>,
    ) -> Result<OspaScore, FilterError> {
        truth.iter().chain(tracks).try_for_each(Trajectory::check)?;
        let (rows, columns) = (existing(truth, &window), existing(tracks, &window));
        let distance = |i: usize, j: usize| self.distance(&truth[rows[i]], &tracks[columns[j]], &window);
        let mut score = self.ospa.score_by(rows.len(), columns.len(), distance)?;
        for pair in &mut score.pairs {
            *pair = (rows[pair.0], columns[pair.1]);
        }
        Ok(score)
    }

    fn distance<const D: usize>(&self, f: &Trajectory<D>, g: &Trajectory<D>, window: &Range<usize>) -> f64 {
        let first = f.start.min(g.start).max(window.start);
        let last = f.steps().end.max(g.steps().end).min(window.end);
        // A sum that would overflow is taken in units of the cut-off.
        let overflows = (self.cutoff * last.saturating_sub(first) as f64).is_infinite();
        let unit = if overflows { self.cutoff } else { 1.0 };
        let (mut sum, mut count) = (0.0, 0.0);
        for step in first..last {
            sum += match (f.at(step), g.at(step)) {
                (Some(a), Some(b)) => euclidean(a, b).min(self.cutoff) / unit,
                (None, None) => continue,
                _ => self.cutoff / unit,
            };
            count += 1.0;
        }
        sum / f64::max(count, 1.0) * unit
    }
}

fn existing<const D: usize>(trajectories: &[Trajectory<D>], window: &Range<usize>) -> Vec<usize> {
    (0..trajectories.len()).filter(|i| trajectories[*i].exists_within(window)).collect()
}
