//! `tercel models`.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde_json::{Value, json};
use tercel_neural::{Card, Model, filter, shipped};

use crate::console::Console;
use crate::failure::Failure;
use crate::output::{print, print_json};

/// List, describe and check the models of learned filters.
#[derive(Debug, Subcommand)]
#[command(after_long_help = AFTER)]
pub enum ModelsCommand {
    /// List models with their kind, number of parameters, day of training and validation loss.
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
    /// Files of models, folders that hold them, or names of models that come with Tercel; without any, all of these.
    #[arg(value_name = "PATH")]
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
  tercel models show my-models/turns.safetensors
  tercel models verify my-models";

const LIST_AFTER: &str = "\
Examples:
  tercel models list
  tercel models list my-models --json";

const SHOW_AFTER: &str = "\
Examples:
  tercel models show neural-imm
  tercel models show my-models/turns.safetensors";

const VERIFY_AFTER: &str = "\
The exit code is 0 when all models are good, and 3 when one is not.

Examples:
  tercel models verify
  tercel models verify my-models/turns.safetensors";

impl ModelsCommand {
    /// Does it.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        match self {
            ModelsCommand::List(arguments) => arguments.list(console),
            ModelsCommand::Show(arguments) => arguments.show(console),
            ModelsCommand::Verify(arguments) => arguments.verify(console),
        }
    }
}

/// A model that is meant: its file, or its name if it comes with Tercel.
enum Place {
    File(PathBuf),
    Shipped(&'static str),
}

impl Place {
    fn name(&self) -> String {
        match self {
            Place::File(path) => path.display().to_string(),
            Place::Shipped(name) => (*name).to_owned(),
        }
    }

    fn read(&self) -> Result<Model, Failure> {
        Ok(match self {
            Place::File(path) => Model::open(path).map_err(|error| match path.exists() {
                true => Failure::from(error),
                false => {
                    Failure::from(error).with_help("`tercel models list` names those that come with Tercel")
                }
            })?,
            Place::Shipped(name) => shipped::model(name)?,
        })
    }

    /// The model, of which a filter can be made and whose card for people says the same.
    fn verified(&self) -> Result<Model, Failure> {
        let model = self.read()?;
        filter::check(&model)?;
        if let Place::File(path) = self {
            same_twin(path, &model)?;
        }
        Ok(model)
    }
}

impl ModelArguments {
    /// What is meant: the files that are named, and those in folders that are named, by name.
    fn places(&self) -> Result<Vec<Place>, Failure> {
        if self.paths.is_empty() {
            return Ok(shipped::NAMES.map(Place::Shipped).into());
        }
        let mut places = Vec::new();
        for path in &self.paths {
            let named = shipped::NAMES.iter().find(|name| path.as_os_str() == **name);
            if let (Some(name), false) = (named, path.exists()) {
                places.push(Place::Shipped(name));
                continue;
            }
            if !path.is_dir() {
                places.push(Place::File(path.clone()));
                continue;
            }
            let found = in_folder(path)
                .map_err(|error| Failure::input(format!("{}: cannot read: {error}", path.display())))?;
            if found.is_empty() {
                let message = format!("{}: there is no model in this folder", path.display());
                return Err(Failure::input(message).with_help("a model is a file that ends in .safetensors"));
            }
            places.extend(found.into_iter().map(Place::File));
        }
        Ok(places)
    }

    /// Reads every model and does something with it. Those that cannot be used are named, and do not keep the others back.
    fn each(
        &self,
        console: &Console,
        read: impl Fn(&Place) -> Result<Model, Failure>,
        mut work: impl FnMut(&Place, &Model) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let places = self.places()?;
        let mut bad = 0;
        for place in &places {
            match read(place) {
                Ok(model) => work(place, &model)?,
                Err(failure) if places.len() == 1 => return Err(failure),
                Err(failure) => {
                    console.fail(&failure);
                    bad += 1;
                }
            }
        }
        match bad {
            0 => Ok(()),
            _ => Err(Failure::input(format!("{bad} of {} models cannot be used", places.len()))),
        }
    }

    fn verify(&self, console: &Console) -> Result<(), Failure> {
        self.each(console, Place::verified, |place, model| {
            print(&format!("{}: ok ({})\n", place.name(), described(model)))
        })
    }
}

impl JsonArguments {
    fn list(&self, console: &Console) -> Result<(), Failure> {
        let width = self.models.places()?.iter().map(|place| place.name().len()).max().unwrap_or(0);
        self.models.each(console, Place::read, |place, model| {
            if self.json {
                return print_json(&as_json(place, model));
            }
            let loss = model.card().metrics.get("validation_loss");
            let loss = loss.map(|loss| format!(", validation loss {loss:.6}")).unwrap_or_default();
            print(&format!("{:width$}  {}{loss}\n", place.name(), described(model)))
        })
    }

    fn show(&self, console: &Console) -> Result<(), Failure> {
        self.models.each(console, Place::read, |place, model| {
            if self.json {
                return print_json(&as_json(place, model));
            }
            let card = model
                .card()
                .to_toml()
                .map_err(|error| Failure::input(format!("{}: model card: {error}", place.name())))?;
            let tensors = model.tensors().iter();
            let tensors: String =
                tensors.map(|(name, tensor)| format!("#   {name} {:?}\n", tensor.shape)).collect();
            let title = format!("# {}: {} parameters\n", place.name(), parameters(model));
            print(&format!("{title}{card}# tensors:\n{tensors}"))
        })
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

/// Refuses a card beside a model that says something else.
fn same_twin(file: &Path, model: &Model) -> Result<(), Failure> {
    let twin = file.with_extension("toml");
    if let Ok(text) = std::fs::read_to_string(&twin) {
        let card = Card::from_toml(&text)
            .map_err(|error| Failure::input(format!("{}: {}", twin.display(), error.trim_end())))?;
        if card != *model.card() {
            let message = format!("{}: differs from the card in {}", twin.display(), file.display());
            return Err(Failure::input(message).with_help("the card in the model counts"));
        }
    }
    Ok(())
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
    format!("{}, {} parameters{trained}", card.kind, parameters(model))
}

fn as_json(place: &Place, model: &Model) -> Value {
    let (parameters, card) = (parameters(model), model.card());
    match place {
        Place::File(file) => json!({ "file": file, "parameters": parameters, "card": card }),
        Place::Shipped(name) => json!({ "shipped": name, "parameters": parameters, "card": card }),
    }
}
