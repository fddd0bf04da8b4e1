//! The result of a study: methods, metrics, and how sure the figures are.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The table of a study, in the form of `tercel study --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyTable {
    /// Name of the study.
    pub study: String,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Runs (or recordings) that each figure is taken over.
    pub runs: usize,
    /// The methods, in the order in which they are best read.
    pub rows: Vec<Row>,
}

/// One method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Its name.
    pub method: String,
    /// Under which condition, by the name of what a study changes from row to row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<BTreeMap<String, f64>>,
    /// Its figures by the name of the metric.
    pub metrics: BTreeMap<String, Figure>,
    /// Time for one step (a scan), microseconds.
    pub us_per_step: f64,
    /// What was published for it elsewhere, by the name of the metric.
    pub published: Option<BTreeMap<String, f64>>,
}

/// A mean over runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figure {
    /// Mean over the runs.
    pub mean: f64,
    /// Standard deviation over the runs.
    pub std: f64,
    /// Lower end of the 95 % bootstrap interval of the mean.
    pub lo: f64,
    /// Upper end of the 95 % bootstrap interval of the mean.
    pub hi: f64,
}

/// Draws of the bootstrap.
const DRAWS: usize = 2_000;

impl Figure {
    /// Mean, spread and bootstrap interval of one value per run. Runs without a value (NaN) are left out.
    ///
    /// ```
    /// use tercel_study::Figure;
    ///
    /// let figure = Figure::of(&[1.0, 2.0, 3.0, 4.0], 7);
    /// assert_eq!(figure.mean, 2.5);
    /// assert!(figure.lo >= 1.0 && figure.hi <= 4.0 && figure.lo < 2.5 && figure.hi > 2.5);
    /// ```
    pub fn of(values: &[f64], seed: u64) -> Self {
        let values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let count = values.len();
        if count == 0 {
            return Figure { mean: f64::NAN, std: f64::NAN, lo: f64::NAN, hi: f64::NAN };
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
        let std = if count > 1 { (squares / (count - 1) as f64).sqrt() } else { 0.0 };
        if values.iter().all(|&value| value == values[0]) {
            return Figure { mean, std, lo: mean, hi: mean };
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw =
            || (0..count).map(|_| values[random.random_range(0..count)]).sum::<f64>() / count as f64;
        let mut means: Vec<f64> = (0..DRAWS).map(|_| draw()).collect();
        means.sort_by(f64::total_cmp);
        Figure { mean, std, lo: means[DRAWS / 40], hi: means[DRAWS - 1 - DRAWS / 40] }
    }
}

impl StudyTable {
    /// The table as text: one line a method, one column for each of these metrics.
    pub fn text(&self, metrics: &[&str]) -> String {
        let width = self.rows.iter().map(|row| row.method.len()).max().unwrap_or(0).max("method".len());
        let mut text = format!("{:width$}", "method");
        for metric in metrics {
            let _ = write!(text, "  {metric:>12}");
        }
        text.push_str("  us per scan\n");
        for row in &self.rows {
            let _ = write!(text, "{:width$}", row.method);
            for metric in metrics {
                match row.metrics.get(*metric) {
                    Some(figure) => {
                        let _ = write!(text, "  {:>width$.3}", figure.mean, width = metric.len().max(12));
                    }
                    None => {
                        let _ = write!(text, "  {:>width$}", "-", width = metric.len().max(12));
                    }
                }
            }
            let _ = writeln!(text, "  {:>11.1}", row.us_per_step);
        }
        text
    }
}
