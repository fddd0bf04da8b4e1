//! `tercel track`.

mod altitudes;
mod feed;
mod outcome;
mod preset;
mod rows;
mod run;
mod teller;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use tercel_data::ndjson::Scans;
use tercel_data::table::{Origin, Scan, Truths};
use tercel_data::{DataError, ImportOptions, ReadOptions, Source};
use tercel_pipeline::PipelineError;

use self::feed::Feed;
use self::outcome::Outcome;
use self::preset::{Chosen, Kind};
use self::rows::Rows;
use self::run::{Run, Wanted};
use self::teller::Teller;
use crate::account::Account;
use crate::console::Console;
use crate::failure::Failure;
use crate::input::{self, OnError, ReadArguments, STDIN, is_stdin};
use crate::origin;
use crate::output::{Target, keep_inputs};
use crate::progress::Progress;
use crate::score::ScoreArguments;

/// Turn detections into tracks.
///
/// INPUT is a table of detections (CSV, Parquet or NDJSON), a recording that `tercel convert` knows, or - for standard
/// input; several files of one kind are tracked as one recording. From standard input NDJSON is tracked line by line: the rows of each scan go out before the next one is read, to
/// standard output unless -o names a file. From a file without -o, the tracks are only counted and scored.
///
/// The table of tracks has rows of confirmed and coasted tracks, and the row with which such a track is given up; with --all
/// also of tentative ones. --rows says how many. Where the origin of the local frame is known, rows have latitude, longitude,
/// speed and course as well, and tracks may go to a map: GeoJSON for geographic programs, KML for globes, GPX for plotters.
///
/// The summary accounts for every detection of the scans that were tracked: it updated a track, started a tentative one, or
/// is counted as clutter. Scans that came too late and those of sensors that the configuration ignores are counted apart.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct TrackArguments {
    /// The detections; - is standard input. Several files of one kind are joined.
    #[arg(required = true)]
    input: Vec<PathBuf>,
    /// Configuration (TOML); without it, one that comes with the program and fits the kind of recording.
    #[arg(long, short, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Truth to score the tracks against; that of an Autoferry recording is found beside it.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArguments,
    /// Table of tracks to write (.csv, .parquet, .ndjson; - is standard output, as NDJSON), or map (.geojson, .kml, .kmz, .gpx).
    #[arg(long, short, value_name = "FILE", value_parser = Target::parse_tracks)]
    output: Option<Target>,
    /// Rows to write of a track: `updates`, when a detection updated it; `scans`, after every scan; a number, at most one in so
    /// many seconds. Changes of its status and its end always have a row [default: updates where all sensors report objects
    /// one by one, as AIS and ADS-B do; scans otherwise].
    #[arg(long, value_name = "WHICH", value_parser = Rows::parse, allow_negative_numbers = true)]
    rows: Option<Rows>,
    /// Origin of the local frame, degrees and m; without it, that of the table or the median position of the reports.
    #[arg(long, value_name = "LAT,LON[,ALT]", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<Origin>,
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
  tercel track monday.csv tuesday.csv --from ais -o ships.geojson
  tercel track states.csv --rows 10 -o aircraft.kml
  tercel track radar.csv --origin 54.18,7.89 -o tracks.gpx
  tercel track data/autoferry/scenario2 --config tracker.toml --json
  tercel track --from csv --angles degrees radar.csv --truth truth.csv -o tracks.csv
  sensor | tercel track - --config tracker.toml --on-error skip | consumer";

