//! Tracks on the Earth: columns for people, and files for maps.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::io::Read;
use std::path::Path;

use serde_json::Value;
use tercel_data::table::{Origin, Status, Track, Tracks};
use tercel_data::{DataError, Format, ReadOptions, TracksWriter, read_tracks, write_tracks, write_tracks_to};

const NOON: f64 = 1_709_640_000.0;

fn row(time: f64, track: u64, status: Status, state: [f64; 4]) -> Track {
    Track {
        time,
        sensor: "ais".into(),
        track,
        status,
        existence: 1.0,
        state: state.to_vec(),
        covariance: vec![],
        modes: vec![],
        extent: None,
        altitude: None,
        identity: None,
        detection: None,
    }
}

fn tracks(longitude: f64, rows: Vec<Track>) -> Tracks {
    let origin = Some(Origin { latitude: 0.0, longitude: f64::to_radians(longitude), altitude: 0.0 });
    Tracks { origin, labels: ["x", "y", "vx", "vy"].map(str::to_owned).to_vec(), modes: vec![], rows }
}

/// A ship that goes east along the equator, where the ellipsoid is a circle, and is lost.
fn ship(longitude: f64, epoch: f64) -> Tracks {
    let seen = |step: u32, status| {
        row(epoch + f64::from(step) * 60.0, 7, status, [f64::from(step) * 600.0 - 600.0, 0.0, 10.0, 0.0])
    };
    let mut rows = vec![seen(0, Status::Confirmed), seen(1, Status::Coasted), seen(2, Status::Confirmed)];
    rows[2].identity = Some("Anna & <Bert>\u{1}".into());
    rows.extend([seen(3, Status::Coasted), seen(4, Status::Deleted)]);
    tracks(longitude, rows)
}

fn written(table: &Tracks, name: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_tracks(&path, table).unwrap();
    std::fs::read_to_string(&path).unwrap()
}

/// The text of the elements of this name.
fn texts<'a>(document: &'a roxmltree::Document<'_>, name: &str) -> Vec<&'a str> {
    document
        .descendants()
        .filter(|node| node.tag_name().name() == name)
        .map(|node| node.text().unwrap_or_default())
        .collect()
}

/// Degrees of longitude at a distance from the origin on the equator.
fn degrees(x: f64) -> f64 {
    (x / 6_378_137.0).asin().to_degrees()
}

#[test]
fn where_the_earth_is_known_rows_have_places_speeds_and_courses() {
    let mut table = ship(8.0, NOON);
    table.rows[2].altitude = Some(30.0);
    let csv = written(&table, "tracks.csv");
    let mut lines = csv.lines();
    let description: Value =
        serde_json::from_str(lines.next().unwrap().strip_prefix("# tercel: ").unwrap()).unwrap();
    for (column, unit) in
        [("latitude", "deg"), ("longitude", "deg"), ("altitude", "m"), ("speed", "m/s"), ("course", "deg")]
    {
        assert_eq!(description["units"][column], unit);
    }
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let cell = |line: usize, name: &str| {
        let at = header.iter().position(|column| *column == name).unwrap();
        csv.lines().nth(2 + line).unwrap().split(',').nth(at).unwrap().to_owned()
    };
    assert_eq!(cell(0, "latitude"), "0");
    assert_eq!(cell(0, "longitude"), format!("{:.7}", 8.0 + degrees(-600.0)));
    assert_eq!((cell(0, "speed"), cell(0, "course")), ("10".to_owned(), "90".to_owned()));
    assert_eq!((cell(1, "altitude"), cell(2, "altitude")), (String::new(), "30".to_owned()));
    assert_eq!(cell(2, "longitude"), format!("{:.7}", 8.0 + degrees(600.0 / (1.0 + 30.0 / 6_378_137.0))));
}

#[test]
fn columns_that_follow_from_others_are_not_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["tracks.csv", "tracks.parquet", "tracks.ndjson"] {
        let (path, table) = (folder.path().join(name), ship(8.0, NOON));
        write_tracks(&path, &table).unwrap();
        assert_eq!(read_tracks(&path, &ReadOptions::default()).unwrap(), table, "{name}");
    }
    let mut table = ship(8.0, NOON);
    table.origin = None;
    let csv = written(&table, "tracks.csv");
    let header = csv.lines().nth(1).unwrap();
    assert!(!header.contains("latitude") && !header.contains("altitude"), "{header}");
    assert!(header.contains("speed,course"), "{header}");
}

