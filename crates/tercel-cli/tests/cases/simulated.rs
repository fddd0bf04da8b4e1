//! Small simulated inputs on which trackers go wrong.

use serde_json::Value;

use super::{Tracked, number, run, simulation, text};

/// Tracks a case, with its truth if it has one.
fn track(case: &str, more: &[&str]) -> Tracked {
    track_with(case, simulation(&format!("{case}/config.toml")).to_str().unwrap(), more)
}

fn track_with(case: &str, config: &str, more: &[&str]) -> Tracked {
    let truth = simulation(&format!("{case}/truth.csv"));
    let mut arguments = vec!["--config", config];
    if truth.exists() {
        arguments.extend(["--truth", truth.to_str().unwrap()]);
    }
    arguments.extend(more);
    Tracked::of(&[&simulation(&format!("{case}/detections.csv"))], &arguments)
}

#[test]
fn one_object_is_one_track_that_covers_it() {
    // Case, cut-off in m, updates of tracks and share of the truth that is covered, at least.
    for (case, cutoff, updates, covered) in [
        ("01_station_position", "20", 79, 0.95),
        ("03_coarse_bearing_east", "20", 235, 0.95),
        ("03_coarse_bearing_northeast", "20", 235, 0.95),
        ("04_doppler_two_scans_at_one_time", "100", 115, 0.95),
        ("04_doppler_position_jitter", "100", 55, 0.95),
        ("05_bearings_default_estimator", "200", 155, 0.9),
        ("09_outage", "20", 50, 0.95),
        ("12_every_row_twice", "20", 55, 0.95),
    ] {
        let tracked = track(case, &["--cutoff", cutoff]);
        assert_eq!(tracked.tracks(), 1, "{case}: {}", tracked.summary);
        assert!(tracked.updated() >= updates, "{case}: {}", tracked.summary);
        assert!(tracked.score("covered") >= covered, "{case}: {}", tracked.summary);
        assert_eq!(tracked.score("switches"), 0.0, "{case}");
        assert!(!tracked.stderr.contains("no track can start"), "{case}: {}", tracked.stderr);
    }
}

#[test]
fn stations_stand_where_the_configuration_says() {
    assert!(track("01_station_position", &[]).score("gospa") < 4.0);
}

#[test]
fn an_object_in_clutter_of_sixty_plots_a_scan_is_found() {
    let tracked = track("02_start_in_clutter", &[]);
    assert!(tracked.score("covered") >= 0.85, "{}", tracked.summary);
    assert!(tracked.score("false_tracks") < 1.0, "{}", tracked.summary);
}

#[test]
fn far_ranges_have_no_bias_and_an_honest_covariance() {
    let tracked = track("06_long_range_converted", &["--rows", "scans"]);
    let (mut bias, mut nees) = (0.0, 0.0);
    for object in 0..30 {
        let time = f64::from(2_000 * object + 196);
        let truth = [1e5, 100.0 * 196.0, 0.0, 100.0];
        let away = |row: &&Value| (number(row, "x") - truth[0]).hypot(number(row, "y") - truth[1]);
        let there = tracked.rows.iter().filter(|row| row["time"] == time && row["status"] != "deleted");
        let row = there.min_by(|a, b| away(a).total_cmp(&away(b))).unwrap();
        bias += number(row, "x").hypot(number(row, "y")) - truth[0].hypot(truth[1]);
        nees += mahalanobis(row, truth);
    }
    assert!((bias / 30.0).abs() < 10.0, "{} m too far", bias / 30.0);
    assert!(nees / 30.0 < 6.0, "NEES {}", nees / 30.0);
}

/// The squared distance of a state from the truth in units of its covariance, by elimination.
fn mahalanobis(row: &Value, truth: [f64; 4]) -> f64 {
    const LABELS: [&str; 4] = ["x", "y", "vx", "vy"];
    let error: [f64; 4] = std::array::from_fn(|i| number(row, LABELS[i]) - truth[i]);
    let mut rows: Vec<Vec<f64>> = (0..4)
        .map(|i| {
            let entry = |j: usize| number(row, &format!("cov_{}_{}", LABELS[i.min(j)], LABELS[i.max(j)]));
            (0..4).map(entry).chain([error[i]]).collect()
        })
        .collect();
    let mut distance = 0.0;
    while !rows.is_empty() {
        // A step of elimination leaves the part of the error that those before do not explain.
        let first = rows.remove(0);
        distance += first.last().unwrap().powi(2) / first[0];
        for row in &mut rows {
            let factor = row[0] / first[0];
            *row = row.iter().zip(&first).skip(1).map(|(entry, above)| entry - factor * above).collect();
        }
    }
    distance
}

