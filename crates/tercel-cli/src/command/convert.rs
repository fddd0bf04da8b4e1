//! `tercel convert`.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use tercel_data::table::{Origin, Truths};
use tercel_data::{
    AtomicFile, DataError, Format, ImportOptions, Imported, ReadOptions, TracksWriter, read_tracks,
    write_detections_to, write_truths_to,
};

use crate::account::Account;
use crate::console::Console;
use crate::failure::Failure;
use crate::input::{ReadArguments, is_stdin, note_left_out};
use crate::origin;
use crate::output::{STDOUT, Target, keep_inputs};
use crate::summary::counted;

/// Bring recordings of other programs into the tables.
///
/// Writes the table of detections and, with --truth-out, what the recording knows of the truth: the file beside an Autoferry
/// recording, the positions that aircraft and ships broadcast of themselves. Several files of one kind become one table in
/// the order of time.
///
/// With the name of a map as output, the input is a table of tracks.
#[derive(Debug, Args)]
#[command(after_long_help = AFTER)]
pub struct ConvertArguments {
    /// The recording; - is standard input (tables only). Several files of one kind are joined.
    #[arg(required = true)]
    input: Vec<PathBuf>,
    /// Table of detections to write (.csv, .parquet, .ndjson; - is standard output, as NDJSON), or map of tracks (.geojson,
    /// .kml, .kmz, .gpx).
    #[arg(long, short, value_name = "FILE", default_value = "-", value_parser = Target::parse_tracks)]
    output: Target,
    /// Table of the truth to write (.csv, .parquet, .ndjson).
    #[arg(long, value_name = "FILE", value_parser = Target::parse)]
    truth_out: Option<Target>,
    #[command(flatten)]
    read: ReadArguments,
    /// Origin of the local frame for geographic recordings, degrees and m; without it, the median position.
    #[arg(long, value_name = "LAT,LON[,ALT]", value_parser = origin::parse, allow_hyphen_values = true)]
    origin: Option<Origin>,
    /// Keep reports that repeat a position (adsb, ais).
    #[arg(long)]
    keep_repeated: bool,
    /// Keep the time of a report where the time of its position is known (adsb).
    #[arg(long)]
    reported_time: bool,
    /// Take an aircraft with another callsign for another object (adsb).
    #[arg(long)]
    split_callsigns: bool,
}

const AFTER: &str = "\
Examples:
  tercel convert scenario2_detections.json.gz -o radar.parquet --truth-out truth.parquet
  tercel convert --from adsb states.csv --origin 47.46,8.55,432 -o aircraft.csv
  tercel convert radar.csv --angles degrees | tercel track -
  tercel convert tracks.parquet -o tracks.geojson";

impl ConvertArguments {
    /// Reads the recording and writes its tables.
    pub fn run(&self, console: &Console) -> Result<(), Failure> {
        self.check()?;
        if let Target::File(path) = &self.output
            && self.output.is_map()
        {
            return self.draw(path, console);
        }
        let source = self.read.source(&self.input[0])?;
        let options = ImportOptions {
            origin: self.origin,
            truths: true,
            keep_repeated: self.keep_repeated,
            reported_time: self.reported_time,
            split_callsigns: self.split_callsigns,
            ..ImportOptions::default()
        };
        let mut imported = self.read.import(source, &self.input, options, console)?;
        note_left_out(&imported, console);
        Account::of(imported.left_out.clone()).say_briefly(console);
        imported.detections.origin = origin::settle(imported.detections.origin, self.origin)?;
        let written = self.write(&imported)?;
        let scans = imported.detections.scans.len() as u64;
        let detections: usize = imported.detections.scans.iter().map(|scan| scan.detections.len()).sum();
        console.note(format_args!(
            "{}: {}, {}",
            source.name(),
            counted(scans, "scan"),
            counted(detections as u64, "detection")
        ));
        if let (Some(truths), false) = (&imported.truths, written) {
            let rows = counted(truths.rows.len() as u64, "row");
            console.note(format_args!("the recording has a truth of {rows}; --truth-out FILE writes it"));
        }
        Ok(())
    }

    /// Puts tracks on a map.
    fn draw(&self, path: &Path, console: &Console) -> Result<(), Failure> {
        let [input] = &self.input[..] else {
            return Err(Failure::usage("a map is made of one table of tracks"));
        };
        if self.truth_out.is_some() || is_stdin(input) {
            return Err(Failure::usage("a map is made of a file of tracks, which has no truth"));
        }
        let mut tracks = read_tracks(input, &ReadOptions::default()).map_err(|error| {
            let is_no_table = matches!(error, DataError::Metadata { .. } | DataError::MissingColumns { .. });
            let failure = Failure::from(error);
            if !is_no_table {
                return failure;
            }
            failure
                .with_help("a map is made of tracks; `tercel track INPUT -o FILE` tracks and draws at once")
        })?;
        tracks.origin = origin::settle(tracks.origin, self.origin)?;
        let writer = TracksWriter::create(path, &tracks)?;
        writer.notes().iter().for_each(|note| console.note(note));
        Ok(writer.finish()?)
    }

    fn check(&self) -> Result<(), Failure> {
        let conflict = |message: &str| Err(Failure::usage(message));
        match &self.truth_out {
            Some(Target::Stdout) => return conflict("--truth-out needs a file"),
            Some(truth) if *truth == self.output => return conflict("-o and --truth-out name the same file"),
            _ => {}
        }
        if self.input.len() > 1 && self.input.iter().any(|path| is_stdin(path)) {
            return conflict("standard input cannot be joined with files");
        }
        let inputs: Vec<&Path> = self.input.iter().map(PathBuf::as_path).collect();
        let outputs = [Some(&self.output), self.truth_out.as_ref()].into_iter().flatten();
        keep_inputs(outputs.filter_map(Target::file), &inputs)
    }

    /// Writes the tables; all of them are complete before the first one appears. True when the truth is among them.
    fn write(&self, imported: &Imported) -> Result<bool, Failure> {
        let truth = match self.truth_out.as_ref().and_then(Target::file) {
            Some(path) => Some(truth_file(path, imported.truths.as_ref())?),
            None => None,
        };
        match &self.output {
            Target::Stdout => {
                write_detections_to(std::io::stdout(), Format::Ndjson, STDOUT, &imported.detections)?;
                std::io::stdout().flush().map_err(|error| Failure::stdout(&error))?;
            }
            Target::File(path) => {
                let mut file = AtomicFile::create(path)?;
                let format = Format::of(path)?;
                write_detections_to(&mut file, format, &path.to_string_lossy(), &imported.detections)?;
                file.finish()?;
            }
        }
        let written = truth.is_some();
        truth.map_or(Ok(()), AtomicFile::finish)?;
        Ok(written)
    }
}

fn truth_file(path: &Path, truths: Option<&Truths>) -> Result<AtomicFile, Failure> {
    let Some(truths) = truths else {
        return Err(Failure::input("the recording has no truth").with_help("leave out --truth-out"));
    };
    let mut file = AtomicFile::create(path)?;
    write_truths_to(&mut file, Format::of(path)?, &path.to_string_lossy(), truths)?;
    Ok(file)
}
