//! The Autoferry benchmark: radar, lidar and cameras of a small ferry in a harbour, two boats with GNSS.
//!
//! Helgesen, Vasstein, Brekke and Stahl (2022), *Heterogeneous multi-sensor tracking for an autonomous surface
//! vehicle in a littoral environment*, Ocean Engineering 252.
//!
//! A recording is two files: `NAME_detections.json` with one object per scan and, beside it,
//! `NAME_groundTruth.json` with the last known positions of the boats at each scan; both may be compressed by
//! gzip. What becomes of them:
//!
//! - The frame of the files is north-east-down with its origin at the Piren pier in Trondheim; ours is
//!   east-north-up with the same origin. `x` is their east, `y` their north.
//! - Lidar (`sensorID` 1) and radar (2) give positions relative to the ferry, turned to north; they become
//!   positions in the local frame. The infrared (3) and the optical (4) cameras give bearings, clockwise from
//!   north; they become bearings from east towards north. All scans carry the position of the ferry.
//! - Some recordings are not in the order of time: scans are sorted by time, and equal ones stay as they were.
//! - The truth repeats a position until the receiver has a new one; repetitions are left out. Rows are sorted by
//!   time.

use std::collections::HashSet;
use std::f64::consts::{FRAC_PI_2, PI};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::{ImportOptions, Imported, Source};
use crate::column::wrapped;
use crate::error::{DataError, Place, Spot};
use crate::format::{decompressed, open, read_error};
use crate::table::{Description, Detection, Detections, Observation, Origin, Scan, Truth, Truths};

/// The pier where the frame of the recordings begins: 63.4389029083° N, 10.39908278° E, 39.923 m.
pub const PIREN: Origin = Origin {
    latitude: 63.438_902_908_3 * PI / 180.0,
    longitude: 10.399_082_78 * PI / 180.0,
    altitude: 39.923,
};

const DETECTIONS: &str = "_detections.json";
const TRUTH: &str = "_groundTruth.json";

#[derive(Deserialize)]
struct RawScan {
    #[serde(rename = "sensorID")]
    sensor: u8,
    #[serde(rename = "ownshipPosition")]
    own: [f64; 2],
    time: f64,
    measurement: Measurement,
}

/// One detection is written without the list around it.
#[derive(Deserialize)]
#[serde(untagged)]
enum Measurement {
    One(f64),
    List(Vec<f64>),
    Rows([Vec<f64>; 2]),
}

#[derive(Deserialize)]
struct RawTruth {
    #[serde(rename = "targetID")]
    target: u64,
    position: Vec<f64>,
    time: f64,
}

/// Reads the recording whose detections are in `path`, with the truth that lies beside it, if it is there.
///
/// `path` may also be the common beginning of both names, such as `data/autoferry/scenario2`.
///
/// # Errors
/// A [`DataError`] when a file cannot be read or is not of this format; rows count scans from 0.
pub fn read(path: &Path, options: &ImportOptions) -> Result<Imported, DataError> {
    let path = detections_file(path);
    let (file, reader) = open(&path)?;
    let detections = read_detections(reader, &file)?;
    let truths = match truth_file(&path).filter(|_| options.truths) {
        Some(path) => {
            let (file, reader) = open(&path)?;
            Some(read_truths(reader, &file)?)
        }
        None => None,
    };
    Ok(Imported { detections, truths, ..Imported::default() })
}

/// Reads the detections from a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] when the stream is not of this format.
pub fn read_detections_from(reader: impl Read, name: &str) -> Result<Detections, DataError> {
    let file: Arc<str> = name.into();
    read_detections(decompressed(reader, &file)?, &file)
}

/// Reads the truth from a stream; `name` stands for it in messages.
///
/// # Errors
/// A [`DataError`] when the stream is not of this format.
pub fn read_truths_from(reader: impl Read, name: &str) -> Result<Truths, DataError> {
    let file: Arc<str> = name.into();
    read_truths(decompressed(reader, &file)?, &file)
}

