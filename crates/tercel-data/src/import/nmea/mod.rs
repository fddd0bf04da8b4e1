//! Sentences of AIS receivers (NMEA 0183): `!AIVDM,1,1,,A,13@ne9OP1p0kA@0P6LH1hP01P000,0*68`.
//!
//! Positions of the messages 1, 2, 3 (class A), 18, 19 (class B), 9 (aircraft) and 27 (far away) come in; so do those of
//! `!AIVDO` and of other talkers (`!BSVDM`, `!ABVDM`). What becomes of the parts:
//!
//! | what | from |
//! |---|---|
//! | time | `c:` in a tag block (`\s:rx1,c:1709632800*07\!AIVDM...`); a time before the sentence or in the fields after its checksum: Unix seconds or milliseconds, or a date in universal time |
//! | identity | the MMSI of the message |
//! | position | longitude and latitude of the message |
//! | altitude | of message 9, m |
//! | velocity | speed and course over ground of the message |
//!
//! - The parts of a message over several sentences are joined by their number, channel and count; it takes the time of the
//!   first part that has one.
//! - Sentences whose checksum is wrong or missing are left out and counted, and so are messages without a position, messages
//!   of which a part is missing, base stations, aids to navigation and aircraft (unless
//!   [`ImportOptions::all_stations`](super::ImportOptions) is set), and other lines.
//! - Where no sentence of a file has a time, the second of the minute in the messages counts, from the first message on: a note
//!   says so. Pauses of more than half a minute are lost then, so a file with times is better.

mod payload;
mod sentence;

use std::collections::{HashMap, VecDeque};
use std::io::BufRead;
use std::sync::Arc;

use self::payload::{Message, Position};
use self::sentence::Sentence;
pub(super) use self::sentence::sentence_in;
use super::ais::motion;
use super::input::Input;
use super::report::{Report, Reporter, Step};
use super::station::Station;
use super::{ImportOptions, table};
use crate::error::DataError;
use crate::source::{Text, read_error, text};

/// Sentences that are read ahead to know whether any has a time.
const SAMPLE: usize = 1000;

/// Sentences that may lie between the parts of a message.
const PARTS_WITHIN: u64 = 200;

/// Reads the sentences of a file.
pub(super) struct Sentences {
    text: Text<'static>,
    file: Arc<str>,
    line: String,
    /// Lines that were read ahead.
    ahead: VecDeque<String>,
    /// Sentences that began a message over several.
    parts: HashMap<(u8, u8, String), Parts>,
    /// Parts of messages that were given up and not counted yet.
    lost: usize,
    read: u64,
    all_stations: bool,
    /// Counts the seconds where no sentence has a time.
    seconds: Option<Seconds>,
    known: HashMap<u32, Arc<str>>,
}

/// The sentences of one message so far.
struct Parts {
    payloads: Vec<Option<String>>,
    time: Option<f64>,
    begun: u64,
}

impl Sentences {
    /// Begins to read.
    pub fn new(input: &Input, options: &ImportOptions) -> Result<Self, DataError> {
        let file = Arc::clone(&input.name);
        let text = text(input.open()?, &file)?;
        let mut sentences = Sentences {
            text,
            file,
            line: String::new(),
            ahead: VecDeque::new(),
            parts: HashMap::new(),
            lost: 0,
            read: 0,
            all_stations: options.all_stations,
            seconds: None,
            known: HashMap::new(),
        };
        sentences.look_for_times()?;
        Ok(sentences)
    }

    /// Reads ahead until a sentence has a time.
    fn look_for_times(&mut self) -> Result<(), DataError> {
        while self.ahead.len() < SAMPLE {
            let mut line = String::new();
            if !self.read_line(&mut line)? {
                break;
            }
            let timed = Sentence::read(&line).is_ok_and(|sentence| sentence.time.is_some());
            self.ahead.push_back(line);
            if timed {
                return Ok(());
            }
        }
        self.seconds = Some(Seconds::default());
        Ok(())
    }

    fn read_line(&mut self, line: &mut String) -> Result<bool, DataError> {
        line.clear();
        let read = self.text.reader.read_line(line).map_err(|error| read_error(&self.file, error))?;
        Ok(read > 0)
    }

    /// Goes on to the next line; false at the end.
    fn advance(&mut self) -> Result<bool, DataError> {
        if let Some(line) = self.ahead.pop_front() {
            self.line = line;
            return Ok(true);
        }
        let mut line = std::mem::take(&mut self.line);
        let more = self.read_line(&mut line)?;
        self.line = line;
        Ok(more)
    }

