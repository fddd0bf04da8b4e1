//! What the reports of many ships cost: the tracker of the preset `ais`, from the scan to the rows of its tracks.

use divan::counter::ItemsCount;
use tercel_data::table::{Detection, Observation, Scan};
use tercel_pipeline::config::presets;
use tercel_pipeline::{Config, Pipeline};

fn main() {
    divan::main();
}

/// Reports of ships that sail straight on, a scan for each second in which some report: each ship once in 60 s.
fn reports(ships: u64, minutes: u64) -> Vec<Scan> {
    let ship = |ship: u64, time: u64| {
        // Somewhere on a square of 200 km, at up to 12 m/s.
        let spread = |factor: u64| (ship * factor % 10_007) as f64 / 10_007.0;
        let [x, y] = [spread(7_919), spread(104_729)].map(|share| 2e5 * share);
        let [vx, vy] = [spread(1_299_709), spread(15_485_863)].map(|share| 16.0 * share - 8.0);
        let wave = ((ship + time) % 17) as f64 - 8.0;
        let (x, y) = (x + vx * time as f64 + wave, y + vy * time as f64 - wave);
        let observation = Observation::Position { x, y, z: None };
        let identity = Some(format!("{}", 219_000_000 + ship).into());
        Detection { identity, ..Detection::new(time * ships + ship, observation) }
    };
    let second = |time: u64| {
        let seen: Vec<Detection> =
            (0..ships).filter(|number| number % 60 == time % 60).map(|number| ship(number, time)).collect();
        Scan::new(time as f64, "ais", seen)
    };
    (0..minutes * 60).map(second).collect()
}

#[divan::bench(args = [300, 5_000])]
fn ships(bencher: divan::Bencher<'_, '_>, ships: u64) {
    let config = presets::get("ais").and_then(|text| Config::parse(text).ok());
    let Some(config) = config else { return };
    let scans = reports(ships, 10);
    let count: usize = scans.iter().map(|scan| scan.detections.len()).sum();
    bencher
        .counter(ItemsCount::new(count))
        .with_inputs(|| (Pipeline::new(&config), scans.clone()))
        .bench_values(|(pipeline, scans)| {
            let mut rows = 0;
            if let Ok(mut pipeline) = pipeline {
                for scan in scans {
                    rows += pipeline.push(scan).map_or(0, |rows| rows.len());
                }
            }
            rows
        });
}
