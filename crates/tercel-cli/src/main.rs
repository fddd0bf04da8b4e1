//! The `tercel` command: arguments, progress and exit codes around the Tercel libraries.
//!
//! Exit codes: 0 for success, 1 for a failure of the system or of the program, 2 for bad usage, 3 for bad input (a file,
//! a table or a configuration that cannot be used).

mod account;
mod arguments;
mod command;
mod console;
mod failure;
mod input;
mod origin;
mod output;
mod progress;
mod score;
mod summary;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};

use crate::arguments::Cli;
use crate::console::{Color, Console};

fn main() -> ExitCode {
    let color = Color::from_arguments(std::env::args_os());
    let matches = Cli::command().color(color.into()).get_matches();
    let cli = match Cli::from_arg_matches(&matches) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    let console = Console::new(cli.color, cli.quiet);
    match cli.command.run(&console) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => console.fail(&failure),
    }
}
