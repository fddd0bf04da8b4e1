//! The air-traffic studies through the machine, with quick methods.

#![allow(clippy::unwrap_used, clippy::panic)]

use tercel_study::StudyTable;
use tercel_study::monte_carlo::{Experiment, Results, Shard, conduct};
use tercel_study::studies::{Choice, Study, experiment_of};

fn experiment(name: &str, runs: u64) -> Box<dyn Experiment> {
    let methods = ["measurement", "oracle"].map(str::to_owned).to_vec();
    let choice = Choice { runs: Some(runs), methods: Some(methods), ..Choice::default() };
    Study::find(name).unwrap().experiment(&choice).unwrap()
}

/// The JSON form without the time for a step, which is measured.
fn json(experiment: &dyn Experiment, results: &Results) -> String {
    let mut table: StudyTable = results.table(experiment);
    table.rows.iter_mut().for_each(|row| row.us_per_step = 0.0);
    serde_json::to_string(&table).unwrap()
}

#[test]
fn a_study_is_the_same_for_any_number_of_threads_and_shards() {
    for name in ["atc-test", "atc-missing"] {
        let experiment = experiment(name, 12);
        let whole = conduct(&*experiment, Shard::WHOLE, Some(1), &|| {}).unwrap();
        let expected = json(&*experiment, &whole);
        for threads in [2, 3] {
            let again = conduct(&*experiment, Shard::WHOLE, Some(threads), &|| {}).unwrap();
            assert_eq!(json(&*experiment, &again), expected);
            assert_eq!(again.cells[0].curves, whole.cells[0].curves);
        }
        let folder = tempfile::tempdir().unwrap();
        let shards = ["3/5", "1/5", "5/5", "4/5", "2/5"].map(|text| {
            let shard: Shard = text.parse().unwrap();
            let path = folder.path().join(Results::file_name(experiment.plan(), shard));
            conduct(&*experiment, shard, None, &|| {}).unwrap().write(&path).unwrap();
            let read = Results::read(&path).unwrap();
            (path, read)
        });
        let merged = Results::merge(shards.to_vec()).unwrap();
        let experiment = experiment_of(&merged.plan).unwrap();
        assert_eq!(json(&*experiment, &merged), expected);
        assert_eq!(merged.cells[1].curves, whole.cells[1].curves);
        let numbers = |results: &Results| -> Vec<_> {
            results.cells.iter().map(|cell| (cell.runs.clone(), cell.values.clone())).collect()
        };
        assert!(numbers(&merged) == numbers(&whole));
    }
}

#[test]
fn the_truth_that_is_told_beats_the_plot() {
    let experiment = experiment("atc-test", 40);
    let results = conduct(&*experiment, Shard::WHOLE, None, &|| {}).unwrap();
    let table = results.table(&*experiment);
    let mean = |row: usize, metric: &str| table.rows[row].metrics[metric].mean;
    assert!(mean(1, "rmse_pos") < 0.6 * mean(0, "rmse_pos"));
    let ratio = mean(0, "rmse_pos_norm") / mean(0, "rmse_pos");
    assert!((ratio - std::f64::consts::SQRT_2).abs() < 1e-12);
    assert_eq!(mean(1, "accuracy"), 100.0);
    assert!(mean(0, "accuracy").is_nan() && mean(0, "rmse_vel").is_nan());
    assert_eq!(mean(0, "failures"), 0.0);
    // Plots of a typical flight are 700 m off per axis, which its radar's accuracy explains.
    assert!((500.0..900.0).contains(&mean(0, "rmse_pos")));
}

#[test]
fn errors_grow_with_the_noise_and_with_the_misses() {
    for (name, first, last) in [("atc-noise", 0, 9), ("atc-missing", 0, 7)] {
        let experiment = experiment(name, 10);
        let results = conduct(&*experiment, Shard::WHOLE, None, &|| {}).unwrap();
        let table = results.table(&*experiment);
        let oracle = |condition: usize| &table.rows[2 * condition + 1];
        assert_eq!(oracle(first).method, "oracle");
        assert!(oracle(last).metrics["rmse_all"].mean > 1.2 * oracle(first).metrics["rmse_all"].mean);
        assert_eq!(oracle(first).at.as_ref().unwrap().len(), 1);
    }
}

#[test]
fn a_published_study_is_a_folder_of_whole_tables() {
    let experiment = experiment("atc-hshm", 3);
    let results = conduct(&*experiment, Shard::WHOLE, None, &|| {}).unwrap();
    let table = results.table(&*experiment);
    let folder = tempfile::tempdir().unwrap();
    results.publish(&*experiment, &table, folder.path()).unwrap();
    let path = |name: &str| folder.path().join(name);
    let options = tercel_data::ReadOptions::default();
    // Two methods; seven metrics and the failures; three runs.
    assert_eq!(tercel_data::read_metrics(path("metrics.csv"), &options).unwrap().rows.len(), 2 * 8 * 3);
    let tracks = tercel_data::read_tracks(path("example_oracle.csv"), &options).unwrap();
    assert_eq!((tracks.labels.len(), tracks.modes.len(), tracks.rows.len()), (4, 3, 400));
    let plots = tercel_data::read_tracks(path("example_measurement.csv"), &options).unwrap();
    assert_eq!((plots.labels.len(), plots.modes.len()), (2, 0));
    assert!(tercel_data::read_truths(path("example_truth.csv"), &options).is_ok());
    assert!(tercel_data::read_detections(path("example_detections.csv"), &options).is_ok());
    let page = std::fs::read_to_string(path("report.html")).unwrap();
    assert!(page.contains("<h1>Study atc-hshm</h1>") && page.contains("471.18 ± 322.29"));
    let read: serde_json::Value =
        serde_json::from_slice(&std::fs::read(path("study.json")).unwrap()).unwrap();
    assert_eq!(read["rows"].as_array().unwrap().len(), 2);
}
