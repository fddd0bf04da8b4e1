//! How tracks are scored against the truth.

use clap::Args;
use serde_json::{Map, Value, json};
use tercel_data::table::{Tracks, Truths};
use tercel_study::evaluate::{EvaluateOptions, Evaluation, evaluate, scored_times};

use crate::console::Console;
use crate::failure::Failure;
use crate::progress::Progress;

/// What counts as found.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Scoring")]
pub struct ScoreArguments {
    /// Distance in m beyond which a track has nothing to do with an object.
    #[arg(long, default_value_t = 20.0, value_name = "M", value_parser = positive, allow_negative_numbers = true)]
    pub cutoff: f64,
    /// Order of GOSPA and OSPA, 1 or more.
    #[arg(long, default_value_t = 1.0, value_name = "P", value_parser = order, allow_negative_numbers = true)]
    pub order: f64,
    /// The metrics named `near` count false tracks only within this distance in m of an object.
    #[arg(long, default_value_t = 150.0, value_name = "M", value_parser = positive, allow_negative_numbers = true)]
    pub near: f64,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if number > 0.0 && f64::is_finite(number) => Ok(number),
        _ => Err("expected a number above 0".to_owned()),
    }
}

fn order(text: &str) -> Result<f64, String> {
    positive(text).ok().filter(|&order| order >= 1.0).ok_or_else(|| "expected a number from 1".to_owned())
}

impl ScoreArguments {
    /// Scores tracks at the times of the truth, and at those of the scans or, where none are given, of the tracks. Without
    /// a time in common nothing is scored, and a warning says so.
    pub fn evaluate(
        &self,
        tracks: &Tracks,
        truths: &Truths,
        scans: Option<Vec<f64>>,
        console: &Console,
    ) -> Result<Evaluation, Failure> {
        if let (Some(ours), Some(theirs)) = (tracks.origin, truths.origin)
            && ours != theirs
        {
            return Err(Failure::input("the tracks and the truth lie in different local frames")
                .with_help("convert the recording and its truth together, with one --origin"));
        }
        let _progress = Progress::spinner(console, "scoring");
        let times = match common_clock(tracks, truths, scans.as_deref()) {
            Ok(()) => scans.map(|scans| scored_times(scans, truths)),
            Err(problem) => {
                let reason = problem.report().map_or("", |report| &report.message);
                console.warn(format_args!("the tracks are not scored: {reason}"));
                Some(Vec::new())
            }
        };
        let options = EvaluateOptions {
            cutoff: self.cutoff,
            order: self.order,
            near: self.near,
            times,
            ..EvaluateOptions::default()
        };
        evaluate(tracks, truths, &options)
            .map_err(|error| Failure::failed(format!("cannot score the tracks: {error}")))
    }

    /// The heading of a table of scores.
    pub fn heading(&self, evaluation: &Evaluation) -> String {
        let times = evaluation.instants.len();
        format!("Against the truth (cut-off {} m, order {}, {times} times)", self.cutoff, self.order)
    }

    /// The scores as JSON.
    pub fn json(&self, evaluation: &Evaluation) -> Value {
        let means: Map<String, Value> =
            evaluation.means.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
        json!({
            "cutoff": self.cutoff,
            "order": self.order,
            "near": self.near,
            "times": evaluation.instants.len(),
            "metrics": means,
        })
    }
}

/// Refuses scans or, where none are given, tracks that have no time in common with the truth: their clocks are different
/// ones. What holds no row has no clock: silence, and the absence of all objects, can be scored.
pub fn common_clock(tracks: &Tracks, truths: &Truths, scans: Option<&[f64]>) -> Result<(), Failure> {
    let told = span(truths.rows.iter().map(|row| row.time));
    let reported = match scans {
        Some(scans) => span(scans.iter().copied()),
        None => span(tracks.rows.iter().map(|row| row.time)),
    };
    match (told, reported) {
        (None, None) => Err(Failure::input("neither the tracks nor the truth hold a row")
            .with_help("one of the two may be empty; both together leave no time to score")),
        (Some(told), Some(reported)) if reported.1 < told.0 || told.1 < reported.0 => {
            Err(Failure::input("there is no time at which both tracks and truth are known")
                .with_help("the times of both must be seconds of the same epoch"))
        }
        _ => Ok(()),
    }
}

/// The first and the last time, if there is any.
fn span(times: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    times.map(|time| (time, time)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}
