//! The commands, one file each.

mod completions;
mod config;
mod convert;
mod evaluate;
mod study;
mod track;

use clap::Subcommand;

use crate::console::Console;
use crate::failure::Failure;

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Turn detections into tracks.
    Track(track::TrackArguments),
    /// Score tracks against the truth.
    Evaluate(evaluate::EvaluateArguments),
    /// Bring recordings of other programs into the tables.
    Convert(convert::ConvertArguments),
    /// Write, check and describe configurations.
    #[command(subcommand)]
    Config(config::ConfigCommand),
    /// Run a study: a scenario, several trackers, their scores.
    Study(study::StudyArguments),
    /// Print the completions of a shell.
    Completions(completions::CompletionsArguments),
}

impl Command {
    /// Does it.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        match self {
            Command::Track(arguments) => arguments.run(console),
            Command::Evaluate(arguments) => arguments.run(console),
            Command::Convert(arguments) => arguments.run(console),
            Command::Config(command) => command.run(console),
            Command::Study(arguments) => arguments.run(console),
            Command::Completions(arguments) => arguments.run(),
        }
    }
}
