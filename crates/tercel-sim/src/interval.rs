//! Intervals from which parameters are drawn.

use rand::{Rng, RngExt};

use crate::SimulationError;

/// A closed interval of numbers, from which values are drawn with equal chance.
///
/// ```
/// use tercel_sim::Interval;
///
/// let speeds = Interval::new(50.0, 400.0)?; // m/s
/// assert_eq!((speeds.low(), speeds.high()), (50.0, 400.0));
/// assert!(Interval::new(3.0, 2.0).is_err());
/// # Ok::<(), tercel_sim::SimulationError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    /// From `low` to `high`; the two may be equal.
    ///
    /// # Errors
    /// When one is not finite or `high` is below `low`.
    pub fn new(low: f64, high: f64) -> Result<Self, SimulationError> {
        SimulationError::unless(low.is_finite(), "start of an interval", low, "it must be finite")?;
        let expected = "it must be finite and not below its start";
        SimulationError::unless(high.is_finite() && low <= high, "end of an interval", high, expected)?;
        Ok(Interval { low, high })
    }

    /// For the constants of this crate.
    pub(crate) const fn fixed(low: f64, high: f64) -> Self {
        Interval { low, high }
    }

    /// The smallest value.
    pub fn low(&self) -> f64 {
        self.low
    }

    /// The largest value.
    pub fn high(&self) -> f64 {
        self.high
    }

    /// Draws a value.
    pub fn draw(&self, random: &mut impl Rng) -> f64 {
        self.low + (self.high - self.low) * random.random::<f64>()
    }
}
