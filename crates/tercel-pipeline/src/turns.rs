//! Plots that come one by one while an antenna turns, gathered into scans.

use std::collections::VecDeque;

use nalgebra::Vector2;
use tercel_core::sensor::wrapped;
use tercel_data::table::{Observation, Scan};

use crate::antenna::{Antenna, Glance};

/// Gathers the plots of one sensor into the sectors that its antenna passes; into whole turns, where they do not show how it
/// turns.
#[derive(Debug, Clone)]
pub(crate) struct Turns {
    period: f64,
    antenna: Option<Antenna>,
    /// The last plots, by which the antenna is found.
    glances: VecDeque<Glance>,
    open: Option<Open>,
}

/// Plots of a sector that is not over.
#[derive(Debug, Clone)]
struct Open {
    scan: Scan,
    start: f64,
    end: f64,
}

/// A scan, and what it looked at.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Look {
    pub scan: Scan,
    /// Bearings from here counter-clockwise over this width, rad; nothing stands for everything.
    pub sector: Option<(f64, f64)>,
}

impl From<Scan> for Look {
    fn from(scan: Scan) -> Self {
        Look { scan, sector: None }
    }
}

/// Sectors of a turn.
const SECTORS: f64 = 8.0;

/// Plots that are remembered to find the antenna.
const GLANCES: usize = 64;

impl Turns {
    /// For an antenna that turns once in `period` seconds.
    pub fn new(period: f64) -> Self {
        Turns { period, antenna: None, glances: VecDeque::new(), open: None }
    }

    /// Of an antenna that is known.
    pub fn of(antenna: Antenna) -> Self {
        Turns { antenna: Some(antenna), ..Turns::new(antenna.period) }
    }

    /// Takes in plots, and returns the scans that they end: the open one, and those of the sectors in which nothing was seen.
    /// `place` is where the sensor stands.
    pub fn push(&mut self, scan: Scan, place: Vector2<f64>) -> Vec<Look> {
        for detection in &scan.detections {
            let bearing = bearing(&detection.observation, place);
            self.learn((detection.time.unwrap_or(scan.time), bearing));
        }
        if let Some(open) = &mut self.open {
            if scan.time < open.start {
                // Too late for its own turn: whoever puts scans in order says so.
                return vec![scan.into()];
            }
            if scan.time < open.end {
                open.join(scan);
                return Vec::new();
            }
        }
        let mut looks = Vec::new();
        let length = if self.antenna.is_some() { self.period / SECTORS } else { self.period };
        let mut start = scan.time;
        if let Some((look, end)) = self.close() {
            // Sectors follow each other without a gap, for as long as plots come.
            if self.antenna.is_some() && scan.time - end < self.period {
                start = end;
                while scan.time >= start + length {
                    let empty = Scan { time: start + length, detections: Vec::new(), ..look.scan.clone() };
                    looks.push(Look { scan: empty, sector: self.sector(start, start + length) });
                    start += length;
                }
            }
            looks.insert(0, look);
        }
        self.open = Some(Open { scan, start, end: start + length });
        looks
    }

    /// The scan that is open, when nothing more comes.
    pub fn finish(&mut self) -> Option<Look> {
        self.close().map(|(look, _)| look)
    }

    /// The scan that is open, if what else comes is newer than all that can belong to it.
    pub fn overdue(&mut self, time: f64) -> Option<Look> {
        let over = self.open.as_ref().is_some_and(|open| time > open.end + self.period);
        if over { self.finish() } else { None }
    }

    /// Plots of the scan that is open.
    pub fn held(&self) -> usize {
        self.open.as_ref().map_or(0, |open| open.scan.detections.len())
    }

    /// No scan that is still to come is older than this, s.
    pub fn oldest(&self) -> f64 {
        self.open.as_ref().map_or(f64::INFINITY, |open| open.scan.time)
    }

    fn close(&mut self) -> Option<(Look, f64)> {
        let Open { scan, start, end } = self.open.take()?;
        Some((Look { scan, sector: self.sector(start, end) }, end))
    }

    /// What the antenna looks at in this time.
    fn sector(&self, start: f64, end: f64) -> Option<(f64, f64)> {
        let antenna = self.antenna?;
        let from = if antenna.sense > 0.0 { antenna.bearing(start) } else { antenna.bearing(end) };
        Some((wrapped(from), std::f64::consts::TAU * (end - start) / self.period))
    }

