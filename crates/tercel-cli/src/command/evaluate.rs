//! `tercel evaluate`.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use tercel_data::table::{Metric, Metrics};
use tercel_data::{Format, ReadOptions, read_detections, read_tracks, write_metrics, write_metrics_to};
use tercel_study::evaluate::Evaluation;

use crate::console::Console;
use crate::failure::Failure;
use crate::input;
use crate::output::{STDOUT, Target, keep_inputs, print, print_json};
use crate::score::{ScoreArguments, common_clock};
use crate::summary::Table;

/// Score tracks against the truth.
///
/// Confirmed and coasted tracks are compared with the true objects at every time of the truth and of the tracks, from the
/// first time of the truth to the last. Objects without a track are missed, also where nothing was reported at all.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct EvaluateArguments {
    /// Tracks (.csv, .parquet, .ndjson); those of other programs need the columns time, track, x and y.
    tracks: PathBuf,
    /// Truth (.csv, .parquet, .ndjson, or the truth file of an Autoferry recording).
    #[arg(long, value_name = "FILE")]
    truth: PathBuf,
    /// Detections at whose scans the tracks are scored, instead of at the times of the tracks.
    #[arg(long, value_name = "FILE")]
    scans: Option<PathBuf>,
    /// Write the scores as a table (.csv, .parquet, .ndjson; - is standard output).
    #[arg(long, short, value_name = "FILE", value_parser = Target::parse)]
    output: Option<Target>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    score: ScoreArguments,
}

const AFTER: &str = "\
Examples:
  tercel evaluate tracks.parquet --truth truth.csv
  tercel evaluate tracks.csv --truth truth.csv --scans radar.csv --cutoff 50 -o metrics.csv
  tercel evaluate tracks.csv --truth truth.csv --json | jq .scores.metrics.gospa";

impl EvaluateArguments {
    /// Scores the tracks.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        if self.json && self.output == Some(Target::Stdout) {
            let message = "--json and -o - both write to standard output";
            return Err(Failure::usage(message));
        }
        let inputs = [Some(&*self.tracks), Some(&*self.truth), self.scans.as_deref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().collect();
        keep_inputs(self.output.as_ref().and_then(Target::file), &inputs)?;
        let tracks = read_tracks(&self.tracks, &ReadOptions::default())?;
        let truths = input::truth(&self.truth)?;
        let scans = match &self.scans {
            Some(path) => {
                let detections = read_detections(path, &ReadOptions::default())?;
                Some(detections.scans.iter().map(|scan| scan.time).collect::<Vec<f64>>())
            }
            None => None,
        };
        common_clock(&tracks, &truths, scans.as_deref())?;
        let evaluation = self.score.evaluate(&tracks, &truths, scans, console)?;
        match &self.output {
            Some(Target::File(path)) => write_metrics(path, &self.metrics(&evaluation))?,
            Some(Target::Stdout) => {
                let metrics = self.metrics(&evaluation);
                return Ok(write_metrics_to(std::io::stdout(), Format::Ndjson, STDOUT, &metrics)?);
            }
            None => {}
        }
        if self.json {
            return print_json(&json!({
                "tracks": self.tracks.to_string_lossy(),
                "truth": self.truth.to_string_lossy(),
                "scores": self.score.json(&evaluation),
            }));
        }
        let mut table = Table::default();
        table.heading(self.score.heading(&evaluation));
        table.scores(&evaluation);
        print(&table.render())
    }

    fn metrics(&self, evaluation: &Evaluation) -> Metrics {
        let row = |(name, value): &(&'static str, f64)| Metric {
            study: "evaluate".to_owned(),
            method: self.tracks.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            run: self.truth.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            metric: (*name).to_owned(),
            component: String::new(),
            value: *value,
        };
        Metrics { rows: evaluation.means.iter().map(row).collect() }
    }
}
