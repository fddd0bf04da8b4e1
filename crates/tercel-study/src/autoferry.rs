//! The study `autoferry`: real radar and lidar in a harbour against boats with satellite navigation.

mod leave_one_out;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use tercel_data::table::{Detections, Metric, Metrics, Tracks, Truths};
use tercel_data::{AtomicFile, ImportOptions, Source, import};
use tercel_pipeline::config::{MotionConfig, presets};
use tercel_pipeline::{Config, Pipeline};

use crate::error::StudyError;
use crate::evaluate::{EvaluateOptions, Evaluation, evaluate};
use crate::report::{Picture, Report, Summary};
use crate::studies::refuse_unused;
use crate::table::{Figure, Row, StudyTable};

/// Name of the study.
pub const NAME: &str = "autoferry";

/// What can be compared.
pub const METHODS: [&str; 7] = [
    "nearest-neighbour",
    "phd",
    "imm-pmbm",
    "lnn-pmbm",
    "lnn-imm-pmbm",
    "nearest-neighbour-loo",
    "imm-pmbm-loo",
];

/// The columns of the table.
pub const COLUMNS: [&str; 11] = [
    "covered",
    "switches",
    "gospa",
    "gospa_localisation",
    "gospa_missed",
    "gospa_false",
    "gospa_near",
    "false_tracks",
    "false_tracks_near",
    "rmse_pos_norm",
    "tgospa",
];

/// Radar scans in the first seconds are not scored: trackers may find their feet.
const WARM_UP: f64 = 10.0;

/// A recording with its truth.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Its name: `scenario2`.
    pub name: String,
    /// What the sensors saw.
    pub detections: Detections,
    /// Where the boats were.
    pub truths: Truths,
}

/// A recording that was tracked and scored.
#[derive(Debug, Clone)]
pub struct Scored {
    /// The tracks.
    pub tracks: Tracks,
    /// Their scores.
    pub evaluation: Evaluation,
    /// Scans that were tracked.
    pub scans: u64,
    /// Time that tracking took, s.
    pub seconds: f64,
}

/// The result of the study.
#[derive(Debug, Clone)]
pub struct AutoferryResult {
    /// Means over the recordings.
    pub table: StudyTable,
    /// Scores of each recording.
    pub metrics: Metrics,
    /// The recordings.
    pub recordings: Vec<Recording>,
    /// What each method made of each of them.
    pub scored: Vec<(String, Vec<Scored>)>,
}

impl Recording {
    /// Reads every recording of a folder: files named `NAME_detections.json` or `NAME_detections.json.gz` with the truth
    /// beside them, by the number in their names.
    ///
    /// # Errors
    /// When the folder cannot be listed, holds none, or a file is refused.
    pub fn read_all(folder: &Path) -> Result<Vec<Recording>, StudyError> {
        let failed = |source| StudyError::Folder { path: folder.to_path_buf(), source };
        let mut names = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(failed)? {
            let file = entry.map_err(failed)?.file_name().to_string_lossy().into_owned();
            if let Some((name, _)) = file.split_once("_detections.json") {
                names.push((number_of(name), name.to_string(), folder.join(&file)));
            }
        }
        names.sort();
        if names.is_empty() {
            let expected = "NAME_detections.json or NAME_detections.json.gz";
            return Err(StudyError::NoRecordings { path: folder.to_path_buf(), expected });
        }
        names
            .into_iter()
            .map(|(_, name, path)| {
                let imported = import(Source::Autoferry, &[path], &ImportOptions::default())?;
                let truths =
                    imported.truths.ok_or_else(|| StudyError::NoTruth { recording: name.clone() })?;
                Ok(Recording { name, detections: imported.detections, truths })
            })
            .collect()
    }

    /// Tracks the recording and scores the tracks at the radar scans.
    ///
    /// # Errors
    /// When the configuration does not fit the recording.
    pub fn score(&self, config: &Config) -> Result<Scored, StudyError> {
        let mut pipeline = Pipeline::new(config)?;
        let scans = self.detections.scans.clone();
        let start = Instant::now();
        let mut rows = Vec::new();
        for scan in scans {
            rows.extend(pipeline.push(scan)?);
        }
        rows.extend(pipeline.finish()?);
        let seconds = start.elapsed().as_secs_f64();
        let tracks = Tracks {
            origin: self.detections.origin,
            labels: pipeline.labels().to_vec(),
            modes: pipeline.modes().to_vec(),
            rows,
        };
        let evaluation = evaluate(&tracks, &self.truths, &self.options())?;
        Ok(Scored { tracks, evaluation, scans: pipeline.summary().scans, seconds })
    }

