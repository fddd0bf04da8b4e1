//! `tercel study`.

mod merge;

use std::convert::Infallible;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use tercel_study::monte_carlo::{Experiment, Results, Shard, conduct};
use tercel_study::studies::{Choice, Kind, STUDIES, Study};
use tercel_study::{StudyTable, autoferry};

use crate::console::Console;
use crate::failure::Failure;
use crate::output;
use crate::progress::Progress;

/// A name without the spaces around it, as in `--methods "ekf, imm"`.
fn trimmed(name: &str) -> Result<String, Infallible> {
    Ok(name.trim().to_owned())
}

/// The parts of `NAME=FILE`.
fn replacement(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, file)) if !name.is_empty() && !file.is_empty() => Ok((name.to_owned(), file.into())),
        _ => Err("expected NAME=FILE, as in `neural-imm=mine.safetensors`".to_owned()),
    }
}

/// Run a study: a scenario, several methods, their scores.
///
/// Prints a table with mean, standard deviation, 95 % bootstrap interval and, where there is one, the published figure. The
/// numbers are the same to the last bit for any number of threads; only the time for a step differs.
///
/// A long study can be shared among machines: run it with --shard 1/4 to 4/4 and the same -o, and join the files with
/// `tercel study merge`. A shard whose file is there is not computed again, so an interrupted study goes on with the first shard that was not finished.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_long_help = AFTER)]
pub struct StudyArguments {
    #[command(subcommand)]
    command: Option<StudyCommand>,
    /// Which one; `tercel study list` lists them.
    #[arg(value_name = "NAME", required = true)]
    name: Option<String>,
    /// Methods to run, with commas between them; without it, all of the study.
    #[arg(long, value_name = "A,B,...", value_delimiter = ',', value_parser = trimmed)]
    methods: Option<Vec<String>>,
    /// Number of runs.
    #[arg(long, value_name = "N")]
    runs: Option<u64>,
    /// Seed of the random numbers; that of the published figures unless another is given.
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Set of scenes, for a study that has several.
    #[arg(long, value_name = "SET")]
    set: Option<String>,
    /// How the motion of vehicles is drawn: reject, l1 or smooth.
    #[arg(long, value_name = "KIND")]
    generator: Option<String>,
    /// Sizes of vehicles: fixed or random.
    #[arg(long, value_name = "KIND")]
    sizes: Option<String>,
    /// Compute a share of the runs, 1/4 to 4/4, into a file in the folder of -o.
    #[arg(long, value_name = "I/N", requires = "output")]
    shard: Option<Shard>,
    /// Compute a shard even if its file is there.
    #[arg(long, requires = "shard")]
    force: bool,
    /// Threads to use; without it, one for each core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Use the model of a file in the place of the shipped one of this name; may be given several times.
    #[arg(long = "model", value_name = "NAME=FILE", value_parser = replacement)]
    models: Vec<(String, PathBuf)>,
    /// Folder with the recordings of a study on real data, or a file of recorded tracks.
    #[arg(long, value_name = "PATH")]
    data: Option<PathBuf>,
    /// Folder for the table, the numbers of every run and the report.
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum StudyCommand {
    Merge(merge::MergeArguments),
    /// List the studies with their methods.
    #[command(after_long_help = LIST_AFTER)]
    List,
}

const AFTER: &str = "\
Studies:
  atc-test         one aircraft that turns, seen by a radar: the published test set
  atc-hshm         the same at high speed with hard turns
  atc-noise        errors over the bearing noise of the radar (--set test or hshm)
  atc-missing      errors over the detection probability of the radar (--set test or hshm)
  atc-ablation     what the parts of the published ensemble are worth
  vehicle          one vehicle seen as many points: motion and ellipse (--set backward or forward)
  vehicle-ablation what the blocks of RMMNet are worth
  vehicle-data     how many vehicles networks must have seen
  aircraft         airliners on recorded tracks (--set course, smoothed, crab or even)
  aircraft-random  the same with tracks to test on that are drawn from all
  extended-scene   three extended objects that cross among false points
  clutter-partial  nine objects in dense clutter, two of which manoeuvre
  clutter-all      six objects in clutter that all manoeuvre at once
  clutter-random   random scenes of 5 to 12 objects that come, go and manoeuvre in clutter
  paris            aircraft around Paris as they flew, seen by a simulated radar
  autoferry        radar and lidar of a small ferry against the GNSS truth of two boats

Examples:
  tercel study atc-test --runs 100 --methods imm,imm-paper
  tercel study atc-noise --set hshm -o results
  tercel study atc-test --shard 1/2 -o shards && tercel study atc-test --shard 2/2 -o shards
  tercel study merge shards -o results
  tercel study vehicle --generator smooth --sizes random --runs 10
  tercel study aircraft --data tracks.npy
  tercel study atc-test --methods imm,neural-imm --model neural-imm=mine.safetensors
  tercel study autoferry --data data/autoferry --json -o results";

const LIST_AFTER: &str = "\
Examples:
  tercel study list";

impl StudyArguments {
    /// Runs the study of that name.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        match (&self.command, &self.name) {
            (Some(StudyCommand::Merge(arguments)), _) => arguments.run(console),
            (Some(StudyCommand::List), _) => output::print(&list()),
            (None, Some(name)) => {
                let study = Study::find(name)?;
                match study.kind {
                    Kind::Recordings => self.run_recordings(study, console),
                    Kind::MonteCarlo(_) => self.run_drawn(study, console),
                }
            }
            // The parser asks for a name where there is no command.
            (None, None) => Err(Failure::usage("name a study")),
        }
    }

    fn run_drawn(&self, study: &Study, console: &Console) -> Result<(), Failure> {
        if self.shard.is_some() && self.json {
            return Err(Failure::usage("--json prints a table, and a shard has none before it is merged"));
        }
        let options = [("generator", &self.generator), ("sizes", &self.sizes)];
        let given = |(name, value): (&str, &Option<String>)| Some((name.to_owned(), value.clone()?));
        let choice = Choice {
            seed: self.seed,
            runs: self.runs,
            methods: self.methods.clone(),
            set: self.set.clone(),
            options: options.into_iter().filter_map(given).collect(),
            data: self.data.clone(),
            models: self.models.iter().cloned().collect(),
        };
        let experiment = study.experiment(&choice)?;
        match (self.shard, &self.output) {
            (Some(shard), Some(folder)) => self.run_shard(&*experiment, shard, folder, console),
            _ => {
                let results = self.conduct(&*experiment, Shard::WHOLE, console)?;
                finish(&*experiment, &results, self.output.as_deref(), self.json, console)
            }
        }
    }

    fn conduct(
        &self,
        experiment: &dyn Experiment,
        shard: Shard,
        console: &Console,
    ) -> Result<Results, Failure> {
        // Hours of work should not end at a folder that cannot be written to.
        if let Some(folder) = &self.output {
            tercel_study::monte_carlo::probe(folder)?;
        }
        let plan = experiment.plan();
        let progress = Progress::bar(console, "running", shard.runs(plan.runs).count() * plan.conditions());
        Ok(conduct(experiment, shard, self.threads.map(usize::from), &|| progress.step())?)
    }

    fn run_shard(
        &self,
        experiment: &dyn Experiment,
        shard: Shard,
        folder: &Path,
        console: &Console,
    ) -> Result<(), Failure> {
        let plan = experiment.plan();
        let path = folder.join(Results::file_name(plan, shard));
        if path.exists() && !self.force {
            let there = Results::read(&path).map_err(|error| {
                Failure::from(error).with_help("--force computes the shard again and replaces the file")
            })?;
            if there.plan != *plan {
                let differs = there.plan.difference(plan).unwrap_or_default();
                let message = format!("{} holds another shard: {differs}", path.display());
                let help = "take another folder, or replace it with --force";
                return Err(Failure::input(message).with_help(help));
            }
            console.note(format!("{} is there already and is kept", path.display()));
            return Ok(());
        }
        let results = self.conduct(experiment, shard, console)?;
        results.write(&path)?;
        for line in results.failures() {
            console.warn(line);
        }
        console.note(format!("shard {shard} is in {}", path.display()));
        Ok(())
    }

    fn run_recordings(&self, study: &Study, console: &Console) -> Result<(), Failure> {
        let drawn = [
            ("--runs", self.runs.is_some()),
            ("--seed", self.seed.is_some()),
            ("--set", self.set.is_some()),
            ("--generator", self.generator.is_some()),
            ("--sizes", self.sizes.is_some()),
            ("--shard", self.shard.is_some()),
            ("--threads", self.threads.is_some()),
        ];
        if let Some((option, _)) = drawn.iter().find(|(_, given)| *given) {
            let message = format!(
                "the study {} takes no {option}: it goes through all of its recordings, one after the other",
                study.name
            );
            return Err(Failure::usage(message));
        }
        let folder = self.data.clone().unwrap_or_else(|| RECORDINGS.into());
        let methods = study.methods(self.methods.as_deref())?;
        let models = self.models.iter().cloned().collect();
        let result = autoferry::run(&folder, &methods, 0, &models, &|what| console.note(what))?;
        if let Some(folder) = &self.output {
            result.write(folder)?;
            let files = "tracks, metrics.csv, study.json and report.html";
            console.note(format!("{files} are in {}", folder.display()));
        }
        if self.json { print_json(&result.table) } else { output::print(&result.text()) }
    }
}

