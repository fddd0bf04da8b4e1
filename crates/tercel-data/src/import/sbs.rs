//! Messages of a BaseStation feed (SBS-1, port 30003 of dump1090 and others): lines such as
//! `MSG,3,1,1,4CA2D6,1,2024/03/05,10:00:00.000,2024/03/05,10:00:00.000,,36089,,,47.45,8.55,,,0,0,0,0`.
//!
//! | what | from |
//! |---|---|
//! | time | date and time at which the message was generated; where empty, those at which it was logged. Universal time |
//! | identity | the address (`4ca2d6`) |
//! | position | latitude and longitude of a message; each message with a position is a report |
//! | altitude | feet, of the same message |
//! | velocity | ground speed (knots) and track of the last message of the aircraft that had them, at most 10 s ago |
//!
//! Messages without a position are left out and counted: those of callsigns, velocities and altitudes alone, whose content
//! belongs to the positions around them. So are lines of other kinds (`SEL`, `ID`, `AIR`, `STA`, `CLK`), and positions that
//! repeat the last one of the aircraft within a second. Lines that begin with none of these are refused.

use std::collections::HashMap;
use std::io::BufRead;
use std::sync::Arc;

use super::ImportOptions;
use super::input::Input;
use super::report::{NOWHERE, Report, Reporter, Step};
use super::table::{FOOT, KNOT, SKIP};
use crate::error::{DataError, Place, Refusal};
use crate::source::{Text, read_error, text};
use crate::time::Moment;

/// Cells of a message, counted from 0.
const ADDRESS: usize = 4;
const GENERATED: usize = 6;
const LOGGED: usize = 8;
const CALLSIGN: usize = 10;
const ALTITUDE: usize = 11;
const SPEED: usize = 12;
const TRACK: usize = 13;
const LATITUDE: usize = 14;
const LONGITUDE: usize = 15;

/// A velocity older than this is another one, s.
const FRESH: f64 = 10.0;

/// What is known of an aircraft beside its position.
#[derive(Debug)]
struct Known {
    object: Arc<str>,
    callsign: Option<String>,
    flight: Option<Arc<str>>,
    motion: Option<(f64, (f64, f64))>,
    last: Option<(f64, f64, f64)>,
}

/// Reads the messages of a file.
pub(super) struct Messages {
    text: Text<'static>,
    file: Arc<str>,
    line: String,
    number: u64,
    aircraft: HashMap<String, Known>,
    split_callsigns: bool,
    keep_repeated: bool,
}

impl Messages {
    /// Begins to read.
    pub fn new(input: &Input, options: &ImportOptions) -> Result<Self, DataError> {
        let file = Arc::clone(&input.name);
        Ok(Messages {
            text: text(input.open()?, &file)?,
            file,
            line: String::new(),
            number: 0,
            aircraft: HashMap::new(),
            split_callsigns: options.split_callsigns,
            keep_repeated: options.keep_repeated,
        })
    }

