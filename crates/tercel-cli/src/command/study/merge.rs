//! `tercel study merge`.

use std::path::PathBuf;

use clap::Args;
use tercel_study::monte_carlo::{Results, find_shards};
use tercel_study::studies::experiment_of;

use super::finish;
use crate::console::Console;
use crate::failure::Failure;

/// Join the shards of a study.
///
/// Prints and writes what the whole study would have, to the last bit; the time for a step is the mean over the shards. Shards
/// that differ in seed, runs, methods, options or version are refused, and so is an incomplete set.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct MergeArguments {
    /// Files of shards, or folders that hold them.
    #[arg(value_name = "FILE", required = true)]
    shards: Vec<PathBuf>,
    /// Folder for the table, the numbers of every run and the report.
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

const AFTER: &str = "\
Examples:
  tercel study merge shards -o results
  tercel study merge atc-test_1-of-2.shard.json atc-test_2-of-2.shard.json --json";

impl MergeArguments {
    /// Joins them.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        let mut shards = Vec::new();
        for path in find_shards(&self.shards)? {
            let results = Results::read(&path)?;
            shards.push((path, results));
        }
        let results = Results::merge(shards)?;
        let experiment = experiment_of(&results.plan)?;
        finish(&*experiment, &results, self.output.as_deref(), self.json, console)
    }
}
