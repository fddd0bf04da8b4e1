//! `tercel study`.

use std::path::PathBuf;

use clap::Args;
use tercel_study::autoferry;

use crate::console::Console;
use crate::failure::Failure;
use crate::output;

/// Run a study: a scenario, several trackers, their scores.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct StudyArguments {
    /// Which one.
    #[arg(value_name = "NAME")]
    name: String,
    /// Folder with the recordings of a study on real data.
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Methods to run, with commas between them; without it, all of the study.
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    pub methods: Option<Vec<String>>,
    /// Folder for the tracks, the table of metrics and the report.
    #[arg(long, short, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    pub json: bool,
}

const AFTER: &str = "\
Studies:
  autoferry  radar and lidar of a small ferry against the GNSS truth of two boats

Examples:
  tercel study autoferry --methods nearest-neighbour,phd
  tercel study autoferry --data data/autoferry --json -o results";

/// A study that the program knows.
struct Study {
    name: &'static str,
    run: fn(&StudyArguments, &Console) -> Result<(), Failure>,
}

const STUDIES: [Study; 1] = [Study { name: "autoferry", run: autoferry }];

impl StudyArguments {
    /// Runs the study of that name.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        match STUDIES.iter().find(|study| study.name == self.name) {
            Some(study) => (study.run)(self, console),
            None => {
                let known: Vec<&str> = STUDIES.iter().map(|study| study.name).collect();
                let message =
                    format!("there is no study `{}`; known studies: {}", self.name, known.join(", "));
                Err(Failure::usage(message))
            }
        }
    }
}

/// The recordings that come with the source code.
const RECORDINGS: &str = "data/autoferry";

fn autoferry(arguments: &StudyArguments, console: &Console) -> Result<(), Failure> {
    let folder = arguments.data.clone().unwrap_or_else(|| RECORDINGS.into());
    let methods = arguments.methods.clone().unwrap_or_else(|| autoferry::METHODS.map(str::to_owned).to_vec());
    let result = autoferry::run(&folder, &methods, 0, &|what| console.note(what))?;
    if let Some(folder) = &arguments.output {
        result.write(folder)?;
        console.note(format!("tracks, metrics.csv, study.json and report.html are in {}", folder.display()));
    }
    if arguments.json {
        let table = serde_json::to_value(&result.table)
            .map_err(|error| Failure::failed(format!("cannot encode the table: {error}")))?;
        return output::print_json(&table);
    }
    output::print(&result.text())
}
