//! Scans in, tracks out.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use tercel_core::multi::{Clutter, Status, Use};
use tercel_data::table::{Description, Scan, Track};

use crate::PipelineError;
use crate::config::{ClockSetBack, Config, OutOfOrder};
use crate::engine::{Engine, Outcome, engine};
use crate::names::Names;
use crate::notice::Notice;
use crate::reorder::{Arrival, Order, Reorder};
use crate::repeats;
use crate::sensors::Station;
use crate::turns::{Look, Turns};
use crate::understood;

/// The tracker that a configuration describes. See the [crate] for an example.
pub struct Pipeline {
    engine: Box<dyn Engine>,
    stations: HashMap<Arc<str>, Station>,
    ignore: Vec<String>,
    reorder: Reorder,
    names: Names,
    labels: Vec<String>,
    modes: Vec<String>,
    summary: Summary,
    confirmed: BTreeSet<u64>,
    /// The largest number of a track, and what is added to those of an engine that started anew.
    numbers: (u64, u64),
    /// Tracks of scans that were released before one that was refused; they come with the next call.
    held: Vec<Track>,
    notices: Vec<Notice>,
    config: Config,
}

/// What happened to all that came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Summary {
    /// Scans that were tracked.
    pub scans: u64,
    /// Scans that came too late and were left out.
    pub late: u64,
    /// Scans that were set aside because their times are far ahead of all others.
    pub ahead: u64,
    /// Scans of sensors that the configuration leaves out.
    pub ignored: u64,
    /// Rows of scans that came too late: their detections, and scans without any.
    pub late_rows: u64,
    /// Rows of scans that were set aside.
    pub ahead_rows: u64,
    /// Rows of sensors that the configuration leaves out.
    pub ignored_rows: u64,
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
        let station =
            |(name, sensor): (&String, _)| Ok((Arc::from(name.as_str()), Station::new(name, sensor)?));
        let input = &config.input;
        let order = Order {
            delay: match input.out_of_order {
                OutOfOrder::Drop => 0.0,
                OutOfOrder::Buffer => input.delay.get(),
            },
            max_jump: input.max_jump.get(),
            restart: input.clock_set_back == ClockSetBack::Restart,
        };
        let engine = engine(config)?;
        Ok(Pipeline {
            modes: engine.modes(),
            engine,
            stations: config.sensors.iter().map(station).collect::<Result<_, PipelineError>>()?,
            ignore: input.ignore.clone(),
            reorder: Reorder::new(order),
            names: Names::default(),
            labels: config.motion.labels().iter().map(ToString::to_string).collect(),
            summary: Summary::default(),
            confirmed: BTreeSet::new(),
            numbers: (0, 0),
            held: Vec::new(),
            notices: Vec::new(),
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

    /// What a user should be told since the last call.
    pub fn notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// True when all that is known of sends reports.
    pub fn reports(&self) -> bool {
        !self.stations.is_empty() && self.stations.values().all(|station| station.detection.is_reports())
    }

    /// Detections that came in and wait to be tracked.
    pub fn held(&self) -> usize {
        let open = self.stations.values().filter_map(|station| station.turns.as_ref()).map(Turns::held);
        open.sum::<usize>() + self.reorder.held()
    }

    /// Looks ahead at a recording: at what is said of its sensors and at its first scans. Sensors of which the configuration does
    /// not say so are then taken as reports, or as antennas that turn, where the recording says or shows that. Without this call,
    /// as with a stream, they scan.
    ///
    /// # Errors
    /// When a sensor is not described.
    pub fn expect(&mut self, description: &Description, first: &[Scan]) -> Result<(), PipelineError> {
        for name in understood::sensors(description, first) {
            if self.ignore.iter().any(|ignored| **ignored == *name) {
                continue;
            }
            let config = self.config.sensors.get(&*name).or_else(|| self.config.sensors.get(DEFAULT));
            let Some(config) = config.cloned() else { continue };
            let Some(found) = understood::sensor(&name, &config, description, first) else { continue };
            let station = self.station(&name, first.first().map_or(0.0, |scan| scan.time))?;
            let notice = found.apply(&name, station);
            self.notices.extend(notice);
        }
        Ok(())
    }

    /// Takes in a scan and returns the tracks after each scan that it released, with their detections: those that the scan
    /// concerned, which are all of them unless its detections are reports.
    ///
    /// With `out_of_order = "buffer"` a scan is held back and its tracks come with a later one, as are plots of an antenna that
    /// turns until a sector is complete.
    ///
    /// # Errors
    /// When the sensor is not described, a detection does not hold what the sensor measures, or a number is not finite. That
    /// scan is left out; the tracks of scans released before it come with the next call.
    pub fn push(&mut self, scan: Scan) -> Result<Vec<Track>, PipelineError> {
        if self.ignore.iter().any(|name| **name == *scan.sensor) {
            self.summary.ignored += 1;
            self.summary.ignored_rows += rows(&scan);
            return Ok(Vec::new());
        }
        let time = scan.time;
        let station = self.station(&scan.sensor, time)?;
        if !time.is_finite() {
            let source = tercel_core::multi::TrackerError::Time { time };
            return Err(PipelineError::Tracker { sensor: scan.sensor.to_string(), source });
        }
        match &mut station.turns {
            Some(turns) => {
                let place = scan.position.map_or(station.position, |[x, y, _]| [x, y].into());
                for look in turns.push(scan, place) {
                    self.arrange(look)?;
                }
            }
            None => self.arrange(scan.into())?,
        }
        self.close_turns(time)?;
        self.release(false)
    }

    /// Tracks the scans that are still held back.
    ///
    /// # Errors
    /// As [`push`](Pipeline::push).
    pub fn finish(&mut self) -> Result<Vec<Track>, PipelineError> {
        self.close_turns(f64::INFINITY)?;
        if let Some((notice, look)) = self.reorder.finish() {
            self.leave_out(notice, &look);
        }
        self.release(true)
    }

    /// Ends the turns of antennas from which nothing has come for a while.
    fn close_turns(&mut self, time: f64) -> Result<(), PipelineError> {
        let turning = self.stations.values_mut().filter_map(|station| station.turns.as_mut());
        let mut over: Vec<Look> = turning.filter_map(|turns| turns.overdue(time)).collect();
        over.sort_by(|a, b| {
            a.scan.time.total_cmp(&b.scan.time).then_with(|| a.scan.sensor.cmp(&b.scan.sensor))
        });
        over.into_iter().try_for_each(|look| self.arrange(look))
    }

    /// Puts a scan in its place among those that wait.
    fn arrange(&mut self, look: Look) -> Result<(), PipelineError> {
        match self.reorder.push(look) {
            Arrival::Taken => {}
            Arrival::LeftOut(notice, look) => self.leave_out(notice, &look),
            Arrival::Restarted(notice, [scans, rows]) => {
                self.summary.late -= scans;
                self.summary.late_rows -= rows;
                self.notices.push(notice);
                self.engine = engine(&self.config)?;
                self.numbers.1 = self.numbers.0;
            }
        }
        Ok(())
    }

    fn leave_out(&mut self, notice: Notice, look: &Look) {
        let rows = rows(&look.scan);
        if let Notice::Ahead { .. } = notice {
            self.summary.ahead += 1;
            self.summary.ahead_rows += rows;
        } else {
            self.summary.late += 1;
            self.summary.late_rows += rows;
        }
        self.notices.push(notice);
    }

    fn release(&mut self, all: bool) -> Result<Vec<Track>, PipelineError> {
        let turning = self.stations.values().filter_map(|station| station.turns.as_ref());
        let oldest = turning.map(|turns| turns.oldest()).fold(f64::INFINITY, f64::min);
        while let Some(look) = self.reorder.pop(all, oldest) {
            let rows = self.track(&look)?;
            if self.held.is_empty() {
                self.held = rows;
            } else {
                self.held.extend(rows);
            }
        }
        Ok(std::mem::take(&mut self.held))
    }

    fn track(&mut self, look: &Look) -> Result<Vec<Track>, PipelineError> {
        let Some(station) = self.stations.get_mut(&look.scan.sensor) else { return Ok(Vec::new()) };
        station.move_to(&look.scan);
        let reports = station.detection.is_reports();
        if let Some(single) = repeats::left_out(&look.scan) {
            self.summary.repeated += (look.scan.detections.len() - single.detections.len()) as u64;
            return self.take(&Look { scan: single, sector: look.sector }, reports);
        }
        self.take(look, reports)
    }

    /// Tracks a scan. An object that reports twice at one time is one object: its second report is taken after the first.
    fn take(&mut self, look: &Look, reports: bool) -> Result<Vec<Track>, PipelineError> {
        let Some([first, again]) = reports.then(|| repeats::named_again(&look.scan)).flatten() else {
            let rows = self.step(look)?;
            self.summary.scans += 1;
            return Ok(rows);
        };
        let mut rows = self.step(&Look { scan: first, sector: look.sector })?;
        rows.extend(self.take(&Look { scan: again, sector: look.sector }, reports)?);
        Ok(rows)
    }

    fn step(&mut self, look: &Look) -> Result<Vec<Track>, PipelineError> {
        let Some(station) = self.stations.get_mut(&look.scan.sensor) else { return Ok(Vec::new()) };
        let mut outcome = self.engine.step(station, look, &mut self.names)?;
        learn(station, &outcome);
        if self.numbers.1 > 0 {
            outcome.rows.iter_mut().for_each(|row| row.track += self.numbers.1);
        }
        self.count(&outcome);
        Ok(outcome.rows)
    }

    /// What serves a sensor: the section of its name, or one made from the default section if it has none.
    fn station(&mut self, name: &Arc<str>, time: f64) -> Result<&mut Station, PipelineError> {
        if !self.stations.contains_key(name) {
            let Some(sensor) = self.config.sensors.get(DEFAULT) else {
                return Err(PipelineError::UnknownSensor { time, sensor: name.to_string() });
            };
            self.stations.insert(Arc::clone(name), Station::new(name, sensor)?);
        }
        // It is there now.
        self.stations
            .get_mut(name)
            .ok_or_else(|| PipelineError::UnknownSensor { time, sensor: name.to_string() })
    }

    fn count(&mut self, outcome: &Outcome) {
        for row in &outcome.rows {
            self.numbers.0 = self.numbers.0.max(row.track);
            if row.status == Status::Confirmed {
                self.confirmed.insert(row.track);
            }
        }
        let summary = &mut self.summary;
        summary.confirmed = self.confirmed.len() as u64;
        for (_, used) in &outcome.uses {
            match used {
                Use::Updated(_) => summary.updates += 1,
                Use::Started(_) => summary.starts += 1,
                Use::Clutter => summary.clutter += 1,
            }
        }
    }
}

/// Rows of a scan in a table.
pub(crate) fn rows(scan: &Scan) -> u64 {
    scan.detections.len().max(1) as u64
}

/// Teaches the clutter map of a sensor with its detections, each in the measure in which no track explains it.
fn learn(station: &mut Station, outcome: &Outcome) {
    let Clutter::Map(map) = &mut station.clutter else { return };
    let doubt = |id: u64| {
        let row = outcome.rows.binary_search_by_key(&id, |row| row.track);
        row.map_or(1.0, |row| 1.0 - outcome.rows[row].existence)
    };
    let unexplained = outcome.uses.iter().filter_map(|(place, used)| match used {
        Use::Updated(id) => Some(((*place)?, doubt(*id))),
        Use::Started(_) | Use::Clutter => Some(((*place)?, 1.0)),
    });
    map.learn(unexplained, &station.detection);
}
