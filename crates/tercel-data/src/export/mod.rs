//! Tracks for maps: what geographic programs, globes and plotters open.

mod clock;
mod geojson;
mod gpx;
mod kml;
mod kmz;
mod path;

use std::path::Path as FilePath;
use std::sync::Arc;

use crate::error::DataError;
use crate::output::AtomicFile;
use crate::source::file_name;
use crate::table::{Track, Tracks};

use self::clock::Clock;
use self::path::{Path, Paths};

/// A format in which tracks go to a map. It is written only, and needs an origin: without one nobody knows where on the Earth
/// the local frame lies.
///
/// Each track is one line from its first row to the last one that is not coasted, since a guess of where an object went after
/// it was last seen looks on a map as if it had been there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MapFormat {
    /// GeoJSON (RFC 7946): a line with its times and the last state as properties.
    GeoJson,
    /// Keyhole Markup Language 2.2: a `gx:Track` with its times.
    Kml,
    /// The same in a compressed archive.
    Kmz,
    /// GPS Exchange Format 1.1: a `trk`.
    Gpx,
}

impl MapFormat {
    /// The format that the name of a file tells: `.geojson`, `.kml`, `.kmz` or `.gpx`.
    pub fn of(path: &FilePath) -> Option<MapFormat> {
        let extension = path.extension()?.to_string_lossy().to_lowercase();
        match extension.as_str() {
            "geojson" => Some(MapFormat::GeoJson),
            "kml" => Some(MapFormat::Kml),
            "kmz" => Some(MapFormat::Kmz),
            "gpx" => Some(MapFormat::Gpx),
            _ => None,
        }
    }
}

/// Gathers tracks and writes them when they are complete.
pub(crate) struct MapWriter {
    format: MapFormat,
    paths: Paths,
    name: Arc<str>,
    file: AtomicFile,
}

impl MapWriter {
    /// Begins a map with the origin and labels of `head`; its rows are not looked at.
    pub fn new(format: MapFormat, head: &Tracks, path: &FilePath) -> Result<Self, DataError> {
        let name = file_name(path);
        match Paths::new(head) {
            Some(paths) => Ok(MapWriter { format, paths, name, file: AtomicFile::create(path)? }),
            None => Err(DataError::NoOrigin { file: name }),
        }
    }

    pub fn append(&mut self, rows: &[Track]) -> Result<(), DataError> {
        rows.iter().try_for_each(|row| self.paths.add(row, &self.name))
    }

    /// What a reader of the map should know.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.paths.out_of_reach > 0 {
            notes.push(format!(
                "{}: {} rows are too far from the origin for a map and are not on it",
                self.name, self.paths.out_of_reach
            ));
        }
        if self.paths.clock() == Clock::Seconds {
            let without = match self.format {
                MapFormat::GeoJson => "are seconds on the map, too",
                MapFormat::Kml | MapFormat::Kmz | MapFormat::Gpx => "are left out",
            };
            notes.push(format!("{}: the times are no Unix times and {without}", self.name));
        }
        notes
    }

    /// Writes the file and puts it in its place.
    pub fn finish(mut self) -> Result<(), DataError> {
        let (clock, paths) = (self.paths.clock(), self.paths.complete());
        let written = match self.format {
            MapFormat::GeoJson => geojson::write(&mut self.file, paths, clock),
            MapFormat::Kml => kml::write(&mut self.file, paths, clock),
            MapFormat::Kmz => kmz::write(&mut self.file, paths, clock),
            MapFormat::Gpx => gpx::write(&mut self.file, paths, clock),
        };
        written.map_err(|error| DataError::io(&self.name, "write", error))?;
        self.file.finish()
    }
}

/// Text between the tags and in the attributes of XML. What XML cannot hold becomes a replacement character.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\t' | '\n' | '\r' => escaped.push(' '),
            '\0'..' ' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            other => escaped.push(other),
        }
    }
    escaped
}
