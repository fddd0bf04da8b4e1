//! `tercel track`, `evaluate`, `convert` and `config` on files.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use support::{files, run, run_with_input};

const CONFIG: [&str; 2] = ["--config", "tracker.toml"];

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The transcript with what differs from run to run taken out.
fn steady(transcript: &str, folder: &Path) -> String {
    let line = |line: &str| match line.strip_prefix("speed") {
        Some(_) => "speed               [speed] scans/s\n".to_owned(),
        None => format!("{}\n", line.replace(text(folder), "[folder]")),
    };
    transcript.lines().map(line).collect()
}

#[test]
fn a_summary_tells_how_it_went() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.csv");
    let run =
        run(["track", "radar.csv", "--truth", "truth.csv", "-o", text(&tracks)].into_iter().chain(CONFIG));
    insta::assert_snapshot!("summary", steady(&run.transcript(), folder.path()));
}

#[test]
fn without_an_output_and_a_configuration_it_says_so() {
    let run = run(["track", "radar.csv"]);
    insta::assert_snapshot!("summary_by_default", steady(&run.transcript(), Path::new("nowhere")));
}

#[test]
fn quiet_leaves_the_summary_alone() {
    assert_eq!(run(["track", "radar.csv", "--quiet"]).succeeded().stderr, "");
}

#[test]
fn every_detection_is_accounted_for() {
    let summary = run(["track", "radar.csv", "--json"].into_iter().chain(CONFIG)).succeeded().json();
    let uses = &summary["detections"];
    let number = |name: &str| uses[name].as_u64().unwrap();
    assert_eq!(number("tracked"), 13);
    assert_eq!(number("updated") + number("started") + number("clutter"), 13);
    assert_eq!(number("left_out"), 0);
    assert_eq!(summary["confirmed_tracks"], 2);
    assert_eq!(summary["scans"]["tracked"], 6);
    assert!(summary["scans_per_second"].as_f64().unwrap() > 0.0);
    assert!(summary["scores"].is_null());
}

#[test]
fn a_file_is_sorted_and_ignored_scans_are_counted_with_their_detections() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("unsorted.csv");
    std::fs::write(
        &table,
        "time,sensor,x,y\n0,radar,0,0\n2,radar,1,0\n1,radar,1,0\n1,radar,9,9\n3,camera,1,1\n3,radar,1,0\n",
    )
    .unwrap();
    let summary = run(["track", text(&table), "--json"].into_iter().chain(CONFIG)).succeeded().json();
    let scans = serde_json::json!({"read": 5, "tracked": 4, "late": 0, "ahead": 0, "ignored": 1, "bad": 0});
    assert_eq!(summary["scans"], scans);
    assert_eq!(summary["detections"]["left_out"], 1);
    assert_eq!(summary["detections"]["tracked"], 5);
}

#[test]
fn scores_need_the_truth_and_find_both_objects() {
    let summary = run(["track", "radar.csv", "--truth", "truth.csv", "--json"].into_iter().chain(CONFIG));
    let scores = summary.succeeded().json()["scores"].clone();
    // Confirmed with the second scan of six.
    assert_eq!(scores["metrics"]["covered"], 10.0 / 12.0);
    assert_eq!(scores["metrics"]["switches"], 0.0);
    assert!(scores["metrics"]["rmse_pos_norm"].as_f64().unwrap() < 0.5);
}

#[test]
fn evaluate_gives_the_scores_of_track() {
    let folder = tempfile::tempdir().unwrap();
    let (tracks, metrics) = (folder.path().join("tracks.parquet"), folder.path().join("metrics.csv"));
    let tracked = run(["track", "radar.csv", "--truth", "truth.csv", "-o", text(&tracks), "--json"]
        .into_iter()
        .chain(CONFIG))
    .succeeded()
    .json();
    let evaluated = run([
        "evaluate",
        text(&tracks),
        "--truth",
        "truth.csv",
        "--scans",
        "radar.csv",
        "-o",
        text(&metrics),
        "--json",
    ])
    .succeeded()
    .json();
    assert_eq!(tracked["scores"], evaluated["scores"]);
    let table = std::fs::read_to_string(&metrics).unwrap();
    assert!(table.contains("evaluate,tracks,truth,gospa,"), "{table}");
    // The scan that no track was reported at is a time of the truth, and counts without the scans as well.
    let alone = run(["evaluate", text(&tracks), "--truth", "truth.csv", "--json"]).succeeded().json();
    assert_eq!(alone["scores"], evaluated["scores"]);
}

