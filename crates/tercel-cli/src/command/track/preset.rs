//! The configuration of a run: the one that the user named, or one that comes with the program.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use tercel_data::Source;
use tercel_data::table::{Description, Observation, Scan, Truths};
use tercel_pipeline::config::Measures;
use tercel_pipeline::{Config, Pipeline, Summary};

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
pub struct Kind {
    source: Source,
    description: Description,
    /// Whether detections carry an identity.
    identities: bool,
}

impl Kind {
    /// The kind of a recording with these first scans.
    pub fn of(source: Source, description: &Description, first: &[Scan]) -> Self {
        Kind { source, description: description.clone(), identities: first.iter().any(has_identity) }
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

    /// The preset that fits. Since the user did not choose it, it is named on standard error. Where nothing is known of the objects,
    /// their speed is told from the first scans.
    pub fn preset(&self, first: &[Scan], console: &Console) -> Result<Chosen, Failure> {
        let name = self.preset_name();
        console.note(format_args!(
            "using the configuration `{name}`; `tercel config init --preset {name} -o FILE` writes it for changes"
        ));
        let (config, pipeline) = config::preset(name)?;
        let chosen = Chosen { config, pipeline, name: name.to_owned() };
        if name != "default" {
            return Ok(chosen);
        }
        if self.identities {
            console.note(
                "the detections have identities, but nothing says whose reports they are; for ships or aircraft: \
                 `tercel config init --preset ais -o FILE` (or adsb), and --config FILE",
            );
        }
        chosen.fitted(&self.description, first, console)
    }
}

/// Speeds of new objects that are tried when the preset starts no track, m/s per axis; first its own.
const SPEEDS: [Option<f64>; 4] = [None, Some(100.0), Some(300.0), Some(3.0)];

/// Scans by which a speed is tried.
const TRIED: usize = 2_000;

impl Chosen {
    /// The same with numbers that fit the first scans, where those of the preset start no track: the speed of new objects, and
    /// no more false detections than there are detections. The first that explain about as much as any do are taken.
    fn fitted(self, description: &Description, first: &[Scan], console: &Console) -> Result<Self, Failure> {
        let scans = &first[..first.len().min(TRIED)];
        if scans.len() < 3 || trial(&self.config, description, scans)? != Some((0, 0)) {
            return Ok(self);
        }
        let mut fits = Vec::new();
        for clutter in [None, density(scans)] {
            for speed in SPEEDS {
                let config = speed.into_iter().fold(self.config.clone(), Config::with_speed);
                let config = clutter.into_iter().fold(config, Config::with_clutter_below);
                if let Some((1.., updates)) = trial(&config, description, scans)? {
                    fits.push((updates, config, expectation(speed, clutter)));
                }
            }
        }
        let most = fits.iter().map(|fit| fit.0).max().unwrap_or(0);
        let Some((_, config, expected)) = fits.into_iter().find(|fit| 10 * fit.0 >= 9 * most) else {
            return Ok(self);
        };
        console.note(format_args!(
            "no track starts with the numbers of the preset: {expected} are expected; a configuration with the right numbers \
             does better (`tercel config init -o FILE`)"
        ));
        let pipeline = Pipeline::new(&config)?;
        Ok(Chosen { config, pipeline, ..self })
    }

    /// Says when objects have heights and a sensor of ranges is not told of any.
    pub fn check_heights(&self, truths: &Truths, console: &Console) {
        let high = truths.rows.iter().filter_map(|row| row.z).fold(0.0_f64, |high, z| high.max(z.abs()));
        let flat = self.config.sensors.iter().find(|(_, sensor)| match &sensor.measures {
            Measures::Polar(polar) => polar.height.is_none() && high > polar.range_deviation.get(),
            Measures::Position(_) | Measures::Bearing(_) => false,
        });
        if let Some((name, _)) = flat {
            console.warn(format_args!(
                "the truth has heights up to {high} m, which are not used: ranges of `{name}` are taken as ranges over ground; \
                 height = {high} in the polar table of [sensors.{name}], or a column `z` of the detections, corrects slant ranges"
            ));
        }
    }

    /// Says what in the configuration cannot work with scans as far apart as these.
    pub fn check(&self, first: &[Scan], console: &Console) -> Result<(), Failure> {
        for sentence in tercel_pipeline::advice(&self.config, interval(first))? {
            console.warn(sentence);
        }
        Ok(())
    }
}

/// How many tracks these scans confirm, and how many detections update tracks where one is confirmed; nothing when a scan is
/// refused, which will be said with its place when it is tracked.
fn trial(config: &Config, description: &Description, scans: &[Scan]) -> Result<Option<(u64, u64)>, Failure> {
    let mut pipeline = Pipeline::new(config)?;
    pipeline.expect(description, scans)?;
    for scan in scans {
        if pipeline.push(scan.clone()).is_err() {
            return Ok(None);
        }
    }
    if pipeline.finish().is_err() {
        return Ok(None);
    }
    let Summary { confirmed, updates, .. } = pipeline.summary();
    Ok(Some((confirmed, if confirmed > 0 { updates } else { 0 })))
}

/// What is expected of objects and clutter, in words.
fn expectation(speed: Option<f64>, clutter: Option<f64>) -> String {
    let speed = speed.map(|speed| format!("objects of {speed} m/s per axis"));
    let clutter = clutter.map(|density| format!("{density:.0e} false detections per scan and m²"));
    speed.into_iter().chain(clutter).collect::<Vec<_>>().join(" and ")
}

/// Detections per scan and m² of the square that holds them all: there cannot be more false ones, on average.
fn density(scans: &[Scan]) -> Option<f64> {
    let mut places = Vec::new();
    for detection in scans.iter().flat_map(|scan| &scan.detections) {
        if let Observation::Position { x, y, .. } = detection.observation {
            places.push([x, y]);
        }
    }
    let extent = |axis: usize| {
        let along = || places.iter().map(|place| place[axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    let side = extent(0).max(extent(1));
    (side > 0.0).then(|| places.len() as f64 / scans.len() as f64 / (side * side))
}

/// Median time between scans of the sensor that scans most, s.
fn interval(first: &[Scan]) -> Option<f64> {
    let mut times: HashMap<&Arc<str>, Vec<f64>> = HashMap::new();
    for scan in first {
        times.entry(&scan.sensor).or_default().push(scan.time);
    }
    let most = times.into_values().max_by_key(Vec::len)?;
    let mut gaps: Vec<f64> = most.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0).collect();
    let middle = gaps.len() / 2;
    (!gaps.is_empty()).then(|| *gaps.select_nth_unstable_by(middle, f64::total_cmp).1)
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
        Kind { source, description, identities: true }.preset_name()
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
