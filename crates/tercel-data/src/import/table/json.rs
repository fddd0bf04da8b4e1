//! Tables of reports as JSON: one document, or one on each line.

use std::borrow::Cow;
use std::collections::{HashMap, VecDeque};
use std::io::{BufRead, Read};
use std::sync::Arc;

use serde_json::{Map, Value};

use super::super::input::Input;
use super::Cell;
use crate::error::{DataError, Place};
use crate::source::{Text, read_error, text};

/// Where the rows are in a document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::import) enum Shape {
    /// Objects, alone or in a list: a row each. What is nested in them belongs to their row.
    Objects,
    /// Polls of readsb or dump1090: a list `aircraft`, and its time in `now`; also one aircraft after the other.
    Aircraft,
    /// Answers of the OpenSky Network: lists under `states`, and their time in `time`.
    States,
}

/// Names of the values of a state vector of the OpenSky Network, in their order.
const STATES: [&str; 18] = [
    "icao24",
    "callsign",
    "origin_country",
    "time_position",
    "last_contact",
    "longitude",
    "latitude",
    "baro_altitude",
    "on_ground",
    "velocity",
    "true_track",
    "vertical_rate",
    "sensors",
    "geo_altitude",
    "squawk",
    "spi",
    "position_source",
    "category",
];

/// Names that a poll may have, whichever of them the first aircraft have.
const AIRCRAFT: [&str; 11] =
    ["hex", "flight", "lat", "lon", "alt_geom", "alt_baro", "altitude", "gs", "speed", "track", "seen_pos"];

/// The time of a poll, which comes to each of its rows.
const POLL: &str = "poll";

/// Rows whose keys are looked at to know the columns of objects that have any.
const SAMPLE: usize = 1000;

/// A row that was read ahead and its line, or why it cannot be used.
type Ahead = Result<(Map<String, Value>, u64), DataError>;

/// The rows of JSON documents.
pub(super) struct JsonRows {
    text: Text<'static>,
    file: Arc<str>,
    shape: Shape,
    names: Vec<String>,
    columns: HashMap<String, usize>,
    /// Rows that were read and not taken yet, with their lines.
    ahead: VecDeque<Ahead>,
    row: Vec<Value>,
    /// Line of the row that was taken, and of the last that was read.
    line: u64,
    read: u64,
    /// The whole file is one document.
    whole: bool,
}

impl JsonRows {
    pub fn new(input: &Input, shape: Shape) -> Result<Self, DataError> {
        let file = Arc::clone(&input.name);
        let text = text(input.open()?, &file)?;
        let mut rows = JsonRows {
            text,
            file,
            shape,
            names: Vec::new(),
            columns: HashMap::new(),
            ahead: VecDeque::new(),
            row: Vec::new(),
            line: 0,
            read: 0,
            whole: false,
        };
        while rows.ahead.len() < SAMPLE && rows.read_document()? {}
        rows.name_columns();
        Ok(rows)
    }

    fn name_columns(&mut self) {
        let known: &[&str] = match self.shape {
            Shape::Objects => &[],
            Shape::Aircraft => &AIRCRAFT,
            Shape::States => &STATES,
        };
        let poll = (self.shape != Shape::Objects).then_some(POLL);
        let ahead = self.ahead.iter().flatten().flat_map(|(object, _)| object.keys().map(String::as_str));
        for name in poll.into_iter().chain(known.iter().copied()).chain(ahead) {
            if !self.columns.contains_key(name) {
                self.columns.insert(name.to_owned(), self.names.len());
                self.names.push(name.to_owned());
            }
        }
    }

    /// Reads a document and appends its rows to those ahead; false at the end.
    fn read_document(&mut self) -> Result<bool, DataError> {
        let mut line = String::new();
        loop {
            line.clear();
            self.text.reader.read_line(&mut line).map_err(|error| read_error(&self.file, error))?;
            if line.is_empty() {
                return Ok(false);
            }
            self.read += 1;
            if !line.trim().is_empty() {
                break;
            }
        }
        let first = self.read;
        match serde_json::from_str(&line) {
            Ok(document) => self.expand(document, first),
            // A document over many lines begins with one that is not complete.
            Err(error) if error.is_eof() && first == 1 => {
                self.text.reader.read_to_string(&mut line).map_err(|error| read_error(&self.file, error))?;
                self.whole = true;
                let document = serde_json::from_str(&line).map_err(|error| DataError::Corrupt {
                    place: Place::line(&self.file, error.line() as u64),
                    problem: format!("this is not whole JSON: {error}"),
                    help: "the file may be truncated: write or copy it again",
                })?;
                self.expand(document, first);
            }
            Err(error) => self.ahead.push_back(Err(self.bad_line(first, &error.to_string()))),
        }
        Ok(true)
    }