#[test]
fn tentative_tracks_are_written_when_asked_for() {
    let rows = |more: &[&str]| {
        let arguments =
            ["track", "radar.csv", "-o", "-", "-q"].into_iter().chain(CONFIG).chain(more.iter().copied());
        let stdout = run(arguments).succeeded().stdout;
        (
            stdout.lines().count() - 1,
            stdout.matches("\"tentative\"").count(),
            stdout.matches("\"deleted\"").count(),
        )
    };
    // Two tracks over five scans; the stray detection starts a third one, which dies before it is believed.
    assert_eq!(rows(&[]), (10, 0, 0));
    let (all, tentative, deleted) = rows(&["--all"]);
    assert_eq!((tentative, deleted), (3, 1));
    assert_eq!(all, 14);
}

#[test]
fn a_believed_track_ends_with_a_row_that_says_so() {
    let scan =
        |time: u32, x: &str| format!("{{\"time\":{time},\"sensor\":\"radar\",\"detections\":[{x}]}}\n");
    let seen = "{\"x\":0,\"y\":0}";
    let lines: String = [(0, seen), (1, seen), (2, seen), (3, ""), (4, ""), (5, "")]
        .iter()
        .map(|(t, x)| scan(*t, x))
        .collect();
    let stdout = run_with_input(["track", "-"].into_iter().chain(CONFIG), &lines).succeeded().stdout;
    let status = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["status"].clone();
    let life: Vec<_> = stdout.lines().skip(1).map(status).collect();
    assert_eq!(life, ["confirmed", "confirmed", "coasted", "deleted"]);
}

#[test]
fn the_report_and_the_tracks_appear_together() {
    let folder = tempfile::tempdir().unwrap();
    let (tracks, report) = (folder.path().join("tracks.parquet"), folder.path().join("report.html"));
    let outputs =
        ["track", "radar.csv", "-o", text(&tracks), "--report", text(&report), "--truth", "truth.csv"];
    run(outputs.into_iter().chain(CONFIG)).succeeded();
    assert_eq!(files(folder.path()), ["report.html", "tracks.parquet"]);
    let page = std::fs::read_to_string(&report).unwrap();
    assert!(page.contains("<title>radar.csv") && page.contains("GOSPA"));
}

#[test]
fn a_run_that_fails_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (tracks, report) = (folder.path().join("tracks.csv"), folder.path().join("report.html"));
    for input in ["nan.csv", "unknown_sensor.csv", "polar.csv"] {
        let outputs = ["track", input, "-o", text(&tracks), "--report", text(&report)];
        assert_eq!(run(outputs.into_iter().chain(CONFIG)).code, 3, "{input}");
        assert_eq!(files(folder.path()), [""; 0], "{input}");
    }
}

#[test]
fn a_report_that_cannot_be_written_takes_the_tracks_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let tracks = folder.path().join("tracks.csv");
    std::fs::create_dir(folder.path().join("taken")).unwrap();
    let taken = folder.path().join("taken");
    let nowhere = folder.path().join("nowhere/report.html");
    for report in [&taken, &nowhere] {
        let outputs = ["track", "radar.csv", "-o", text(&tracks), "--report", text(report)];
        assert_eq!(run(outputs.into_iter().chain(CONFIG)).code, 1);
        assert_eq!(files(folder.path()), ["taken"]);
    }
}

