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
