//! What people take away from `tercel track`: tables with places, maps, as many rows as they want, and an account of what was
//! not used.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use std::collections::HashMap;
use std::path::Path;

use serde_json::Value;
use support::{files, fixtures, run, run_with_input};

const SHIPS: &str = "ais_three_ships.csv";

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The rows of a table of tracks.
fn rows(path: &Path) -> Vec<Value> {
    let table = std::fs::read_to_string(path).unwrap();
    table.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Tracks a fixture with more arguments and returns its rows.
fn tracked(input: &str, more: &[&str]) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.ndjson");
    run(["track", input, "-q", "-o", text(&tracks)].iter().chain(more)).succeeded();
    rows(&tracks)
}

#[test]
fn a_converted_recording_is_tracked_as_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let summary = |input: &str| {
        let json = run(["track", input, "--json", "-q"]).succeeded().json();
        (json["configuration"].clone(), json["confirmed_tracks"].clone(), json["detections"].clone())
    };
    let direct = summary(SHIPS);
    assert_eq!((&direct.0, &direct.1), (&"ais".into(), &3.into()));
    for name in ["d.csv", "d.parquet", "d.ndjson"] {
        run(["convert", SHIPS, "-o", text(&path(name))]).succeeded();
        assert_eq!(summary(text(&path(name))), direct, "{name}");
    }
    let stream = std::fs::read_to_string(path("d.ndjson")).unwrap();
    let tracks = path("t.csv");
    let arguments = ["track", "-", "--json", "-o", text(&tracks)];
    let streamed = run_with_input(arguments, &stream).succeeded();
    assert!(streamed.stderr.contains("`ais`"), "{}", streamed.stderr);
    assert_eq!(streamed.json()["confirmed_tracks"], 3);
}

#[test]
fn files_of_two_days_are_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read_to_string(fixtures().join(SHIPS)).unwrap();
    let lines: Vec<&str> = whole.lines().collect();
    let day = |name: &str, part: &[&str]| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{}\n{}\n", lines[0], part.join("\n"))).unwrap();
        path
    };
    let (one, two) = (day("monday.csv", &lines[1..25]), day("tuesday.csv", &lines[25..]));
    let summary = run(["track", text(&one), text(&two), "--json", "-q"]).succeeded().json();
    assert_eq!((&summary["confirmed_tracks"], &summary["scans"]["tracked"]), (&3.into(), &48.into()));
    assert_eq!(summary["inputs"].as_array().unwrap().len(), 2);

    let table = |name: &str, day: &Path| {
        let path = folder.path().join(name);
        run(["convert", text(day), "--origin", "56,11", "-o", text(&path)]).succeeded();
        path
    };
    let (one, two) = (table("monday.parquet", &one), table("tuesday.parquet", &two));
    let joined = run(["track", text(&one), text(&two), "--json", "-q"]).succeeded().json();
    assert_eq!((&joined["configuration"], &joined["confirmed_tracks"]), (&"ais".into(), &3.into()));

    assert_eq!(run(["track", text(&one), "-"]).code, 2);
}

#[test]
fn identities_without_a_description_are_pointed_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ships.csv");
    std::fs::write(&path, "time,sensor,x,y,identity\n0,a,0,0,219000101\n1,a,5,0,219000101\n").unwrap();
    let stderr = run(["track", text(&path)]).succeeded().stderr;
    assert!(stderr.contains("`default`") && stderr.contains("--preset ais"), "{stderr}");
    let stderr = run(["track", "radar.csv"]).succeeded().stderr;
    assert!(!stderr.contains("--preset ais"), "{stderr}");
}