#[test]
fn a_folder_that_is_not_there_is_a_failure_of_the_system() {
    let run = run(["track", "radar.csv", "-o", "nowhere/tracks.csv"].into_iter().chain(CONFIG));
    assert_eq!(run.code, 1, "{}", run.transcript());
    assert!(run.stderr.contains("error: nowhere/tracks.csv: cannot write: "), "{}", run.stderr);
}

#[test]
fn tables_stay_the_same_from_format_to_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (parquet, csv) = (path("a.parquet"), path("b.csv"));
    run(["convert", "radar.csv", "-o", text(&parquet)]).succeeded();
    run(["convert", text(&parquet), "-o", text(&csv)]).succeeded();
    let there = run(["convert", text(&csv), "-q"]).succeeded();
    assert_eq!(there.stderr, "");
    assert_eq!(there.stdout, run(["convert", "radar.csv"]).succeeded().stdout);
}

#[test]
fn degrees_become_radians() {
    let converted = run(["convert", "degrees.csv", "--angles", "degrees"]).succeeded().stdout;
    assert!(converted.contains(&format!("\"bearing\":{}", std::f64::consts::FRAC_PI_2)), "{converted}");
}

#[test]
fn a_truth_that_is_not_there_is_said_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let (out, truth) = (folder.path().join("out.csv"), folder.path().join("truth.csv"));
    let run = run(["convert", "radar.csv", "-o", text(&out), "--truth-out", text(&truth)]);
    assert_eq!(run.code, 3);
    assert!(run.stderr.contains("has no truth"), "{}", run.stderr);
    assert_eq!(files(folder.path()), [""; 0]);
}

#[test]
fn a_recording_brings_its_truth_and_its_configuration() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/autoferry/scenario2");
    let summary = run(["track", text(&scenario), "--json"]).succeeded();
    assert!(summary.stderr.contains("`harbour`"), "{}", summary.stderr);
    let json = summary.json();
    assert_eq!(json["configuration"], "harbour");
    assert!(json["scores"]["metrics"]["covered"].as_f64().unwrap() > 0.9, "{json}");

    let folder = tempfile::tempdir().unwrap();
    let (out, truth) = (folder.path().join("out.parquet"), folder.path().join("truth.parquet"));
    run(["convert", text(&scenario), "-o", text(&out), "--truth-out", text(&truth)]).succeeded();
    let config = folder.path().join("harbour.toml");
    run(["config", "init", "--preset", "harbour", "-o", text(&config)]).succeeded();
    let again = ["track", text(&out), "--truth", text(&truth), "--config", text(&config), "--json"];
    assert_eq!(run(again).succeeded().json()["scores"], json["scores"]);
}

#[test]
fn every_preset_is_a_good_configuration() {
    let presets = run(["config", "presets"]).succeeded().stdout;
    assert!(presets.lines().count() >= 4);
    for line in presets.lines() {
        let (name, about) = line.split_once(' ').unwrap();
        assert!(about.trim().ends_with('.'), "{name} says what it is for");
        let text = run(["config", "init", "--preset", name]).succeeded().stdout;
        let checked = run_with_input(["config", "check", "-"], &text).succeeded().stdout;
        assert!(checked.starts_with("-: ok"), "{name}: {checked}");
    }
}

#[test]
fn a_configuration_that_is_there_stays_unless_forced() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tracker.toml");
    std::fs::write(&file, "mine").unwrap();
    let refused = run(["config", "init", "-o", text(&file)]);
    assert_eq!(refused.code, 1);
    assert!(refused.stderr.contains("help: --force"), "{}", refused.stderr);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    run(["config", "init", "-o", text(&file), "--force"]).succeeded();
    assert!(std::fs::read_to_string(&file).unwrap().contains("[motion]"));
}

#[test]
fn the_schema_is_json_with_units() {
    let schema = run(["config", "schema"]).succeeded().json();
    assert_eq!(schema["title"], "Tercel configuration");
    assert!(schema.to_string().contains("\"x-unit\":\"m/s\""));
}
