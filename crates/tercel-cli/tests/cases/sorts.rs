//! Plots of all sorts, made up for what goes wrong with them.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::{Tracked, jitter, number, refused, run, text};

/// Objects at x, y with vx, vy.
const PAIR: [[f64; 4]; 2] = [[0.0, 0.0, 10.0, 5.0], [500.0, 300.0, -8.0, 0.0]];

/// Positions of the pair in scans a second apart: time, x, y.
fn plots(scans: usize) -> Vec<[f64; 3]> {
    let mut plots = Vec::new();
    for scan in 0..scans {
        let time = scan as f64;
        for (number, [x, y, vx, vy]) in PAIR.into_iter().enumerate() {
            let seed = 4 * scan + 2 * number;
            plots.push([time, x + vx * time + jitter(seed), y + vy * time + jitter(seed + 1)]);
        }
    }
    plots
}

/// Rows of all plots under a header.
fn table(header: &str, row: impl Fn([f64; 3]) -> String) -> String {
    plots(20).into_iter().fold(format!("{header}\n"), |table, plot| table + &row(plot) + "\n")
}

/// Checks that both objects are tracks of all their plots.
fn assert_pair(case: &str, tracked: &Tracked) {
    let Tracked { summary, stderr, .. } = tracked;
    assert_eq!((tracked.tracks(), tracked.updated()), (2, 38), "{case}: {summary}\n{stderr}");
}

/// Plots of a radar at a place that turns clockwise once in a period: time, range, bearing.
fn painted(place: [f64; 2], period: f64, objects: &[[f64; 4]], until: f64) -> Vec<[f64; 3]> {
    let mut plots = Vec::new();
    for (number, [x, y, vx, vy]) in objects.iter().enumerate() {
        for turn in 0..(until / period) as usize {
            // The antenna points east when a turn begins; a few steps find when it points at the object.
            let mut time = turn as f64 * period;
            for _ in 0..5 {
                let bearing = (y + vy * time - place[1]).atan2(x + vx * time - place[0]);
                time = (turn as f64 + (-bearing / TAU).rem_euclid(1.0)) * period;
            }
            let (dx, dy) = (x + vx * time - place[0], y + vy * time - place[1]);
            let seed = 2 * (100 * number + turn);
            plots.push([time, dx.hypot(dy) + 20.0 * jitter(seed), dy.atan2(dx) + 0.001 * jitter(seed + 1)]);
        }
    }
    plots.sort_by(|a, b| a[0].total_cmp(&b[0]));
    plots
}

