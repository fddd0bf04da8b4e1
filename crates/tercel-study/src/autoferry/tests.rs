use super::*;

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/autoferry")
}

#[test]
fn the_shipped_configuration_keeps_its_level() {
    let result = run(&folder(), &["nearest-neighbour".to_string()], 1, &BTreeMap::new(), &|_| {}).unwrap();
    let row = &result.table.rows[0];
    let mean = |name: &str| row.metrics[name].mean;
    assert!(mean("covered") >= 0.94, "{}", mean("covered"));
    assert!(mean("switches") <= 0.4, "{}", mean("switches"));
    assert!(mean("gospa") <= 13.0, "{}", mean("gospa"));
    assert!(mean("gospa_near") <= 10.0, "{}", mean("gospa_near"));
}

#[test]
fn the_shipped_mixture_of_hypotheses_keeps_its_level() {
    let result = run(&folder(), &["imm-pmbm".to_string()], 1, &BTreeMap::new(), &|_| {}).unwrap();
    let row = &result.table.rows[0];
    let mean = |name: &str| row.metrics[name].mean;
    assert!(mean("covered") >= 0.94, "{}", mean("covered"));
    assert!(mean("switches") <= 0.2, "{}", mean("switches"));
    assert!(mean("gospa") <= 18.0, "{}", mean("gospa"));
    assert!(mean("gospa_near") <= 11.0, "{}", mean("gospa_near"));
    assert!(mean("rmse_pos_norm") <= 4.35, "{}", mean("rmse_pos_norm"));
}

#[test]
fn recordings_come_by_their_numbers() {
    let names: Vec<String> = Recording::read_all(&folder()).unwrap().into_iter().map(|r| r.name).collect();
    assert_eq!(names, ["scenario2", "scenario3", "scenario5", "scenario13", "scenario16"]);
}

/// The expected figures come from a scorer written on its own with numpy, which assigns by exact enumeration, for the tracks
/// of `autoferry_scenario3_tracks.csv`.
#[test]
fn scores_agree_with_an_independent_scorer() {
    let recordings = Recording::read_all(&folder()).unwrap();
    let recording = recordings.iter().find(|recording| recording.name == "scenario3").unwrap();
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/autoferry_scenario3_tracks.csv");
    let tracks = tercel_data::read_tracks(fixture, &tercel_data::ReadOptions::default()).unwrap();
    let evaluation = evaluate(&tracks, &recording.truths, &recording.options()).unwrap();
    let expected = [
        ("covered", 0.9027777777777778),
        ("switches", 1.0),
        ("false_tracks", 0.75),
        ("false_tracks_near", 0.3333333333333333),
        ("gospa", 21.570789381318733),
        ("gospa_localisation", 12.12634493687428),
        ("gospa_missed", 1.9444444444444444),
        ("gospa_false", 7.5),
        ("gospa_near", 17.40412271465206),
        ("rmse_pos_norm", 7.823672364794709),
    ];
    assert_eq!(evaluation.instants.len(), 72);
    for (name, value) in expected {
        let got = evaluation.mean(name).unwrap();
        assert!((got - value).abs() < 1e-9, "{name}: {got} instead of {value}");
    }
}

#[test]
fn an_unknown_method_lists_the_known_ones() {
    let error = run(&folder(), &["magic".to_string()], 1, &BTreeMap::new(), &|_| {}).unwrap_err().to_string();
    assert!(error.contains("`magic`") && error.contains("phd"), "{error}");
}

#[test]
fn a_folder_without_recordings_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let error = Recording::read_all(empty.path()).unwrap_err().to_string();
    assert!(error.contains("_detections.json"), "{error}");
}
