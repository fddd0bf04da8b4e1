//! `tercel track -`: detections in and tracks out, line by line.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use support::{command, files, lines, run_with_input};

const TRACK: [&str; 4] = ["track", "-", "--config", "tracker.toml"];

/// Lines of a stream as they come.
fn follow(stream: impl std::io::Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

#[test]
fn tracks_come_out_while_the_input_is_open() {
    let mut child = command().args(TRACK).stdin(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let output = follow(child.stdout.take().unwrap());
    let patience = Duration::from_secs(30);
    let lines = lines();
    input.write_all(lines[..1].concat().as_bytes()).unwrap();
    assert!(
        output.recv_timeout(patience).unwrap().starts_with("{\"tercel\":"),
        "the description comes first"
    );
    for (time, line) in lines.iter().enumerate().skip(1) {
        input.write_all(line.as_bytes()).unwrap();
        let row: serde_json::Value = serde_json::from_str(&output.recv_timeout(patience).unwrap()).unwrap();
        assert_eq!((row["time"].as_f64(), row["status"].as_str()), (Some(time as f64), Some("confirmed")));
    }
    drop(input);
    assert!(child.wait().unwrap().success());
}

#[test]
fn the_summary_goes_to_standard_error() {
    let run = run_with_input(TRACK, &lines().concat()).succeeded();
    assert!(run.stdout.lines().all(|line| line.starts_with('{')));
    assert!(run.stderr.contains("scans       6 tracked, 0 late\n"), "{}", run.stderr);
}

#[test]
fn a_bad_line_ends_the_stream_after_the_tracks_so_far() {
    let mut lines = lines();
    lines.insert(3, "{\"time\": 2.5, \"sensor\": \"radar\", \"x\": \"east\", \"y\": 0}\n".to_owned());
    let run = run_with_input(TRACK, &lines.concat());
    assert_eq!(run.code, 3);
    assert_eq!(run.stdout.lines().count(), 3, "a description and two rows: {}", run.stdout);
    insta::assert_snapshot!("bad_line", run.stderr);
}

#[test]
fn bad_lines_are_skipped_and_counted_when_asked_for() {
    let mut lines = lines();
    lines.insert(3, "oops\n".to_owned());
    lines.insert(5, "{\"time\": 3.5, \"sensor\": \"sonar\", \"detections\": []}\n".to_owned());
    lines.insert(
        6,
        "{\"time\": 3.6, \"sensor\": \"radar\", \"detections\": [{\"bearing\": 0.1}]}\n".to_owned(),
    );
    let run = run_with_input(TRACK.into_iter().chain(["--on-error", "skip"]), &lines.concat()).succeeded();
    assert_eq!(run.stdout.lines().count(), 6, "{}", run.stdout);
    assert_eq!(run.stderr.matches("warning: left out: ").count(), 3, "{}", run.stderr);
    assert!(run.stderr.contains("6 tracked, 0 late, 3 could not be used"), "{}", run.stderr);
}

#[test]
fn a_bad_line_leaves_no_half_file() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.csv");
    let arguments = TRACK.into_iter().chain(["-o", tracks.to_str().unwrap()]);
    assert_eq!(run_with_input(arguments, &(lines().concat() + "oops\n")).code, 3);
    assert_eq!(files(folder.path()), [""; 0]);
}

#[test]
fn a_stream_may_go_to_a_file_with_a_summary_in_json() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.parquet");
    let arguments = TRACK.into_iter().chain(["-o", tracks.to_str().unwrap(), "--json"]);
    let summary = run_with_input(arguments, &lines().concat()).succeeded().json();
    assert_eq!(summary["input"], "-");
    assert_eq!(summary["scans"]["tracked"], 6);
    assert_eq!(files(folder.path()), ["tracks.parquet"]);
}

#[test]
fn an_empty_stream_is_no_error() {
    let run = run_with_input(TRACK, "").succeeded();
    assert_eq!(run.stdout.lines().count(), 1, "{}", run.stdout);
    assert!(run.stderr.contains("scans       0 tracked"), "{}", run.stderr);
}

#[test]
fn a_reader_that_goes_away_ends_the_program_quietly() {
    let mut child = command().args(TRACK).stdin(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let mut input = child.stdin.take().unwrap();
    // The program may be gone before the last line.
    let _ = input.write_all(lines().concat().as_bytes());
    drop(input);
    let run = support::finish(child.wait_with_output().unwrap());
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
}

#[test]
fn a_table_comes_through_standard_input_as_a_whole() {
    let table = std::fs::read_to_string(support::fixtures().join("radar.csv")).unwrap();
    let run = run_with_input(TRACK.into_iter().chain(["--from", "csv"]), &table).succeeded();
    assert_eq!(run.stdout.lines().count(), 11, "{}", run.stdout);
}
