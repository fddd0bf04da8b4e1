//! Streams that stay open.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use serde_json::Value;

use super::support::{command, finish, run_with_input};
use super::{recording, simulation};

const PATIENCE: Duration = Duration::from_secs(60);

/// Lines of a stream as they come.
fn follow(stream: impl Read + Send + 'static) -> Receiver<String> {
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

/// Runs with a configuration and input that stays open.
fn open(config: &str) -> (std::process::Child, ChildStdin, Receiver<String>) {
    let arguments = ["track", "-", "--config", config];
    let streams = command().args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).spawn();
    let mut child = streams.unwrap();
    let input = child.stdin.take().unwrap();
    let errors = follow(child.stderr.take().unwrap());
    (child, input, errors)
}

#[test]
fn a_clock_that_is_set_back_is_told_at_the_first_scan_that_is_left_out() {
    let config = simulation("07_clock_set_back/config.toml");
    let stream = std::fs::read_to_string(simulation("07_clock_set_back/stream.ndjson")).unwrap();
    let lines: Vec<&str> = stream.split_inclusive('\n').collect();
    let (mut child, mut input, errors) = open(config.to_str().unwrap());
    // Six scans from 1000 s on, and the first after the clock was set back; the stream stays open.
    input.write_all(lines[..7].concat().as_bytes()).unwrap();
    let said = errors.recv_timeout(PATIENCE).unwrap();
    assert!(said.contains("too late and left out"), "{said}");
    assert!(said.contains("clock_set_back = \"restart\"") && !said.contains("buffer"), "{said}");
    drop(input);
    assert!(child.wait().unwrap().success());
}

#[test]
fn a_clock_that_is_set_back_starts_anew_where_that_is_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("restart.toml");
    let text = std::fs::read_to_string(simulation("07_clock_set_back/config.toml")).unwrap();
    std::fs::write(&config, format!("{text}[input]\nclock_set_back = \"restart\"\n")).unwrap();
    let stream = std::fs::read_to_string(simulation("07_clock_set_back/stream.ndjson")).unwrap();
    let tracks = folder.path().join("tracks.ndjson");
    let arguments =
        ["track", "-", "--json", "-o", tracks.to_str().unwrap(), "--config", config.to_str().unwrap()];
    let run = run_with_input(arguments, &stream).succeeded();
    let summary = run.json();
    assert_eq!(summary["confirmed_tracks"], 2, "{summary}");
    assert_eq!(summary["detections"]["tracked"], stream.lines().count(), "{summary}");
    assert_eq!(summary["left_out"], serde_json::json!([]));
    assert!(run.stderr.contains("tracking starts anew"), "{}", run.stderr);
    let rows = std::fs::read_to_string(&tracks).unwrap();
    let rows: Vec<Value> = rows.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |track: u64| rows.iter().filter(move |row| row["track"] == track);
    assert!(of(1).all(|row| row["time"].as_f64() >= Some(1000.0)));
    assert!(of(2).all(|row| row["time"].as_f64() < Some(1000.0)) && of(2).count() > 0);
}

#[test]
fn one_wrong_time_in_a_stream_costs_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.ndjson");
    let stream = std::fs::read_to_string(recording("stream_one_future_time.ndjson")).unwrap();
    let run = run_with_input(["track", "-", "--json", "-o", tracks.to_str().unwrap()], &stream).succeeded();
    let summary = run.json();
    assert_eq!(summary["detections"]["tracked"], 80, "{summary}");
    assert_eq!(summary["confirmed_tracks"], 2, "{summary}");
    assert_eq!(summary["left_out"][0]["rows"], 1, "{summary}");
    assert!(run.stderr.contains("set aside"), "{}", run.stderr);
}

#[test]
fn a_stream_of_reports_says_which_configuration_it_needs() {
    let stream = std::fs::read_to_string(recording("stream_latlon.ndjson")).unwrap();
    let run = run_with_input(["track", "-"], &stream).succeeded();
    assert!(run.stderr.contains("--preset ais"), "{}", run.stderr);
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("adsb.toml");
    let config = config.to_str().unwrap();
    super::run(["config", "init", "--preset", "adsb", "-o", config]).succeeded();
    let run = run_with_input(["track", "-", "--config", config], &stream).succeeded();
    assert!(run.stderr.contains("tracks      3 confirmed"), "{}", run.stderr);
}

#[test]
fn other_formats_come_through_standard_input() {
    for (file, from) in
        [("ais_three_ships.csv", "ais"), ("ais_tagged.nmea", "nmea"), ("basestation.csv", "sbs")]
    {
        let mut child = command()
            .args(["track", "-", "--from", from])
            .stdin(std::fs::File::open(recording(file)).unwrap())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        let mut said = String::new();
        child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        let run = finish(child.wait_with_output().unwrap());
        assert_eq!(run.code, 0, "{file}: {said}");
        assert!(said.contains("tracks      3 confirmed"), "{file}: {said}");
    }
}