    fn options(&self) -> EvaluateOptions {
        let radar =
            self.detections.scans.iter().filter(|scan| &*scan.sensor == "radar").map(|scan| scan.time);
        let first = radar.clone().fold(f64::INFINITY, f64::min);
        EvaluateOptions {
            times: Some(radar.filter(|time| time - first > WARM_UP).collect()),
            truth_gap: f64::INFINITY,
            truth_hold: f64::INFINITY,
            ..EvaluateOptions::default()
        }
    }
}

impl AutoferryResult {
    /// The means over the recordings, and the figures of each recording, as text.
    pub fn text(&self) -> String {
        let mut text = self.table.text(&COLUMNS);
        for (method, results) in &self.scored {
            let rows = self.recordings.iter().zip(results).map(|(recording, result)| {
                let mut row = row(method, std::slice::from_ref(result), self.table.seed);
                row.method.clone_from(&recording.name);
                row
            });
            let table = StudyTable { rows: rows.collect(), ..self.table.clone() };
            text.push_str(&format!("\n{method}\n{}", table.text(&COLUMNS)));
        }
        text
    }

    /// Writes to `folder` the tracks of each method and recording (`METHOD_RECORDING.parquet`), the scores (`metrics.csv`), the
    /// table (`study.json`) and a report with a picture of each recording under the first method (`report.html`).
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), StudyError> {
        let failed = |source| StudyError::Folder { path: folder.to_path_buf(), source };
        std::fs::create_dir_all(folder).map_err(failed)?;
        for (method, results) in &self.scored {
            for (recording, result) in self.recordings.iter().zip(results) {
                let name = format!("{method}_{}.parquet", recording.name);
                tercel_data::write_tracks(folder.join(name), &result.tracks)?;
            }
        }
        tercel_data::write_metrics(folder.join("metrics.csv"), &self.metrics)?;
        let json = serde_json::to_vec_pretty(&self.table).map_err(|error| failed(error.into()))?;
        let mut file = AtomicFile::create(&folder.join("study.json"))?;
        file.write_all(&json).map_err(failed)?;
        file.finish()?;
        Ok(self.report()?.write(folder.join("report.html"))?)
    }

    fn report(&self) -> Result<Report, StudyError> {
        let mut summary = Summary::new();
        for row in &self.table.rows {
            for (name, figure) in &row.metrics {
                summary =
                    summary.with(format!("{}: {name}", row.method), format!("{:.3}", figure.mean), None);
            }
        }
        let mut report = Report::new("Study autoferry")
            .with_subtitle(format!("Means over {} recordings; pictures of the first method", self.table.runs))
            .with(summary);
        if let Some((method, results)) = self.scored.first() {
            for (recording, result) in self.recordings.iter().zip(results) {
                let picture =
                    Picture::new(&recording.detections, &result.tracks, Some(&recording.truths), &[])?;
                let title = Summary::new().with("recording", format!("{}, {method}", recording.name), None);
                report = report.with(title).with(picture.with_chart(result.evaluation.chart()));
            }
        }
        Ok(report)
    }
}

/// The first number in a name, so that `scenario13` comes after `scenario2`.
fn number_of(name: &str) -> u64 {
    let digits: String =
        name.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap_or(0)
}

