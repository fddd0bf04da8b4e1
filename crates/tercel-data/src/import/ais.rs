//! Positions that ships broadcast (AIS), as CSV.
//!
//! | what | names of the column |
//! |---|---|
//! | time (needed) | `Time`, `Timestamp`, `BaseDateTime`, `base_date_time`, `datetime`, `t_unix`: Unix seconds, or a date in universal time (also `31/12/2019 23:59:58`) |
//! | ship (needed) | `MMSI` |
//! | latitude, longitude (needed) | `LAT`, `Latitude`, `Latitude_degrees`; `LON`, `Longitude`, `Longitude_degrees`: degrees |
//! | course over ground | `COG`, `COG_degrees`: degrees clockwise from north |
//! | speed over ground | `SOG`, `SOG_knots`: knots |
//!
//! So the exports of MarineCadastre and of the Danish Maritime Authority come in as they are. Capitals do not
//! matter. Rows whose position is "not available" (latitude 91, longitude 181, or empty) are left out, as are
//! rows that repeat the time and position of the same ship, which happens when several shore stations heard it.
//! A speed of 102.3 knots or a course of 360° is "not available", too.
//!
//! Each report becomes a detection of the sensor `ais` whose `truth` is the MMSI of the ship. Ships are placed on
//! the ellipsoid and have no `z`.

use std::collections::HashMap;
use std::io::{BufRead, Read};
use std::path::Path;
use std::sync::Arc;

use super::cooperative::{self, Report};
use super::fields::{Field, KNOT, Names, Report as Line, Reports};
use super::{ImportOptions, Imported, LeftOut, latitude, longitude};
use crate::error::DataError;
use crate::format::{decompressed, open};

const TIME: Names = &[
    ("time", 1.0),
    ("timestamp", 1.0),
    ("basedatetime", 1.0),
    ("base_date_time", 1.0),
    ("datetime", 1.0),
    ("t_unix", 1.0),
];
pub(super) const SHIP: Names = &[("mmsi", 1.0)];
const LATITUDE: Names = &[("lat", 1.0), ("latitude", 1.0), ("latitude_degrees", 1.0)];
const LONGITUDE: Names = &[("lon", 1.0), ("longitude", 1.0), ("longitude_degrees", 1.0)];
const COURSE: Names = &[("cog", 1.0), ("cog_degrees", 1.0)];
const SPEED: Names = &[("sog", KNOT), ("sog_knots", KNOT)];

/// Reads a file.
///
/// # Errors
/// A [`DataError`] that names the line and the column.
pub fn read(path: &Path, options: &ImportOptions) -> Result<Imported, DataError> {
    let (file, mut reader) = open(path)?;
    from_lines(reader.as_mut(), &file, options)
}

/// Reads a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] that names the line and the column.
pub fn read_from(reader: impl Read, name: &str, options: &ImportOptions) -> Result<Imported, DataError> {
    let file: Arc<str> = name.into();
    let mut reader = decompressed(reader, &file)?;
    from_lines(reader.as_mut(), &file, options)
}

fn from_lines(
    reader: &mut dyn BufRead,
    file: &Arc<str>,
    options: &ImportOptions,
) -> Result<Imported, DataError> {
    let mut lines = Reports::new(reader, file)?;
    let [time, ship, north, east] = lines.needed([TIME, SHIP, LATITUDE, LONGITUDE])?;
    let (course, speed) = (lines.field(COURSE), lines.field(SPEED));
    let mut last = HashMap::new();
    let mut reports = Vec::new();
    let (mut nowhere, mut repeated) = (0, 0);
    while let Some(line) = lines.next()? {
        let place = (line.time(&time)?, latitude(&line, &north)?, longitude(&line, &east)?);
        let (Some(time), Some(latitude), Some(longitude)) = place else {
            nowhere += 1;
            continue;
        };
        let object: Option<Arc<str>> = line.text(&ship).map(Arc::from);
        let said = [time, latitude, longitude];
        if last.insert(object.clone(), said) == Some(said) && !options.keep_repeated {
            repeated += 1;
            continue;
        }
        let motion = motion(&line, &speed, &course)?;
        reports.push(Report { time, object, latitude, longitude, altitude: None, motion });
    }
    let left_out = LeftOut::list([("without a time or position", nowhere), ("a repeated report", repeated)]);
    let imported = cooperative::tables(reports, "ais", left_out, options, file)?;
    Ok(Imported { notes: lines.notes(), ..imported })
}

/// Speed and course, unless they are "not available".
fn motion(line: &Line<'_>, speed: &Field, course: &Field) -> Result<Option<(f64, f64)>, DataError> {
    const NO_SPEED: f64 = 102.25 * KNOT;
    const NO_COURSE: f64 = 360.0;
    let speed = line.number(speed)?.filter(|speed| (0.0..NO_SPEED).contains(speed));
    let course = line.number(course)?.filter(|course| (0.0..NO_COURSE).contains(course));
    Ok(speed.zip(course.map(f64::to_radians)))
}
