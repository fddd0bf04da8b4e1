//! `tercel train`.

#[cfg(feature = "train")]
mod observer;
#[cfg(feature = "train")]
mod run;

use std::path::PathBuf;

use clap::Args;

use crate::console::Console;
use crate::failure::Failure;

/// Train the network of a learned filter.
///
/// The recipe says everything that the result depends on: data, sizes, loss, optimiser, schedule and seed. It is checked
/// before anything is trained, and so is whether the files can be written. Beside the model stand its card (.toml), the
/// learning curve (.curve.ndjson: one JSON object for each epoch) and a checkpoint (.checkpoint), from which --resume goes on
/// after an interruption with the same result, bit for bit.
///
/// A program that was built without the feature `train` does not have this command:
/// `cargo install --path crates/tercel-cli --features train` builds one that does.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
#[cfg_attr(not(feature = "train"), allow(dead_code, reason = "the arguments are read by the feature"))]
pub struct TrainArguments {
    /// The recipe, a TOML file; - is standard input.
    #[arg(value_name = "RECIPE")]
    recipe: PathBuf,
    /// Model to write; without it, models/NAME.safetensors with the name in the recipe.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Go on from the checkpoint beside the model.
    #[arg(long)]
    resume: bool,
    /// Start anew even if there is a model or a checkpoint of that name, and replace them.
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    /// Threads to use; without it, one for each core. The result does not depend on them.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Recorded tracks, for recipes that learn from them: a NumPy array, or a folder with one. A fifth of them, on which a
    /// study tests, is left out.
    #[arg(long, value_name = "PATH")]
    data: Option<PathBuf>,
    /// Licence of the weights, for the model card: MIT, CC-BY-4.0, ...
    #[arg(long, value_name = "NAME", default_value = "")]
    licence: String,
}

const AFTER: &str = "\
Examples:
  tercel train recipes/kalman-net-straight.toml
  tercel train recipes/kalman-net-straight.toml --resume
  tercel train my-recipe.toml -o my-models/turns.safetensors --threads 4
  tercel train recipes/rmmnet-aircraft.toml --data tracks.npy";

impl TrainArguments {
    /// Trains.
    #[cfg(feature = "train")]
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        run::run(self, console)
    }

    /// Says how to get a program that can.
    #[cfg(not(feature = "train"))]
    pub fn run(&self, _: &Console) -> Result<(), Failure> {
        Err(Failure::usage("this program was built without the feature `train`")
            .with_help("cargo install --path crates/tercel-cli --features train builds one with it"))
    }
}
