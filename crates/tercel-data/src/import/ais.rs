//! Positions that ships broadcast (AIS), as a table: CSV and other text, Parquet, or JSON.
//!
//! | what | names of the column |
//! |---|---|
//! | time (needed) | `timestampExternal`, `received_at`, `BaseDateTime`, `date_time_utc`, `msgtime`, `time`, `TSTAMP`, `Timestamp`, ...: a date in universal time unless it says otherwise, or Unix seconds, milli-, micro- or nanoseconds |
//! | ship (needed) | `MMSI`, `sourcemmsi`, `userid`, `vessel_id` |
//! | latitude, longitude (needed) | `LAT`, `Latitude`; `LON`, `LONG`, `Longitude`: degrees; longitudes may run to 360 |
//! | course over ground | `COG`, `course`, `courseOverGround`: degrees clockwise from north |
//! | speed over ground | `SOG`, `speed`, `speedOverGround`: knots |
//! | kind of station | `Type of mobile`, `TransceiverClass`, `class`; `message_nr`, `msg_type`: number of the message |
//!
//! Names are compared by their letters and digits, and may end in a unit: `SOG (knots)`, `COG_degrees`. So the exports of
//! MarineCadastre (all years), the Danish Maritime Authority, the Norwegian Coastal Administration, AISHub, Spire,
//! exactEarth, Global Fishing Watch and BarentsWatch come in as they are.
//!
//! - Dates such as `03/05/2024` are read with the day first or the month first as the rest of the file tells. Where
//!   nothing in the file tells, it is refused, unless [`ReadOptions::date_order`](crate::ReadOptions) says it; the Danish
//!   export has the day first.
//! - The second of the minute (0 to 59), which AIS messages carry, is never taken for a time.
//! - Rows whose position is "not available" (latitude 91, longitude 181, or empty) are left out and counted.
//! - Base stations, aids to navigation and aircraft are left out and counted, unless
//!   [`ImportOptions::all_stations`](super::ImportOptions) is set. The number, the kind or the message tells.
//! - A speed of 102.3 knots or a course of 360° is "not available", and so is the speed or course of a report whose other
//!   half is.
//! - The same report from another receiver is left out and counted: one of the same ship at the same time within 10 m, or
//!   within a second and 2 m.
//!
//! Each report becomes a detection of the sensor `ais` whose `identity` is the MMSI. Ships are placed on the ellipsoid and
//! have no `z`.

use std::collections::HashMap;
use std::sync::Arc;

use super::ImportOptions;
use super::clock::{self, Clock};
use super::input::Input;
use super::report::{NOWHERE, Report, Reporter, Step};
use super::station::Station;
use super::table::{DEGREES, Field, KNOT, KNOTS, Names, PLAIN, Table, plain};
use crate::error::DataError;
use crate::options::{DateOrder, ReadOptions};

const TIME: Names = Names(&[(
    PLAIN,
    &[
        "timestampexternal",
        "timestamputc",
        "receivedtime",
        "receivetime",
        "receivedat",
        "timereceived",
        "datetimereceived",
        "rxuxtime",
        "rxtime",
        "msgtime",
        "dtposutc",
        "datetimeutc",
        "basedatetime",
        "datetime",
        "timeutc",
        "tstamp",
        "time",
        "tunix",
        "unixtime",
        "epoch",
        "ts",
        "t",
        "timestamp",
    ],
)]);
/// Columns by which a table is known to be of ships.
pub(super) const SHIP: Names = Names(&[(
    PLAIN,
    &["mmsi", "sourcemmsi", "mmsinumber", "staticdatammsi", "userid", "vesselid", "shipid"],
)]);
const LATITUDE: Names =
    Names(&[(DEGREES, &["latitude", "lat", "positionlatitude", "lastpositionupdatelatitude"])]);
const LONGITUDE: Names = Names(&[(
    DEGREES,
    &["longitude", "lon", "long", "lng", "positionlongitude", "lastpositionupdatelongitude"],
)]);
const COURSE: Names = Names(&[(DEGREES, &["cog", "courseoverground", "course"])]);
const SPEED: Names = Names(&[(KNOTS, &["sog", "speedoverground", "speed"])]);
const KIND: Names = Names(&[(
    PLAIN,
    &["typeofmobile", "transceiverclass", "stationtype", "aisclass", "vesselclass", "class"],
)]);
const MESSAGE: Names = Names(&[(PLAIN, &["messagenr", "messageid", "messagetype", "msgtype", "msgid"])]);

/// All names, for files that are read by columns.
pub(super) const NAMES: [&Names; 8] = [&TIME, &SHIP, &LATITUDE, &LONGITUDE, &COURSE, &SPEED, &KIND, &MESSAGE];

