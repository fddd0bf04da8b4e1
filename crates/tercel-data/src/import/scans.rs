//! Reports of objects about themselves as scans in a local frame.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;
use tercel_core::geo::{Geodetic, LocalFrame};

use super::report::Report;
use super::source::Family;
use crate::error::DataError;
use crate::geographic::frame;
use crate::table::{Detection, Observation, Origin, Scan, Truth};

/// Turns reports, which come in the order of time, into scans.
///
/// An object that does not report its altitude is placed at the one that it reported last, so that its track has no jump,
/// and without one on the ellipsoid; its detection then has no `z`.
pub(super) struct Framing {
    frame: LocalFrame,
    family: &'static Family,
    sensor: Arc<str>,
    keep_repeated: bool,
    /// The truth, if it is asked for: what objects say of themselves.
    pub truths: Option<Vec<Truth>>,
    /// Reports that another receiver had heard as well.
    pub repeated: usize,
    objects: HashMap<Arc<str>, Object>,
    next: u64,
}

/// What an object reported last.
struct Object {
    report: Report,
    altitude: Option<f64>,
}

impl Framing {
    pub fn new(
        origin: Origin,
        family: &'static Family,
        keep_repeated: bool,
        file: &Arc<str>,
    ) -> Result<Self, DataError> {
        Ok(Framing {
            frame: frame(origin, file)?,
            family,
            sensor: family.sensor.into(),
            keep_repeated,
            truths: None,
            repeated: 0,
            objects: HashMap::new(),
            next: 0,
        })
    }

    /// The detection of a report; nothing if it is one that another receiver heard as well.
    pub fn detection(&mut self, report: Report) -> Option<Detection> {
        let altitude = match &report.object {
            None => report.altitude,
            Some(object) => match self.objects.get_mut(object) {
                Some(known) => {
                    if !self.keep_repeated && same_report(&known.report, &report, self.family) {
                        self.repeated += 1;
                        return None;
                    }
                    known.altitude = report.altitude.or(known.altitude);
                    known.report = report.clone();
                    known.altitude
                }
                None => {
                    let known = Object { report: report.clone(), altitude: report.altitude };
                    self.objects.insert(Arc::clone(object), known);
                    report.altitude
                }
            },
        };
        let place = Geodetic {
            latitude: report.latitude,
            longitude: report.longitude,
            altitude: altitude.unwrap_or(0.0),
        };
        let enu = self.frame.to_enu(&place);
        let z = report.altitude.map(|_| enu.z);
        let mut truth = None;
        if let (Some(truths), Some(object)) = (&mut self.truths, &report.object) {
            truths.push(Truth {
                time: report.time,
                object: Arc::clone(object),
                position: [enu.x, enu.y],
                z,
                velocity: report.motion.and_then(|motion| velocity(&self.frame, place, motion)),
                extent: None,
            });
            truth = Some(Arc::clone(object));
        }
        let id = self.next;
        self.next += 1;
        Some(Detection {
            identity: report.object,
            truth,
            ..Detection::new(id, Observation::Position { x: enu.x, y: enu.y, z })
        })
    }

    /// A scan of the sensor.
    pub fn scan(&self, time: f64, detections: Vec<Detection>) -> Scan {
        Scan::new(time, Arc::clone(&self.sensor), detections)
    }
}

/// True when a report is one before it of the same object, heard by another receiver.
pub(super) fn same_report(before: &Report, report: &Report, family: &Family) -> bool {
    /// An object cannot be at two places, m.
    const AT_ONE_TIME: f64 = 10.0;
    /// Metres in a radian of latitude.
    const RADIAN: f64 = 6_371_000.0;
    let later = (report.time - before.time).abs();
    if later > 1.0 {
        return false;
    }
    let apart = if later == 0.0 { AT_ONE_TIME } else { family.rounding };
    let north = report.latitude - before.latitude;
    let east = (report.longitude - before.longitude) * report.latitude.cos();
    north.hypot(east) * RADIAN <= apart
}

/// Velocity in the local frame: north at the object is not quite north at the origin.
fn velocity(frame: &LocalFrame, place: Geodetic, (speed, course): (f64, f64)) -> Option<[f64; 2]> {
    let there = LocalFrame::new(place).ok()?;
    let ecef = there.velocity_from_enu(&Vector3::new(speed * course.sin(), speed * course.cos(), 0.0));
    let enu = frame.velocity_to_enu(&ecef);
    Some([enu.x, enu.y])
}
