//! GPS Exchange Format.

use std::io::{Result, Write};

use super::{Clock, Path, escaped};
use crate::export::path::Point;

/// Writes a `trk` for each track, with a segment for each part between crossings of the antimeridian.
pub(super) fn write(sink: &mut dyn Write, paths: &[Path], clock: Clock) -> Result<()> {
    sink.write_all(
        b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
        <gpx version=\"1.1\" creator=\"Tercel\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n",
    )?;
    for path in paths {
        write!(sink, "<trk><name>{}</name><number>{}</number>", escaped(&path.name()), path.track)?;
        for part in path.parts(false) {
            sink.write_all(b"<trkseg>\n")?;
            for point in &part {
                waypoint(sink, point, clock)?;
            }
            sink.write_all(b"</trkseg>")?;
        }
        sink.write_all(b"</trk>\n")?;
    }
    sink.write_all(b"</gpx>\n")
}

fn waypoint(sink: &mut dyn Write, point: &Point, clock: Clock) -> Result<()> {
    let latitude = format!("{:.7}", point.place[0]);
    let longitude = format!("{:.7}", point.place[1]);
    // The schema takes the antimeridian on its western face only.
    let longitude = longitude.strip_prefix("180.").map_or(longitude.clone(), |rest| format!("-180.{rest}"));
    write!(sink, "<trkpt lat=\"{latitude}\" lon=\"{longitude}\">")?;
    if let Some(altitude) = point.altitude {
        write!(sink, "<ele>{altitude:.2}</ele>")?;
    }
    if let Some(date) = clock.date(point.time) {
        write!(sink, "<time>{date}</time>")?;
    }
    sink.write_all(b"</trkpt>\n")
}
