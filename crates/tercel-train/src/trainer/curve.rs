//! The learning curve.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::shards::Tally;

/// One epoch of the learning curve: a line of the curve's file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The epoch, from 0.
    pub epoch: usize,
    /// The mean training loss.
    pub loss: Option<f64>,
    /// Its parts.
    pub parts: BTreeMap<String, Option<f64>>,
    /// The mean validation loss; `None` if it is not finite.
    pub validation: Option<f64>,
    /// Its parts.
    pub validation_parts: BTreeMap<String, Option<f64>>,
    /// The learning rate of the last update.
    pub rate: f64,
    /// The mean norm of the gradients before clipping.
    pub norm: f64,
    /// The time that the epoch took, with validation, in seconds.
    pub seconds: f64,
    /// Updates that were skipped because the loss or its gradient was not finite.
    pub skipped: usize,
}

impl Row {
    pub(super) fn new(epoch: usize, tally: &Tally, validation: &Tally, rate: f64, seconds: f64) -> Self {
        let finite = |value: f64| Some(tidy(value)).filter(|value| value.is_finite());
        let parts =
            |tally: &Tally| tally.parts().map(|(name, value)| (name.to_owned(), finite(value))).collect();
        Self {
            epoch,
            loss: finite(tally.mean()),
            parts: parts(tally),
            validation: finite(validation.mean()),
            validation_parts: parts(validation),
            rate: tidy(rate),
            norm: tidy(tally.mean_norm()),
            seconds: tidy(seconds),
            skipped: tally.skipped,
        }
    }

    /// The row as a JSON object and a line feed.
    pub fn line(&self) -> String {
        // Names and finite numbers are all there is, so writing cannot fail.
        serde_json::to_string(self).map(|line| line + "\n").unwrap_or_default()
    }
}

/// Rounds to nine digits: as many as a curve is read with, and so few that JSON gives them back exactly.
fn tidy(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}
