//! Where an object was over time.

use std::ops::Range;

use crate::error::FilterError;

/// The positions of one object, step by step. Steps count scans, so that truth and tracks share them; a step at which the
/// object was not there, or not estimated, is a gap.
///
/// ```
/// use tercel_core::metric::Trajectory;
///
/// let track = Trajectory { start: 3, positions: vec![Some([0.0, 0.0]), None, Some([2.0, 0.0])] };
/// assert_eq!(track.at(5), Some(&[2.0, 0.0]));
/// assert_eq!((track.at(2), track.at(4), track.at(6)), (None, None, None));
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory<const D: usize> {
    /// The step of the first position.
    pub start: usize,
    /// Positions (m) from there on.
    pub positions: Vec<Option<[f64; D]>>,
}

impl<const D: usize> Trajectory<D> {
    /// A trajectory without gaps.
    pub fn new(start: usize, positions: impl IntoIterator<Item = [f64; D]>) -> Self {
        Trajectory { start, positions: positions.into_iter().map(Some).collect() }
    }

    /// The position at a step, if there is one.
    #[inline]
    pub fn at(&self, step: usize) -> Option<&[f64; D]> {
        self.positions.get(step.checked_sub(self.start)?)?.as_ref()
    }

    /// The steps from the first entry to the last, gaps included.
    pub fn steps(&self) -> Range<usize> {
        self.start..self.start + self.positions.len()
    }

    /// Whether there is a position at any of these steps.
    pub fn exists_within(&self, steps: &Range<usize>) -> bool {
        let own = self.steps();
        (steps.start.max(own.start)..steps.end.min(own.end)).any(|step| self.at(step).is_some())
    }

    pub(super) fn check(&self) -> Result<(), FilterError> {
        if self.positions.iter().flatten().flatten().all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(FilterError::NotFinite { what: "position" })
    }
}

/// Goes through the steps of many trajectories once, and knows who is there: the time of all steps together follows the number
/// of positions, not that of trajectories times steps.
///
/// ```
/// use tercel_core::metric::{Trajectory, Walk};
///
/// let tracks = [Trajectory::new(3, [[0.0], [1.0]]), Trajectory::new(0, [[9.0]]), Trajectory::new(4, [[5.0]])];
/// let mut walk = Walk::new(&tracks);
/// assert_eq!(walk.at(0), (vec![1], vec![[9.0]]));
/// assert_eq!(walk.at(4), (vec![0, 2], vec![[1.0], [5.0]]));
/// ```
#[derive(Debug, Clone)]
pub struct Walk<'a, const D: usize> {
    trajectories: &'a [Trajectory<D>],
    /// Those that have not begun, the next one last.
    waiting: Vec<usize>,
    /// Those that have begun and not ended, rising.
    alive: Vec<usize>,
}

impl<'a, const D: usize> Walk<'a, D> {
    /// A walk that has not begun.
    pub fn new(trajectories: &'a [Trajectory<D>]) -> Self {
        let mut waiting: Vec<usize> = (0..trajectories.len()).collect();
        waiting.sort_by_key(|&one| std::cmp::Reverse(trajectories[one].start));
        Walk { trajectories, waiting, alive: Vec::new() }
    }

    /// Numbers, rising, and positions (m) of the trajectories that have one at `step`. A step before that of the last call
    /// may miss some.
    pub fn at(&mut self, step: usize) -> (Vec<usize>, Vec<[f64; D]>) {
        let all = self.trajectories;
        self.alive.retain(|&one| all[one].steps().contains(&step));
        let before = self.alive.len();
        while let Some(one) = self.waiting.pop_if(|one| all[*one].start <= step) {
            if all[one].steps().contains(&step) {
                self.alive.push(one);
            }
        }
        if self.alive.len() > before {
            self.alive.sort_unstable();
        }
        self.alive.iter().filter_map(|&one| Some((one, *all[one].at(step)?))).unzip()
    }
}
