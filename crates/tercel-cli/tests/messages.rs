//! What the program says about bad input, and how it ends. `INSTA_UPDATE=always` accepts a change.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use support::{command, finish, run};

fn assert_message(name: &str, arguments: &[&str], code: i32) {
    let run = run(arguments);
    assert_eq!(run.code, code, "{name}: {}", run.transcript());
    insta::assert_snapshot!(name, run.transcript());
}

#[test]
fn a_table_that_cannot_be_used_ends_with_3_and_says_where_it_is_wrong() {
    for (name, file) in [
        ("missing_file", "nope.csv"),
        ("empty_file", "empty.csv"),
        ("missing_column", "missing_column.csv"),
        ("not_a_number", "nan.csv"),
        ("wrong_units", "degrees.csv"),
        ("looks_like_degrees", "looks_like_degrees.csv"),
        ("unknown_sensor", "unknown_sensor.csv"),
        ("other_observation", "polar.csv"),
        ("duplicate_detection", "duplicate.csv"),
        ("unknown_format", "tracker.toml"),
    ] {
        assert_message(name, &["track", file, "--config", "tracker.toml"], 3);
    }
}

#[test]
fn a_configuration_that_cannot_be_used_ends_with_3_and_says_where_it_is_wrong() {
    for (name, file) in [
        ("config_missing", "nope.toml"),
        ("config_unknown_key", "unknown_key.toml"),
        ("config_out_of_range", "out_of_range.toml"),
        ("config_no_toml", "no_toml.toml"),
        ("config_no_position", "no_position.toml"),
    ] {
        assert_message(name, &["config", "check", file], 3);
        let tracked = run(["track", "radar.csv", "--config", file]);
        assert_eq!(tracked.stderr, run(["config", "check", file]).stderr, "both commands say the same");
        assert_eq!(tracked.code, 3);
    }
}

#[test]
fn arguments_that_do_not_fit_end_with_2() {
    for (name, arguments) in [
        ("usage_unknown_study", &["study", "nope"][..]),
        ("usage_output_format", &["track", "radar.csv", "-o", "tracks.txt"]),
        ("usage_compressed_output", &["track", "radar.csv", "-o", "tracks.csv.gz"]),
        ("usage_json_and_stdout", &["track", "radar.csv", "-o", "-", "--json"]),
        ("usage_same_file", &["track", "radar.csv", "-o", "./radar.csv"]),
        ("usage_from", &["convert", "radar.csv", "--from", "asterix"]),
        ("usage_cutoff", &["evaluate", "radar.csv", "--truth", "truth.csv", "--cutoff", "-3"]),
        ("usage_no_truth", &["evaluate", "radar.csv"]),
        ("usage_preset", &["config", "init", "--preset", "nope"]),
        ("usage_origin", &["convert", "radar.csv", "--origin", "95,8"]),
    ] {
        assert_message(name, arguments, 2);
    }
}

#[test]
fn a_truncated_parquet_file_ends_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.parquet");
    run(["convert".as_ref(), "radar.csv".as_ref(), "-o".as_ref(), whole.as_os_str()]).succeeded();
    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(folder.path().join("half.parquet"), &bytes[..bytes.len() / 2]).unwrap();
    let output = command().current_dir(folder.path()).args(["track", "half.parquet"]).output().unwrap();
    let run = finish(output);
    assert_eq!(run.code, 3);
    insta::assert_snapshot!("truncated_parquet", run.transcript());
}

#[test]
fn a_table_of_another_kind_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.csv");
    run(["track".as_ref(), "radar.csv".as_ref(), "-q".as_ref(), "-o".as_ref(), tracks.as_os_str()])
        .succeeded();
    let run = finish(command().current_dir(folder.path()).args(["track", "tracks.csv"]).output().unwrap());
    assert_eq!(run.code, 3);
    insta::assert_snapshot!("tracks_are_no_detections", run.transcript());
}