#[test]
fn a_label_that_is_called_like_a_derived_column_takes_its_place() {
    let mut table = ship(8.0, NOON);
    table.labels.push("speed".to_owned());
    table.rows.iter_mut().for_each(|row| row.state.push(42.0));
    let mut csv = Vec::new();
    write_tracks_to(&mut csv, Format::Csv, "tracks", &table).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    let header: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    let speeds: Vec<usize> = (0..header.len()).filter(|&at| header[at] == "speed").collect();
    assert_eq!(speeds.len(), 1, "{header:?}");
    assert_eq!(csv.lines().nth(2).unwrap().split(',').nth(speeds[0]), Some("42"));
}

#[test]
fn geojson_has_a_line_with_its_times_and_the_last_state() {
    let map: Value = serde_json::from_str(&written(&ship(8.0, NOON), "tracks.geojson")).unwrap();
    assert_eq!(map["type"], "FeatureCollection");
    let feature = &map["features"][0];
    let line = &feature["geometry"];
    assert_eq!(line["type"], "LineString");
    let round = |degrees: f64| (degrees * 1e7).round() / 1e7;
    let lon = |x: f64| round(8.0 + degrees(x));
    assert_eq!(
        line["coordinates"],
        serde_json::json!([[lon(-600.0), 0.0], [lon(0.0), 0.0], [lon(600.0), 0.0]]),
        "longitude first, and it ends where the ship was last seen"
    );
    let properties = &feature["properties"];
    let times = ["2024-03-05T12:00:00Z", "2024-03-05T12:01:00Z", "2024-03-05T12:02:00Z"];
    assert_eq!(properties["times"], serde_json::json!(times));
    assert_eq!((&properties["begin"], &properties["end"]), (&times[0].into(), &times[2].into()));
    assert_eq!(properties["identity"], "Anna & <Bert>\u{1}");
    assert_eq!((&properties["track"], &properties["status"]), (&7.into(), &"deleted".into()));
    assert_eq!((&properties["speed"], &properties["course"]), (&10.0.into(), &90.0.into()));
}

#[test]
fn geojson_is_cut_at_the_antimeridian() {
    let map: Value = serde_json::from_str(&written(&ship(180.0, NOON), "tracks.geojson")).unwrap();
    let line = &map["features"][0]["geometry"];
    assert_eq!(line["type"], "MultiLineString");
    let longitudes: Vec<Vec<f64>> = line["coordinates"]
        .as_array()
        .unwrap()
        .iter()
        .map(|part| part.as_array().unwrap().iter().map(|place| place[0].as_f64().unwrap()).collect())
        .collect();
    assert_eq!(longitudes.len(), 2);
    assert!(longitudes[0].iter().all(|longitude| *longitude > 179.9), "{longitudes:?}");
    assert!(longitudes[1].iter().all(|longitude| *longitude < -179.9), "{longitudes:?}");
    assert_eq!((longitudes[0].last(), longitudes[1].first()), (Some(&180.0), Some(&-180.0)));
    let times = map["features"][0]["properties"]["times"].as_array().unwrap().len();
    assert_eq!(times, longitudes.iter().map(Vec::len).sum::<usize>(), "a time for each position");
}

#[test]
fn kml_has_a_track_in_time() {
    let text = written(&ship(8.0, NOON), "tracks.kml");
    let kml = roxmltree::Document::parse(&text).unwrap();
    assert_eq!(texts(&kml, "name"), ["Tracks", "Anna & <Bert>\u{fffd}"]);
    assert_eq!(texts(&kml, "when").len(), 3);
    assert_eq!(texts(&kml, "when")[2], "2024-03-05T12:02:00Z");
    assert_eq!(texts(&kml, "coord")[1], "8.0000000 0.0000000 0.00");
    assert_eq!(texts(&kml, "altitudeMode"), ["clampToGround"]);
}