#[test]
fn slant_ranges_are_corrected_by_the_height_and_otherwise_told() {
    let without = track("08_slant_range", &["--cutoff", "500"]);
    assert!(without.stderr.contains("ranges over ground"), "{}", without.stderr);
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("height.toml");
    let text = std::fs::read_to_string(simulation("08_slant_range/config.toml")).unwrap();
    std::fs::write(&config, text.replace("convert = true", "convert = true, height = 9000.0")).unwrap();
    let with = track_with("08_slant_range", config.to_str().unwrap(), &["--cutoff", "500"]);
    assert!(with.score("covered") >= 0.9 && with.tracks() == 1, "{}", with.summary);
    assert!(!with.stderr.contains("ranges over ground"), "{}", with.stderr);
}

#[test]
fn a_track_that_needs_three_hits_of_five_scans_waits_for_them() {
    let tracked = track("09_three_of_five", &["--all"]);
    let confirmed = tracked.rows.iter().find(|row| row["status"] == "confirmed").unwrap();
    assert_eq!((number(confirmed, "track"), number(confirmed, "time")), (1.0, 3.0));
    assert!(tracked.rows.iter().all(|row| row["status"] != "deleted"));
}

#[test]
fn rows_that_stand_twice_are_counted() {
    let tracked = track("12_every_row_twice", &[]);
    assert_eq!(tracked.left_out(), [("a detection that repeats another of its scan".to_owned(), 60)]);
    assert_eq!(tracked.detections(), 60);
    assert_eq!(tracked.summary["detections"]["left_out"], 60);
}

#[test]
fn an_object_over_the_radar_keeps_its_track() {
    let tracked = track("13_range_zero", &["--all"]);
    assert_eq!((tracked.tracks(), tracked.updated()), (1, 20), "{}", tracked.summary);
    assert!(tracked.rows.iter().all(|row| row["track"] == 1));
}

#[test]
fn a_key_with_its_default_changes_nothing() {
    let partial = track("14_pmbm_partial_management", &[]);
    let config = simulation("14_pmbm_partial_management/config_without_table.toml");
    let without = track_with("14_pmbm_partial_management", config.to_str().unwrap(), &[]);
    assert_eq!(partial.tracks(), 2);
    assert!(partial.score("covered") > 0.98, "{}", partial.summary);
    assert_eq!(partial.summary["scores"], without.summary["scores"]);
    assert_eq!(partial.rows, without.rows);
}

#[test]
fn what_is_not_reported_is_missed() {
    let scored = |tracks: &str, more: &[&str]| {
        let tracks = simulation(&format!("10_evaluate/{tracks}.csv"));
        let truth = simulation("10_evaluate/truth.csv");
        let arguments = ["evaluate", tracks.to_str().unwrap(), "--truth", truth.to_str().unwrap(), "--json"];
        let summary = run(arguments.iter().chain(more)).succeeded().json();
        move |name: &str| summary["scores"]["metrics"][name].as_f64().unwrap()
    };
    let none = scored("tracks_none", &[]);
    assert_eq!((none("covered"), none("gospa")), (0.0, 10.0));
    let two = scored("tracks_two_scans_only", &[]);
    assert!((two("covered") - 0.4).abs() < 1e-12 && (two("gospa") - 6.0).abs() < 1e-12);
    let off = scored("tracks_one_metre_off", &["--order", "8", "--cutoff", "100"]);
    assert!((off("tgospa") - 1.0).abs() < 1e-9 && (off("gospa") - 1.0).abs() < 1e-9);
}

#[test]
fn a_file_whose_clock_was_set_back_is_sorted_and_says_so() {
    let tracked = track("07_clock_set_back", &[]);
    assert_eq!(tracked.detections(), 80);
    assert!(tracked.stderr.contains("60 of 80 rows stood behind later ones"), "{}", tracked.stderr);
    assert!(tracked.rows.iter().all(|row| !text(row, "sensor").is_empty()));
}
