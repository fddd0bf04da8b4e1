//! What the runs gave.

use serde::{Deserialize, Serialize};

use super::{Attempt, ExactSum, Outcome, Plan, Shard};

/// The results of the runs of a shard.
#[derive(Debug, Clone, PartialEq)]
pub struct Results {
    /// The plan that was followed.
    pub plan: Plan,
    /// Which of its runs are here.
    pub shard: Shard,
    /// One cell for each condition and, within it, each method.
    pub cells: Vec<Cell>,
}

/// The results of one method under one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// The runs, ascending.
    pub runs: Vec<u64>,
    /// For each run its metrics, in the order of the plan; nothing where the method says nothing or failed.
    pub values: Vec<Vec<Option<f64>>>,
    /// The runs that failed, ascending.
    pub failures: Vec<Failure>,
    /// For each curve of the plan the sums over the runs at its points.
    pub curves: Vec<Vec<ExactSum>>,
    /// Time of all steps of the runs that succeeded, s. This differs from one computation to the next.
    pub seconds: f64,
    /// Number of these steps.
    pub steps: u64,
}

/// A run that failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// Its number.
    pub run: u64,
    /// Why.
    pub message: String,
}

impl Results {
    /// The cell of a method under a condition.
    pub fn cell(&self, condition: usize, method: usize) -> Option<&Cell> {
        let methods = self.plan.methods.len();
        self.cells.get(condition * methods + method).filter(|_| method < methods)
    }
}

impl Cell {
    /// No runs yet.
    pub(super) fn new(plan: &Plan) -> Self {
        let curves = plan.curves.iter().map(|curve| vec![ExactSum::default(); curve.x.len()]).collect();
        Cell { runs: Vec::new(), values: Vec::new(), failures: Vec::new(), curves, seconds: 0.0, steps: 0 }
    }

    pub(super) fn push(&mut self, run: u64, attempt: Attempt) {
        self.runs.push(run);
        match attempt.outcome.and_then(checked) {
            Ok(outcome) => {
                self.seconds += attempt.time.as_secs_f64();
                self.steps += attempt.steps;
                for (sums, curve) in self.curves.iter_mut().zip(&outcome.curves) {
                    for (sum, &value) in sums.iter_mut().zip(curve) {
                        // Checked above: every value can be added.
                        let _ = sum.add(value);
                    }
                }
                let told = outcome.metrics.iter().map(|&value| Some(value).filter(|value| !value.is_nan()));
                self.values.push(told.collect());
            }
            Err(message) => {
                self.values.push(Vec::new());
                self.failures.push(Failure { run, message });
            }
        }
    }

    /// Takes the runs of another cell.
    pub(super) fn merge(&mut self, other: Cell) {
        self.seconds += other.seconds;
        self.steps += other.steps;
        self.runs.extend(other.runs);
        self.values.extend(other.values);
        self.failures.extend(other.failures);
        for (sums, others) in self.curves.iter_mut().zip(&other.curves) {
            sums.iter_mut().zip(others).for_each(|(sum, other)| sum.merge(other));
        }
    }

    /// Puts the runs in their order.
    pub(super) fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.runs.len()).collect();
        order.sort_by_key(|&place| self.runs[place]);
        self.values = order.iter().map(|&place| std::mem::take(&mut self.values[place])).collect();
        self.runs.sort_unstable();
        self.failures.sort_by_key(|failure| failure.run);
    }

    /// The values of a metric over the runs, NaN where there is none.
    pub(super) fn metric(&self, metric: usize) -> Vec<f64> {
        let value = |values: &Vec<Option<f64>>| values.get(metric).copied().flatten().unwrap_or(f64::NAN);
        self.values.iter().map(value).collect()
    }

    /// 1 for each run that failed, 0 for the others.
    pub(super) fn failed(&self) -> Vec<f64> {
        let failed = |run| self.failures.binary_search_by_key(run, |failure| failure.run).is_ok();
        self.runs.iter().map(|run| f64::from(u8::from(failed(run)))).collect()
    }
}

/// The outcome, if its numbers can be averaged.
fn checked(outcome: Outcome) -> Result<Outcome, String> {
    if let Some(value) = outcome.metrics.iter().find(|value| value.is_infinite()) {
        return Err(format!("diverged: a metric is {value}"));
    }
    for curve in &outcome.curves {
        let wrong = curve.iter().enumerate().find(|(_, value)| !value.is_nan() && !ExactSum::takes(**value));
        if let Some((step, value)) = wrong {
            return Err(format!("diverged: {value:.3e} at step {step} of a curve"));
        }
    }
    Ok(outcome)
}
