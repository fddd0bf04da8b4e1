//! Tables as people write them: what is in them is used, or counted by reason, or refused with the way out.

use super::{Case, Tracked, number, recording, refused};

#[test]
fn tables_are_read_whatever_their_times_names_and_order() {
    let future = &[("a time far ahead", 1)];
    let cases = [
        Case::new("xy_epoch_ms.csv", 2, 40).says(&["milliseconds"]),
        Case::new("xy_epoch_ns.parquet", 2, 40).says(&["nanoseconds"]),
        Case::new("xy_excel_serial.csv", 2, 40).says(&["days"]),
        Case::new("xy_unsorted.csv", 2, 40).says(&["32 of 40 rows", "sorted by time"]),
        Case::new("two_sensors_one_after_other.csv", 2, 80).says(&["sorted by time"]),
        Case::new("stream_one_future_time.ndjson", 2, 80).leaves_out(future).says(&["set aside"]),
        Case::new("stream_objects_list.ndjson", 2, 40).says(&["`objects`"]),
        Case::new("xy_nan_row.csv", 2, 40).leaves_out(&[("no measurement", 1)]),
        Case::new("xy_no_header.csv", 2, 40).with(&["--columns", "time,sensor,x,y"]),
        Case::new("xy_utf16.csv", 2, 40),
        Case::new("xy_tab.tsv", 2, 40),
        Case::new("xy_timestamp_column.csv", 2, 40).says(&["--sensor"]),
        Case::new("sensor_number.parquet", 2, 40),
        Case::new("truth_number.parquet", 2, 40),
    ];
    for case in cases {
        let tracked = case.check();
        assert_eq!(tracked.updated(), case.detections - 2, "{}: {}", case.file, tracked.summary);
    }
}

#[test]
fn what_cannot_be_read_is_refused_with_the_way_out() {
    for (file, words) in [
        ("xy_no_header.csv", "there is no header"),
        ("mot_det.txt", "MOT"),
        ("ais_one_garbage_row.csv", "--on-error skip"),
        ("ais_cut_last_line.csv", "--on-error skip"),
    ] {
        let said = refused(&recording(file), &[]);
        assert!(said.contains(words), "{file}: {said}");
    }
}

#[test]
fn plots_of_a_radar_that_turns_are_tracked_with_and_without_the_numbers_of_turns() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("air.toml");
    let config = config.to_str().unwrap();
    super::run(["config", "init", "--preset", "air-surveillance", "-o", config]).succeeded();
    for file in ["radar_rotating.csv", "radar_rotating_scan.csv"] {
        let tracked = Tracked::of(&[&recording(file)], &["--config", config]);
        assert_eq!((tracked.tracks(), tracked.detections()), (5, 80), "{file}: {}", tracked.summary);
        assert!(tracked.updated() >= 74, "{file}: {}", tracked.summary);
        assert_eq!(tracked.stderr.contains("turns once in 4.000 s"), file == "radar_rotating.csv");
    }
}

#[test]
fn compass_bearings_in_degrees_are_not_mirrored() {
    let config = recording("polar.toml");
    let arguments = ["--angles", "degrees", "--bearings", "compass", "-c", config.to_str().unwrap()];
    let tracked = Tracked::of(&[&recording("polar_compass_degrees.csv")], &arguments);
    assert_eq!((tracked.tracks(), tracked.detections()), (2, 40));
    for [x, y] in [[848.0, 1100.0], [690.0, 895.0]] {
        let near = |row: &&serde_json::Value| (number(row, "x") - x).hypot(number(row, "y") - y) < 15.0;
        assert!(tracked.ends().into_values().any(|row| near(&row)), "{x}, {y}: {:?}", tracked.ends());
    }
}

#[test]
fn plots_in_latitude_and_longitude_without_names_become_tracks() {
    let tracked = Case::new("plots_latlon.csv", 3, 48).says(&["no track starts with the numbers"]).check();
    assert!(tracked.updated() >= 42, "{}", tracked.summary);
}
