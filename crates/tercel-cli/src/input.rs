//! Which file is read, and as what.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use tercel_data::table::Truths;
use tercel_data::{
    Angles, Bearings, DataError, ImportOptions, Imported, LeftOut, ReadOptions, Recording, Source, Unit,
    import, import_from, read_truths,
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
    /// Unit of bearings in a detection table, where their column does not name it.
    #[arg(long, value_enum, default_value_t, value_name = "UNIT")]
    pub angles: AngleUnit,
    /// From where bearings run; without it, the name of their column tells.
    #[arg(long, value_enum, value_name = "WAY")]
    pub bearings: Option<BearingWay>,
    /// Units of columns, by their names or by length and speed: range=nm,z=ft,speed=kn.
    #[arg(long, value_name = "COLUMN=UNIT", value_delimiter = ',', value_parser = unit)]
    pub units: Vec<(String, Unit)>,
    /// Which column of the file holds one of the table: x=east_m. May be given several times.
    #[arg(long, value_name = "COLUMN=NAME", value_parser = pair)]
    pub column: Vec<(String, String)>,
    /// A column of the file that is not looked at. May be given several times.
    #[arg(long, value_name = "NAME")]
    pub ignore: Vec<String>,
    /// Names of the columns of a CSV file that has no header, in their order: time,x,y.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub columns: Option<Vec<String>>,
    /// Name of the sensor, for a detection table that does not name one.
    #[arg(long, value_name = "NAME")]
    pub sensor: Option<String>,
    /// Key of the list of detections in JSON.
    #[arg(long, value_name = "KEY")]
    pub list: Option<String>,
    /// Unit of times that are numbers; without it, their size and spacing tell.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub time_unit: Option<TimeUnit>,
    /// Zone of dates without one: UTC, +02:00, Europe/Oslo. Without it, UTC.
    #[arg(long, value_name = "ZONE", allow_hyphen_values = true)]
    pub time_zone: Option<String>,
    /// What stands first in dates such as 05/03/2024.
    #[arg(long, value_enum, value_name = "ORDER")]
    pub date_order: Option<DateOrder>,
    /// What becomes of a row, a line or a scan that cannot be used.
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    pub on_error: OnError,
    /// Leave out rows that repeat another row of their scan.
    #[arg(long)]
    pub drop_repeated: bool,
    /// Keep base stations, aids to navigation and aircraft among the ships (ais, nmea).
    #[arg(long)]
    pub all_stations: bool,
}

/// What becomes of a row that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum OnError {
    /// The program ends with exit code 3; of a stream, after the tracks so far are written.
    #[default]
    Fail,
    /// It is left out and counted, with a warning for each line of a stream.
    Skip,
}

/// A unit of angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum AngleUnit {
    /// Bearings in degrees.
    Degrees,
    /// Bearings in radians.
    #[default]
    Radians,
}

/// From where and which way round bearings run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum BearingWay {
    /// From east (x) towards north (y).
    Math,
    /// Clockwise from north.
    Compass,
}

/// A unit of times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
    /// Minutes.
    Min,
    /// Days, as spreadsheets count them.
    Days,
}

/// What stands first in a date.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum DateOrder {
    /// 05/03/2024 is 5 March.
    DayFirst,
    /// 05/03/2024 is 3 May.
    MonthFirst,
}

fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((column, name)) if !column.is_empty() && !name.is_empty() => {
            Ok((column.trim().to_owned(), name.to_owned()))
        }
        _ => Err("expected COLUMN=NAME, such as x=east_m".to_owned()),
    }
}

fn unit(text: &str) -> Result<(String, Unit), String> {
    let (column, unit) = text.split_once('=').ok_or("expected COLUMN=UNIT, such as range=nm")?;
    Ok((column.trim().to_owned(), unit.parse()?))
}

fn source_parser() -> impl TypedValueParser<Value = Source> {
    let known = PossibleValuesParser::new(Source::ALL.map(Source::name));
    known.try_map(|name| Source::ALL.into_iter().find(|source| source.name() == name).ok_or("unknown format"))
}

impl ReadArguments {
    /// The options of the reader.
    pub fn options(&self) -> ReadOptions {
        ReadOptions {
            angles: match self.angles {
                AngleUnit::Degrees => Angles::Degrees,
                AngleUnit::Radians => Angles::Radians,
            },
            bearings: self.bearings.map(|way| match way {
                BearingWay::Math => Bearings::Math,
                BearingWay::Compass => Bearings::Compass,
            }),
            units: self.units.clone(),
            renames: self.column.clone(),
            ignore: self.ignore.clone(),
            columns: self.columns.clone(),
            sensor: self.sensor.as_deref().map(Into::into),
            list: self.list.clone(),
            time_unit: self.time_unit.map(|unit| match unit {
                TimeUnit::S => Unit::Second,
                TimeUnit::Ms => Unit::Millisecond,
                TimeUnit::Us => Unit::Microsecond,
                TimeUnit::Ns => Unit::Nanosecond,
                TimeUnit::Min => Unit::Minute,
                TimeUnit::Days => Unit::Day,
            }),
            time_zone: self.time_zone.clone(),
            date_order: self.date_order.map(|order| match order {
                DateOrder::DayFirst => tercel_data::DateOrder::DayFirst,
                DateOrder::MonthFirst => tercel_data::DateOrder::MonthFirst,
            }),
            on_error: match self.on_error {
                OnError::Fail => tercel_data::OnError::Fail,
                OnError::Skip => tercel_data::OnError::Skip,
            },
            drop_repeated: self.drop_repeated,
            origin: None,
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

impl ReadArguments {
    /// What opens recordings of one source, to be read scan by scan.
    pub fn opener(
        &self,
        source: Source,
        paths: &[PathBuf],
        options: ImportOptions,
    ) -> impl FnOnce() -> Result<Recording, DataError> + Send + use<> {
        let options = ImportOptions { read: self.options(), all_stations: self.all_stations, ..options };
        let paths = paths.to_vec();
        move || match &paths[..] {
            [path] if is_stdin(path) => Recording::from_reader(source, std::io::stdin(), STDIN, &options),
            _ => Recording::open(source, &paths, &options),
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
    say_left_out(&imported.left_out, console);
}

/// Says how many rows are not in the tables, and why.
pub fn say_left_out(left_out: &[LeftOut], console: &Console) {
    for left_out in left_out {
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
