//! Ranges of the values of a recipe.

use std::fmt::Display;
use std::ops::Range;

use crate::TrainError;

/// The error for a value that makes no sense.
pub fn refused(key: &str, value: impl Display, expected: impl Into<String>) -> TrainError {
    TrainError::Value { key: key.to_owned(), value: value.to_string(), expected: expected.into() }
}

/// A finite value above zero.
///
/// # Errors
///
/// If it is not.
pub fn positive(key: &str, value: f64) -> Result<(), TrainError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(refused(key, value, "it must be finite and above 0"))
    }
}

/// A finite value not below a limit.
///
/// # Errors
///
/// If it is not.
pub fn at_least(key: &str, value: f64, limit: f64) -> Result<(), TrainError> {
    if value.is_finite() && value >= limit {
        Ok(())
    } else {
        Err(refused(key, value, format!("it must be finite and at least {limit}")))
    }
}

/// A value in a range, without its end.
///
/// # Errors
///
/// If it is not.
pub fn within(key: &str, value: f64, range: Range<f64>) -> Result<(), TrainError> {
    if range.contains(&value) {
        Ok(())
    } else {
        Err(refused(key, value, format!("it must be at least {} and below {}", range.start, range.end)))
    }
}

/// A size or count between two limits, both included.
///
/// # Errors
///
/// If it is not.
pub fn size(key: &str, value: usize, [low, high]: [usize; 2]) -> Result<(), TrainError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(refused(key, value, format!("it must be between {low} and {high}")))
    }
}
