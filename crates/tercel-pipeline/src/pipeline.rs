//! Scans in, tracks out.

use std::collections::{BTreeMap, BTreeSet};

use tercel_core::multi::{Clutter, Status, Use};
use tercel_data::table::{Scan, Track};

use crate::PipelineError;
use crate::config::{Config, OutOfOrder};
use crate::engine::{Engine, Outcome, engine};
use crate::reorder::Reorder;
use crate::repeats;
use crate::sensors::Station;

/// The tracker that a configuration describes. See the [crate] for an example.
pub struct Pipeline {
    engine: Box<dyn Engine>,
    stations: BTreeMap<String, Station>,
    ignore: Vec<String>,
    reorder: Reorder,
    labels: Vec<String>,
    modes: Vec<String>,
    summary: Summary,
    confirmed: BTreeSet<u64>,
    /// Tracks of scans that were released before one that was refused; they come with the next call.
    held: Vec<Track>,
    config: Config,
}

/// What happened to all that came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Summary {
    /// Scans that were tracked.
    pub scans: u64,
    /// Scans that came too late and were left out.
    pub late: u64,
    /// Scans of sensors that the configuration leaves out.
    pub ignored: u64,
    /// Detections that updated a track.
    pub updates: u64,
    /// Detections that started a tentative track.
    pub starts: u64,
    /// Detections that were counted as clutter.
    pub clutter: u64,
    /// Detections that were left out because their scan holds another with the same numbers and the same identity.
    pub repeated: u64,
    /// Tracks that were confirmed.
    pub confirmed: u64,
}

/// The section that serves every sensor without one of its own.
const DEFAULT: &str = "default";

impl Pipeline {
    /// Builds what the configuration describes.
    ///
    /// # Errors
    /// When a value of the configuration makes no tracker; the message names its key.
    pub fn new(config: &Config) -> Result<Self, PipelineError> {
        let station = |(name, sensor): (&String, _)| Ok((name.clone(), Station::new(name, sensor)?));
        let delay = match config.input.out_of_order {
            OutOfOrder::Drop => 0.0,
            OutOfOrder::Buffer => config.input.delay.get(),
        };
        let engine = engine(config)?;
        Ok(Pipeline {
            modes: engine.modes(),
            engine,
            stations: config.sensors.iter().map(station).collect::<Result<_, PipelineError>>()?,
            ignore: config.input.ignore.clone(),
            reorder: Reorder::new(delay),
            labels: config.motion.labels().iter().map(ToString::to_string).collect(),
            summary: Summary::default(),
            confirmed: BTreeSet::new(),
            held: Vec::new(),
            config: config.clone(),
        })
    }

    /// Names of the components of the state, for the table of tracks.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// Names of the modes of motion; empty for a single one.
    pub fn modes(&self) -> &[String] {
        &self.modes
    }

    /// What happened so far.
    pub fn summary(&self) -> Summary {
        self.summary
    }

    /// Takes in a scan and returns the tracks after each scan that it released, with their detections.
    ///
    /// With `out_of_order = "buffer"` a scan is held back and its tracks come with a later one.
    ///
    /// # Errors
    /// When the sensor is not described, a detection does not hold what the sensor measures, or a number is not finite. That
    /// scan is left out; the tracks of scans released before it come with the next call.
    pub fn push(&mut self, scan: Scan) -> Result<Vec<Track>, PipelineError> {
        if self.ignore.iter().any(|name| **name == *scan.sensor) {
            self.summary.ignored += 1;
            return Ok(Vec::new());
        }
        self.station(&scan)?;
        if !scan.time.is_finite() {
            let source = tercel_core::multi::TrackerError::Time { time: scan.time };
            return Err(PipelineError::Tracker { sensor: scan.sensor.to_string(), source });
        }
        if self.reorder.push(scan).is_some() {
            self.summary.late += 1;
        }
        self.release(false)
    }

    /// Tracks the scans that are still held back.
    ///
    /// # Errors
    /// As [`push`](Pipeline::push).
    pub fn finish(&mut self) -> Result<Vec<Track>, PipelineError> {
        self.release(true)
    }

    fn release(&mut self, all: bool) -> Result<Vec<Track>, PipelineError> {
        while let Some(scan) = self.reorder.pop(all) {
            let rows = self.track(&scan)?;
            self.held.extend(rows);
        }
        Ok(std::mem::take(&mut self.held))
    }

    fn track(&mut self, scan: &Scan) -> Result<Vec<Track>, PipelineError> {
        let name = self.station(scan)?;
        let Some(station) = self.stations.get_mut(&name) else { return Ok(Vec::new()) };
        station.move_to(scan);
        let single = repeats::left_out(scan);
        let repeated =
            single.as_ref().map_or(0, |single| scan.detections.len() - single.detections.len()) as u64;
        let scan = single.as_ref().unwrap_or(scan);
        let outcome = self.engine.step(station, scan)?;
        learn(station, &outcome);
        self.count(&outcome);
        self.summary.repeated += repeated;
        Ok(outcome.rows)
    }

    /// Name of the section that describes the sensor of a scan; one made from the default section if it has none.
    fn station(&mut self, scan: &Scan) -> Result<String, PipelineError> {
        let name = scan.sensor.to_string();
        if !self.stations.contains_key(&name) {
            let Some(sensor) = self.config.sensors.get(DEFAULT) else {
                return Err(PipelineError::UnknownSensor { time: scan.time, sensor: name });
            };
            self.stations.insert(name.clone(), Station::new(&name, sensor)?);
        }
        Ok(name)
    }

    fn count(&mut self, outcome: &Outcome) {
        let believed = outcome.rows.iter().filter(|row| row.status == Status::Confirmed);
        self.confirmed.extend(believed.map(|row| row.track));
        let summary = &mut self.summary;
        summary.confirmed = self.confirmed.len() as u64;
        summary.scans += 1;
        for (_, used) in &outcome.uses {
            match used {
                Use::Updated(_) => summary.updates += 1,
                Use::Started(_) => summary.starts += 1,
                Use::Clutter => summary.clutter += 1,
            }
        }
    }
}

/// Teaches the clutter map of a sensor with its detections, each in the measure in which no track explains it.
fn learn(station: &mut Station, outcome: &Outcome) {
    let detection = station.detection();
    let Clutter::Map(map) = &mut station.clutter else { return };
    let doubt = |id: u64| {
        let row = outcome.rows.binary_search_by_key(&id, |row| row.track);
        row.map_or(1.0, |row| 1.0 - outcome.rows[row].existence)
    };
    let unexplained = outcome.uses.iter().filter_map(|(place, used)| match used {
        Use::Updated(id) => Some(((*place)?, doubt(*id))),
        Use::Started(_) | Use::Clutter => Some(((*place)?, 1.0)),
    });
    map.learn(unexplained, &detection);
}
