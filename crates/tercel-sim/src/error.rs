//! Why a scenario cannot be simulated.

/// A number of a scenario that cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{what} is {value}, but {expected}")]
pub struct SimulationError {
    /// What the number is.
    pub what: &'static str,
    /// The number.
    pub value: f64,
    /// What it has to be.
    pub expected: &'static str,
}

impl SimulationError {
    /// `value`, if `holds`.
    pub(crate) fn unless(
        holds: bool,
        what: &'static str,
        value: f64,
        expected: &'static str,
    ) -> Result<f64, SimulationError> {
        if holds { Ok(value) } else { Err(SimulationError { what, value, expected }) }
    }
}
