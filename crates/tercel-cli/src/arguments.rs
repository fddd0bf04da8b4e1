//! What every command takes.

use clap::Parser;

use crate::command::Command;
use crate::console::Color;

/// Turns sensor detections into tracks.
///
/// Detections come in as CSV, Parquet or NDJSON tables or as recordings of other programs; tracks, metrics and reports go
/// out. Every command has examples at the end of its own --help.
#[derive(Debug, Parser)]
#[command(name = "tercel", version, max_term_width = 100, after_long_help = AFTER)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Print no notes, warnings or progress on standard error: only errors and, in one line, what was left out.
    #[arg(long, short, global = true, help_heading = "Global options")]
    pub quiet: bool,
    /// When to use colours. The environment variable NO_COLOR is respected.
    #[arg(
        long,
        value_enum,
        default_value_t,
        global = true,
        value_name = "WHEN",
        help_heading = "Global options"
    )]
    pub color: Color,
}

const AFTER: &str = "\
Exit codes:
  0  success
  1  failure: the system refused, or the program is at fault
  2  bad usage: the arguments do not fit
  3  bad input: a file, a table or a configuration that cannot be used

Examples:
  tercel track radar.csv -o tracks.parquet --report report.html
  tercel config init -o tracker.toml
  tercel track --help";