/// The recordings that come with the source code.
const RECORDINGS: &str = "data/autoferry";

/// Writes and prints the results of all runs.
fn finish(
    experiment: &dyn Experiment,
    results: &Results,
    folder: Option<&Path>,
    json: bool,
    console: &Console,
) -> Result<(), Failure> {
    let table = results.table(experiment);
    // What was computed is shown first: a full disk should not take it away.
    if json {
        for line in results.failures() {
            console.warn(line);
        }
        print_json(&table)?;
    } else {
        output::print(&results.text(&table))?;
    }
    if let Some(folder) = folder {
        results.publish(experiment, &table, folder)?;
        let files = "study.json, metrics.csv, report.html and the tables of an example";
        console.note(format!("{files} are in {}", folder.display()));
    }
    Ok(())
}

fn print_json(table: &StudyTable) -> Result<(), Failure> {
    let text = serde_json::to_string(table)
        .map_err(|error| Failure::failed(format!("cannot encode the table: {error}")))?;
    output::print(&format!("{text}\n"))
}

fn list() -> String {
    let width = STUDIES.iter().map(|study| study.name.len()).max().unwrap_or(0);
    let line = |study: &Study| {
        let methods = study.methods.join(", ");
        format!("{:width$}  {}\n{:width$}  methods: {methods}\n", study.name, study.about, "")
    };
    STUDIES.iter().map(line).collect()
}
