//! Keyhole Markup Language.

use std::io::{Result, Write};

use super::{Clock, Path, escaped};
use crate::export::path::Point;

/// Colours of the lines (alpha, blue, green, red), one after the other, so that neighbours can be told apart.
const COLOURS: [&str; 8] =
    ["ff0055ff", "ffff9900", "ff33cc33", "ff00ccff", "ffcc33cc", "ffcccc00", "ff3399ff", "ffff66aa"];

/// Writes a placemark for each track: a `gx:Track` with times, or a line where the times are no dates.
pub(super) fn write(sink: &mut dyn Write, paths: &[Path], clock: Clock) -> Result<()> {
    sink.write_all(
        b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
        <kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n\
        <Document>\n<name>Tracks</name>\n",
    )?;
    for (number, colour) in COLOURS.iter().enumerate() {
        writeln!(
            sink,
            "<Style id=\"line{number}\"><LineStyle><color>{colour}</color><width>2</width></LineStyle></Style>"
        )?;
    }
    for (number, path) in paths.iter().enumerate() {
        placemark(sink, path, number % COLOURS.len(), clock)?;
    }
    sink.write_all(b"</Document>\n</kml>\n")
}

fn placemark(sink: &mut dyn Write, path: &Path, style: usize, clock: Clock) -> Result<()> {
    writeln!(sink, "<Placemark>\n<name>{}</name>\n<styleUrl>#line{style}</styleUrl>", escaped(&path.name()))?;
    let last = path.points().last();
    let mut data = vec![("track", path.track.to_string()), ("status", path.status.name().to_owned())];
    data.extend(path.identity.as_ref().map(|identity| ("identity", escaped(identity))));
    data.extend(last.and_then(|point| point.speed).map(|speed| ("speed", format!("{speed:.2} m/s"))));
    data.extend(last.and_then(|point| point.course).map(|course| ("course", format!("{course:.1}°"))));
    sink.write_all(b"<ExtendedData>")?;
    for (name, value) in data {
        write!(sink, "<Data name=\"{name}\"><value>{value}</value></Data>")?;
    }
    sink.write_all(b"</ExtendedData>\n")?;
    let mode = if path.is_in_space() { "absolute" } else { "clampToGround" };
    let dates: Option<Vec<String>> = path.points().iter().map(|point| clock.date(point.time)).collect();
    match dates {
        Some(dates) => timed(sink, path, mode, &dates)?,
        None => lines(sink, path, mode)?,
    }
    sink.write_all(b"</Placemark>\n")
}

/// A track in time. Its reader takes the short way over the antimeridian by itself.
fn timed(sink: &mut dyn Write, path: &Path, mode: &str, dates: &[String]) -> Result<()> {
    writeln!(sink, "<gx:Track>\n<altitudeMode>{mode}</altitudeMode>")?;
    for date in dates {
        writeln!(sink, "<when>{date}</when>")?;
    }
    for point in path.points() {
        writeln!(sink, "<gx:coord>{}</gx:coord>", coordinates(point, path.is_in_space(), " "))?;
    }
    sink.write_all(b"</gx:Track>\n")
}

/// The parts of a line, or a point where there is only one.
fn lines(sink: &mut dyn Write, path: &Path, mode: &str) -> Result<()> {
    let in_space = path.is_in_space();
    sink.write_all(b"<MultiGeometry>\n")?;
    for part in path.parts(true) {
        let kind = if part.len() > 1 { "LineString" } else { "Point" };
        write!(sink, "<{kind}><altitudeMode>{mode}</altitudeMode><coordinates>")?;
        for point in &part {
            write!(sink, "{} ", coordinates(point, in_space, ","))?;
        }
        writeln!(sink, "</coordinates></{kind}>")?;
    }
    sink.write_all(b"</MultiGeometry>\n")
}

fn coordinates(point: &Point, in_space: bool, between: &str) -> String {
    let [latitude, longitude] = point.place;
    let altitude = point.altitude.filter(|_| in_space).unwrap_or(0.0);
    format!("{longitude:.7}{between}{latitude:.7}{between}{altitude:.2}")
}
