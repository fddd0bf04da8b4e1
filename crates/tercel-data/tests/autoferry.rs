//! The Autoferry importer on the bundled recordings.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::f64::consts::PI;
use std::path::PathBuf;

use tercel_data::table::{Observation, Scan, Truths};
use tercel_data::{ImportOptions, Imported, Source, import};

const SCENARIOS: [u32; 5] = [2, 3, 5, 13, 16];

fn recording(scenario: u32) -> Imported {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../data/autoferry");
    let path = folder.join(format!("scenario{scenario}_detections.json.gz"));
    import(Source::Autoferry, &[path], &ImportOptions::default()).unwrap()
}

/// Positions of the boats at a time, between their receivers' fixes.
fn boats(truths: &Truths, time: f64) -> Vec<[f64; 2]> {
    ["havfruen", "gunnerus", "jetboat"]
        .iter()
        .filter_map(|name| {
            let rows: Vec<_> = truths.rows.iter().filter(|row| row.object.as_ref() == *name).collect();
            let after = rows.partition_point(|row| row.time <= time);
            let (a, b) = (rows.get(after.checked_sub(1)?)?, rows.get(after)?);
            let share = (time - a.time) / (b.time - a.time);
            Some([0, 1].map(|i| a.position[i] + share * (b.position[i] - a.position[i])))
        })
        .collect()
}

fn of<'a>(imported: &'a Imported, sensor: &'a str) -> impl Iterator<Item = &'a Scan> {
    imported.detections.scans.iter().filter(move |scan| scan.sensor.as_ref() == sensor)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn every_scan_is_there_in_the_order_of_time() {
    let scans = SCENARIOS.map(|scenario| {
        let detections = recording(scenario).detections;
        assert!(detections.scans.windows(2).all(|pair| pair[0].time <= pair[1].time));
        let ids = detections.scans.iter().flat_map(|scan| &scan.detections).map(|detection| detection.id);
        assert!(ids.eq(0..detections.scans.iter().map(|scan| scan.detections.len() as u64).sum()));
        detections.scans.len()
    });
    assert_eq!(scans, [1907, 2107, 3250, 1885, 1914]);
}

#[test]
fn both_boats_have_a_truth_without_repetitions() {
    for scenario in SCENARIOS {
        let truths = recording(scenario).truths.unwrap();
        let second = if scenario < 10 { "gunnerus" } else { "jetboat" };
        for boat in ["havfruen", second] {
            let times: Vec<f64> =
                truths.rows.iter().filter(|row| row.object.as_ref() == boat).map(|row| row.time).collect();
            assert!(times.len() > 50, "{boat} of scenario {scenario} has {} fixes", times.len());
            assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }
}

#[test]
fn radar_and_lidar_see_the_boats_where_their_receivers_say() {
    for scenario in SCENARIOS {
        let imported = recording(scenario);
        let truths = imported.truths.as_ref().unwrap();
        for sensor in ["radar", "lidar"] {
            let mut errors = Vec::new();
            for scan in of(&imported, sensor) {
                for boat in boats(truths, scan.time) {
                    let nearest = scan
                        .detections
                        .iter()
                        .filter_map(|detection| match detection.observation {
                            Observation::Position { x, y, .. } => Some((x - boat[0]).hypot(y - boat[1])),
                            Observation::Polar { .. } => None,
                        })
                        .fold(f64::INFINITY, f64::min);
                    errors.extend(Some(nearest).filter(|error| *error < 20.0));
                }
            }
            assert!(
                errors.len() > 20,
                "{sensor} of scenario {scenario} saw the boats {} times",
                errors.len()
            );
            let error = median(errors);
            // The largest boat is 36 m long, and the receiver is not where the radar sees it.
            assert!(error < 10.0, "{sensor} of scenario {scenario} is {error} m off");
        }
    }
}

/// How often the cameras have a bearing within 0.05 rad of the direction to a boat, if their bearings are turned so.
fn hits(imported: &Imported, turned: fn(f64) -> f64) -> usize {
    let truths = imported.truths.as_ref().unwrap();
    let cameras = of(imported, "infrared").chain(of(imported, "camera"));
    cameras
        .map(|scan| {
            let own = scan.position.unwrap();
            let sees = |boat: &[f64; 2]| {
                let direction = (boat[1] - own[1]).atan2(boat[0] - own[0]);
                scan.detections.iter().any(|detection| match detection.observation {
                    Observation::Polar { bearing, .. } => {
                        ((turned(bearing) - direction + PI).rem_euclid(2.0 * PI) - PI).abs() < 0.05
                    }
                    Observation::Position { .. } => false,
                })
            };
            boats(truths, scan.time).iter().filter(|boat| sees(boat)).count()
        })
        .sum()
}

#[test]
fn cameras_see_the_boats_in_the_direction_where_their_receivers_say() {
    for scenario in SCENARIOS {
        let imported = recording(scenario);
        let right = hits(&imported, |bearing| bearing);
        // What other conventions would give: mirrored at east, at north, and from north instead of east.
        let others: [fn(f64) -> f64; 3] =
            [|bearing| -bearing, |bearing| PI - bearing, |bearing| bearing + PI / 2.0];
        let wrong = others.map(|other| hits(&imported, other));
        assert!(
            wrong.iter().all(|wrong| right > 2 * wrong),
            "scenario {scenario}: {right} bearings point to a boat, and with other conventions {wrong:?}"
        );
    }
}
