//! Positions that aircraft broadcast (ADS-B), as a table: CSV and other text, Parquet, or JSON.
//!
//! | what | names of the column |
//! |---|---|
//! | time (needed) | `time`, `t_unix`, `timestamp`, `datetime`, `now`, `last_contact`: a date in universal time unless it says otherwise, or Unix seconds, milli-, micro- or nanoseconds |
//! | latitude, longitude (needed) | `lat`, `latitude`; `lon`, `longitude`, `long`: degrees. Or both as `lat,lon` in `Position` |
//! | aircraft | `icao24`, `icao`, `hex`, `address`; where there is none, the callsign |
//! | callsign | `callsign`, `flight` |
//! | altitude | feet: `altitude`, `alt`, `alt_geom`, `alt_baro`; metres: `geoaltitude`, `baroaltitude` |
//! | speed over ground | m/s: `velocity`; knots: `gs`, `groundspeed`, `speed` |
//! | track | `heading`, `track`, `true_track`, `direction`: degrees clockwise from north |
//! | time of the position | `lastposupdate`, `time_position`; or its age in `seen_pos`, s |
//! | news of the position | `fresh`: 0 when the position is that of the row before |
//!
//! Names are compared by their letters and digits (`geo_altitude` is `geoaltitude`), and may end in a unit, which then
//! counts: `alt_ft`, `altitude (m)`, `gs_kt`. So state vectors of the OpenSky Network (its database, its Python client, its
//! REST answers), tables of readsb, dump1090 and the library traffic, and exports of the public flight page come in as they
//! are.
//!
//! - One column of altitudes counts for all rows, since altitudes of different kinds lie apart: the first in the order above
//!   that at least half of the rows with an altitude have. `geoaltitude` is in feet in tables of traffic, which have a
//!   `groundspeed`. `ground` is no altitude.
//! - State vectors are made on a grid of time and repeat a position until there is a new one. Repetitions are left out and
//!   counted: rows with `fresh` 0, or with the time of position of the row before of the same aircraft, or, where there is
//!   neither column, with its position.
//! - A report takes the time of its position where that is known.
//!
//! Each report becomes a detection of the sensor `adsb` whose `identity` is the address of the aircraft. `x` and `y` are
//! computed with the altitude, which `z` comes from.

mod altitude;

use std::collections::HashMap;
use std::sync::Arc;

use super::ImportOptions;
use super::clock::{self, Clock};
use super::input::Input;
use super::report::{NOWHERE, Report, Reporter, Step};
use super::table::{DEGREES, Field, KNOTS, METRES_PER_SECOND, Names, PLAIN, Table};
use crate::error::DataError;

const TIME: Names = Names(&[(
    PLAIN,
    &[
        "time",
        "tunix",
        "timestamp",
        "datetime",
        "utc",
        "now",
        "poll",
        "unixtime",
        "lastcontact",
        "timeposition",
        "lastposupdate",
    ],
)]);
pub(super) const LATITUDE: Names = Names(&[(DEGREES, &["lat", "latitude"])]);
const LONGITUDE: Names = Names(&[(DEGREES, &["lon", "longitude", "long", "lng"])]);
/// Latitude and longitude in one column.
pub(super) const POSITION: Names = Names(&[(PLAIN, &["position", "latlon", "coordinates"])]);
/// Columns by which a table is known to be of aircraft.
pub(super) const AIRCRAFT: Names = Names(&[(
    PLAIN,
    &["icao24", "icao", "hex", "hexident", "icaoaddress", "icao24address", "modes", "address"],
)]);
pub(super) const CALLSIGN: Names = Names(&[(PLAIN, &["callsign", "flight"])]);
const SPEED: Names =
    Names(&[(METRES_PER_SECOND, &["velocity"]), (KNOTS, &["gs", "groundspeed", "gspeed", "speed"])]);
const TRACK: Names = Names(&[(DEGREES, &["heading", "track", "truetrack", "direction", "trackangle"])]);
const POSITION_TIME: Names = Names(&[(PLAIN, &["lastposupdate", "timeposition"])]);
const AGE: Names = Names(&[(PLAIN, &["seenpos"])]);
const FRESH: Names = Names(&[(PLAIN, &["fresh"])]);

/// All names, for files that are read by columns.
pub(super) const NAMES: [&Names; 12] = [
    &TIME,
    &LATITUDE,
    &LONGITUDE,
    &POSITION,
    &AIRCRAFT,
    &CALLSIGN,
    &altitude::NAMES,
    &SPEED,
    &TRACK,
    &POSITION_TIME,
    &AGE,
    &FRESH,
];

/// What an aircraft reported last.
#[derive(Debug, Default)]
struct Last {
    position: Option<[f64; 2]>,
    /// Of the position, s.
    time: Option<f64>,
    callsign: Option<String>,
    /// Names of the flights of the aircraft.
    flights: HashMap<String, Arc<str>>,
}

/// Reads the reports of a table.
pub(super) struct Aircraft {
    table: Table,
    clock: Clock,
    time: Field,
    latitude: Field,
    longitude: Field,
    position: Field,
    aircraft: Field,
    callsign: Field,
    altitude: Field,
    speed: Field,
    track: Field,
    position_time: Field,
    age: Field,
    fresh: Field,
    keep_repeated: bool,
    reported_time: bool,
    split_callsigns: bool,
    notes: Vec<String>,
    known: HashMap<Box<str>, Arc<str>>,
    last: HashMap<Option<Arc<str>>, Last>,
}

