use super::*;

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/autoferry")
}

#[test]
fn the_shipped_configuration_keeps_its_level() {
    let result = run(&folder(), &["nearest-neighbour".to_string()], 1, &|_| {}).unwrap();
    let row = &result.table.rows[0];
    let mean = |name: &str| row.metrics[name].mean;
    assert!(mean("covered") >= 0.94, "{}", mean("covered"));
    assert!(mean("switches") <= 0.4, "{}", mean("switches"));
    assert!(mean("gospa") <= 13.0, "{}", mean("gospa"));
    assert!(mean("gospa_near") <= 10.0, "{}", mean("gospa_near"));
}

/// Figures of an independent scorer (numpy, exact enumeration) for the tracks in `scored_tracks.csv.gz`.
#[test]
fn scores_agree_with_an_independent_scorer() {
    let recordings = Recording::read_all(&folder()).unwrap();
    assert_eq!(
        recordings.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(),
        ["scenario2", "scenario3", "scenario5", "scenario13", "scenario16"]
    );
}

#[test]
fn an_unknown_method_lists_the_known_ones() {
    let error = run(&folder(), &["magic".to_string()], 1, &|_| {}).unwrap_err().to_string();
    assert!(error.contains("`magic`") && error.contains("phd"), "{error}");
}

#[test]
fn a_folder_without_recordings_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let error = Recording::read_all(empty.path()).unwrap_err().to_string();
    assert!(error.contains("_detections.json"), "{error}");
}
