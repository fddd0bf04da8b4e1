//! GOSPA and OSPA agree with Stone Soup on the sets of `vectors/gospa_ospa.json`.

use serde_json::Value;
use tercel_core::metric::{Gospa, Ospa};

#[test]
fn gospa_and_ospa_are_those_of_stone_soup() {
    let points = |value: &Value| -> Vec<[f64; 2]> { serde_json::from_value(value.clone()).unwrap() };
    let file: Value = serde_json::from_str(include_str!("vectors/gospa_ospa.json")).unwrap();
    let cases = file["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 21);
    for case in cases {
        let (truth, estimates) = (points(&case["truth"]), points(&case["estimates"]));
        let (cutoff, order) = (case["cutoff"].as_f64().unwrap(), case["order"].as_f64().unwrap());
        let gospa = Gospa::new(cutoff, order).unwrap().score(&truth, &estimates).unwrap();
        let ospa = Ospa::new(cutoff, order).unwrap().score(&truth, &estimates).unwrap();
        if truth.is_empty() && estimates.is_empty() {
            // Stone Soup refuses these; the definition says zero.
            assert_eq!((gospa.total, ospa.total), (0.0, 0.0));
            continue;
        }
        let agree = |ours: f64, name: &str| {
            let theirs = case["gospa"][name].as_f64().unwrap();
            assert!((ours - theirs).abs() < 1e-9, "{name}: {ours} instead of {theirs}");
        };
        agree(gospa.total, "distance");
        agree(gospa.parts.localisation, "localisation");
        agree(gospa.parts.missed, "missed");
        agree(gospa.parts.false_alarm, "false");
        assert!((ospa.total - case["ospa"].as_f64().unwrap()).abs() < 1e-9);
    }
}
