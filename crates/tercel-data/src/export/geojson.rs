//! GeoJSON.

use std::io::{Result, Write};

use serde::Serialize;
use serde_json::{Value, json};

use super::{Clock, Path};
use crate::export::path::Point;

/// Writes a collection with one feature per track (RFC 7946): a line, cut where it crosses the antimeridian, or a point where
/// there is only one. `times` holds a time for each of its positions, in their order; `speed`, `course` and `altitude` are the
/// last ones.
pub(super) fn write(sink: &mut dyn Write, paths: &[Path], clock: Clock) -> Result<()> {
    sink.write_all(b"{\"type\":\"FeatureCollection\",\"features\":[")?;
    for (number, path) in paths.iter().enumerate() {
        sink.write_all(if number > 0 { b",\n" } else { b"\n" })?;
        serde_json::to_writer(&mut *sink, &feature(path, clock))?;
    }
    sink.write_all(b"\n]}\n")
}

/// One track.
#[derive(Serialize)]
struct Feature<'a> {
    r#type: &'static str,
    properties: Properties<'a>,
    geometry: Value,
}

/// What programs show in a table, in this order.
#[derive(Serialize)]
struct Properties<'a> {
    name: String,
    track: u64,
    identity: Option<&'a str>,
    status: &'static str,
    begin: Option<Value>,
    end: Option<Value>,
    points: usize,
    altitude: Option<f64>,
    speed: Option<f64>,
    course: Option<f64>,
    times: Vec<Value>,
}

fn feature(path: &Path, clock: Clock) -> Feature<'_> {
    let time = |point: &Point| clock.date(point.time).map_or_else(|| json!(point.time), |date| json!(date));
    let parts = path.parts(true);
    let points = path.points();
    let last = points.last();
    let number = |value: fn(&Point) -> Option<f64>, decimals| {
        last.and_then(value).map(|number| rounded(number, decimals))
    };
    let properties = Properties {
        name: path.name(),
        track: path.track,
        identity: path.identity.as_deref(),
        status: path.status.name(),
        begin: points.first().map(time),
        end: last.map(time),
        points: points.len(),
        altitude: number(|point| point.altitude, 2),
        speed: number(|point| point.speed, 3),
        course: number(|point| point.course, 2),
        times: parts.iter().flatten().map(time).collect(),
    };
    Feature { r#type: "Feature", properties, geometry: geometry(&parts, path.is_in_space()) }
}

fn geometry(parts: &[Vec<Point>], in_space: bool) -> Value {
    let position = |point: &Point| {
        let [latitude, longitude] = point.place.map(|degrees| rounded(degrees, 7));
        match point.altitude.filter(|_| in_space) {
            Some(altitude) => json!([longitude, latitude, rounded(altitude, 2)]),
            None => json!([longitude, latitude]),
        }
    };
    let line = |part: &Vec<Point>| part.iter().map(position).collect::<Vec<_>>();
    match parts {
        [part] => match &part[..] {
            [point] => json!({"type": "Point", "coordinates": position(point)}),
            _ => json!({"type": "LineString", "coordinates": line(part)}),
        },
        _ => json!({"type": "MultiLineString", "coordinates": parts.iter().map(line).collect::<Vec<_>>()}),
    }
}

/// The number with so many decimals.
fn rounded(number: f64, decimals: i32) -> f64 {
    let scale = 10.0_f64.powi(decimals);
    let rounded = (number * scale).round() / scale;
    // A minus before nothing is only confusing.
    if rounded == 0.0 { 0.0 } else { rounded }
}