#[test]
fn two_radars_that_turn_at_different_rates_see_the_same_aircraft() {
    let objects = [
        [8_000.0, 6_000.0, 150.0, 60.0],
        [-9_000.0, 7_000.0, 100.0, -80.0],
        [6_000.0, -9_000.0, -120.0, 90.0],
        [-7_000.0, -8_000.0, 60.0, 170.0],
    ];
    let station = |name: &str, x: f64| {
        format!(
            "[sensors.{name}]\nmeasures = {{ polar = {{ range_deviation = 30.0, bearing_deviation = 0.002, convert = true }} }}\n\
             position = [{x:?}, 0.0]\nclutter = {{ uniform = {{ density = 1e-10 }} }}\n"
        )
    };
    let motion = "[motion]\nconstant_velocity = { acceleration_density = 0.5, speed = 150.0 }\n";
    let config = [motion, &station("west", -2_000.0), &station("east", 3_000.0)].concat();
    let mut rows = Vec::new();
    for (sensor, x, period) in [("west", -2_000.0, 4.0), ("east", 3_000.0, 2.5)] {
        let plots = painted([x, 0.0], period, &objects, 80.0);
        rows.extend(plots.into_iter().map(|[time, range, bearing]| (time, sensor, range, bearing)));
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut text = "time,sensor,range,bearing\n".to_owned();
    for (time, sensor, range, bearing) in &rows {
        writeln!(text, "{time:.3},{sensor},{range:.1},{bearing:.5}").unwrap();
    }
    let tracked = Tracked::of_text_with("plots.csv", &text, &config);
    assert_eq!(tracked.tracks(), 4, "{}\n{}", tracked.summary, tracked.stderr);
    assert_eq!(tracked.detections(), rows.len() as u64);
    assert!(tracked.updated() as usize >= rows.len() - 8, "{}", tracked.summary);
    for said in ["`west` have their own times", "once in 4.00", "`east` have their own times", "once in 2.50"]
    {
        assert!(tracked.stderr.contains(said), "{said}: {}", tracked.stderr);
    }
}

#[test]
fn plots_at_times_of_their_own_that_show_no_antenna_are_reports() {
    let mut text = "time,sensor,x,y\n".to_owned();
    for (step, [time, x, y]) in plots(20).into_iter().enumerate() {
        let own = time + if step % 2 == 0 { 0.13 } else { 0.57 } + 0.05 * jitter(step);
        let [_, _, vx, vy] = PAIR[step % 2];
        writeln!(text, "{own:.3},tracker,{:.2},{:.2}", x + vx * (own - time), y + vy * (own - time)).unwrap();
    }
    let tracked = Tracked::of_text("plots.csv", &text, &[]);
    assert_pair("own times", &tracked);
    assert!(tracked.stderr.contains("kind = \"reports\""), "{}", tracked.stderr);
}

#[test]
fn semicolons_and_decimal_commas_are_read() {
    let row = |[time, x, y]: [f64; 3]| format!("{time:.1};radar;{x:.3};{y:.3}").replace('.', ",");
    assert_pair("comma", &Tracked::of_text("plots.csv", &table("time;sensor;x;y", row), &[]));
}

#[test]
fn dates_with_the_month_first_are_read_when_that_is_said() {
    let row = |[time, x, y]: [f64; 3]| format!("03/05/2024 10:00:{time:02},radar,{x:.3},{y:.3}");
    let text = table("time,sensor,x,y", row);
    let tracked = Tracked::of_text("plots.csv", &text, &["--date-order", "month-first"]);
    assert_pair("month first", &tracked);
    let first = number(&tracked.rows[0], "time") - 1_709_632_800.0;
    assert!((0.0..20.0).contains(&first), "5 March, 10 o'clock and {first} s");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plots.csv");
    std::fs::write(&file, &text).unwrap();
    assert!(refused(&file, &[]).contains("--date-order"));
}

#[test]
fn two_sensors_with_clocks_of_their_own_in_any_order_of_rows_are_used() {
    let mut text = "time,sensor,x,y\n".to_owned();
    // The rows of a scan of the lidar stand before those of the radar, though they are later.
    for pair in plots(20).chunks(2) {
        for (sensor, later) in [("lidar", 0.4), ("radar", 0.0)] {
            for ([time, x, y], [_, _, vx, vy]) in pair.iter().zip(PAIR) {
                writeln!(text, "{},{sensor},{:.2},{:.2}", time + later, x + vx * later, y + vy * later)
                    .unwrap();
            }
        }
    }
    let tracked = Tracked::of_text("plots.csv", &text, &[]);
    assert_eq!((tracked.tracks(), tracked.updated()), (2, 78), "{}\n{}", tracked.summary, tracked.stderr);
    assert!(tracked.stderr.contains("sorted by time"), "{}", tracked.stderr);
}

#[test]
fn times_may_be_negative() {
    let row = |[time, x, y]: [f64; 3]| format!("{},radar,{x:.3},{y:.3}", time - 10.0);
    let tracked = Tracked::of_text("plots.csv", &table("time,sensor,x,y", row), &[]);
    assert_pair("negative", &tracked);
    assert!(tracked.rows.iter().any(|row| number(row, "time") < -5.0));
}

#[test]
fn one_time_that_is_zero_costs_one_row_and_no_time() {
    let mut text = "time,sensor,x,y\n0,radar,70,35\n".to_owned();
    for [time, x, y] in plots(30).into_iter().step_by(2) {
        writeln!(text, "{},radar,{x:.3},{y:.3}", 1_709_632_800.0 + time).unwrap();
    }
    let tracked = Tracked::of_text("plots.csv", &text, &[]);
    assert_eq!((tracked.tracks(), tracked.updated()), (1, 29), "{}\n{}", tracked.summary, tracked.stderr);
}

#[test]
fn scans_at_one_time_are_all_used() {
    let mut text = "time,sensor,scan,x,y\n".to_owned();
    for (row, [time, x, y]) in plots(20).into_iter().enumerate() {
        let scan = 2 * (row / 2);
        writeln!(text, "{time},radar,{scan},{x:.3},{y:.3}\n{time},radar,{},{:.3},{y:.3}", scan + 1, x + 1.0)
            .unwrap();
    }
    let tracked = Tracked::of_text("plots.csv", &text, &[]);
    assert_eq!((tracked.tracks(), tracked.updated()), (2, 78), "{}\n{}", tracked.summary, tracked.stderr);
    assert_eq!(tracked.summary["scans"]["tracked"], 40);
}

#[test]
fn times_that_stand_still_are_one_scan_of_many_plots() {
    let tracked = Tracked::of_text(
        "plots.csv",
        &table("time,sensor,x,y", |[_, x, y]| format!("7,radar,{x:.3},{y:.3}")),
        &[],
    );
    assert_eq!((tracked.tracks(), tracked.detections()), (0, 40), "{}", tracked.summary);
    assert_eq!(tracked.summary["scans"]["tracked"], 1);
}

#[test]
fn nautical_miles_and_compass_bearings_are_told_by_the_names_of_columns() {
    let config = "[motion]\nconstant_velocity = { acceleration_density = 0.5, speed = 15.0 }\n\
        [sensors.radar]\nmeasures = { polar = { range_deviation = 5.0, bearing_deviation = 0.01 } }\n\
        clutter = { uniform = { density = 1e-6 } }\n";
    let row = |[time, x, y]: [f64; 3]| {
        let (range, bearing) = ((x + 900.0).hypot(y + 900.0), (x + 900.0).atan2(y + 900.0));
        format!("{time},radar,{:.6},{:.4}", range / 1852.0, bearing.to_degrees().rem_euclid(360.0))
    };
    let text = table("time,sensor,Range (NM),True Bearing (deg)", row);
    let tracked = Tracked::of_text_with("plots.csv", &text, config);
    assert_pair("nautical miles", &tracked);
    let far: Vec<f64> =
        tracked.ends().into_values().map(|row| number(row, "x").hypot(number(row, "y"))).collect();
    let [x, y, vx, vy] = PAIR[0];
    let wanted = (x + 19.0 * vx + 900.0).hypot(y + 19.0 * vy + 900.0);
    assert!(far.iter().any(|range| (range - wanted).abs() < 10.0), "{far:?}, not {wanted}");
}

#[test]
fn heights_of_plots_correct_slant_ranges() {
    let config = "[motion]\nconstant_velocity = { acceleration_density = 0.5, speed = 150.0 }\n\
        [sensors.radar]\nmeasures = { polar = { range_deviation = 20.0, bearing_deviation = 0.001, convert = true } }\n\
        clutter = { uniform = { density = 1e-10 } }\n";
    let mut text = "time,sensor,range,bearing,z\n".to_owned();
    for step in 0..60 {
        let (time, x, y, z) = (4.0 * f64::from(step), -20_000.0 + 800.0 * f64::from(step), 4_000.0, 8_000.0);
        let slant = f64::hypot(x, y).hypot(z) + 20.0 * jitter(step as usize);
        writeln!(text, "{time},radar,{slant:.1},{:.6},{z}", f64::atan2(y, x)).unwrap();
    }
    let tracked = Tracked::of_text_with("plots.csv", &text, config);
    assert_eq!((tracked.tracks(), tracked.updated()), (1, 59), "{}\n{}", tracked.summary, tracked.stderr);
    let end = tracked.ends()[&1];
    assert!((number(end, "x") - 27_200.0).hypot(number(end, "y") - 4_000.0) < 100.0, "{end}");
}

#[test]
fn cells_that_are_no_number_cost_one_row_where_that_is_wanted() {
    let text =
        table("time,sensor,x,y", |[time, x, y]| format!("{time},radar,{x:.3},{y:.3}")) + "20,radar,lost,3\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plots.csv");
    std::fs::write(&file, &text).unwrap();
    assert!(refused(&file, &[]).contains(":42"), "the line is named");
    let tracked = Tracked::of(&[&file], &["--on-error", "skip"]);
    assert_pair("no number", &tracked);
    assert_eq!(tracked.left_out().iter().map(|left| left.1).sum::<u64>(), 1, "{:?}", tracked.left_out());
}

#[test]
fn rows_of_a_sensor_that_is_ignored_are_counted() {
    let text = table("time,sensor,x,y", |[time, x, y]| {
        format!("{time},radar,{x:.3},{y:.3}\n{time},camera,{y:.3},{x:.3}")
    });
    let config = run(["config", "init"]).succeeded().stdout + "\n[input]\nignore = [\"camera\"]\n";
    let tracked = Tracked::of_text_with("plots.csv", &text, &config);
    assert_pair("ignored", &tracked);
    assert_eq!(tracked.left_out(), [("a sensor that the configuration ignores".to_owned(), 40)]);
    assert!(tracked.rows.iter().all(|row| text_of(row) == "radar"));
}

fn text_of(row: &serde_json::Value) -> String {
    text(row, "sensor")
}
