//! Standard output and output files.

use std::io::Write;
use std::path::{Path, PathBuf};

use tercel_data::{AtomicFile, Format, MapFormat};

use crate::failure::Failure;

/// Name of standard output in messages.
pub const STDOUT: &str = "standard output";

/// Where a table goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// Standard output, as NDJSON.
    Stdout,
    /// A file; its name tells the format.
    File(PathBuf),
}

impl Target {
    /// Reads an argument, `-` for standard output, and checks that the name of a file tells a format that can be written.
    pub fn parse(text: &str) -> Result<Target, String> {
        if text == "-" {
            return Ok(Target::Stdout);
        }
        match Format::of(Path::new(text)) {
            Ok(_) if !text.to_lowercase().ends_with(".gz") => Ok(Target::File(PathBuf::from(text))),
            _ => {
                Err("the name must end in .csv, .parquet or .ndjson, or be - for standard output".to_owned())
            }
        }
    }

    /// Reads an argument for tracks, which may go to a map as well.
    pub fn parse_tracks(text: &str) -> Result<Target, String> {
        match (MapFormat::of(Path::new(text)), Target::parse(text)) {
            (Some(_), _) => Ok(Target::File(PathBuf::from(text))),
            (None, Err(_)) => {
                Err("the name must end in .csv, .parquet, .ndjson, .geojson, .kml, .kmz or .gpx, or be - \
                                   for standard output"
                    .to_owned())
            }
            (None, table) => table,
        }
    }

    /// True when it is a map.
    pub fn is_map(&self) -> bool {
        self.file().is_some_and(|path| MapFormat::of(path).is_some())
    }

    /// The path, if it is a file.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Target::Stdout => None,
            Target::File(path) => Some(path),
        }
    }
}

/// Refuses to write over what is read.
pub fn keep_inputs<'a>(outputs: impl IntoIterator<Item = &'a Path>, inputs: &[&Path]) -> Result<(), Failure> {
    // Two paths are one file only if it is there.
    let same = |one: &Path, other: &Path| {
        one.canonicalize().is_ok_and(|one| other.canonicalize().is_ok_and(|other| one == other))
    };
    match outputs.into_iter().find(|output| inputs.iter().any(|input| same(output, input))) {
        Some(path) => {
            Err(Failure::usage(format!("{}: an output names the same file as an input", path.display())))
        }
        None => Ok(()),
    }
}

/// Prints text.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()).map_err(|error| Failure::stdout(&error))
}

/// Prints one JSON object on a line of its own.
pub fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    print(&format!("{value}\n"))
}

/// Writes text to a file, whole or not at all, or prints it.
pub fn write_text(target: Option<&Path>, text: &str) -> Result<(), Failure> {
    let Some(path) = target.filter(|path| *path != Path::new("-")) else { return print(text) };
    let mut file = AtomicFile::create(path)?;
    file.write_all(text.as_bytes())
        .map_err(|error| Failure::failed(format!("{}: cannot write: {error}", path.display())))?;
    Ok(file.finish()?)
}
