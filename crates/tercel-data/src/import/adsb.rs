//! Positions that aircraft broadcast (ADS-B), as CSV in the manner of the OpenSky Network.
//!
//! | what | names of the column |
//! |---|---|
//! | time (needed) | `time`, `t_unix`, `timestamp`, `datetime`: Unix seconds, or a date in universal time |
//! | latitude, longitude (needed) | `lat`, `latitude`; `lon`, `longitude`, `long`: degrees |
//! | aircraft | `icao24`, `icao`, `hex` |
//! | callsign | `callsign`, `flight` |
//! | altitude | `altitude`, `alt_ft`, `altitude_ft` in feet; `geoaltitude`, `baroaltitude` (also with `_`), `altitude_m`, `alt_m` in metres |
//! | speed over ground | `velocity`, `gs_ms` in m/s; `gs_kt`, `groundspeed`, `ground_speed`, `gs` in knots |
//! | track | `heading`, `track_deg`, `track`, `true_track`: degrees clockwise from north |
//! | time of the position | `lastposupdate`, `time_position` |
//! | news of the position | `fresh`: 0 when the position is that of the row before |
//!
//! The first name that is there counts, for all rows, since altitudes of different kinds lie apart.
//!
//! State vectors are made on a grid of time and repeat a position until there is a new one. Repetitions are left
//! out: rows with `fresh` 0, or with the time of position of the row before of the same aircraft, or, where there
//! is neither column, with its position. A report takes the time of its position where that is known.
//!
//! Each report becomes a detection of the sensor `adsb` whose `truth` is the address of the aircraft.

use std::collections::HashMap;
use std::io::{BufRead, Read};
use std::path::Path;
use std::sync::Arc;

use super::cooperative::{self, Report};
use super::fields::{FOOT, Field, KNOT, Names, Report as Line, Reports};
use super::{ImportOptions, Imported, LeftOut, latitude, longitude};
use crate::error::DataError;
use crate::format::{decompressed, open};

const TIME: Names = &[("time", 1.0), ("t_unix", 1.0), ("timestamp", 1.0), ("datetime", 1.0)];
const LATITUDE: Names = &[("lat", 1.0), ("latitude", 1.0)];
const LONGITUDE: Names = &[("lon", 1.0), ("longitude", 1.0), ("long", 1.0)];
pub(super) const AIRCRAFT: Names = &[("icao24", 1.0), ("icao", 1.0), ("hex", 1.0)];
const CALLSIGN: Names = &[("callsign", 1.0), ("flight", 1.0)];
const ALTITUDE: Names = &[
    ("altitude", FOOT),
    ("alt_ft", FOOT),
    ("altitude_ft", FOOT),
    ("geoaltitude", 1.0),
    ("geo_altitude", 1.0),
    ("baroaltitude", 1.0),
    ("baro_altitude", 1.0),
    ("altitude_m", 1.0),
    ("alt_m", 1.0),
];
const SPEED: Names = &[
    ("velocity", 1.0),
    ("gs_ms", 1.0),
    ("gs_kt", KNOT),
    ("groundspeed", KNOT),
    ("ground_speed", KNOT),
    ("gs", KNOT),
];
const TRACK: Names = &[("heading", 1.0), ("track_deg", 1.0), ("track", 1.0), ("true_track", 1.0)];
const POSITION_TIME: Names = &[("lastposupdate", 1.0), ("time_position", 1.0)];
const FRESH: Names = &[("fresh", 1.0)];

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
    let fields = Fields::new(&lines)?;
    let mut aircraft = HashMap::new();
    let mut reports = Vec::new();
    let (mut nowhere, mut repeated) = (0, 0);
    while let Some(line) = lines.next()? {
        let Some(mut report) = fields.report(&line, options)? else {
            nowhere += 1;
            continue;
        };
        let last: &mut Last = aircraft.entry(report.object.clone()).or_default();
        if fields.repeats(&line, &report, last)? && !options.keep_repeated {
            repeated += 1;
            continue;
        }
        last.position = Some([report.latitude, report.longitude]);
        if options.split_callsigns {
            last.callsign = fields.callsign_of(&line).or(last.callsign.take());
            report.object = named(report.object, last.callsign.as_deref());
        }
        reports.push(report);
    }
    let left_out =
        LeftOut::list([("without a time or position", nowhere), ("a repeated position", repeated)]);
    let imported = cooperative::tables(reports, "adsb", left_out, options, file)?;
    Ok(Imported { notes: lines.notes(), ..imported })
}

/// `3c4591/BOX413`.
fn named(aircraft: Option<Arc<str>>, callsign: Option<&str>) -> Option<Arc<str>> {
    match (aircraft, callsign) {
        (Some(aircraft), Some(callsign)) => Some(format!("{aircraft}/{callsign}").into()),
        (aircraft, _) => aircraft,
    }
}

/// What an aircraft reported last.
#[derive(Debug, Default)]
struct Last {
    position: Option<[f64; 2]>,
    position_time: Option<f64>,
    callsign: Option<String>,
}

struct Fields {
    time: Field,
    latitude: Field,
    longitude: Field,
    aircraft: Field,
    callsign: Field,
    altitude: Field,
    speed: Field,
    track: Field,
    position_time: Field,
    fresh: Field,
}

impl Fields {
    fn new(lines: &Reports<'_>) -> Result<Self, DataError> {
        let [time, latitude, longitude] = lines.needed([TIME, LATITUDE, LONGITUDE])?;
        Ok(Fields {
            time,
            latitude,
            longitude,
            aircraft: lines.field(AIRCRAFT),
            callsign: lines.field(CALLSIGN),
            altitude: lines.field(ALTITUDE),
            speed: lines.field(SPEED),
            track: lines.field(TRACK),
            position_time: lines.field(POSITION_TIME),
            fresh: lines.field(FRESH),
        })
    }

    /// The report of a line, if it has a time and a position.
    fn report(&self, line: &Line<'_>, options: &ImportOptions) -> Result<Option<Report>, DataError> {
        let mut time = line.time(&self.time)?;
        if !options.reported_time {
            time = line.time(&self.position_time)?.or(time);
        }
        let (latitude, longitude) = (latitude(line, &self.latitude)?, longitude(line, &self.longitude)?);
        let (Some(time), Some(latitude), Some(longitude)) = (time, latitude, longitude) else {
            return Ok(None);
        };
        let motion = line.number(&self.speed)?.zip(line.number(&self.track)?.map(f64::to_radians));
        let object = line.text(&self.aircraft).map(|text| text.to_lowercase().into());
        Ok(Some(Report { time, object, latitude, longitude, altitude: line.number(&self.altitude)?, motion }))
    }

    fn callsign_of(&self, line: &Line<'_>) -> Option<String> {
        line.text(&self.callsign)
    }

    /// True when the position is that of an earlier row.
    fn repeats(&self, line: &Line<'_>, report: &Report, last: &mut Last) -> Result<bool, DataError> {
        if self.fresh.present() {
            let fresh = line.text(&self.fresh).unwrap_or_default();
            return Ok(["0", "0.0", "false"].iter().any(|word| fresh.eq_ignore_ascii_case(word)));
        }
        if let Some(time) = line.time(&self.position_time)? {
            return Ok(last.position_time.replace(time) == Some(time));
        }
        Ok(last.position == Some([report.latitude, report.longitude]))
    }
}
