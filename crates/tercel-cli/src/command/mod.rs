//! The commands, one file each.

mod completions;
mod config;
mod convert;
mod evaluate;
mod models;
mod simulate;
mod study;
mod track;
mod train;

use clap::Subcommand;

use crate::console::Console;
use crate::failure::Failure;

/// What to do. The commands' own documentation is their help.
#[derive(Debug, Subcommand)]
pub enum Command {
    Track(track::TrackArguments),
    Evaluate(evaluate::EvaluateArguments),
    Convert(convert::ConvertArguments),
    #[command(subcommand)]
    Config(config::ConfigCommand),
    Simulate(simulate::SimulateArguments),
    Study(study::StudyArguments),
    #[command(subcommand)]
    Models(models::ModelsCommand),
    Train(train::TrainArguments),
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
            Command::Simulate(arguments) => arguments.run(console),
            Command::Study(arguments) => arguments.run(console),
            Command::Models(command) => command.run(console),
            Command::Train(arguments) => arguments.run(console),
            Command::Completions(arguments) => arguments.run(),
        }
    }
}