impl Aircraft {
    /// Begins to read; times and altitudes are looked at before.
    pub fn new(input: &Input, options: &ImportOptions) -> Result<Self, DataError> {
        let open = || Table::open(input, &NAMES, &options.read);
        let table = open()?;
        let field = |names| table.field(names);
        let (latitude, longitude, position) = (field(&LATITUDE), field(&LONGITUDE), field(&POSITION));
        let both = latitude.present() && longitude.present();
        if !both && !position.present() {
            let needed = [(&LATITUDE, &latitude), (&LONGITUDE, &longitude)];
            let missing = needed.iter().filter(|(_, field)| !field.present());
            return Err(table.missing(&missing.map(|(names, _)| *names).collect::<Vec<_>>()));
        }
        let clock = input.clock(|| clock::settle(open()?, &TIME, &options.read))?;
        let (altitude, note) = altitude::settle(open()?)?;
        let aircraft = field(&AIRCRAFT);
        Ok(Aircraft {
            time: table.column(&clock.column),
            // Without an address the callsign says which aircraft it is.
            aircraft: if aircraft.present() { aircraft } else { field(&CALLSIGN) },
            callsign: field(&CALLSIGN),
            speed: field(&SPEED),
            track: field(&TRACK),
            position_time: field(&POSITION_TIME),
            age: field(&AGE),
            fresh: field(&FRESH),
            latitude,
            longitude,
            position,
            altitude,
            keep_repeated: options.keep_repeated,
            reported_time: options.reported_time,
            split_callsigns: options.split_callsigns,
            notes: note.into_iter().collect(),
            known: HashMap::new(),
            last: HashMap::new(),
            table,
            clock,
        })
    }

    fn object(&mut self) -> Option<Arc<str>> {
        let text = self.table.text(&self.aircraft)?;
        if let Some(known) = self.known.get(text.as_ref()) {
            return Some(Arc::clone(known));
        }
        let object: Arc<str> = text.to_lowercase().into();
        self.known.insert(text.as_ref().into(), Arc::clone(&object));
        Some(object)
    }

    fn place(&self) -> Result<Option<(f64, f64)>, DataError> {
        if self.latitude.present() && self.longitude.present() {
            let latitude = self.table.latitude(&self.latitude)?;
            return Ok(latitude.zip(self.table.longitude(&self.longitude)?));
        }
        self.table.position(&self.position)
    }

    /// The time of the position, where it is known.
    fn position_time(&mut self, reported: f64) -> Result<Option<f64>, DataError> {
        match self.clock.time(&self.table, &self.position_time)? {
            Some(time) => Ok(Some(time)),
            None => Ok(self.table.number(&self.age)?.map(|age| reported - age)),
        }
    }

    fn altitude(&self) -> Result<Option<f64>, DataError> {
        let on_ground = self
            .table
            .text(&self.altitude)
            .is_some_and(|text| text.eq_ignore_ascii_case("ground") || text.eq_ignore_ascii_case("gnd"));
        if on_ground { Ok(None) } else { self.table.number(&self.altitude) }
    }

    /// True when the position is that of an earlier row.
    fn repeats(&self, place: [f64; 2], time: Option<f64>, last: &Last) -> bool {
        if self.fresh.present() {
            let fresh = self.table.text(&self.fresh).unwrap_or_default();
            return ["0", "0.0", "false"].iter().any(|word| fresh.eq_ignore_ascii_case(word));
        }
        let same_place = last.position == Some(place);
        match time {
            Some(time) if self.position_time.present() => last.time == Some(time),
            // Ages are rounded, so that the time of a position is not the same in all rows.
            Some(time) => same_place && last.time.is_none_or(|last| time - last < 1.0),
            None => same_place,
        }
    }
}

impl Reporter for Aircraft {
    fn step(&mut self) -> Result<Step, DataError> {
        if !self.table.advance()? {
            return Ok(Step::End);
        }
        let (reported, place) = (self.clock.time(&self.table, &self.time)?, self.place()?);
        let position_time = match reported {
            Some(reported) => self.position_time(reported)?,
            None => self.clock.time(&self.table, &self.position_time)?,
        };
        let time = if self.reported_time { reported.or(position_time) } else { position_time.or(reported) };
        let (Some(time), Some((latitude, longitude))) = (time, place) else {
            return Ok(Step::LeftOut(NOWHERE));
        };
        let altitude = self.altitude()?;
        let motion = self
            .table
            .number_if_any(&self.speed)
            .zip(self.table.number_if_any(&self.track).map(f64::to_radians));
        let object = self.object();
        let mut last = self.last.remove(&object).unwrap_or_default();
        let repeats = !self.keep_repeated && self.repeats([latitude, longitude], position_time, &last);
        last.time = position_time.or(last.time);
        let mut named = object.clone();
        if !repeats {
            last.position = Some([latitude, longitude]);
            if self.split_callsigns {
                last.callsign = self.table.text(&self.callsign).map(Into::into).or(last.callsign);
                named = flight(object.clone(), &mut last);
            }
        }
        self.last.insert(object, last);
        if repeats {
            return Ok(Step::LeftOut("a repeated position"));
        }
        Ok(Step::Report(Report { time, object: named, latitude, longitude, altitude, motion }))
    }

    fn notes(&self) -> Vec<String> {
        self.clock.notes.iter().chain(&self.notes).cloned().chain(self.table.notes()).collect()
    }
}

/// `3c4591/BOX413`.
fn flight(aircraft: Option<Arc<str>>, last: &mut Last) -> Option<Arc<str>> {
    let (Some(object), Some(callsign)) = (&aircraft, &last.callsign) else { return aircraft };
    let named = || format!("{object}/{callsign}").into();
    Some(Arc::clone(last.flights.entry(callsign.clone()).or_insert_with(named)))
}