#[test]
fn rows_say_where_on_the_earth_a_ship_was() {
    let reports = std::fs::read_to_string(fixtures().join(SHIPS)).unwrap();
    // MMSI,BaseDateTime,LAT,LON,...
    let places: Vec<[f64; 2]> = reports
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|cells| [cells[2].parse().unwrap(), cells[3].parse().unwrap()])
        .collect();
    let rows = tracked(SHIPS, &[]);
    let updates: Vec<&Value> = rows.iter().filter(|row| row.get("detection").is_some()).collect();
    assert!(updates.len() >= 40, "{}", updates.len());
    for row in updates {
        let [latitude, longitude] = places[row["detection"].as_u64().unwrap() as usize];
        let north = (row["latitude"].as_f64().unwrap() - latitude) * 111_000.0;
        let east = (row["longitude"].as_f64().unwrap() - longitude) * 111_000.0 * latitude.to_radians().cos();
        assert!(north.hypot(east) < 20.0, "{row}");
    }
    let last = rows.iter().rfind(|row| row["track"] == 1).unwrap();
    assert!((last["speed"].as_f64().unwrap() - 6.17).abs() < 0.1, "12 knots: {last}");
    assert!((last["course"].as_f64().unwrap() - 45.0).abs() < 1.0, "{last}");
}

#[test]
fn tracks_of_a_recording_go_to_maps() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for name in ["tracks.geojson", "tracks.kml", "tracks.gpx", "tracks.parquet"] {
        run(["track", SHIPS, "-o", text(&path(name))]).succeeded();
    }
    let read = |name: &str| std::fs::read_to_string(path(name)).unwrap();
    let map: Value = serde_json::from_str(&read("tracks.geojson")).unwrap();
    assert_eq!(map["features"].as_array().unwrap().len(), 3);
    let starts: Vec<&str> = map["features"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["properties"]["begin"].as_str().unwrap())
        .collect();
    assert!(starts.iter().all(|start| start.starts_with("2024-03-05T10:00:")), "{starts:?}");
    assert_eq!(read("tracks.kml").matches("<Placemark>").count(), 3);
    assert_eq!(read("tracks.gpx").matches("<trk>").count(), 3);
    for name in ["again.geojson", "again.kml", "again.gpx"] {
        run(["convert", text(&path("tracks.parquet")), "-o", text(&path(name))]).succeeded();
        assert_eq!(read(name), read(&name.replace("again", "tracks")), "{name}");
    }
}

#[test]
fn a_map_needs_to_know_where_on_the_earth_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("tracks.kml");
    let refused = run(["track", "radar.csv", "-o", text(&map)]);
    assert_eq!(refused.code, 3);
    assert!(refused.stderr.contains("--origin LAT,LON"), "{}", refused.stderr);
    assert_eq!(files(folder.path()), [""; 0]);
    let drawn = run(["track", "radar.csv", "-o", text(&map), "--origin", "54.18,7.89"]).succeeded();
    assert!(drawn.stderr.contains("no Unix times"), "{}", drawn.stderr);
    assert_eq!(files(folder.path()), ["tracks.kml"]);

    let (table, detections) = (folder.path().join("t.csv"), folder.path().join("d.csv"));
    run(["track", SHIPS, "-q", "-o", text(&table)]).succeeded();
    let moved = run(["convert", text(&table), "-o", text(&map), "--origin", "1,2"]);
    assert_eq!(moved.code, 3, "{}", moved.transcript());
    run(["convert", SHIPS, "-q", "-o", text(&detections)]).succeeded();
    for input in [SHIPS, text(&detections)] {
        let untracked = run(["convert", input, "-o", text(&map)]);
        assert_eq!(untracked.code, 3);
        assert!(untracked.stderr.contains("tercel track INPUT -o FILE"), "{}", untracked.stderr);
    }
}