    fn learn(&mut self, glance: Glance) {
        match &mut self.antenna {
            Some(antenna) => antenna.follow(glance),
            None => {
                if self.glances.len() == GLANCES {
                    self.glances.pop_front();
                }
                self.glances.push_back(glance);
                self.antenna = Antenna::of_period(self.period, self.glances.make_contiguous());
            }
        }
    }
}

impl Open {
    fn join(&mut self, mut more: Scan) {
        let time = self.scan.time.max(more.time);
        for (scan, own) in [(&mut self.scan, false), (&mut more, true)] {
            for detection in &mut scan.detections {
                let seen = detection.time.unwrap_or(scan.time);
                detection.time = (own || seen != time).then_some(seen).filter(|seen| *seen != time);
            }
        }
        self.scan.detections.append(&mut more.detections);
        self.scan.time = time;
        (self.scan.position, self.scan.velocity) = (more.position, more.velocity);
    }
}

/// The bearing of a detection from where its sensor stands.
pub(crate) fn bearing(observation: &Observation, place: Vector2<f64>) -> f64 {
    match observation {
        Observation::Polar { bearing, .. } => *bearing,
        Observation::Position { x, y, .. } => (y - place.y).atan2(x - place.x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tercel_data::table::Detection;

    /// Scans that come out, with their times and numbers of plots, of plots at these times (s).
    fn gathered(turns: &mut Turns, plots: &[(f64, f64)]) -> Vec<(f64, usize)> {
        let plot = |(id, &(time, bearing)): (usize, &(f64, f64))| {
            let observation = Observation::Polar { range: Some(1e4), bearing, range_rate: None, z: None };
            Scan::new(time, "radar", vec![Detection::new(id as u64, observation)])
        };
        let scans = plots.iter().enumerate().map(plot);
        let mut out: Vec<Look> = scans.flat_map(|scan| turns.push(scan, Vector2::zeros())).collect();
        out.extend(turns.finish());
        out.iter().map(|look| (look.scan.time, look.scan.detections.len())).collect()
    }

    #[test]
    fn without_bearings_that_turn_a_scan_is_a_whole_turn() {
        let plots = [(0.0, 0.3), (1.0, 0.1), (3.9, 0.2), (4.0, 0.3), (7.0, 0.1), (13.0, 0.0)];
        assert_eq!(gathered(&mut Turns::new(4.0), &plots), [(3.9, 3), (7.0, 2), (13.0, 1)]);
    }

    #[test]
    fn plots_keep_the_times_at_which_they_were_made() {
        let mut turns = Turns::new(4.0);
        let scan = |time: f64| {
            let observation = Observation::Position { x: 1.0, y: 2.0, z: None };
            Scan::new(time, "radar", vec![Detection::new(time as u64, observation)])
        };
        for time in [0.0, 1.0, 3.0] {
            assert!(turns.push(scan(time), Vector2::zeros()).is_empty());
        }
        let Look { scan, sector } = turns.finish().unwrap();
        let times: Vec<_> = scan.detections.iter().map(|detection| detection.time).collect();
        assert_eq!((scan.time, times, sector), (3.0, vec![Some(0.0), Some(1.0), None], None));
    }

    #[test]
    fn once_the_antenna_is_known_a_scan_is_a_sector_that_holds_its_plots() {
        use std::f64::consts::TAU;
        let mut turns = Turns::new(4.0);
        let bearings = [0.3, 1.9, 2.9, 3.9, 5.4];
        let mut sectors = Vec::new();
        for turn in 0..12 {
            for bearing in bearings {
                let time = (f64::from(turn) + bearing / TAU) * 4.0;
                let observation = Observation::Polar {
                    range: Some(1e4),
                    bearing: wrapped(bearing),
                    range_rate: None,
                    z: None,
                };
                let scan = Scan::new(time, "radar", vec![Detection::new(0, observation)]);
                sectors.extend(turns.push(scan, Vector2::zeros()));
            }
        }
        let seen = |look: &&Look| !look.scan.detections.is_empty();
        let Look { scan, sector } = sectors.iter().rfind(seen).unwrap();
        let (from, width) = sector.unwrap();
        assert!((width - TAU / 8.0).abs() < 1e-9, "{width}");
        for detection in &scan.detections {
            let Observation::Polar { bearing, .. } = detection.observation else { panic!("not polar") };
            let inside = wrapped(bearing - from - 0.5 * width).abs();
            assert!(inside < 0.55 * width, "{inside} of {width}");
        }
    }
}
