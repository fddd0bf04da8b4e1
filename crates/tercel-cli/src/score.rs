//! How tracks are scored against the truth.

use clap::Args;
use serde_json::{Map, Value, json};
use tercel_data::table::{Tracks, Truths};
use tercel_study::evaluate::{EvaluateOptions, Evaluation, evaluate};

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
    /// Scores tracks at the given times, as far as the truth is known then; without times, wherever there is a track.
    pub fn evaluate(
        &self,
        tracks: &Tracks,
        truths: &Truths,
        times: Option<Vec<f64>>,
        console: &Console,
    ) -> Result<Evaluation, Failure> {
        if let (Some(ours), Some(theirs)) = (tracks.origin, truths.origin)
            && ours != theirs
        {
            return Err(Failure::input("the tracks and the truth lie in different local frames")
                .with_help("convert the recording and its truth together, with one --origin"));
        }
        let _progress = Progress::spinner(console, "scoring");
        let options = EvaluateOptions {
            cutoff: self.cutoff,
            order: self.order,
            near: self.near,
            times: times.map(|times| within(times, truths)),
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

/// Times in ascending order, each once, between the first and the last of the truth.
fn within(mut times: Vec<f64>, truths: &Truths) -> Vec<f64> {
    let known = || truths.rows.iter().map(|row| row.time);
    let (first, last) = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
    times.retain(|time| (first..=last).contains(time));
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}
