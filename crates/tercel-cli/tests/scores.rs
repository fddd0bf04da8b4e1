//! `tercel evaluate` on small tables whose scores can be told by hand.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use serde_json::Value;
use support::{Run, run};

/// An object at five times, a second apart, 10 m from each to the next.
const TRUTH: &str = "straight_truth.csv";

fn evaluate(tracks: &str, truth: &str, more: &[&str]) -> Run {
    let tracks = format!("{tracks}.csv");
    let arguments = ["evaluate", &tracks, "--truth", truth].into_iter().chain(more.iter().copied());
    run(arguments.map(str::to_owned).collect::<Vec<_>>())
}

#[track_caller]
fn metric(tracks: &str, truth: &str, more: &[&str], name: &str) -> f64 {
    let more: Vec<&str> = more.iter().copied().chain(["--json"]).collect();
    let scores: Value = evaluate(tracks, truth, &more).succeeded().json();
    scores["scores"]["metrics"][name].as_f64().unwrap_or(f64::NAN)
}

#[test]
fn a_table_without_tracks_is_a_score() {
    for (name, expected) in [("covered", 0.0), ("gospa", 10.0), ("gospa_missed", 10.0), ("tgospa", 10.0)] {
        assert_eq!(metric("tracks_none", TRUTH, &[], name), expected, "{name}");
    }
    let text = evaluate("tracks_none", TRUTH, &[]).succeeded().stdout;
    assert!(text.contains("5 times") && !text.contains("-0.00"), "{text}");
}

#[test]
fn times_of_the_truth_at_which_nothing_was_reported_are_missed() {
    assert_eq!(metric("tracks_two_scans_only", TRUTH, &[], "covered"), 0.4);
    assert_eq!(metric("tracks_two_scans_only", TRUTH, &[], "gospa"), 6.0);
}

#[test]
fn a_table_without_truth_makes_every_track_false() {
    let empty = "truth_none.csv";
    assert_eq!(metric("tracks_one_metre_off", empty, &[], "gospa_false"), 10.0);
    assert_eq!(metric("tracks_one_metre_off", empty, &[], "false_tracks"), 1.0);
    assert!(metric("tracks_one_metre_off", empty, &[], "covered").is_nan());
}

#[test]
fn one_metre_off_is_one_metre_at_any_order() {
    for more in [
        ["--order", "1", "--cutoff", "20"],
        ["--order", "8", "--cutoff", "100"],
        ["--order", "150", "--cutoff", "1000"],
    ] {
        for name in ["gospa", "ospa", "tgospa"] {
            let value = metric("tracks_one_metre_off", TRUTH, &more, name);
            assert!((value - 1.0).abs() < 1e-9, "{name} {more:?}: {value}");
        }
    }
}

#[test]
fn a_pair_at_the_cut_off_is_missed_and_false_and_no_zero_is_negative() {
    let text = evaluate("tracks_at_the_cutoff", TRUTH, &[]).succeeded().stdout;
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
    for expected in [
        ["covered", "0.000"].as_slice(),
        &["gospa_localisation", "0.00", "m"],
        &["gospa_missed", "10.00", "m"],
        &["gospa_false", "10.00", "m"],
    ] {
        assert!(rows.iter().any(|row| row == expected), "{expected:?} is missing in {text}");
    }
}

#[test]
fn tracks_and_truth_of_different_epochs_are_refused_with_help() {
    let failed = evaluate("tracks_of_another_epoch", TRUTH, &[]);
    assert_eq!(failed.code, 3);
    assert!(
        failed.stderr.contains("the times of both must be seconds of the same epoch"),
        "{}",
        failed.stderr
    );
    let nothing = evaluate("tracks_none", "truth_none.csv", &[]);
    assert_eq!(nothing.code, 3);
    assert!(nothing.stderr.contains("neither the tracks nor the truth"), "{}", nothing.stderr);
}
