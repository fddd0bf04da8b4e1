//! What can go wrong inside a filter.

/// A filter step that could not be carried out. The belief is left as it was before the step.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// A matrix that must be positive definite is not, and rounding does not explain it.
    #[error("{matrix} is not positive definite: pivot {pivot} is {value:e}")]
    NotPositiveDefinite {
        /// Which matrix: "innovation covariance", "state covariance", ...
        matrix: &'static str,
        /// Row of the first pivot of the Cholesky factor that is not positive.
        pivot: usize,
        /// Value of that pivot.
        value: f64,
    },
    /// A number that must be finite is not.
    #[error("{what} is not finite")]
    NotFinite {
        /// Which quantity: "measurement", "state mean", ...
        what: &'static str,
    },
    /// A parameter lies outside its range.
    #[error("{parameter} is {value}; {expected}")]
    Parameter {
        /// Name of the parameter.
        parameter: &'static str,
        /// The value that was given.
        value: f64,
        /// What was expected, as a sentence part: "must be positive".
        expected: &'static str,
    },
    /// A sensor cannot start an object from one measurement.
    #[error("{sensor} measurements do not say where an object is: {reason}")]
    NotInvertible {
        /// Which sensor.
        sensor: &'static str,
        /// Why, and what helps.
        reason: &'static str,
    },
}

impl FilterError {
    /// Returns `value` when it is finite and positive, and an error that names `parameter` otherwise.
    pub fn positive(parameter: &'static str, value: f64) -> Result<f64, FilterError> {
        if value > 0.0 && value.is_finite() {
            return Ok(value);
        }
        Err(FilterError::Parameter { parameter, value, expected: "must be positive and finite" })
    }

    /// Returns `value` when it lies in `[0, 1]`, and an error that names `parameter` otherwise.
    pub fn probability(parameter: &'static str, value: f64) -> Result<f64, FilterError> {
        if (0.0..=1.0).contains(&value) {
            return Ok(value);
        }
        Err(FilterError::Parameter { parameter, value, expected: "must be a probability, 0 to 1" })
    }
}
