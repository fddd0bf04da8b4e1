//! Recordings of ships and aircraft, as other programs write them.

use serde_json::Value;

use super::{Case, Tracked, number, recording, run, text};

#[test]
fn every_ship_is_one_track_with_its_name() {
    let skip: &[&str] = &["--on-error", "skip"];
    let cases = [
        Case::new("ais_three_ships.csv", 3, 48),
        Case::new("ais_harbour_60m.csv", 6, 70),
        Case::new("ais_two_receivers.csv", 3, 48)
            .leaves_out(&[("the same report from another receiver", 48)]),
        Case::new("dma_stray_quotes.csv", 3, 48).says(&["a quote that is never closed"]),
        Case::new("ais_second_of_minute.csv", 3, 60),
        Case::new("ais_every_15_min.csv", 3, 72),
        Case::new("ais_one_garbage_row.csv", 3, 48).with(skip).leaves_out(&[("`LAT`", 1)]),
        Case::new("ais_cut_last_line.csv", 3, 48).with(skip).leaves_out(&[("the last line is cut", 1)]),
        Case::new("ais_longitude_360.csv", 1, 40),
        Case::new("ais_us_dates.csv", 3, 60).says(&["month first"]),
        Case::new("ais_pandas.parquet", 3, 48),
        Case::new("marinecadastre_2025.csv.zst", 3, 48),
        Case::new("ais_tagged.nmea", 3, 48),
        Case::new("ais_semicolon.csv", 3, 48),
    ];
    for case in cases {
        let tracked = case.check();
        assert_eq!(tracked.summary["configuration"], "ais", "{}", case.file);
        assert_eq!(tracked.updated(), case.detections - case.tracks, "{}: {}", case.file, tracked.summary);
        tracked.assert_names(case.file);
        assert_no_mixture(case.file, &tracked);
    }
}

#[test]
fn every_aircraft_is_one_track_with_its_address() {
    let cases = [
        Case::new("readsb_pandas.csv", 3, 48),
        Case::new("opensky_python_states.csv", 3, 48),
        Case::new("basestation.csv", 3, 48).leaves_out(&[("a message without a position", 28)]),
        Case::new("fr24_track.csv", 1, 30),
        Case::new("stream_latlon.ndjson", 3, 48),
    ];
    for case in cases {
        let tracked = case.check();
        assert_eq!(tracked.summary["configuration"], "adsb", "{}", case.file);
        assert_eq!(tracked.updated(), case.detections - case.tracks, "{}: {}", case.file, tracked.summary);
        tracked.assert_names(case.file);
    }
}

#[test]
fn one_poll_of_a_receiver_is_read_at_the_times_of_its_positions() {
    let tracked = Case::new("aircraft.json", 0, 4).leaves_out(&[("without a time or position", 1)]).check();
    assert_eq!(tracked.summary["detections"]["started"], 4);
    Case::new("opensky_states.json", 0, 3).check();
    let rows = converted("aircraft.json");
    let times: Vec<f64> = rows.iter().map(|row| number(row, "time")).collect();
    let first = rows.iter().find(|row| row["identity"] == "4ca2d6").unwrap();
    assert_eq!(number(first, "time"), 1_709_632_800.0, "2.9 s before the poll");
    assert!(times.is_sorted() && times.len() == 4, "{times:?}");
}

#[test]
fn altitudes_in_feet_become_heights() {
    let rows = converted("readsb_pandas.csv");
    // 36,389 ft at the ellipsoid, less what the Earth falls away under the tangent plane.
    let at_origin = |row: &Value| number(row, "x").powi(2) + number(row, "y").powi(2);
    for row in rows.iter().filter(|row| row["identity"] == "4ca2d6") {
        let fall = at_origin(row) / (2.0 * 6_371_000.0);
        assert!((number(row, "z") - (36_389.0 * 0.3048 - fall)).abs() < 3.0, "{row}");
    }
}

#[test]
fn a_converted_recording_is_tracked_like_the_original() {
    let folder = tempfile::tempdir().unwrap();
    // An aircraft is believed with its second report, so its first one has no row.
    for (file, configuration, rows) in [("ais_three_ships.csv", "ais", 48), ("readsb_pandas.csv", "adsb", 45)]
    {
        for ending in ["parquet", "csv", "ndjson"] {
            let table = folder.path().join(format!("detections.{ending}"));
            let source = recording(file);
            run(["convert", source.to_str().unwrap(), "-o", table.to_str().unwrap()]).succeeded();
            let tracked = Tracked::of(&[&table], &[]);
            assert_eq!((tracked.tracks(), tracked.detections()), (3, 48), "{file} as {ending}");
            assert_eq!(tracked.summary["configuration"], configuration);
            tracked.assert_names(file);
            assert_eq!(
                tracked.rows.len(),
                rows,
                "{file}: a row for each report, and none for those of others"
            );
            for row in &tracked.rows {
                assert!((45.0..60.0).contains(&number(row, "latitude")), "{row}");
                assert!((7.0..13.0).contains(&number(row, "longitude")), "{row}");
            }
        }
    }
}

/// The rows of a file as a table of detections.
fn converted(file: &str) -> Vec<Value> {
    let stdout = run(["convert", recording(file).to_str().unwrap(), "-q"]).succeeded().stdout;
    stdout.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Checks that no track took a report of another ship, by the reports themselves.
fn assert_no_mixture(file: &str, tracked: &Tracked) {
    let skip = ["convert", recording(file).to_str().unwrap(), "-q", "--on-error", "skip"].map(str::to_owned);
    let stdout = run(skip).succeeded().stdout;
    let reports: Vec<Value> =
        stdout.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect();
    let name = |id: u64| text(reports.iter().find(|row| row["detection"] == id).unwrap(), "truth");
    for row in tracked.rows.iter().filter(|row| row["detection"].is_u64()) {
        assert_eq!(text(row, "identity"), name(row["detection"].as_u64().unwrap()), "{file}: {row}");
    }
}
