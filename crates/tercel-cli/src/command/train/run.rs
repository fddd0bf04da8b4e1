//! From a recipe to a model.

use std::io::ErrorKind;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use tercel_study::extended::{Aircraft, Held};
use tercel_train::recipe::{Outline, TestTracks};
use tercel_train::trainer::{End, Run, Stamp, Summary, Tracks};
use tercel_train::{TrainError, task};

use super::TrainArguments;
use super::observer::Observer;
use crate::console::Console;
use crate::failure::{Failure, Report, read_text};
use crate::output;

/// Folder of models whose place is not given.
const FOLDER: &str = "models";

pub fn run(arguments: &TrainArguments, console: &Console) -> Result<(), Failure> {
    let name = arguments.recipe.to_string_lossy();
    let text = read_text(&arguments.recipe)?;
    let outline = Outline::parse(&text).map_err(|error| failure(&name, error))?;
    let run =
        Run { resume: arguments.resume, stamp: stamp(arguments), ..Run::new(target(arguments, &outline)?) };
    let threads = arguments.threads.map_or(run.threads, usize::from);
    let run = Run { threads, tracks: tracks(arguments, &outline)?, ..run };
    let written = [run.model.with_extension("toml"), run.curve(), run.checkpoint(), run.model.clone()];
    // The card is named as the model, and may be named as the recipe.
    output::keep_inputs(written.iter().map(PathBuf::as_path), &[arguments.recipe.as_path()])?;
    keep_what_is_there(arguments, &run)?;
    let mut observer = Observer::new(console, outline.schedule.epochs);
    let trained = task::train(&text, &run, &mut |progress| {
        observer.take(progress);
        ControlFlow::Continue(())
    });
    drop(observer);
    let summary = trained.map_err(|error| failure(&name, error))?;
    output::print(&result(&outline, &run, &summary))
}

/// The tracks to learn from: none of those on which the study tests.
fn tracks(arguments: &TrainArguments, outline: &Outline) -> Result<Option<Tracks>, Failure> {
    let Some(path) = &arguments.data else { return Ok(None) };
    let failed = |error| Failure::Input(Report::of(&error));
    let held = match outline.test_tracks() {
        TestTracks::Last => Held::Last,
        TestTracks::Random => Held::Random,
    };
    let aircraft = Aircraft::training(path, held).map_err(failed)?;
    Ok(Some(Tracks::new(aircraft.tracks().to_vec())))
}

/// Where the model goes; its folder is made.
fn target(arguments: &TrainArguments, outline: &Outline) -> Result<PathBuf, Failure> {
    if let Some(path) = &arguments.output {
        return match path.extension().and_then(|ending| ending.to_str()) {
            Some("safetensors") => {
                if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
                    make_folder(folder)?;
                }
                Ok(path.clone())
            }
            _ => Err(Failure::usage("the name of a model must end in .safetensors")),
        };
    }
    make_folder(Path::new(FOLDER))?;
    Ok(Path::new(FOLDER).join(format!("{}.safetensors", outline.name)))
}

fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::failed(format!("{}: cannot create: {error}", folder.display())))
}

/// Refuses to train over what took hours, unless asked to.
fn keep_what_is_there(arguments: &TrainArguments, run: &Run) -> Result<(), Failure> {
    let there = [run.checkpoint(), run.model.clone()].into_iter().find(|path| path.is_file());
    match there {
        Some(path) if !arguments.resume && !arguments.force => {
            Err(Failure::failed(format!("{}: there is a training of that name already", path.display()))
                .with_help("--resume goes on with it, --force starts anew"))
        }
        _ => Ok(()),
    }
}

fn stamp(arguments: &TrainArguments) -> Stamp {
    Stamp {
        trained: jiff::Timestamp::now().strftime("%Y-%m-%d").to_string(),
        revision: option_env!("TERCEL_REVISION").unwrap_or_default().to_owned(),
        licence: arguments.licence.clone(),
    }
}

fn result(outline: &Outline, run: &Run, summary: &Summary) -> String {
    let best = summary.curve.get(summary.best_epoch).and_then(|row| row.validation);
    let best = match best {
        Some(loss) => format!("validation loss {loss:.6} after epoch {}", summary.best_epoch + 1),
        None => "no epoch had a finite validation loss, so no model was written".to_owned(),
    };
    let ended = match summary.end {
        End::Early => ", stopped early: it got no better",
        End::Complete | End::Stopped => "",
    };
    format!(
        "{}: {} {}, {} parameters\n{best}; {} of {} epochs{ended}\n",
        run.model.display(),
        outline.kind,
        outline.name,
        summary.best.count(),
        summary.curve.len(),
        outline.schedule.epochs,
    )
}

/// What is wrong with a recipe is said with its name; what is wrong with a file has one already.
fn failure(recipe: &str, error: TrainError) -> Failure {
    let report = Report::of(&error);
    match &error {
        TrainError::File { .. } | TrainError::Diverged { .. } | TrainError::Parameter { .. } => {
            Failure::Failed(report)
        }
        TrainError::Model(tercel_neural::ModelError::Io { source, .. })
            if source.kind() != ErrorKind::NotFound =>
        {
            Failure::Failed(report)
        }
        TrainError::Recipe(_) | TrainError::Value { .. } | TrainError::Data(_) => {
            Failure::Input(report).found_in(recipe)
        }
        _ => Failure::Input(report),
    }
}