#[test]
fn reports_lead_to_a_row_for_each_update() {
    let rows = tracked(SHIPS, &[]);
    let mut before: HashMap<u64, Value> = HashMap::new();
    for row in &rows {
        let last = before.insert(row["track"].as_u64().unwrap(), row["status"].clone());
        let changed = last.is_none_or(|status| status != row["status"]);
        assert!(changed || row.get("detection").is_some(), "{row}");
    }
    // A report concerns its own ship, and no track has a row for that of another.
    let scans = tracked(SHIPS, &["--rows", "scans"]);
    assert_eq!(scans.len(), rows.len());
    let updated = |rows: &[Value]| rows.iter().filter(|row| row.get("detection").is_some()).count();
    assert_eq!(updated(&rows), updated(&scans), "no update is left out");
}

#[test]
fn rows_may_be_thinned_out() {
    let scans = tracked("radar.csv", &["--config", "tracker.toml"]);
    assert_eq!(scans, tracked("radar.csv", &["--config", "tracker.toml", "--rows", "scans"]));
    assert_eq!(scans.len(), 10);
    let thin = tracked("radar.csv", &["--config", "tracker.toml", "--rows", "2.5"]);
    let times: Vec<f64> =
        thin.iter().filter(|row| row["track"] == 1).filter_map(|row| row["time"].as_f64()).collect();
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= 2.5), "{times:?}");
    assert!(thin.len() < scans.len() && thin.len() >= 4, "{thin:?}");
    assert_eq!(run(["track", "radar.csv", "--rows", "0"]).code, 2);
}

#[test]
fn scores_and_reports_do_not_depend_on_the_rows_that_are_written() {
    let scores = |rows: &str| {
        let arguments =
            ["track", "radar.csv", "--truth", "truth.csv", "-c", "tracker.toml", "--json", "--rows", rows];
        run(arguments).succeeded().json()["scores"].clone()
    };
    assert_eq!(scores("100"), scores("scans"));
}

#[test]
fn what_is_left_out_is_said_wherever_people_look() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.csv");
    let lines = support::late_and_ignored();
    let arguments = ["track", "-", "-c", "tracker.toml", "-o", text(&tracks)];
    let sentence = "3 rows: a scan that came too late (2), a sensor that the configuration ignores (1)";
    let loud = run_with_input(arguments, &lines).succeeded();
    assert!(loud.stdout.contains(sentence), "{}", loud.stdout);
    let quiet = run_with_input(arguments.into_iter().chain(["-q"]), &lines).succeeded();
    assert_eq!(quiet.stderr, format!("left out {sentence}\n"));
    let json = run_with_input(arguments.into_iter().chain(["-q", "--json"]), &lines).succeeded().json();
    let account = serde_json::json!([
        {"reason": "a scan that came too late", "rows": 2},
        {"reason": "a sensor that the configuration ignores", "rows": 1},
    ]);
    assert_eq!(json["left_out"], account);
}

#[test]
fn what_a_reader_leaves_out_is_in_the_account() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ships.csv");
    let ships = std::fs::read_to_string(fixtures().join(SHIPS)).unwrap();
    let again = ships.lines().last().unwrap();
    std::fs::write(&path, format!("{ships}{again}\n")).unwrap();
    for command in ["track", "convert"] {
        let out = folder.path().join("out.csv");
        let quiet = run([command, text(&path), "-q", "-o", text(&out)]).succeeded();
        assert_eq!(quiet.stderr.lines().count(), 1, "{}", quiet.stderr);
        assert!(quiet.stderr.starts_with("left out 1 row: "), "{}", quiet.stderr);
    }
    let json = run(["track", text(&path), "-q", "--json"]).succeeded().json();
    assert_eq!(json["left_out"][0]["rows"], 1);
}

#[test]
fn a_line_that_cannot_be_used_is_in_the_account() {
    let lines = support::lines().concat() + "oops\n";
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.csv");
    let arguments = ["track", "-", "-q", "--on-error", "skip", "--json", "-o", text(&tracks)];
    let skipped = run_with_input(arguments, &lines).succeeded();
    assert_eq!(skipped.stderr, "left out 1 row: a line or scan that cannot be used (1)\n");
    assert_eq!(skipped.json()["left_out"][0]["rows"], 1);
}