/// The file of the detections: the given one, or the one whose name begins so.
pub(super) fn detections_file(path: &Path) -> PathBuf {
    if path.is_file() {
        return path.to_path_buf();
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    [format!("{name}{DETECTIONS}.gz"), format!("{name}{DETECTIONS}")]
        .iter()
        .map(|name| path.with_file_name(name))
        .find(|path| path.is_file())
        .unwrap_or_else(|| path.to_path_buf())
}

/// The file of the truth beside that of the detections.
fn truth_file(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_string_lossy();
    let scenario = name.split_once(DETECTIONS)?.0;
    [format!("{scenario}{TRUTH}.gz"), format!("{scenario}{TRUTH}")]
        .iter()
        .map(|name| path.with_file_name(name))
        .find(|path| path.is_file())
}

fn parse<T: DeserializeOwned>(mut reader: impl Read, file: &Arc<str>) -> Result<T, DataError> {
    // Parsing from memory is several times as fast as from a reader.
    let mut text = Vec::new();
    reader.read_to_end(&mut text).map_err(|error| read_error(file, error))?;
    if text.is_empty() {
        return Err(DataError::Empty { file: Arc::clone(file) });
    }
    serde_json::from_slice(&text).map_err(|error| DataError::Corrupt {
        place: Place::line(file, error.line() as u64),
        problem: format!("this is not an Autoferry recording: {error}"),
        help: "give the file NAME_detections.json, with NAME_groundTruth.json beside it",
    })
}

fn read_detections(reader: impl Read, file: &Arc<str>) -> Result<Detections, DataError> {
    let raw: Vec<RawScan> = parse(reader, file)?;
    let sensors: [Arc<str>; 4] = ["lidar", "radar", "infrared", "camera"].map(Arc::from);
    let mut scans = Vec::with_capacity(raw.len());
    for (row, scan) in raw.iter().enumerate() {
        let wrong = |problem: String| DataError::Row {
            place: Place { file: Arc::clone(file), spot: Spot::Row(row as u64) },
            problem,
            help: "the recording is not of the published format",
        };
        let sensor = usize::from(scan.sensor)
            .checked_sub(1)
            .and_then(|index| sensors.get(index))
            .ok_or_else(|| wrong(format!("sensorID is {}; expected 1 to 4", scan.sensor)))?;
        let observations = if scan.sensor <= 2 { positions(scan) } else { bearings(scan) };
        let observations =
            observations.ok_or_else(|| wrong("the measurement has another shape".to_owned()))?;
        let detection = |observation| Detection::new(0, observation);
        scans.push(Scan {
            time: scan.time,
            sensor: Arc::clone(sensor),
            position: Some([scan.own[1], scan.own[0], 0.0]),
            velocity: None,
            detections: observations.into_iter().map(detection).collect(),
        });
    }
    scans.sort_by(|a, b| a.time.total_cmp(&b.time));
    let detections = scans.iter_mut().flat_map(|scan| &mut scan.detections);
    detections.zip(0..).for_each(|(detection, id)| detection.id = id);
    let description =
        Description { source: Some(Source::Autoferry.name().to_owned()), ..Description::default() };
    Ok(Detections { origin: Some(PIREN), description, scans })
}

/// Positions of a scan of the radar or the lidar: none, one as `[north, east]`, or `[[north...], [east...]]`.
fn positions(scan: &RawScan) -> Option<Vec<Observation>> {
    let position = |north: f64, east: f64| Observation::Position {
        x: east + scan.own[1],
        y: north + scan.own[0],
        z: None,
    };
    match &scan.measurement {
        Measurement::List(one) => match one[..] {
            [] => Some(Vec::new()),
            [north, east] => Some(vec![position(north, east)]),
            _ => None,
        },
        Measurement::Rows([north, east]) if north.len() == east.len() => {
            Some(north.iter().zip(east).map(|(&north, &east)| position(north, east)).collect())
        }
        _ => None,
    }
}

/// Bearings of a scan of a camera: none, one as a number, or a list.
fn bearings(scan: &RawScan) -> Option<Vec<Observation>> {
    let observation = |&compass: &f64| Observation::Polar {
        range: None,
        bearing: wrapped(FRAC_PI_2 - compass),
        range_rate: None,
        z: None,
    };
    match &scan.measurement {
        Measurement::One(bearing) => Some(vec![observation(bearing)]),
        Measurement::List(bearings) => Some(bearings.iter().map(observation).collect()),
        Measurement::Rows(_) => None,
    }
}

fn read_truths(reader: impl Read, file: &Arc<str>) -> Result<Truths, DataError> {
    let raw: Vec<Vec<RawTruth>> = parse(reader, file)?;
    let mut seen = HashSet::new();
    let mut rows = Vec::new();
    for (row, boat) in
        raw.iter().enumerate().flat_map(|(row, boats)| boats.iter().map(move |boat| (row, boat)))
    {
        if !seen.insert((boat.target, boat.time.to_bits())) {
            continue;
        }
        let (Some(&north), Some(&east)) = (boat.position.first(), boat.position.get(1)) else {
            return Err(DataError::Row {
                place: Place { file: Arc::clone(file), spot: Spot::Row(row as u64) },
                problem: format!("the position of boat {} has no two components", boat.target),
                help: "the recording is not of the published format",
            });
        };
        rows.push(Truth {
            time: boat.time,
            object: name(boat.target, boat.time),
            position: [east, north],
            z: None,
            velocity: None,
            extent: None,
        });
    }
    rows.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(Truths { origin: Some(PIREN), rows })
}

/// Name of a boat: the second one is the research vessel on the first day and a jet boat on the second.
fn name(target: u64, time: f64) -> Arc<str> {
    /// 5 May 2021, 0:00 universal time.
    const SECOND_DAY: f64 = 1_620_172_800.0;
    match target {
        1 => "havfruen".into(),
        2 if time < SECOND_DAY => "gunnerus".into(),
        2 => "jetboat".into(),
        other => other.to_string().into(),
    }
}
