//! `tercel models`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde_json::{Value, json};
use tercel_neural::{Card, Model, filter};

use crate::console::Console;
use crate::failure::Failure;
use crate::output::{print, print_json};

/// List, describe and check the models of learned filters.
#[derive(Debug, Subcommand)]
#[command(after_long_help = AFTER)]
pub enum ModelsCommand {
    /// List models with their kind, size, day and validation loss.
    #[command(after_long_help = LIST_AFTER)]
    List(JsonArguments),
    /// Print the cards of models, and what their tensors are.
    #[command(after_long_help = SHOW_AFTER)]
    Show(JsonArguments),
    /// Read every model as a filter would, and name what is wrong.
    ///
    /// A model is good when its file is whole, all numbers are finite, its card is understood, sizes and tensors are those of
    /// its kind, and the card in the file beside it, if there is one, says the same.
    #[command(after_long_help = VERIFY_AFTER)]
    Verify(ModelArguments),
}

/// Which models.
#[derive(Debug, Args)]
pub struct ModelArguments {
    /// Models, or folders that hold them.
    #[arg(value_name = "PATH", default_value = "models")]
    paths: Vec<PathBuf>,
}

/// Which models, and how they are printed.
#[derive(Debug, Args)]
pub struct JsonArguments {
    #[command(flatten)]
    models: ModelArguments,
    /// Print one JSON object for each model, each on its line.
    #[arg(long)]
    json: bool,
}

const AFTER: &str = "\
Examples:
  tercel models list
  tercel models show models/kalman-net-2.safetensors
  tercel models verify";

const LIST_AFTER: &str = "\
Examples:
  tercel models list
  tercel models list my-models --json";

const SHOW_AFTER: &str = "\
Examples:
  tercel models show models/kalman-net-2.safetensors";

const VERIFY_AFTER: &str = "\
The exit code is 0 when all models are good, and 3 when one is not.

Examples:
  tercel models verify
  tercel models verify my-models/turns.safetensors";

impl ModelsCommand {
    /// Does it.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        match self {
            ModelsCommand::List(arguments) => arguments.list(),
            ModelsCommand::Show(arguments) => arguments.show(),
            ModelsCommand::Verify(arguments) => arguments.verify(console),
        }
    }
}

impl ModelArguments {
    /// The files that are meant: those that are named, and those in folders that are named, by name.
    fn files(&self) -> Result<Vec<PathBuf>, Failure> {
        let mut files = Vec::new();
        for path in &self.paths {
            if !path.is_dir() {
                files.push(path.clone());
                continue;
            }
            let found = in_folder(path)
                .map_err(|error| Failure::input(format!("{}: cannot read: {error}", path.display())))?;
            if found.is_empty() {
                let message = format!("{}: there is no model in this folder", path.display());
                return Err(Failure::input(message).with_help("a model is a file that ends in .safetensors"));
            }
            files.extend(found);
        }
        Ok(files)
    }

    fn verify(&self, console: &Console) -> Result<(), Failure> {
        let files = self.files()?;
        let mut bad = 0;
        for file in &files {
            match verified(file) {
                Ok(model) => print(&format!("{}: ok ({})\n", file.display(), described(&model)))?,
                Err(failure) => {
                    console.fail(&failure);
                    bad += 1;
                }
            }
        }
        match bad {
            0 => Ok(()),
            _ => Err(Failure::input(format!("{bad} of {} models cannot be used", files.len()))),
        }
    }
}

impl JsonArguments {
    fn list(&self) -> Result<(), Failure> {
        let files = self.models.files()?;
        let width = files.iter().map(|file| file.display().to_string().len()).max().unwrap_or(0);
        for file in &files {
            let model = Model::open(file)?;
            if self.json {
                print_json(&as_json(file, &model))?;
            } else {
                let loss = model.card().metrics.get("validation_loss");
                let loss = loss.map(|loss| format!(", validation loss {loss:.6}")).unwrap_or_default();
                let name = file.display().to_string();
                print(&format!("{name:width$}  {}{loss}\n", described(&model)))?;
            }
        }
        Ok(())
    }

    fn show(&self) -> Result<(), Failure> {
        for file in self.models.files()? {
            let model = Model::open(&file)?;
            if self.json {
                print_json(&as_json(&file, &model))?;
                continue;
            }
            let card = model
                .card()
                .to_toml()
                .map_err(|error| Failure::input(format!("{}: model card: {error}", file.display())))?;
            let tensors = model.tensors().iter();
            let tensors: String =
                tensors.map(|(name, tensor)| format!("#   {name} {:?}\n", tensor.shape)).collect();
            let title = format!("# {}: {} parameters\n", file.display(), parameters(&model));
            print(&format!("{title}{card}# tensors:\n{tensors}"))?;
        }
        Ok(())
    }
}

fn in_folder(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in folder.read_dir()? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "safetensors") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// A model that a filter can be made of, whose card for people says the same.
fn verified(file: &Path) -> Result<Model, Failure> {
    let model = Model::open(file)?;
    filter::check(&model)?;
    let twin = file.with_extension("toml");
    if let Ok(text) = std::fs::read_to_string(&twin) {
        let card = Card::from_toml(&text)
            .map_err(|error| Failure::input(format!("{}: {}", twin.display(), error.trim_end())))?;
        if card != *model.card() {
            let message = format!("{}: differs from the card in {}", twin.display(), file.display());
            return Err(Failure::input(message).with_help("the card in the model counts"));
        }
    }
    Ok(model)
}

fn parameters(model: &Model) -> usize {
    model.tensors().values().map(|tensor| tensor.values.len()).sum()
}

fn described(model: &Model) -> String {
    let card = model.card();
    let trained = match card.trained.as_str() {
        "" => String::new(),
        day => format!(", trained {day}"),
    };
    format!("{} {}, {} parameters{trained}", card.kind, card.name, parameters(model))
}

fn as_json(file: &Path, model: &Model) -> Value {
    json!({ "file": file, "parameters": parameters(model), "card": model.card() })
}