impl TrackArguments {
    /// Tracks the input and says how it went.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        self.check()?;
        let stream = self.is_piped() && matches!(self.read.from, None | Some(Source::Ndjson));
        let outcome = if stream { self.run_stream(console)? } else { self.run_file(console)? };
        outcome.write(self, console)
    }

    /// True when the input is standard input.
    fn is_piped(&self) -> bool {
        self.input.iter().any(|path| is_stdin(path))
    }

    /// The inputs in messages.
    fn input_name(&self) -> String {
        if self.is_piped() {
            return STDIN.to_owned();
        }
        let names: Vec<_> = self.input.iter().map(|path| path.to_string_lossy()).collect();
        names.join(", ")
    }

    /// Where the tracks go: what comes from standard input goes to standard output.
    fn target(&self) -> Option<Target> {
        let default = || self.is_piped().then_some(Target::Stdout);
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
        if self.input.len() > 1 && self.is_piped() {
            return conflict("standard input cannot be joined with files");
        }
        let others = [self.truth.as_deref(), self.config.as_deref()];
        let inputs: Vec<&Path> =
            self.input.iter().map(PathBuf::as_path).chain(others.into_iter().flatten()).collect();
        keep_inputs([tracks, self.report.as_deref()].into_iter().flatten(), &inputs)?;
        // Found now rather than after hours of tracking.
        let Some(folder) = self.report.as_deref().and_then(Path::parent) else { return Ok(()) };
        if !folder.as_os_str().is_empty() && !folder.is_dir() {
            return Err(Failure::failed(format!("{}: there is no such folder", folder.display())));
        }
        Ok(())
    }

    fn wanted(&self, truths: Option<&Truths>) -> Wanted {
        let keep = truths.is_some() || self.report.is_some();
        Wanted { target: self.target(), rows: self.rows, all: self.all, keep }
    }

    fn run_file(&self, console: &Console) -> Result<Outcome, Failure> {
        let named = self.config.as_deref().map(Chosen::read).transpose()?;
        let source = self.read.source(&self.input[0])?;
        // What aircraft and ships say of themselves is the detections here; it cannot be their truth as well.
        let truths = source == Source::Autoferry && self.truth.is_none();
        let options = ImportOptions { truths, origin: self.origin, ..ImportOptions::default() };
        let started = Instant::now();
        let mut feed = Feed::open(&self.read, (source, &self.input), options, console)?;
        let chosen = match named {
            Some(chosen) => chosen,
            None => Kind::of(source, &feed.description, feed.first()).preset(feed.first(), console)?,
        };
        chosen.check(feed.first(), console)?;
        let truths = self.truths(feed.truths.take())?;
        if let Some(truths) = &truths {
            chosen.check_heights(truths, console);
        }
        let wanted = self.wanted(truths.as_ref());
        if wanted.target.is_none() {
            console.note("the tracks are counted only; -o FILE writes them");
        }
        let mut run = Run::new(chosen.pipeline, wanted);
        let mut teller = Teller::default();
        let origin = origin::settle(feed.origin, self.origin)?;
        run.begin(origin, feed.description.clone(), feed.first())?;
        teller.tell(run.notices(), console);
        let progress = Progress::spinner(console, "tracking");
        for scan in feed.by_ref() {
            run.track(scan?)?.map_err(|error| self.refused(error))?;
            teller.tell(run.notices(), console);
            progress.step();
        }
        drop(progress);
        run.end()?.map_err(|error| self.refused(error))?;
        teller.tell(run.notices(), console);
        let left_out = Account::of(feed.finish(console));
        let reading = started.elapsed().saturating_sub(Duration::from_secs_f64(run.seconds()));
        let (config, configuration) = (chosen.config, chosen.name);
        Ok(Outcome { run, truths, config, configuration, left_out, bad: 0, reading })
    }

    fn run_stream(&self, console: &Console) -> Result<Outcome, Failure> {
        let named = self.config.as_deref().map(Chosen::read).transpose()?;
        let truths = self.truths(None)?;
        let options = ReadOptions { origin: self.origin, ..self.read.options() };
        let mut scans = Scans::new(std::io::stdin().lock(), STDIN, options);
        // What the stream was before stands in its first line; without it nobody can choose a configuration.
        let mut next = scans.next();
        let chosen = match named {
            Some(chosen) => chosen,
            None => {
                let first = next.as_ref().and_then(|scan| scan.as_ref().ok());
                let first = first.map_or(&[][..], std::slice::from_ref);
                Kind::of(Source::Ndjson, &scans.description(), first).preset(&[], console)?
            }
        };
        let mut run = Run::new(chosen.pipeline, self.wanted(truths.as_ref()));
        let (mut bad, mut teller) = (0, Teller::default());
        while let Some(scan) = next {
            run.begin(origin::settle(scans.origin(), self.origin)?, scans.description(), &[])?;
            let tracked = self.track_one(&mut run, scan)?;
            teller.tell(run.notices(), console);
            match tracked {
                Ok(()) => {}
                Err(failure) if self.read.on_error == OnError::Skip => {
                    bad += 1;
                    if let Some(report) = failure.report() {
                        console.warn(format_args!("left out: {}", report.message));
                    }
                }
                Err(failure) => return Err(failure),
            }
            next = scans.next();
        }
        run.begin(origin::settle(scans.origin(), self.origin)?, scans.description(), &[])?;
        run.end()?.map_err(|error| self.refused(error))?;
        teller.tell(run.notices(), console);
        scans.notes().iter().for_each(|note| console.note(note));
        let (config, configuration) = (chosen.config, chosen.name);
        let (left_out, reading) = (Account::default(), Duration::ZERO);
        Ok(Outcome { run, truths, config, configuration, left_out, bad, reading })
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
        match run.track(scan)? {
            Ok(()) => Ok(Ok(())),
            Err(error @ (PipelineError::UnknownSensor { .. } | PipelineError::Observation { .. })) => {
                Ok(Err(self.refused(error)))
            }
            Err(error) => Err(self.refused(error)),
        }
    }

    /// A scan that the tracker refuses, with the name of the input.
    fn refused(&self, error: PipelineError) -> Failure {
        Failure::from(error).found_in(&self.input_name())
    }
}