#[test]
fn kmz_is_an_archive_of_the_same_kml() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tracks.kmz");
    let table = ship(8.0, NOON);
    write_tracks(&path, &table).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    // The local header has 30 bytes and the name; the directory begins where the end of the archive says.
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let end = bytes.len() - 22;
    assert_eq!((&bytes[..4], &bytes[end..end + 4]), (&b"PK\x03\x04"[..], &b"PK\x05\x06"[..]));
    let (size, directory) = (number(end + 12), number(end + 16));
    assert_eq!((directory + size, &bytes[directory..directory + 4]), (end, &b"PK\x01\x02"[..]));
    assert_eq!(&bytes[30..37], b"doc.kml");
    assert_eq!(number(18), directory - 37, "what is packed lies between the headers");
    let mut text = String::new();
    flate2::read::DeflateDecoder::new(&bytes[37..directory]).read_to_string(&mut text).unwrap();
    assert_eq!(text, written(&table, "tracks.kml"));
    assert_eq!(number(22), text.len());
}

#[test]
fn gpx_has_points_with_times_and_heights() {
    let mut table = ship(180.0, NOON);
    table.rows.iter_mut().for_each(|row| row.altitude = Some(1_234.5));
    let text = written(&table, "tracks.gpx");
    let gpx = roxmltree::Document::parse(&text).unwrap();
    assert_eq!(gpx.root_element().default_namespace(), Some("http://www.topografix.com/GPX/1/1"));
    assert_eq!(texts(&gpx, "ele"), ["1234.50"; 3]);
    assert_eq!(texts(&gpx, "time")[0], "2024-03-05T12:00:00Z");
    let points =
        gpx.descendants().filter(|node| node.has_tag_name(("http://www.topografix.com/GPX/1/1", "trkpt")));
    let longitudes: Vec<f64> = points.map(|point| point.attribute("lon").unwrap().parse().unwrap()).collect();
    assert_eq!(longitudes.len(), 3, "no point is made up");
    assert!(longitudes.iter().all(|longitude| (-180.0..180.0).contains(longitude)), "{longitudes:?}");
}

#[test]
fn times_that_are_no_dates_are_no_dates_on_the_map() {
    let table = ship(8.0, 0.0);
    for name in ["tracks.kml", "tracks.gpx"] {
        let text = written(&table, name);
        let map = roxmltree::Document::parse(&text).unwrap();
        assert!(texts(&map, "when").is_empty() && texts(&map, "time").is_empty(), "{text}");
    }
    let map: Value = serde_json::from_str(&written(&table, "tracks.geojson")).unwrap();
    assert_eq!(map["features"][0]["properties"]["times"], serde_json::json!([0.0, 60.0, 120.0]));
    let folder = tempfile::tempdir().unwrap();
    for (epoch, notes) in [(0.0, 1), (NOON, 0)] {
        let writer = TracksWriter::create(folder.path().join("t.kml"), &ship(8.0, epoch)).unwrap();
        assert_eq!(writer.notes().len(), notes);
    }
}

#[test]
fn a_map_without_an_origin_is_refused_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let table = Tracks { origin: None, ..ship(8.0, NOON) };
    for name in ["tracks.geojson", "tracks.kml", "tracks.gpx"] {
        let error = write_tracks(folder.path().join(name), &table).unwrap_err();
        assert!(matches!(error, DataError::NoOrigin { .. }), "{error}");
        assert!(error.help().unwrap().contains("--origin LAT,LON"));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_map_appears_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tracks.geojson");
    let table = ship(8.0, NOON);
    let mut writer = TracksWriter::create(&path, &Tracks { rows: vec![], ..table.clone() }).unwrap();
    for row in &table.rows {
        writer.append(std::slice::from_ref(row)).unwrap();
        assert!(!path.exists());
    }
    writer.finish().unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), written(&table, "tracks.geojson"));
    let bad = row(NOON, 1, Status::Confirmed, [0.0; 4]);
    let mut writer = TracksWriter::create(&path, &Tracks { rows: vec![], ..table }).unwrap();
    assert!(writer.append(&[Track { state: vec![1.0], ..bad }]).is_err());
}

#[test]
fn what_is_beside_the_earth_is_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = ship(8.0, NOON);
    table.rows[1].state[0] = 1e9;
    let writer = TracksWriter::create(folder.path().join("t.gpx"), &table).unwrap();
    assert!(writer.notes()[0].contains(": 1 rows are too far"), "{:?}", writer.notes());
}

#[test]
fn the_name_tells_the_map() {
    for (name, map) in
        [("a.GeoJSON", true), ("a.kml", true), ("b/a.gpx", true), ("kml", false), ("a.json", false)]
    {
        assert_eq!(tercel_data::MapFormat::of(Path::new(name)).is_some(), map, "{name}");
    }
}
