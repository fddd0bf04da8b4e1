//! `tercel config`.

use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};
use tercel_pipeline::config::presets;
use tercel_pipeline::{Config, Pipeline, advice};

use crate::console::Console;
use crate::failure::{Failure, read_text};
use crate::output::{print, write_text};

/// Write, check and describe configurations.
#[derive(Debug, Subcommand)]
#[command(after_long_help = AFTER)]
pub enum ConfigCommand {
    /// Write a configuration with comments, to start from.
    Init(InitArguments),
    /// Check a configuration: say that it is good, or where it is not.
    Check(CheckArguments),
    /// Print the JSON Schema of configurations: every key with its unit, its range and a sentence.
    #[command(after_long_help = SCHEMA_AFTER)]
    Schema,
    /// List the configurations that come with the program.
    #[command(after_long_help = PRESETS_AFTER)]
    Presets,
}

/// What `config init` takes.
#[derive(Debug, Args)]
#[command(after_long_help = INIT_AFTER)]
pub struct InitArguments {
    /// Which one; `tercel config presets` lists them.
    #[arg(long, value_name = "NAME", default_value = "default", value_parser = PossibleValuesParser::new(presets::names()))]
    preset: String,
    /// File to write; without it, standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Replace a file that is there already.
    #[arg(long, requires = "output")]
    force: bool,
}

/// What `config check` takes.
#[derive(Debug, Args)]
#[command(after_long_help = CHECK_AFTER)]
pub struct CheckArguments {
    /// The configuration, a TOML file; - is standard input.
    file: PathBuf,
}

const AFTER: &str = "\
Examples:
  tercel config init -o tracker.toml
  tercel config check tracker.toml";

const INIT_AFTER: &str = "\
Examples:
  tercel config init -o tracker.toml
  tercel config init --preset adsb | less";

const CHECK_AFTER: &str = "\
The exit code is 0 for a good configuration and 3 for one that cannot be used.

Examples:
  tercel config check tracker.toml
  tercel config init --preset ais | tercel config check -";

const SCHEMA_AFTER: &str = "\
Examples:
  tercel config schema > tercel.schema.json";

const PRESETS_AFTER: &str = "\
Examples:
  tercel config presets
  tercel config init --preset default -o tracker.toml";

impl ConfigCommand {
    /// Does it.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        match self {
            ConfigCommand::Init(arguments) => arguments.run(console),
            ConfigCommand::Check(arguments) => {
                let (config, _) = read(&arguments.file)?;
                let told = advice(&config, None).map_err(|error| Failure::failed(error.to_string()))?;
                told.iter().for_each(|sentence| console.warn(format_args!("{sentence}")));
                print(&format!("{}: ok ({})\n", arguments.file.display(), described(&config)))
            }
            ConfigCommand::Schema => print(&format!("{:#}\n", Config::schema())),
            ConfigCommand::Presets => print(&list()),
        }
    }
}

impl InitArguments {
    fn run(&self, console: &Console) -> Result<(), Failure> {
        let output = self.output.as_deref();
        if let Some(path) = output.filter(|path| path.is_file() && !self.force) {
            return Err(Failure::failed(format!("{}: the file is there already", path.display()))
                .with_help("--force replaces it"));
        }
        write_text(output, presets::get(&self.preset).unwrap_or_default())?;
        if let Some(path) = output {
            console.note(format_args!("wrote {}", path.display()));
        }
        Ok(())
    }
}

/// Reads a configuration and builds its tracker, which finds what no single key can say.
pub fn read(path: &Path) -> Result<(Config, Pipeline), Failure> {
    build(&path.to_string_lossy(), &read_text(path)?, path.parent().unwrap_or(Path::new("")))
}

/// One of the configurations that come with the program.
pub fn preset(name: &str) -> Result<(Config, Pipeline), Failure> {
    build(name, presets::get(name).unwrap_or_default(), Path::new(""))
}

/// Files that the configuration names are looked for from `folder`.
fn build(name: &str, text: &str, folder: &Path) -> Result<(Config, Pipeline), Failure> {
    let build = || {
        let config = Config::parse(text)?.in_folder(folder);
        let pipeline = Pipeline::new(&config)?;
        Ok((config, pipeline))
    };
    build().map_err(|error| Failure::config(name, text, &error))
}

fn described(config: &Config) -> String {
    let sensors: Vec<&str> = config.sensors.keys().map(String::as_str).collect();
    format!("motion {}, sensors {}", config.motion.name(), sensors.join(", "))
}

/// Names of the presets with the sentence that they begin with.
fn list() -> String {
    let width = presets::names().map(str::len).max().unwrap_or(0) + 2;
    let line = |name| {
        let text = presets::get(name).unwrap_or_default();
        let about = text.lines().next().and_then(|line| line.strip_prefix('#')).unwrap_or_default();
        format!("{name:width$}{}\n", about.trim())
    };
    presets::names().map(line).collect()
}
