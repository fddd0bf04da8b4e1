//! What a recording says and shows of its sensors.

use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

use nalgebra::Vector2;
use tercel_data::table::{Description, Observation, Scan};

use crate::antenna::{Antenna, Glance};
use crate::config::{SensorConfig, SensorKind};
use crate::notice::Notice;
use crate::sensors::Station;
use crate::turns::{Turns, bearing};

/// How a sensor is to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Understood {
    /// The recording says that it reports.
    Reports,
    /// Its detections have times of their own.
    OneByOne,
    /// Its antenna turns.
    Turns(Antenna),
}

impl Understood {
    /// Takes a sensor so. What was found out, and not said, is worth a notice.
    pub fn apply(self, name: &Arc<str>, station: &mut Station) -> Option<Notice> {
        let sensor = Arc::clone(name);
        match self {
            Understood::Reports => {
                station.report();
                None
            }
            Understood::OneByOne => {
                station.report();
                Some(Notice::Reporting { sensor })
            }
            Understood::Turns(antenna) => {
                station.turns = Some(Turns::of(antenna));
                Some(Notice::Turning { sensor, period: antenna.period })
            }
        }
    }
}

/// Scans of a sensor that say what it is, at least.
const ENOUGH: usize = 8;

/// Share of the scans that hold one detection, where detections have times of their own.
const SINGLE: f64 = 0.9;

/// Scans of a sensor that are looked at, at most.
const LOOKED_AT: usize = 512;

/// Names of the sensors of a recording.
pub(crate) fn sensors(description: &Description, first: &[Scan]) -> BTreeSet<Arc<str>> {
    let said = description.sensors.keys().map(|name| Arc::from(name.as_str()));
    first.iter().map(|scan| Arc::clone(&scan.sensor)).chain(said).collect()
}

/// How a sensor is to be understood, if the configuration leaves that open and the recording does not.
pub(crate) fn sensor(
    name: &Arc<str>,
    config: &SensorConfig,
    description: &Description,
    first: &[Scan],
) -> Option<Understood> {
    if config.kind != SensorKind::Auto || config.scans.is_some() {
        return None;
    }
    if description.sensors.get(&**name).is_some_and(|sensor| sensor.reports) {
        return Some(Understood::Reports);
    }
    let scans: Vec<&Scan> = first.iter().filter(|scan| scan.sensor == *name).take(LOOKED_AT).collect();
    let count = scans.len();
    if count < ENOUGH {
        return None;
    }
    if names_are_seldom(&scans) {
        return Some(Understood::Reports);
    }
    // One detection in each scan, each at a time of its own: a radar that turns, or objects that report. Two may share a
    // time, as clocks of milliseconds go.
    let rising = scans.windows(2).all(|pair| pair[0].time < pair[1].time);
    let filled = scans.iter().all(|scan| !scan.detections.is_empty());
    let scans: Vec<&Scan> = scans.iter().copied().filter(|scan| scan.detections.len() == 1).collect();
    if !rising || !filled || (scans.len() as f64) < SINGLE * count as f64 {
        return None;
    }
    let place = Vector2::from(config.position);
    let glances: Vec<Glance> = scans
        .iter()
        .map(|scan| {
            let place = scan.position.map_or(place, |[x, y, _]| [x, y].into());
            (scan.time, bearing(&scan.detections[0].observation, place))
        })
        .collect();
    let spacing = median(scans.windows(2).map(|pair| pair[1].time - pair[0].time).collect())?;
    let turning = Antenna::of_plots(&glances).filter(|antenna| antenna.period > 1.5 * spacing);
    match turning {
        Some(antenna) => Some(Understood::Turns(antenna)),
        None => interleaved(&scans).then_some(Understood::OneByOne),
    }
}

/// True when a scan names few of the objects: nobody sees a tenth of a picture at a time.
fn names_are_seldom(scans: &[&Scan]) -> bool {
    let detections = scans.iter().flat_map(|scan| &scan.detections);
    let names: HashSet<&Arc<str>> =
        detections.clone().filter_map(|detection| detection.identity.as_ref()).collect();
    let (count, named) =
        (detections.clone().count(), detections.filter(|one| one.identity.is_some()).count());
    names.len() > 1 && named == count && (count as f64) < 0.5 * (scans.len() * names.len()) as f64
}

/// True when several objects take turns: each detection lies far from the one before, and near to one a few before it.
fn interleaved(scans: &[&Scan]) -> bool {
    const LAGS: usize = 12;
    let place = |scan: &Scan| match scan.detections[0].observation {
        Observation::Position { x, y, .. } => Some(Vector2::new(x, y)),
        Observation::Polar { range, bearing, .. } => {
            range.map(|range| range * Vector2::new(bearing.cos(), bearing.sin()))
        }
    };
    let Some(places) = scans.iter().map(|scan| place(scan)).collect::<Option<Vec<_>>>() else { return false };
    let apart =
        |lag: usize| median(places.windows(lag + 1).map(|window| (window[lag] - window[0]).norm()).collect());
    let Some(next) = apart(1) else { return false };
    (2..=LAGS.min(places.len() / 3)).filter_map(apart).any(|later| later < 0.3 * next)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;
    use tercel_data::table::Detection;

    #[test]
    fn two_plots_at_one_time_do_not_hide_an_antenna() {
        let config = Config::parse(
            "[motion]\nconstant_velocity = { acceleration_density = 1.0, speed = 100.0 }\n[sensors.radar]\n\
             measures = { polar = { range_deviation = 50.0, bearing_deviation = 0.01 } }\n\
             clutter = { uniform = { density = 1e-9 } }\n",
        )
        .unwrap();
        let plot = |bearing: f64| {
            Detection::new(0, Observation::Polar { range: Some(9e3), bearing, range_rate: None, z: None })
        };
        let mut scans = Vec::new();
        for turn in 0..16 {
            for bearing in [0.3, 1.9, 2.9, -2.4, -0.9_f64] {
                let time = 4.0
                    * (f64::from(turn) + bearing.rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU);
                scans.push(Scan::new(time, "radar", vec![plot(bearing)]));
            }
        }
        scans[7].detections.push(plot(1.9));
        let found =
            sensor(&"radar".into(), &config.sensors["radar"], &Description::default(), &scans).unwrap();
        assert!(
            matches!(found, Understood::Turns(antenna) if (antenna.period - 4.0).abs() < 0.01),
            "{found:?}"
        );
    }
}
