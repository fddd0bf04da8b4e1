//! Which file is read, and as what.

use std::path::Path;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use tercel_data::table::Truths;
use tercel_data::{
    Angles, ImportOptions, Imported, OnError, ReadOptions, Source, import, import_from, read_truths,
};

use crate::console::Console;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::summary::counted;

/// Name of standard input in messages.
pub const STDIN: &str = "standard input";

/// How an input file is read.
#[derive(Debug, Args)]
pub struct ReadArguments {
    /// What the input is; without it, its name and its first line tell.
    #[arg(long, value_name = "FORMAT", value_parser = source_parser())]
    pub from: Option<Source>,
    /// Unit of bearings in a detection table.
    #[arg(long, value_enum, default_value_t, value_name = "UNIT")]
    pub angles: AngleUnit,
    /// Names of the columns of a CSV file that has no header, in their order: time,x,y.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub columns: Option<Vec<String>>,
    /// Name of the sensor, for a detection table that does not name one.
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Keep base stations, aids to navigation and aircraft among the ships (ais, nmea).
    #[arg(long)]
    pub all_stations: bool,
}

/// A unit of angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum AngleUnit {
    /// Bearings in degrees.
    Degrees,
    /// Bearings in radians, from -pi to pi.
    #[default]
    Radians,
}

fn source_parser() -> impl TypedValueParser<Value = Source> {
    let known = PossibleValuesParser::new(Source::ALL.map(Source::name));
    known.try_map(|name| Source::ALL.into_iter().find(|source| source.name() == name).ok_or("unknown format"))
}

impl ReadArguments {
    /// The options of the reader.
    pub fn options(&self) -> ReadOptions {
        let angles = match self.angles {
            AngleUnit::Degrees => Angles::Degrees,
            AngleUnit::Radians => Angles::Radians,
        };
        ReadOptions {
            angles,
            sensor: self.sensor.as_deref().map(Into::into),
            columns: self.columns.clone(),
            on_error: OnError::Fail,
        }
    }

    /// The source of a file: the one that was named, or the one that it looks like.
    pub fn source(&self, path: &Path) -> Result<Source, Failure> {
        match self.from {
            Some(source) => Ok(source),
            None if is_stdin(path) => Ok(Source::Ndjson),
            None => Ok(Source::recognise(path)?),
        }
    }

    /// Reads recordings of one source.
    pub fn import<P: AsRef<Path>>(
        &self,
        source: Source,
        paths: &[P],
        options: ImportOptions,
        console: &Console,
    ) -> Result<Imported, Failure> {
        let _progress = Progress::spinner(console, "reading");
        let options = ImportOptions { read: self.options(), all_stations: self.all_stations, ..options };
        match paths {
            [path] if is_stdin(path.as_ref()) => Ok(import_from(source, std::io::stdin(), STDIN, &options)?),
            _ => Ok(import(source, paths, &options)?),
        }
    }
}

/// True for `-`.
pub fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// Says how many rows of a recording are not in the tables, and why.
pub fn note_left_out(imported: &Imported, console: &Console) {
    for note in &imported.notes {
        console.note(note);
    }
    for left_out in &imported.left_out {
        console.note(format_args!("left out {}: {}", counted(left_out.rows as u64, "row"), left_out.reason));
    }
}

/// Reads the truth: a table, or the JSON file of an Autoferry recording.
pub fn truth(path: &Path) -> Result<Truths, Failure> {
    let name = path.to_string_lossy().to_lowercase();
    if !name.ends_with(".json") && !name.ends_with(".json.gz") {
        return Ok(read_truths(path, &ReadOptions::default())?);
    }
    let file = std::fs::File::open(path)
        .map_err(|error| Failure::input(format!("{}: cannot open: {error}", path.display())))?;
    Ok(tercel_data::import::autoferry::read_truths_from(file, &path.to_string_lossy())?)
}