    fn bad_line(&self, line: u64, problem: &str) -> DataError {
        // The position in the line would make every such row a reason of its own.
        let problem = problem.split(" at line ").next().unwrap_or_default();
        DataError::Row {
            place: Place::line(&self.file, line),
            problem: format!("the line is not JSON: {problem}"),
            help: super::SKIP,
        }
    }

    /// Appends the rows of a document to those ahead.
    fn expand(&mut self, document: Value, line: u64) {
        match (self.shape, document) {
            (_, Value::Array(documents)) => {
                documents.into_iter().for_each(|document| self.expand(document, line));
            }
            (Shape::Aircraft, Value::Object(mut poll)) => {
                let now = poll.remove("now").unwrap_or(Value::Null);
                match poll.remove("aircraft") {
                    Some(Value::Array(aircraft)) => {
                        aircraft.into_iter().for_each(|object| self.append(object, &now, line));
                    }
                    _ => self.append(Value::Object(poll), &now, line),
                }
            }
            (Shape::States, Value::Object(mut answer)) => {
                let time = answer.remove("time").unwrap_or(Value::Null);
                if let Some(Value::Array(states)) = answer.remove("states") {
                    states.into_iter().for_each(|state| self.append(named(state), &time, line));
                }
            }
            (Shape::Objects, Value::Object(mut object)) => match object.remove("features") {
                Some(features @ Value::Array(_)) => self.expand(features, line),
                Some(other) => self.append(other, &Value::Null, line),
                None => self.append(Value::Object(object), &Value::Null, line),
            },
            (_, other) => {
                let problem = format!("expected an object, found {}", kind(&other));
                self.ahead.push_back(Err(self.bad_line(line, &problem)));
            }
        }
    }

    fn append(&mut self, object: Value, time: &Value, line: u64) {
        let mut row = Map::new();
        flatten(object, &mut row);
        if self.shape != Shape::Objects && !time.is_null() {
            row.insert(POLL.to_owned(), time.clone());
        }
        self.ahead.push_back(Ok((row, line)));
    }
}

/// A state vector under the names of its values.
fn named(state: Value) -> Value {
    match state {
        Value::Array(values) => {
            Value::Object(STATES.iter().map(|name| (*name).to_owned()).zip(values).collect())
        }
        other => other,
    }
}

/// Brings what is nested in an object to its top; `coordinates` of GeoJSON become longitude and latitude.
fn flatten(value: Value, row: &mut Map<String, Value>) {
    let Value::Object(object) = value else { return };
    let mut nested = Vec::new();
    for (key, value) in object {
        match value {
            Value::Object(_) => nested.push(value),
            Value::Array(mut place) if key == "coordinates" && place.len() >= 2 => {
                row.insert("latitude".to_owned(), place.swap_remove(1));
                row.insert("longitude".to_owned(), place.swap_remove(0));
            }
            _ => {
                row.entry(key).or_insert(value);
            }
        }
    }
    nested.into_iter().for_each(|value| flatten(value, row));
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

impl super::Rows for JsonRows {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn advance(&mut self) -> Result<bool, DataError> {
        while self.ahead.is_empty() {
            if !self.read_document()? {
                return Ok(false);
            }
        }
        let Some(next) = self.ahead.pop_front() else { return Ok(false) };
        let (object, line) = next?;
        self.line = line;
        self.row.clear();
        self.row.resize(self.names.len(), Value::Null);
        for (key, value) in object {
            if let Some(column) = self.columns.get(&key) {
                self.row[*column] = value;
            }
        }
        Ok(true)
    }

    fn cell(&self, column: usize) -> Cell<'_> {
        match self.row.get(column) {
            Some(Value::Number(number)) => number.as_f64().map_or(Cell::Nothing, Cell::Number),
            Some(Value::String(text)) => Cell::Text(Cow::Borrowed(text)),
            Some(Value::Bool(value)) => Cell::Text(Cow::Borrowed(if *value { "true" } else { "false" })),
            _ => Cell::Nothing,
        }
    }

    fn place(&self) -> Place {
        // Within one document the lines are not known.
        if self.whole { Place::whole(&self.file) } else { Place::line(&self.file, self.line) }
    }

    fn notes(&self) -> Vec<String> {
        self.text.note().into_iter().collect()
    }
}
