//! What a file holds, by its first bytes: names of files say little, and streams have none.

use std::io::{BufRead, Read};
use std::sync::Arc;

use super::table::Shape;
use crate::error::DataError;
use crate::source::{read_error, text};

/// A kind of content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    /// Nothing at all.
    Empty,
    Parquet,
    /// JSON of one of the shapes that reports come in, or lines of it.
    Json(Shape),
    /// Scans of an Autoferry recording.
    Autoferry,
    /// Sentences of AIS receivers: `!AIVDM`.
    Nmea,
    /// Messages of a BaseStation feed: `MSG,3,`.
    Sbs,
    /// Boxes of the MOT Challenge.
    Mot,
    /// A table of ours, which says so in its first line.
    Described,
    /// Other text.
    Text,
}

/// How much of a file is looked at.
const START: u64 = 1 << 16;

/// What a stream, which is already decompressed, holds.
pub(super) fn of(mut reader: Box<dyn BufRead>, file: &Arc<str>) -> Result<Content, DataError> {
    let start = reader.fill_buf().map_err(|error| read_error(file, error))?;
    if start.is_empty() {
        return Ok(Content::Empty);
    }
    if start.starts_with(b"PAR1") {
        return Ok(Content::Parquet);
    }
    let mut bytes = Vec::new();
    let text = text(reader, file)?;
    text.reader.take(START).read_to_end(&mut bytes).map_err(|error| read_error(file, error))?;
    Ok(of_text(&String::from_utf8_lossy(&bytes)))
}

fn of_text(start: &str) -> Content {
    let trimmed = start.trim_start();
    let mut lines = trimmed.lines().map(str::trim).filter(|line| !line.is_empty()).take(50);
    if trimmed.starts_with("# tercel:") {
        Content::Described
    } else if trimmed.starts_with(['{', '[']) {
        of_json(trimmed)
    } else if lines.clone().any(is_sentence) {
        Content::Nmea
    } else if lines.clone().any(is_basestation) {
        Content::Sbs
    } else if trimmed.contains('\n') && lines.clone().next().is_some() && lines.all(is_box) {
        Content::Mot
    } else {
        Content::Text
    }
}

fn of_json(start: &str) -> Content {
    if has_list(start, "aircraft") {
        Content::Json(Shape::Aircraft)
    } else if has_list(start, "states") {
        Content::Json(Shape::States)
    } else if start.starts_with('[') && start.contains("\"sensorID\"") {
        Content::Autoferry
    } else {
        Content::Json(Shape::Objects)
    }
}

/// True when there is a key `name` whose value is a list, or nothing.
fn has_list(start: &str, name: &str) -> bool {
    let key = format!("\"{name}\"");
    start.match_indices(&key).any(|(at, _)| {
        let rest = start[at + key.len()..].trim_start();
        rest.strip_prefix(':').is_some_and(|rest| rest.trim_start().starts_with(['[', 'n']))
    })
}

/// True when a line holds a sentence of an AIS receiver.
fn is_sentence(line: &str) -> bool {
    super::nmea::sentence_in(line).is_some()
}

/// True for a message of a BaseStation feed, which has no header.
fn is_basestation(line: &str) -> bool {
    let mut cells = line.split(',');
    let kind = cells.next().unwrap_or_default();
    ["MSG", "SEL", "ID", "AIR", "STA", "CLK"].contains(&kind) && cells.count() >= 9
}

/// True for a line of the MOT Challenge: frame, object or -1, left, top, width, height, and three or four more numbers.
fn is_box(line: &str) -> bool {
    let numbers: Option<Vec<f64>> = line.split(',').map(|cell| cell.trim().parse().ok()).collect();
    let Some(numbers) = numbers.filter(|numbers| (9..=10).contains(&numbers.len())) else { return false };
    let whole = |number: f64| number.fract() == 0.0;
    whole(numbers[0])
        && numbers[0] >= 0.0
        && whole(numbers[1])
        && numbers[1] >= -1.0
        && numbers[4] > 0.0
        && numbers[5] > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_told_from_the_first_lines() {
        for (start, content) in [
            ("{\"now\": 1.5,\n \"aircraft\" : [\n", Content::Json(Shape::Aircraft)),
            ("{\"time\":1,\"states\":null}", Content::Json(Shape::States)),
            ("{\"time\":1,\"sensor\":\"aircraft\"}\n", Content::Json(Shape::Objects)),
            ("[{\"sensorID\":1}]", Content::Autoferry),
            ("# log\n\\s:rx,c:1*00\\!AIVDM,1,1,,A,13,0*00\n", Content::Nmea),
            ("2024-03-05 10:00:00 !BSVDM,1,1,,A,13,0*00\n", Content::Nmea),
            ("MSG,3,1,1,4CA2D6,1,2024/03/05,10:00:00.000,2024/03/05,10:00:00.000,,36089\n", Content::Sbs),
            ("1,-1,100,200,50,120,0.9,-1,-1,-1\n1,-1,1,2,3,4,0.9,-1,-1,-1\n", Content::Mot),
            ("0.0,radar,1,2\n", Content::Text),
            ("# tercel: {}\n", Content::Described),
            ("mmsi,lat,lon\n", Content::Text),
        ] {
            assert_eq!(of_text(start), content, "{start}");
        }
    }
}