    /// The payload of the message that the sentence completes, with its time; nothing while parts are missing.
    fn complete(&mut self, sentence: &Sentence<'_>) -> Option<(String, Option<f64>)> {
        if sentence.count <= 1 {
            return Some((sentence.payload.to_owned(), sentence.time));
        }
        self.forget_old();
        let key = (sentence.sequence, sentence.count, sentence.channel.to_owned());
        let parts = self.parts.entry(key.clone()).or_insert_with(|| Parts {
            payloads: vec![None; usize::from(sentence.count)],
            time: None,
            begun: self.read,
        });
        let at = usize::from(sentence.number.saturating_sub(1));
        if parts.payloads.get(at).is_none_or(Option::is_some) {
            // Another message of the same number has begun.
            self.lost += parts.payloads.iter().flatten().count();
            *parts =
                Parts { payloads: vec![None; usize::from(sentence.count)], time: None, begun: self.read };
        }
        parts.time = parts.time.or(sentence.time);
        if let Some(part) = parts.payloads.get_mut(at) {
            *part = Some(sentence.payload.to_owned());
        }
        let whole: Option<String> = parts.payloads.iter().map(Option::as_deref).collect();
        let time = parts.time;
        whole.map(|whole| {
            self.parts.remove(&key);
            (whole, time)
        })
    }

    /// Gives up messages whose missing parts do not come any more.
    fn forget_old(&mut self) {
        let read = self.read;
        let mut lost = 0;
        self.parts.retain(|_, parts| {
            let keep = read - parts.begun <= PARTS_WITHIN;
            lost += if keep { 0 } else { parts.payloads.iter().flatten().count() };
            keep
        });
        self.lost += lost;
    }

    /// What becomes of a message.
    fn message(&mut self, payload: &str, time: Option<f64>) -> Step {
        let Some(message) = Message::decode(payload) else {
            return Step::LeftOut("a message that is too short or not of AIS");
        };
        let time = match &mut self.seconds {
            Some(seconds) => seconds.time(message.position.as_ref().and_then(|position| position.second)),
            None => time,
        };
        if !self.all_stations {
            let by_number = Station::of_number(&message.mmsi.to_string());
            let station =
                if by_number == Station::Ship { Station::of_message(message.kind.into()) } else { by_number };
            if let Some(reason) = station.reason() {
                return Step::LeftOut(reason);
            }
        }
        let Some(Position { latitude, longitude, altitude, speed, course, .. }) = message.position else {
            return Step::LeftOut("a message without a position");
        };
        let Some(time) = time else { return Step::LeftOut("a message without a time") };
        let object = self.known.entry(message.mmsi).or_insert_with(|| format!("{:09}", message.mmsi).into());
        Step::Report(Report {
            time,
            object: Some(Arc::clone(object)),
            latitude: latitude.to_radians(),
            longitude: longitude.to_radians(),
            altitude,
            motion: motion(speed.map(|knots| knots * table::KNOT), course),
        })
    }
}

impl Reporter for Sentences {
    fn step(&mut self) -> Result<Step, DataError> {
        if self.lost > 0 {
            self.lost -= 1;
            return Ok(Step::LeftOut("a message of which a part is missing"));
        }
        if !self.advance()? {
            self.lost = self.parts.drain().map(|(_, parts)| parts.payloads.iter().flatten().count()).sum();
            return if self.lost > 0 { self.step() } else { Ok(Step::End) };
        }
        self.read += 1;
        let line = std::mem::take(&mut self.line);
        let step = match Sentence::read(&line) {
            Err(reason) => Step::LeftOut(reason),
            Ok(sentence) => match self.complete(&sentence) {
                Some((payload, time)) => self.message(&payload, time),
                None => Step::Used,
            },
        };
        self.line = line;
        Ok(if is_blank(&self.line) { Step::Used } else { step })
    }

    fn notes(&self) -> Vec<String> {
        let no_time = "no sentence has a time: times are counted by the second of the minute in the messages, from \
                       the first one on, so that pauses of more than half a minute are lost";
        let counted = self.seconds.as_ref().map(|_| no_time.to_owned());
        counted.into_iter().chain(self.text.note()).collect()
    }
}

fn is_blank(line: &str) -> bool {
    line.trim().is_empty() || line.starts_with('#')
}

/// Counts seconds by those of the minute.
#[derive(Debug, Default)]
struct Seconds {
    last: Option<f64>,
}

impl Seconds {
    /// The time of a message: that with its second of the minute which is nearest to the last one.
    fn time(&mut self, second: Option<u8>) -> Option<f64> {
        let time = match (second, self.last) {
            (None, last) => last,
            (Some(second), None) => Some(f64::from(second)),
            (Some(second), Some(last)) => {
                let ahead = (f64::from(second) - last).rem_euclid(60.0);
                Some(last + if ahead > 30.0 { ahead - 60.0 } else { ahead })
            }
        };
        self.last = time.or(self.last);
        time
    }
}
