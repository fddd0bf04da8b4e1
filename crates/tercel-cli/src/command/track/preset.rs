//! The configuration of a run: the one that the user named, or one that comes with the program.

use std::path::Path;

use tercel_data::Source;
use tercel_data::table::{Description, Detections, Scan};
use tercel_pipeline::{Config, Pipeline};

use crate::command::config;
use crate::console::Console;
use crate::failure::Failure;

/// A configuration, its tracker and its name.
pub struct Chosen {
    /// How the tracker is described.
    pub config: Config,
    /// The tracker.
    pub pipeline: Pipeline,
    /// Name of the file or of the preset.
    pub name: String,
}

impl Chosen {
    /// Reads a configuration.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let (config, pipeline) = config::read(path)?;
        Ok(Chosen { config, pipeline, name: path.to_string_lossy().into_owned() })
    }
}

/// What tells which preset fits.
pub struct Recording {
    source: Source,
    description: Description,
    /// Whether detections carry an identity.
    identities: bool,
}

impl Recording {
    /// A recording that was read to its end.
    pub fn whole(source: Source, detections: &Detections) -> Self {
        Recording {
            source,
            description: detections.description.clone(),
            identities: detections.scans.iter().any(has_identity),
        }
    }

    /// A stream of which the first scan is known.
    pub fn beginning(description: Description, first: Option<&Scan>) -> Self {
        Recording { source: Source::Ndjson, description, identities: first.is_some_and(has_identity) }
    }

    /// What the recording was before it became a table. A recording of several sources is of a kind if all sensors are.
    fn kind(&self) -> &str {
        let Description { source, sensors } = &self.description;
        let mut names = sensors.keys();
        match (source, names.next(), names.next()) {
            (Some(source), ..) => source,
            (None, Some(sensor), None) if self.description.all_report() => sensor,
            _ => self.source.family().name(),
        }
    }

    fn preset_name(&self) -> &'static str {
        match self.kind() {
            "autoferry" => "harbour",
            "adsb" => "adsb",
            "ais" => "ais",
            _ => "default",
        }
    }

    /// The preset that fits. Since the user did not choose it, it is named on standard error.
    pub fn preset(&self, console: &Console) -> Result<Chosen, Failure> {
        let name = self.preset_name();
        console.note(format_args!(
            "using the configuration `{name}`; `tercel config init --preset {name} -o FILE` writes it for changes"
        ));
        if self.identities && name == "default" {
            console.note(
                "the detections have identities, but nothing says whose reports they are; for ships or aircraft: \
                 `tercel config init --preset ais -o FILE` (or adsb), and --config FILE",
            );
        }
        let (config, pipeline) = config::preset(name)?;
        Ok(Chosen { config, pipeline, name: name.to_owned() })
    }
}

fn has_identity(scan: &Scan) -> bool {
    scan.detections.iter().any(|detection| detection.identity.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tercel_data::table::SensorDescription;

    fn preset(source: Source, was: Option<&str>, sensors: &[&str]) -> &'static str {
        let reports = SensorDescription { reports: true, identity: true, interval: None };
        let sensors = sensors.iter().map(|name| ((*name).to_owned(), reports.clone())).collect();
        let description = Description { source: was.map(str::to_owned), sensors };
        Recording { source, description, identities: true }.preset_name()
    }

    #[test]
    fn a_table_is_tracked_as_what_it_was_before() {
        assert_eq!(preset(Source::Ais, Some("ais"), &["ais"]), "ais");
        assert_eq!(preset(Source::Parquet, Some("ais"), &["ais"]), "ais");
        assert_eq!(preset(Source::Csv, Some("autoferry"), &[]), "harbour");
        assert_eq!(preset(Source::Ndjson, None, &["adsb"]), "adsb", "joined from files of two programs");
    }

    #[test]
    fn what_is_not_known_to_be_reports_gets_the_default() {
        assert_eq!(preset(Source::Csv, None, &[]), "default");
        assert_eq!(preset(Source::Csv, None, &["ais", "radar"]), "default");
        assert_eq!(preset(Source::Adsb, None, &[]), "adsb", "a file without a report");
    }
}