    fn message(&mut self, line: &str) -> Result<Step, DataError> {
        let cells =
            Cells { cells: line.split(',').map(str::trim).collect(), file: &self.file, line: self.number };
        match cells.cells[0] {
            "MSG" => {}
            "SEL" | "ID" | "AIR" | "STA" | "CLK" => {
                return Ok(Step::LeftOut("a line that is no message (SEL, ID, AIR, STA, CLK)"));
            }
            _ => return Err(cells.refuse_line()),
        }
        if cells.cells.len() <= LONGITUDE {
            return Err(cells.refuse_line());
        }
        let time = match cells.time(GENERATED)? {
            Some(time) => Some(time),
            None => cells.time(LOGGED)?,
        };
        let address = cells.cells[ADDRESS].to_lowercase();
        let (Some(time), false) = (time, address.is_empty()) else { return Ok(Step::LeftOut(NOWHERE)) };
        let known = self.aircraft.entry(address).or_insert_with_key(|address| Known {
            object: address.as_str().into(),
            callsign: None,
            flight: None,
            motion: None,
            last: None,
        });
        if let Some(callsign) =
            cells.get(CALLSIGN).filter(|callsign| known.callsign.as_deref() != Some(callsign))
        {
            known.flight = Some(format!("{}/{callsign}", known.object).into());
            known.callsign = Some(callsign.to_owned());
        }
        let motion = cells.number(SPEED)?.zip(cells.number(TRACK)?);
        if let Some((speed, track)) = motion {
            known.motion = Some((time, (speed * KNOT, track.to_radians())));
        }
        let place = (cells.degrees(LATITUDE, 90.0)?, cells.degrees(LONGITUDE, 180.0)?);
        let (Some(latitude), Some(longitude)) = place else {
            return Ok(Step::LeftOut("a message without a position"));
        };
        let repeats = known.last.is_some_and(|(last, north, east)| {
            (time - last).abs() < 1.0 && (north, east) == (latitude, longitude)
        });
        if repeats && !self.keep_repeated {
            return Ok(Step::LeftOut("a repeated position"));
        }
        known.last = Some((time, latitude, longitude));
        let object = if self.split_callsigns { known.flight.as_ref() } else { None }.unwrap_or(&known.object);
        Ok(Step::Report(Report {
            time,
            object: Some(Arc::clone(object)),
            latitude,
            longitude,
            altitude: cells.number(ALTITUDE)?.map(|feet| feet * FOOT),
            motion: known.motion.filter(|(at, _)| (time - at).abs() <= FRESH).map(|(_, motion)| motion),
        }))
    }
}

impl Reporter for Messages {
    fn step(&mut self) -> Result<Step, DataError> {
        let mut line = std::mem::take(&mut self.line);
        line.clear();
        let read = self.text.reader.read_line(&mut line).map_err(|error| read_error(&self.file, error))?;
        self.number += 1;
        let step = match line.trim() {
            _ if read == 0 => Ok(Step::End),
            "" => Ok(Step::Used),
            line => self.message(line),
        };
        self.line = line;
        step
    }

    fn notes(&self) -> Vec<String> {
        self.text.note().into_iter().collect()
    }
}

/// The cells of one message.
struct Cells<'a> {
    cells: Vec<&'a str>,
    file: &'a Arc<str>,
    line: u64,
}

impl<'a> Cells<'a> {
    fn get(&self, at: usize) -> Option<&'a str> {
        self.cells.get(at).copied().filter(|cell| !cell.is_empty())
    }

    fn number(&self, at: usize) -> Result<Option<f64>, DataError> {
        let Some(cell) = self.get(at) else { return Ok(None) };
        match cell.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(self.refuse(at, cell, "a number")),
        }
    }

    /// Degrees in rad.
    fn degrees(&self, at: usize, limit: f64) -> Result<Option<f64>, DataError> {
        match self.number(at)? {
            Some(degrees) if degrees.abs() > limit => {
                Err(self.refuse(at, self.cells[at], &format!("degrees in [-{limit}, {limit}]")))
            }
            degrees => Ok(degrees.map(f64::to_radians)),
        }
    }

    /// Date and time in two cells.
    fn time(&self, at: usize) -> Result<Option<f64>, DataError> {
        let Some((date, time)) = self.get(at).zip(self.get(at + 1)) else { return Ok(None) };
        match Moment::parse(&format!("{date} {time}")) {
            Some(Moment::Civil(time) | Moment::Instant(time)) => Ok(Some(time)),
            _ => Err(self.refuse(
                at,
                &format!("{date},{time}"),
                "a date and time such as 2024/03/05,10:00:00.000",
            )),
        }
    }

    fn refuse(&self, at: usize, cell: &str, expected: &str) -> DataError {
        let name = match at {
            GENERATED | LOGGED => "date and time",
            ALTITUDE => "altitude",
            SPEED => "ground speed",
            TRACK => "track",
            LATITUDE => "latitude",
            _ => "longitude",
        };
        Refusal::new(format!("`{cell}`"), expected).helped(SKIP).at(Place::line(self.file, self.line), name)
    }

    fn refuse_line(&self) -> DataError {
        DataError::Row {
            place: Place::line(self.file, self.line),
            problem: "the line is no whole message of a BaseStation feed".to_owned(),
            help: SKIP,
        }
    }
}
