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
    if scans.len() < ENOUGH {
        return None;
    }
    if names_are_seldom(&scans) {
        return Some(Understood::Reports);
    }
    // One detection in each scan, each at a time of its own: a radar that turns, or objects that report.
    let single = scans.iter().all(|scan| scan.detections.len() == 1);
    let rising = scans.windows(2).all(|pair| pair[0].time < pair[1].time);
    if !single || !rising {
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
