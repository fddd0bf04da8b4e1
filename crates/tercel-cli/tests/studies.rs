//! `tercel study` and `tercel simulate`. `INSTA_UPDATE=always` accepts a change.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use serde_json::Value;
use support::{files, run};

/// The same few runs of quick methods in all tests.
const FEW: [&str; 4] = ["--runs", "6", "--methods", "measurement,oracle"];

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn study<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    let (name, rest) = arguments.split_first().unwrap();
    ["study", name].into_iter().chain(FEW).chain(rest.iter().copied()).collect()
}

/// The JSON form without the time for a step.
fn timeless(mut table: Value) -> Value {
    for row in table["rows"].as_array_mut().unwrap() {
        assert!(row["us_per_step"].take().as_f64().unwrap() > 0.0);
    }
    table
}

/// What a JSON value is made of, without its numbers.
fn shape(value: &Value) -> Value {
    match value {
        Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), shape(value))).collect(),
        Value::Array(list) => list.iter().map(shape).collect(),
        Value::Number(_) => "number".into(),
        other => other.clone(),
    }
}

#[test]
fn the_json_form_has_its_shape() {
    let table = run(study(&["atc-test", "--json"])).succeeded().json();
    assert_eq!((&table["seed"], &table["runs"]), (&7919.into(), &6.into()));
    insta::assert_snapshot!("study_json", serde_json::to_string_pretty(&shape(&table)).unwrap());
    let sweep = run(study(&["atc-noise", "--json", "--set", "hshm"])).succeeded().json();
    assert_eq!(sweep["rows"].as_array().unwrap().len(), 20);
    assert_eq!(sweep["rows"][3]["at"], serde_json::json!({"bearing_deviation_deg": 0.2}));
}

#[test]
fn the_table_has_mean_deviation_and_interval() {
    let table = run(study(&["atc-test", "--seed", "5"])).succeeded().stdout;
    assert!(table.starts_with("study atc-test, seed 5, 6 runs\nmethod "), "{table}");
    assert!(table.contains(" ± ") && table.contains("  95 %") && table.contains(" .. "), "{table}");
    let sweep = run(study(&["atc-missing"])).succeeded().stdout;
    assert!(sweep.starts_with("study atc-missing, set test, seed 7919, 8 x 6 runs\n"), "{sweep}");
    assert!(sweep.contains("\nrmse_pos, m (mean) over Probability of detection\n"), "{sweep}");
}

#[test]
fn threads_and_shards_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let shards = folder.path().join("shards");
    let whole = run(study(&["atc-test", "--json", "--threads", "1"])).succeeded().json();
    let whole = timeless(whole);
    assert_eq!(timeless(run(study(&["atc-test", "--json", "--threads", "3"])).succeeded().json()), whole);
    for shard in ["2/3", "1/3", "3/3"] {
        let made = run(study(&["atc-test", "--shard", shard, "-o", text(&shards)])).succeeded();
        assert_eq!(made.stdout, "");
    }
    let results = folder.path().join("results");
    let merged = run(["study", "merge", text(&shards), "--json", "-o", text(&results)]).succeeded();
    assert_eq!(timeless(merged.json()), whole);
    let written = std::fs::read(results.join("study.json")).unwrap();
    assert_eq!(timeless(serde_json::from_slice(&written).unwrap()), whole);
    let names = files(&results);
    let expected = [
        "example_detections.csv",
        "example_measurement.csv",
        "example_oracle.csv",
        "example_truth.csv",
        "metrics.csv",
        "report.html",
        "study.json",
    ];
    assert_eq!(names, expected);
}

#[test]
fn a_study_replaces_the_tables_of_the_one_before_and_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    let mine = folder.path().join("example_mine.csv");
    std::fs::write(&mine, "mine").unwrap();
    let chosen =
        |methods| ["study", "atc-test", "--runs", "2", "--methods", methods, "-o", text(folder.path())];
    run(chosen("oracle,measurement")).succeeded();
    run(chosen("ekf")).succeeded();
    assert_eq!(std::fs::read(&mine).unwrap(), b"mine");
    let names = files(folder.path());
    let examples: Vec<_> = names.iter().filter(|name| name.starts_with("example_")).collect();
    assert_eq!(
        examples,
        ["example_detections.csv", "example_ekf.csv", "example_mine.csv", "example_truth.csv"]
    );
}

#[test]
fn a_shard_that_is_there_is_kept_and_another_one_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let shard = |more: &[&str]| {
        let arguments = ["atc-test", "--shard", "1/2", "-o", text(folder.path())];
        run(study(&[&arguments[..], more].concat()))
    };
    shard(&[]).succeeded();
    let path = folder.path().join("atc-test_1-of-2.shard.json");
    let before = std::fs::read(&path).unwrap();
    let again = shard(&[]).succeeded();
    assert!(again.stderr.contains("is there already and is kept"), "{}", again.stderr);
    assert_eq!(std::fs::read(&path).unwrap(), before);
    let other = shard(&["--seed", "9"]);
    assert_eq!(other.code, 3);
    assert!(other.stderr.contains("differ") && other.stderr.contains("--force"));
    shard(&["--seed", "9", "--force"]).succeeded();
    assert_ne!(std::fs::read(&path).unwrap(), before);
    std::fs::write(&path, &before[..100]).unwrap();
    let damaged = shard(&[]);
    assert_eq!(damaged.code, 3);
    assert!(damaged.stderr.contains("damaged") && damaged.stderr.contains("--force"), "{}", damaged.stderr);
}

