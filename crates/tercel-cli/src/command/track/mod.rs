//! `tercel track`.

mod outcome;
mod run;

use std::path::{Path, PathBuf};

use clap::Args;
use tercel_data::ndjson::Scans;
use tercel_data::table::{Scan, Truths};
use tercel_data::{DataError, ImportOptions, Imported, Source};
use tercel_pipeline::{Config, Pipeline, PipelineError};

use self::outcome::Outcome;
use self::run::Run;
use super::config;
use crate::console::Console;
use crate::failure::Failure;
use crate::input::{self, OnError, ReadArguments, STDIN, is_stdin, note_left_out};
use crate::output::{Target, keep_inputs};
use crate::progress::Progress;
use crate::score::ScoreArguments;

/// Turn detections into tracks.
///
/// INPUT is a table of detections (CSV, Parquet or NDJSON), a recording that `tercel convert` knows, or - for standard
/// input. From standard input NDJSON is tracked line by line: the rows of each scan go out before the next one is read, to
/// standard output unless -o names a file. From a file without -o, the tracks are only counted and scored.
///
/// The table of tracks has one row per track and scan: confirmed and coasted tracks, and the row with which such a track is
/// given up. With --all tentative tracks are rows as well.
///
/// The summary accounts for every detection of the scans that were tracked: it updated a track, started a tentative one, or
/// is counted as clutter. Scans that came too late and those of sensors that the configuration ignores are counted apart.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct TrackArguments {
    /// The detections; - is standard input.
    input: PathBuf,
    /// Configuration (TOML); without it, one that comes with the program and fits the kind of recording.
    #[arg(long, short, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Truth to score the tracks against; that of an Autoferry recording is found beside it.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArguments,
    /// Table of tracks to write (.csv, .parquet, .ndjson; - is standard output, as NDJSON).
    #[arg(long, short, value_name = "FILE", value_parser = Target::parse)]
    output: Option<Target>,
    /// Write tentative tracks as well.
    #[arg(long)]
    all: bool,
    /// Report to write: one HTML file that opens offline.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print the summary as one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    score: ScoreArguments,
}

const AFTER: &str = "\
Examples:
  tercel track radar.csv -o tracks.parquet --report report.html
  tercel track data/autoferry/scenario2 --config tracker.toml --json
  tercel track --from csv --angles degrees radar.csv --truth truth.csv -o tracks.csv
  sensor | tercel track - --config tracker.toml --on-error skip | consumer";

