//! What one run of a study is.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use tercel_data::table::{Detections, Tracks, Truths};

use super::{Plan, Results};
use crate::StudyError;
use crate::report::{Picture, Section};

/// A study that draws its scenes: what the machine needs to know of it.
pub trait Experiment: Sync {
    /// Which runs, methods and conditions there are.
    fn plan(&self) -> &Plan;

    /// Run number `run` under a condition, by every method in the order of the plan.
    ///
    /// The result may depend on the plan, the condition and the number of the run, and on nothing else: not on the runs
    /// before, the time, or the thread.
    fn run(&self, condition: usize, run: u64) -> Vec<Attempt>;

    /// Figures that were published for a method under a condition, by the name of the metric.
    fn published(&self, _method: &str, _condition: usize) -> Option<BTreeMap<String, f64>> {
        None
    }

    /// What the report says besides figures and curves.
    fn sections(&self) -> Vec<Section> {
        Vec::new()
    }

    /// What the report says that follows from all results together.
    fn conclusions(&self, _results: &Results) -> Vec<Section> {
        Vec::new()
    }

    /// One run drawn with what every method made of it, for the report.
    ///
    /// # Errors
    /// When a picture cannot be made. A method that fails is left out.
    fn example(&self) -> Result<Option<Example>, StudyError> {
        Ok(None)
    }
}

/// What one method made of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Attempt {
    /// Its figures, or why it failed.
    pub outcome: Result<Outcome, String>,
    /// Time that the method took; scoring is not part of it.
    pub time: Duration,
    /// Steps that it took in this time.
    pub steps: u64,
}

/// The figures of one run of one method.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// One number per metric of the plan; NaN where the method says nothing.
    pub metrics: Vec<f64>,
    /// One list per curve of the plan, as long as its abscissa; NaN where the method says nothing.
    pub curves: Vec<Vec<f64>>,
}

/// One run with what the methods made of it.
#[derive(Debug, Clone)]
pub struct Example {
    /// Which run it is, in a sentence.
    pub title: String,
    /// The picture.
    pub picture: Picture,
    /// What was seen.
    pub detections: Detections,
    /// What was there.
    pub truths: Truths,
    /// What each method made of it.
    pub tracks: Vec<(String, Tracks)>,
}

impl Attempt {
    /// Takes the time of `work`, and then scores its answer.
    pub fn of<T, E: std::fmt::Display>(
        steps: u64,
        work: impl FnOnce() -> Result<T, E>,
        score: impl FnOnce(T) -> Result<Outcome, String>,
    ) -> Self {
        let start = Instant::now();
        let answer = work();
        let time = start.elapsed();
        let outcome = answer.map_err(|error| error.to_string()).and_then(score);
        Attempt { outcome, time, steps }
    }
}