/// Runs the study over the recordings of a folder.
///
/// `nearest-neighbour`, `phd` and `imm-pmbm` use one shipped configuration for all recordings. A name that ends in `-loo` tunes
/// that configuration anew for each recording on the others alone: how much of the result is fitted to these few scenes.
/// `models` are files of models that take the place of shipped ones, by the names of those. `progress` is called with a sentence
/// before each long step.
///
/// # Errors
/// When a method is not known, no method uses a model, or a recording cannot be read or tracked.
pub fn run(
    folder: &Path,
    methods: &[String],
    seed: u64,
    models: &BTreeMap<String, PathBuf>,
    progress: &dyn Fn(&str),
) -> Result<AutoferryResult, StudyError> {
    if let Some(name) = methods.iter().find(|name| !METHODS.contains(&name.as_str())) {
        let known = METHODS.join(", ");
        return Err(StudyError::UnknownMethod { study: NAME, name: name.clone(), known });
    }
    let used: Vec<String> = methods.iter().filter_map(|method| model_of(method)).map(str::to_owned).collect();
    refuse_unused(models.keys(), &used)?;
    let recordings = Recording::read_all(folder)?;
    let mut scored = Vec::new();
    for method in methods {
        progress(&format!("{method} on {} recordings", recordings.len()));
        let results: Result<Vec<Scored>, StudyError> = match leave_one_out::Tuned::find(method) {
            Some(tuned) => tuned.leave_one_out(&recordings, progress),
            None => {
                let config = shipped(method, models)?;
                recordings.iter().map(|recording| recording.score(&config)).collect()
            }
        };
        scored.push((method.clone(), results?));
    }
    let rows = scored.iter().map(|(method, results)| row(method, results, seed)).collect();
    let table = StudyTable {
        study: NAME.to_string(),
        options: BTreeMap::new(),
        version: env!("CARGO_PKG_VERSION").to_string(),
        seed,
        runs: recordings.len(),
        rows,
    };
    let metrics = metrics(&recordings, &scored);
    Ok(AutoferryResult { table, metrics, recordings, scored })
}

/// The shipped configuration of a method.
fn shipped(method: &str, models: &BTreeMap<String, PathBuf>) -> Result<Config, StudyError> {
    let preset = match method {
        "phd" => "harbour-phd",
        "imm-pmbm" => "harbour-pmbm",
        "lnn-pmbm" | "lnn-imm-pmbm" => "harbour-learned",
        _ => "harbour",
    };
    // The presets are part of the program, and a test reads each.
    let mut config = Config::parse(presets::get(preset).unwrap_or_default())?;
    if let (Some(model), MotionConfig::Learned(motion)) = (model_of(method), &mut config.motion) {
        let own = models.get(model).map(|file| file.to_string_lossy().into_owned());
        motion.model = own.unwrap_or_else(|| model.to_owned());
    }
    Ok(config)
}

/// The model of a method with learned motion.
fn model_of(method: &str) -> Option<&'static str> {
    match method {
        "lnn-pmbm" => Some("liquid"),
        "lnn-imm-pmbm" => Some("neural-imm-liquid"),
        _ => None,
    }
}

fn row(method: &str, results: &[Scored], seed: u64) -> Row {
    let figure = |name: &str| {
        let values: Vec<f64> =
            results.iter().map(|result| result.evaluation.mean(name).unwrap_or(f64::NAN)).collect();
        Figure::of(&values, seed)
    };
    let metrics = COLUMNS.iter().map(|name| (name.to_string(), figure(name))).collect();
    let seconds: f64 = results.iter().map(|result| result.seconds).sum();
    let scans: u64 = results.iter().map(|result| result.scans).sum();
    let us_per_step = 1e6 * seconds / scans.max(1) as f64;
    Row { method: method.to_string(), at: None, metrics, us_per_step, published: published(method) }
}

/// The best figures of Stone Soup 1.9.1's trackers on the same recordings, tuned on them: a JPDA with the radar's lag in its
/// model. They are the mark for every method here.
fn published(_method: &str) -> Option<BTreeMap<String, f64>> {
    let figures = [
        ("covered", 0.947),
        ("switches", 0.2),
        ("gospa", 19.3),
        ("gospa_near", 12.2),
        ("rmse_pos_norm", 4.5),
    ];
    Some(figures.into_iter().map(|(name, value)| (name.to_string(), value)).collect())
}

fn metrics(recordings: &[Recording], scored: &[(String, Vec<Scored>)]) -> Metrics {
    let mut rows = Vec::new();
    for (method, results) in scored {
        for (recording, result) in recordings.iter().zip(results) {
            for &(metric, value) in &result.evaluation.means {
                rows.push(Metric {
                    study: NAME.to_string(),
                    method: method.clone(),
                    run: recording.name.clone(),
                    metric: metric.to_string(),
                    component: String::new(),
                    value,
                });
            }
        }
    }
    Metrics { rows }
}

#[cfg(test)]
mod tests;