#[test]
fn shards_that_do_not_fit_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let shard = |shard: &str, seed: &str, name: &str| {
        let into = folder.path().join(name);
        run(study(&["atc-test", "--seed", seed, "--shard", shard, "-o", text(&into)])).succeeded();
        into
    };
    let (one, two, other) = (shard("1/2", "1", "a"), shard("2/2", "1", "b"), shard("2/2", "2", "c"));
    let refused = |paths: &[&Path]| {
        let merge = ["study", "merge"].into_iter().chain(paths.iter().map(|path| text(path)));
        let run = run(merge);
        assert_eq!((run.code, run.stdout.as_str()), (3, ""));
        run.stderr.replace(text(folder.path()), "[folder]")
    };
    insta::assert_snapshot!("merge_missing", refused(&[&one]));
    insta::assert_snapshot!("merge_seeds", refused(&[&one, &other]));
    insta::assert_snapshot!("merge_twice", refused(&[&one, &two, &two]));
    insta::assert_snapshot!("merge_nothing", refused(&[folder.path()]));
    let path = two.join("atc-test_2-of-2.shard.json");
    let text = std::fs::read_to_string(&path).unwrap();
    let version = format!("\"tercel\":\"{}\"", env!("CARGO_PKG_VERSION"));
    std::fs::write(&path, text.replace(&version, "\"tercel\":\"0.0.1\"")).unwrap();
    assert!(refused(&[&one, &two]).contains("the shard was made by Tercel 0.0.1"));
}

#[test]
fn what_a_study_does_not_take_is_refused_with_the_reason() {
    for (name, arguments) in [
        ("study_unknown", &["study", "atc-tets"][..]),
        ("study_unknown_method", &["study", "atc-test", "--methods", "imn"]),
        ("study_set", &["study", "atc-test", "--set", "hshm"]),
        ("study_unknown_set", &["study", "atc-noise", "--set", "slow"]),
        ("study_no_runs", &["study", "atc-test", "--runs", "0"]),
        ("study_data", &["study", "atc-test", "--data", "."]),
        ("study_runs_of_recordings", &["study", "autoferry", "--runs", "3"]),
        ("study_shard", &["study", "atc-test", "--shard", "5/4", "-o", "x"]),
        ("study_shard_alone", &["study", "atc-test", "--shard", "1/4"]),
        ("study_shard_json", &["study", "atc-test", "--shard", "1/4", "-o", "x", "--json"]),
        ("study_nothing", &["study"]),
        ("simulate_unknown", &["simulate", "atc-fast", "-o", "x"]),
        ("simulate_detection", &["simulate", "atc-test", "--detection", "1.5", "-o", "x"]),
    ] {
        let run = run(arguments);
        assert_eq!(run.code, 2, "{name}: {}", run.transcript());
        if name == "study_unknown_method" {
            // Methods come and go; the list of them is not what this is about.
            assert!(run.stderr.contains("methods are: measurement, ekf"), "{}", run.stderr);
            assert!(run.stderr.contains("help: did you mean `imm`?"), "{}", run.stderr);
        } else {
            insta::assert_snapshot!(name, run.transcript());
        }
    }
}

#[test]
fn every_study_is_listed_with_its_methods() {
    let list = run(["study", "list"]).succeeded().stdout;
    for name in [
        "atc-test",
        "atc-hshm",
        "atc-noise",
        "atc-missing",
        "atc-ablation",
        "vehicle",
        "aircraft",
        "extended-scene",
        "clutter-partial",
        "clutter-all",
        "clutter-random",
        "autoferry",
    ] {
        assert!(list.lines().any(|line| line.starts_with(name)), "{list}");
        assert!(run(["study", "--help"]).stdout.contains(&format!("\n  {name} ")));
    }
    assert!(list.contains("methods: measurement, ") && list.contains("nearest-neighbour-loo"));
}

#[test]
fn simulated_flights_can_be_tracked_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let flights = path("flights");
    let simulate = ["simulate", "atc-test", "--seed", "4", "--runs", "2", "--detection", "0.9"];
    run(simulate.into_iter().chain(["-o", text(&flights)])).succeeded();
    let names = [
        "detections_00000.parquet",
        "detections_00001.parquet",
        "truth_00000.parquet",
        "truth_00001.parquet",
    ];
    assert_eq!(files(&flights), names);
    let (config, tracks) = (path("air-traffic.toml"), path("tracks.csv"));
    run(["config", "init", "--preset", "air-traffic", "-o", text(&config)]).succeeded();
    let (detections, truth) = (flights.join(names[1]), flights.join(names[3]));
    run(["track", text(&detections), "--config", text(&config), "-o", text(&tracks)]).succeeded();
    let scored = ["evaluate", text(&tracks), "--truth", text(&truth), "--cutoff", "5000", "--json"];
    let metrics = run(scored).succeeded().json()["scores"]["metrics"].clone();
    // Believed with the second scan of 200.
    assert_eq!((metrics["covered"].as_f64(), metrics["switches"].as_f64()), (Some(0.995), Some(0.0)));
    assert!(metrics["rmse_pos"].as_f64().unwrap() < 700.0, "{metrics}");
    run(["simulate", "atc-test", "--format", "csv", "-o", text(&path("csv"))]).succeeded();
    assert_eq!(files(&path("csv")), ["detections_00000.csv", "truth_00000.csv"]);
}