impl TrackArguments {
    /// Tracks the input and says how it went.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        self.check()?;
        let stream = is_stdin(&self.input) && matches!(self.read.from, None | Some(Source::Ndjson));
        let outcome = if stream { self.run_stream(console)? } else { self.run_file(console)? };
        outcome.write(self, console)
    }

    /// Where the tracks go: what comes from standard input goes to standard output.
    fn target(&self) -> Option<Target> {
        let default = || is_stdin(&self.input).then_some(Target::Stdout);
        self.output.clone().or_else(default)
    }

    fn check(&self) -> Result<(), Failure> {
        let conflict = |message: &str| Err(Failure::usage(message));
        let target = self.target();
        let tracks = target.as_ref().and_then(Target::file);
        if self.json && target == Some(Target::Stdout) {
            return conflict(
                "--json and the tracks both go to standard output; name a file for the tracks with -o",
            );
        }
        if tracks.is_some() && tracks == self.report.as_deref() {
            return conflict("-o and --report name the same file");
        }
        let inputs = [Some(&*self.input), self.truth.as_deref(), self.config.as_deref()];
        let inputs: Vec<&Path> = inputs.into_iter().flatten().collect();
        keep_inputs([tracks, self.report.as_deref()].into_iter().flatten(), &inputs)?;
        // Found now rather than after hours of tracking.
        let Some(folder) = self.report.as_deref().and_then(Path::parent) else { return Ok(()) };
        if !folder.as_os_str().is_empty() && !folder.is_dir() {
            return Err(Failure::failed(format!("{}: there is no such folder", folder.display())));
        }
        Ok(())
    }

    fn run_file(&self, console: &Console) -> Result<Outcome, Failure> {
        let source = self.read.source(&self.input)?;
        let (config, pipeline, name) = self.configuration(source, console)?;
        // What aircraft and ships say of themselves is the detections here; it cannot be their truth as well.
        let truths = source == Source::Autoferry && self.truth.is_none();
        let options = ImportOptions { truths, ..ImportOptions::default() };
        let imported = self.read.import(source, std::slice::from_ref(&self.input), options, console)?;
        note_left_out(&imported, console);
        let Imported { detections, truths, .. } = imported;
        let truths = self.truths(truths)?;
        let target = self.target();
        if target.is_none() {
            console.note("the tracks are counted only; -o FILE writes them");
        }
        let mut run = Run::new(pipeline, target, self.all, truths.is_some() || self.report.is_some());
        run.begin(detections.origin)?;
        let progress = Progress::bar(console, "tracking", detections.scans.len());
        for scan in detections.scans {
            let rows = run.track(scan).map_err(|error| self.refused(error))?;
            run.hand_on(rows)?;
            progress.step();
        }
        drop(progress);
        let rows = run.end().map_err(|error| self.refused(error))?;
        run.hand_on(rows)?;
        Ok(Outcome { run, truths, config, configuration: name, bad: 0 })
    }

    fn run_stream(&self, console: &Console) -> Result<Outcome, Failure> {
        let (config, pipeline, name) = self.configuration(Source::Ndjson, console)?;
        let truths = self.truths(None)?;
        let mut run = Run::new(pipeline, self.target(), self.all, truths.is_some() || self.report.is_some());
        let mut scans = Scans::new(std::io::stdin().lock(), STDIN, self.read.options());
        let mut bad = 0;
        while let Some(scan) = scans.next() {
            run.begin(scans.origin())?;
            match self.track_one(&mut run, scan)? {
                Ok(()) => {}
                Err(failure) if self.read.on_error == OnError::Skip => {
                    bad += 1;
                    if let Some(report) = failure.report() {
                        console.warn(format_args!("left out: {}", report.message));
                    }
                }
                Err(failure) => return Err(failure),
            }
        }
        run.begin(scans.origin())?;
        for note in scans.notes() {
            console.note(note);
        }
        let rows = run.end().map_err(|error| self.refused(error))?;
        run.hand_on(rows)?;
        Ok(Outcome { run, truths, config, configuration: name, bad })
    }

    /// The configuration, its tracker and its name. One that the user did not choose is named on standard error.
    fn configuration(
        &self,
        source: Source,
        console: &Console,
    ) -> Result<(Config, Pipeline, String), Failure> {
        if let Some(path) = &self.config {
            let (config, pipeline) = config::read(path)?;
            return Ok((config, pipeline, path.to_string_lossy().into_owned()));
        }
        let name = match source.family() {
            Source::Autoferry => "harbour",
            Source::Adsb => "adsb",
            Source::Ais => "ais",
            _ => "default",
        };
        console.note(format_args!(
            "using the configuration `{name}`; `tercel config init --preset {name} -o FILE` writes it for changes"
        ));
        let (config, pipeline) = config::preset(name)?;
        Ok((config, pipeline, name.to_owned()))
    }

    fn truths(&self, found: Option<Truths>) -> Result<Option<Truths>, Failure> {
        match &self.truth {
            Some(path) => input::truth(path).map(Some),
            None => Ok(found),
        }
    }

    /// Tracks a scan of a stream. The inner error is one of that scan alone, after which the stream can go on.
    fn track_one(
        &self,
        run: &mut Run,
        scan: Result<Scan, DataError>,
    ) -> Result<Result<(), Failure>, Failure> {
        let scan = match scan {
            Ok(scan) => scan,
            Err(error) if error.is_io() => return Err(error.into()),
            Err(error) => return Ok(Err(error.into())),
        };
        match run.track(scan) {
            Ok(rows) => run.hand_on(rows).map(Ok),
            Err(error @ (PipelineError::UnknownSensor { .. } | PipelineError::Observation { .. })) => {
                Ok(Err(self.refused(error)))
            }
            Err(error) => Err(self.refused(error)),
        }
    }

    /// A scan that the tracker refuses, with the name of the input.
    fn refused(&self, error: PipelineError) -> Failure {
        let file = if is_stdin(&self.input) { STDIN.into() } else { self.input.to_string_lossy() };
        Failure::from(error).found_in(&file)
    }
}
