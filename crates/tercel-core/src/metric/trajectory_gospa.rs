//! GOSPA of sets of trajectories.

mod chain;
mod groups;
mod problem;
mod relaxation;
mod simplex;
#[cfg(test)]
mod tests;

use problem::Problem;

use super::scale::Scale;
use super::trajectory::Trajectory;
use crate::error::FilterError;

/// Measures how far a set of tracks is from the set of true trajectories, over all steps at once: GOSPA at each step, plus
/// a price for each time that an object changes its track.
///
/// ## Definition
/// With cut-off `c`, order `p` and switch penalty `γ`. Weights `w_ij(k)` in `[0, 1]` say how much of object `i` track `j`
/// stands for at step `k`; rows and columns of `w(k)` sum to 1 at most. Where both exist closer than `c`,
/// `D_ij(k) = d(x_i, y_j)ᵖ`; of weights elsewhere nothing is gained and nothing lost:
/// ```text
/// totalᵖ = min_w Σ_k [ Σ_ij w_ij(k) D_ij(k)                      localisation
///                    + cᵖ/2 Σ_i (1 - Σ_j w_ij(k))                missed, over objects that exist at k
///                    + cᵖ/2 Σ_j (1 - Σ_i w_ij(k)) ]              false, over tracks that exist at k
///                + γᵖ/2 Σ_k Σ_ij |w_ij(k+1) - w_ij(k)|           switches
/// ```
/// where the sums of the weights in the second and third term run over the pairs closer than `c`. An object that changes
/// from one track to another pays `γᵖ`, one that loses or finds a track half of it. For one step this is [`Gospa`](super::Gospa).
///
/// ## Computation
/// Without the condition that a track stands for one object at most, each object would take the cheapest path through the
/// tracks, which dynamic programming finds in one pass. Prices on the use of a track at a step make the objects avoid each
/// other; any prices prove a lower bound (Lagrangian duality), and any paths that do not collide an upper one.
/// 1. Each object takes its cheapest path. Where these do not collide they are the answer; objects that collide form a
///    group, which is solved alone, and takes in whomever it collides with then.
/// 2. In a group, prices climb, from those of the assignments of the single steps, until the bounds meet.
/// 3. If they do not meet within 400 climbs, a linear programme over the paths seen so far finds better prices and, where
///    the optimum is fractional, the weights; paths are added until none is missing (Dantzig and Wolfe's column generation).
///
/// So no general solver is needed, and the time follows the positions and the collisions. Costs are those of what is
/// missed or off, never the difference of two large ones, in units of the cut-off: small errors keep their digits at any
/// order. The difference of the bounds, with what rounding may have done to them, is part of the result, as
/// [`gap`](TrajectoryGospaScore::gap): it is at most 1e-10 of `cᵖ/2` for each step of each
/// trajectory, or more where 100 rounds of step 3 do not suffice. Ten objects against thirty tracks over 500 steps take
/// about 1 ms when the tracks follow the objects, and about a second when the two have nothing to do with each other and
/// meet all the time; single cases of the latter kind took 10 s.
///
/// ## Use it when
/// whole tracks are judged: broken tracks, swaps, late starts. Choose `γ` by how many metres of error a switch is worth.
///
/// ## Reference
/// García-Fernández, Rahmathullah and Svensson, "A metric on the space of finite sets of trajectories for evaluation of
/// multi-target tracking algorithms", IEEE TSP 68 (2020): the linear programming metric. When the weights are whole
/// numbers, as almost always, it equals the multi-dimensional assignment metric of the same paper. Parts as there; not divided
/// by the number of steps.
///
/// ```
/// use tercel_core::metric::{Trajectory, TrajectoryGospa};
///
/// let metric = TrajectoryGospa::new(10.0, 1.0, 4.0)?;
/// let line = |y: f64, steps: std::ops::Range<usize>| {
///     Trajectory::new(steps.start, steps.map(move |t| [t as f64, y]))
/// };
/// let truth = [line(0.0, 0..10)];
/// // The track breaks after six steps and a new one follows it, one metre off.
/// let tracks = [line(0.0, 0..6), line(1.0, 6..10)];
/// let score = metric.score(&truth, &tracks)?;
/// assert_eq!((score.parts.localisation, score.parts.switches), (4.0, 4.0));
/// assert_eq!(score.switches, 1.0);
/// assert_eq!(score.total, 8.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrajectoryGospa {
    scale: Scale,
    switch: f64,
}

/// How far two sets of trajectories are apart, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryGospaScore {
    /// The metric, in the unit of the distance (m), summed over all steps.
    pub total: f64,
    /// What it is made of, as `p`-th powers: they sum to `total` to the power `p`.
    pub parts: TrajectoryGospaParts,
    /// How many switches there are: one where an object changes its track, a half where it loses or finds one.
    pub switches: f64,
    /// The step of the first of `steps`.
    pub start: usize,
    /// The parts at each step. Switches count at the step after them.
    pub steps: Vec<TrajectoryGospaParts>,
    /// Which track stood for which object and for how many steps, as (object, track, steps); steps are whole numbers
    /// unless the best weights are not.
    pub pairs: Vec<(usize, usize, f64)>,
    /// How far the sum of the parts may lie above the true minimum (mᵖ), proved by the prices.
    pub gap: f64,
}

/// Parts of [`TrajectoryGospa`], as `p`-th powers (mᵖ). Where `cᵖ` or `γᵖ` is beyond the largest number a part is infinite; the
/// total is not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrajectoryGospaParts {
    /// Errors of the objects while they were found.
    pub localisation: f64,
    /// Price of the objects while they were not found.
    pub missed: f64,
    /// Price of the tracks while they belonged to no object.
    pub false_alarm: f64,
    /// Price of the changes of tracks.
    pub switches: f64,
}

impl TrajectoryGospaParts {
    /// The sum of the parts.
    pub fn sum(&self) -> f64 {
        self.localisation + self.missed + self.false_alarm + self.switches
    }

    fn add(&mut self, other: &TrajectoryGospaParts) {
        self.localisation += other.localisation;
        self.missed += other.missed;
        self.false_alarm += other.false_alarm;
        self.switches += other.switches;
    }
}

impl TrajectoryGospa {
    /// A metric with a cut-off (m) above zero, an order of at least 1 and a switch penalty `γ` (m) above zero.
    ///
    /// # Errors
    /// When one is out of range.
    pub fn new(cutoff: f64, order: f64, switch: f64) -> Result<Self, FilterError> {
        let switch = FilterError::positive("switch penalty", switch)?;
        Ok(TrajectoryGospa { scale: Scale::new(cutoff, order)?, switch })
    }

    /// Compares tracks with the true trajectories by the Euclidean distance of their positions.
    ///
    /// # Errors
    /// When a position is not finite.
    pub fn score<const D: usize>(
        &self,
        truth: &[Trajectory<D>],
        tracks: &[Trajectory<D>],
    ) -> Result<TrajectoryGospaScore, FilterError> {
        truth.iter().chain(tracks).try_for_each(Trajectory::check)?;
        let problem = Problem::new(truth, tracks, self.scale, self.switch);
        let solved = problem.solve();
        let mut parts = TrajectoryGospaParts::default();
        solved.steps.iter().for_each(|step| parts.add(step));
        Ok(TrajectoryGospaScore {
            total: solved.total,
            parts,
            switches: solved.switches,
            start: problem.start(),
            steps: solved.steps,
            pairs: solved.pairs,
            gap: solved.gap,
        })
    }
}