/// Reads the reports of a table.
pub(super) struct Ships {
    table: Table,
    clock: Clock,
    time: Field,
    ship: Field,
    latitude: Field,
    longitude: Field,
    course: Field,
    speed: Field,
    kind: Field,
    message: Field,
    all_stations: bool,
    known: HashMap<Box<str>, (Arc<str>, Station)>,
}

impl Ships {
    /// Begins to read; the times are looked at before.
    pub fn new(input: &Input, options: &ImportOptions) -> Result<Self, DataError> {
        let open = || Table::open(input, &NAMES, &options.read);
        let table = open()?;
        let needed = [&SHIP, &LATITUDE, &LONGITUDE];
        let missing: Vec<&Names> = needed.into_iter().filter(|names| !table.field(names).present()).collect();
        if !missing.is_empty() {
            return Err(table.missing(&missing));
        }
        let danish = table.columns().any(|column| plain(&column.name) == "typeofmobile");
        let order = options.read.date_order.or(danish.then_some(DateOrder::DayFirst));
        let read = ReadOptions { date_order: order, ..options.read.clone() };
        let clock = input.clock(|| clock::settle(open()?, &TIME, &read))?;
        let field = |names| table.field(names);
        Ok(Ships {
            time: table.column(&clock.column),
            ship: field(&SHIP),
            latitude: field(&LATITUDE),
            longitude: field(&LONGITUDE),
            course: field(&COURSE),
            speed: field(&SPEED),
            kind: field(&KIND),
            message: field(&MESSAGE),
            all_stations: options.all_stations,
            known: HashMap::new(),
            table,
            clock,
        })
    }

    /// The number of the ship in the row and what it says of the station.
    fn ship(&mut self) -> Option<(Arc<str>, Station)> {
        let text = self.table.text(&self.ship)?;
        if let Some(known) = self.known.get(text.as_ref()) {
            return Some(known.clone());
        }
        let number = number(&text);
        let known = (Arc::from(number.as_str()), Station::of_number(&number));
        self.known.insert(text.as_ref().into(), known.clone());
        Some(known)
    }

    /// What the row says of its station beside the number.
    fn station(&self) -> Station {
        let kind = self.table.text(&self.kind).map_or(Station::Ship, |kind| Station::of_kind(&kind));
        match self.table.number_if_any(&self.message) {
            Some(message) if kind == Station::Ship => Station::of_message(message as u64),
            _ => kind,
        }
    }

    /// Speed and course, unless they are "not available".
    fn motion(&self) -> Option<(f64, f64)> {
        motion(self.table.number_if_any(&self.speed), self.table.number_if_any(&self.course))
    }
}

/// Speed (m/s) and course (degrees) of a report, unless they are "not available". The course in rad.
pub(super) fn motion(speed: Option<f64>, course: Option<f64>) -> Option<(f64, f64)> {
    const NO_SPEED: f64 = 102.25 * KNOT;
    const NO_COURSE: f64 = 360.0;
    let speed = speed.filter(|speed| (0.0..NO_SPEED).contains(speed));
    let course = course.filter(|course| (0.0..NO_COURSE).contains(course));
    speed.zip(course.map(f64::to_radians))
}

/// The number of a ship without blanks and without the point that programs give to whole numbers.
fn number(text: &str) -> String {
    let bare: String = text.chars().filter(|c| !c.is_whitespace() && *c != '\'').collect();
    match bare.parse::<f64>() {
        Ok(number)
            if bare.contains(['.', 'e', 'E']) && number.fract() == 0.0 && (0.0..1e15).contains(&number) =>
        {
            format!("{number}")
        }
        _ => bare,
    }
}

impl Reporter for Ships {
    fn step(&mut self) -> Result<Step, DataError> {
        if !self.table.advance()? {
            return Ok(Step::End);
        }
        let ship = self.ship();
        if !self.all_stations {
            let by_number = ship.as_ref().map_or(Station::Ship, |(_, station)| *station);
            let station = if by_number == Station::Ship { self.station() } else { by_number };
            if let Some(reason) = station.reason() {
                return Ok(Step::LeftOut(reason));
            }
        }
        let time = self.clock.time(&self.table, &self.time)?;
        let (latitude, longitude) =
            (self.table.latitude(&self.latitude)?, self.table.longitude(&self.longitude)?);
        let (Some(time), Some(latitude), Some(longitude)) = (time, latitude, longitude) else {
            return Ok(Step::LeftOut(NOWHERE));
        };
        let object = ship.map(|(object, _)| object);
        Ok(Step::Report(Report { time, object, latitude, longitude, altitude: None, motion: self.motion() }))
    }

    fn notes(&self) -> Vec<String> {
        self.clock.notes.iter().cloned().chain(self.table.notes()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_ships_are_digits_alone() {
        for text in ["219000101", "219 000 101", "219000101.0", "2.19000101E8", "'219000101"] {
            assert_eq!(number(text), "219000101", "{text}");
        }
        assert_eq!(number("002190017"), "002190017");
        assert_eq!(number("a1b2"), "a1b2");
    }
}
