//! What aircraft and ships say about themselves, as detections and as truth.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;
use tercel_core::geo::{Geodetic, LocalFrame};

use super::{ImportOptions, Imported, LeftOut};
use crate::error::DataError;
use crate::geographic::{frame, middle};
use crate::table::{Description, Detection, Detections, Observation, Scan, SensorDescription, Truth, Truths};

/// One report of an object about itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Report {
    /// Unix seconds.
    pub time: f64,
    pub object: Option<Arc<str>>,
    /// WGS84, rad.
    pub latitude: f64,
    /// WGS84, rad.
    pub longitude: f64,
    /// m, where it was reported.
    pub altitude: Option<f64>,
    /// m/s over ground, and course clockwise from north, rad.
    pub motion: Option<(f64, f64)>,
}

/// The tables of reports, in the order of time.
///
/// Reports of one time are one scan. Without an origin the local frame lies at the median position, on the
/// ellipsoid. An object that does not report its altitude is placed at the one that it reported last, so that its
/// track has no jump, and without one on the ellipsoid; its detection then has no `z`.
pub(super) fn tables(
    mut reports: Vec<Report>,
    sensor: &str,
    left_out: Vec<LeftOut>,
    options: &ImportOptions,
    file: &Arc<str>,
) -> Result<Imported, DataError> {
    reports.sort_by(|a, b| a.time.total_cmp(&b.time));
    let Some(origin) =
        options.origin.or_else(|| middle(reports.iter().map(|report| (report.latitude, report.longitude))))
    else {
        return Ok(Imported {
            truths: options.truths.then(Truths::default),
            left_out,
            ..Imported::default()
        });
    };
    let frame = frame(origin, file)?;
    let sensor: Arc<str> = sensor.into();
    let mut altitudes: HashMap<Option<Arc<str>>, f64> = HashMap::new();
    let mut scans: Vec<Scan> = Vec::new();
    let mut truths = Vec::new();
    for (report, id) in reports.into_iter().zip(0..) {
        if let Some(altitude) = report.altitude {
            altitudes.insert(report.object.clone(), altitude);
        }
        let altitude = altitudes.get(&report.object).copied().unwrap_or(0.0);
        let place = Geodetic { latitude: report.latitude, longitude: report.longitude, altitude };
        let enu = frame.to_enu(&place);
        let z = report.altitude.map(|_| enu.z);
        if let Some(object) = report.object.as_ref().filter(|_| options.truths) {
            truths.push(Truth {
                time: report.time,
                object: Arc::clone(object),
                position: [enu.x, enu.y],
                z,
                velocity: report.motion.and_then(|motion| velocity(&frame, place, motion)),
                extent: None,
            });
        }
        let detection = Detection {
            identity: report.object.clone(),
            truth: report.object,
            ..Detection::new(id, Observation::Position { x: enu.x, y: enu.y, z })
        };
        match scans.last_mut().filter(|scan| scan.time == report.time) {
            Some(scan) => scan.detections.push(detection),
            None => scans.push(Scan::new(report.time, Arc::clone(&sensor), vec![detection])),
        }
    }
    let origin = Some(origin);
    let reports = SensorDescription { reports: true, identity: true, interval: None };
    let description =
        Description { source: Some(sensor.to_string()), sensors: [(sensor.to_string(), reports)].into() };
    Ok(Imported {
        detections: Detections { origin, description, scans },
        truths: options.truths.then_some(Truths { origin, rows: truths }),
        left_out,
        ..Imported::default()
    })
}

/// Velocity in the local frame: north at the object is not quite north at the origin.
fn velocity(frame: &LocalFrame, place: Geodetic, (speed, course): (f64, f64)) -> Option<[f64; 2]> {
    let there = LocalFrame::new(place).ok()?;
    let ecef = there.velocity_from_enu(&Vector3::new(speed * course.sin(), speed * course.cos(), 0.0));
    let enu = frame.velocity_to_enu(&ecef);
    Some([enu.x, enu.y])
}
