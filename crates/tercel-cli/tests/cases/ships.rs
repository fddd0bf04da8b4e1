//! Reports of ships and aircraft, made up for what goes wrong with them.

use std::fmt::Write;

use super::{Tracked, jitter, number, refused, run};

/// A ship that sails on straight.
#[derive(Clone, Copy)]
struct Ship {
    mmsi: u32,
    /// Degrees north and east.
    start: [f64; 2],
    /// m/s to the north and to the east.
    velocity: [f64; 2],
}

impl Ship {
    const fn new(mmsi: u32, start: [f64; 2], velocity: [f64; 2]) -> Self {
        Ship { mmsi, start, velocity }
    }

    /// Latitude and longitude after a time, s, with an error of metres.
    fn at(&self, time: f64, error: [f64; 2]) -> [f64; 2] {
        const DEGREE: f64 = 111_200.0;
        let [latitude, longitude] = self.start;
        let north = latitude + (self.velocity[0] * time + error[0]) / DEGREE;
        [north, longitude + (self.velocity[1] * time + error[1]) / (DEGREE * latitude.to_radians().cos())]
    }
}

const SHIPS: [Ship; 3] = [
    Ship::new(219_000_101, [56.10, 11.20], [4.4, 4.4]),
    Ship::new(219_000_102, [56.15, 11.24], [-4.1, 0.0]),
    Ship::new(219_000_103, [56.05, 11.29], [3.9, -6.7]),
];

/// Reports of ships in the order of time, each ship every so many seconds: time after the start, ship, latitude, longitude.
fn reports(ships: &[Ship], count: usize, interval: f64, error: f64) -> Vec<(f64, Ship, [f64; 2])> {
    let mut reports = Vec::new();
    for report in 0..count {
        for (number, ship) in ships.iter().enumerate() {
            let time = interval * (report as f64 + number as f64 / ships.len() as f64);
            let seed = 2 * (report * ships.len() + number);
            reports.push((time, *ship, ship.at(time, [error * jitter(seed), error * jitter(seed + 1)])));
        }
    }
    reports
}

/// Seconds of 5 March 2024, 10 o'clock.
const START: f64 = 1_709_632_800.0;

/// A table with Unix times.
fn table(reports: &[(f64, Ship, [f64; 2])]) -> String {
    reports.iter().fold("mmsi,timestamp,lat,lon\n".to_owned(), |mut table, (time, ship, [lat, lon])| {
        writeln!(table, "{},{},{lat:.6},{lon:.6}", ship.mmsi, START + time).unwrap();
        table
    })
}

#[test]
fn milliseconds_of_ships_are_told_and_read() {
    let mut text = "MMSI,timestamp,LAT,LON\n".to_owned();
    for (time, ship, [lat, lon]) in reports(&SHIPS, 15, 10.0, 2.0) {
        writeln!(text, "{},{:.0},{lat:.6},{lon:.6}", ship.mmsi, 1000.0 * (START + time)).unwrap();
    }
    let tracked = Tracked::of_text("ships.csv", &text, &[]);
    assert_eq!((tracked.tracks(), tracked.updated()), (3, 42), "{}", tracked.stderr);
    tracked.assert_names("milliseconds");
    assert!((number(&tracked.rows[0], "time") - START).abs() < 20.0, "{}", tracked.rows[0]);
}

#[test]
fn longitudes_to_360_of_ships_on_both_sides_of_the_antimeridian_are_one_picture() {
    let ships = [
        Ship::new(503_000_111, [-17.5, 179.98], [0.0, 9.0]),
        Ship::new(503_000_112, [-17.48, 180.03], [0.0, -8.0]),
    ];
    let tracked = Tracked::of_text("ships.csv", &table(&reports(&ships, 60, 10.0, 2.0)), &[]);
    assert_eq!((tracked.tracks(), tracked.updated()), (2, 118), "{}", tracked.stderr);
    tracked.assert_names("longitudes to 360");
    assert!(tracked.rows.iter().all(|row| number(row, "longitude").abs() > 179.8));
    assert!(tracked.rows.iter().all(|row| number(row, "x").abs() < 2e4), "a frame that is not torn");
}

#[test]
fn one_number_of_two_ships_is_two_tracks() {
    let ships = [
        Ship::new(219_000_199, [56.10, 11.20], [4.0, 4.0]),
        Ship::new(219_000_199, [56.28, 11.20], [-4.0, 4.0]),
    ];
    let tracked = Tracked::of_text("ships.csv", &table(&reports(&ships, 30, 10.0, 2.0)), &[]);
    assert_eq!(tracked.tracks(), 2, "{}\n{}", tracked.summary, tracked.stderr);
    assert!(tracked.updated() >= 54, "{}", tracked.summary);
    for track in [1, 2] {
        let rows = tracked.rows.iter().filter(|row| row["track"] == track && row["status"] == "confirmed");
        let north: Vec<f64> = rows.map(|row| number(row, "latitude")).collect();
        let spread = north.iter().fold(0.0_f64, |spread, lat| spread.max((lat - north[0]).abs()));
        assert!(spread < 0.05, "track {track} jumps between the ships");
    }
}

#[test]
fn ten_moored_ships_a_few_metres_apart_keep_their_names() {
    let ship = |number: u32| {
        Ship::new(219_000_200 + number, [56.10, 11.20 + 0.000_484 * f64::from(number)], [0.0, 0.0])
    };
    let ships: Vec<Ship> = (0..10).map(ship).collect();
    let tracked = Tracked::of_text("ships.csv", &table(&reports(&ships, 20, 180.0, 15.0)), &[]);
    assert_eq!((tracked.tracks(), tracked.updated()), (10, 190), "{}", tracked.summary);
    tracked.assert_names("moored");
}

#[test]
fn names_with_a_quote_that_is_never_closed_cost_no_row() {
    let mut text = "MMSI,BaseDateTime,LAT,LON,VesselName\n".to_owned();
    for (row, (time, ship, [lat, lon])) in reports(&SHIPS, 10, 10.0, 2.0).into_iter().enumerate() {
        let name = if row % 11 == 4 { "\"OLE" } else { "ALFA" };
        let (minute, second) = ((time / 60.0).floor(), time % 60.0);
        writeln!(text, "{},2024-03-05T10:{minute:02.0}:{second:06.3},{lat:.6},{lon:.6},{name}", ship.mmsi)
            .unwrap();
    }
    let tracked = Tracked::of_text("ships.csv", &text, &[]);
    assert_eq!((tracked.tracks(), tracked.detections()), (3, 30), "{}", tracked.stderr);
    assert!(tracked.stderr.contains("quote"), "{}", tracked.stderr);
}

#[test]
fn files_of_two_days_are_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let all = reports(&SHIPS, 40, 10.0, 2.0);
    let (first, second) = all.split_at(60);
    let [monday, tuesday] = ["monday.csv", "tuesday.csv"].map(|name| folder.path().join(name));
    std::fs::write(&monday, table(first)).unwrap();
    std::fs::write(&tuesday, table(second)).unwrap();
    for files in [[monday.as_path(), &tuesday], [tuesday.as_path(), &monday]] {
        let tracked = Tracked::of(&files, &[]);
        assert_eq!((tracked.tracks(), tracked.updated()), (3, 117), "{}", tracked.stderr);
        tracked.assert_names("two days");
    }
}

#[test]
fn tracks_of_ships_go_to_a_map_with_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let [ships, map] = ["ships.csv", "ships.geojson"].map(|name| folder.path().join(name));
    std::fs::write(&ships, table(&reports(&SHIPS, 10, 10.0, 2.0))).unwrap();
    run(["track", ships.to_str().unwrap(), "-o", map.to_str().unwrap()]).succeeded();
    let map: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&map).unwrap()).unwrap();
    let mut names: Vec<&str> = map["features"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["properties"]["name"].as_str().unwrap())
        .collect();
    names.sort_unstable();
    assert_eq!(names, ["219000101", "219000102", "219000103"]);
}

#[test]
fn base_stations_and_buoys_are_no_ships_and_are_counted() {
    let mut ships = SHIPS.to_vec();
    ships.push(Ship::new(2_190_001, [56.1, 11.3], [0.0, 0.0]));
    ships.push(Ship::new(992_190_001, [56.2, 11.3], [0.0, 0.0]));
    let text = table(&reports(&ships, 10, 10.0, 2.0)).replace("\n2190001,", "\n002190001,");
    let tracked = Tracked::of_text("ships.csv", &text, &[]);
    assert_eq!((tracked.tracks(), tracked.detections()), (3, 30), "{}", tracked.stderr);
    assert_eq!(tracked.left_out().iter().map(|left| left.1).sum::<u64>(), 20, "{:?}", tracked.left_out());
    assert_eq!(Tracked::of_text("ships.csv", &text, &["--all-stations"]).tracks(), 5);
}

#[test]
fn dates_that_may_begin_with_the_day_or_the_month_are_refused_until_it_is_said() {
    let mut text = "MMSI,timestamp,lat,lon\n".to_owned();
    for (time, ship, [lat, lon]) in reports(&SHIPS, 12, 20.0, 2.0) {
        let (minute, second) = ((time / 60.0).floor(), (time % 60.0).floor());
        writeln!(text, "{},03/05/2024 10:{minute:02.0}:{second:02.0},{lat:.6},{lon:.6}", ship.mmsi).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ships.csv");
    std::fs::write(&file, &text).unwrap();
    assert!(refused(&file, &[]).contains("--date-order"));
    let tracked = Tracked::of(&[&file], &["--date-order", "month-first"]);
    assert_eq!(tracked.tracks(), 3);
    assert!((number(&tracked.rows[0], "time") - START).abs() < 20.0, "5 March: {}", tracked.rows[0]);
}

#[test]
fn aircraft_with_gaps_of_a_feed_are_one_track_each() {
    let aircraft = [
        ("4ca2d6", Ship::new(1, [47.45, 8.55], [78.0, 216.0])),
        ("3c6444", Ship::new(2, [47.60, 8.10], [-72.0, 197.0])),
        ("4b1814", Ship::new(3, [47.20, 8.90], [78.0, -45.0])),
    ];
    let ships = aircraft.map(|(_, ship)| ship);
    let mut text = "time,icao24,lat,lon,geoaltitude\n".to_owned();
    for (time, ship, [lat, lon]) in reports(&ships, 40, 10.0, 20.0) {
        // The receiver is away for a minute and a half.
        if !(100.0..190.0).contains(&time) {
            let (address, _) = aircraft[ship.mmsi as usize - 1];
            writeln!(text, "{},{address},{lat:.6},{lon:.6},9000", START + time).unwrap();
        }
    }
    let tracked = Tracked::of_text("states.csv", &text, &[]);
    assert_eq!(tracked.tracks(), 3, "{}\n{}", tracked.summary, tracked.stderr);
    assert_eq!(tracked.updated(), tracked.detections() - 3, "{}", tracked.summary);
    tracked.assert_names("gaps");
}

#[test]
fn a_radar_and_the_reports_of_ships_share_tracks() {
    let config = "[motion]\nconstant_velocity = { acceleration_density = 0.01, speed = 10.0 }\n\
        [sensors.radar]\nmeasures = { position = { deviation = 20.0 } }\ndetection = 0.9\n\
        clutter = { uniform = { density = 1e-9 } }\n\
        [sensors.ais]\nkind = \"reports\"\nmeasures = { position = { deviation = 10.0 } }\n\
        clutter = { uniform = { density = 1e-12 } }\n";
    let objects = [[0.0, 0.0, 6.0, 2.0], [3000.0, 500.0, -5.0, 3.0], [-1500.0, 2500.0, 0.0, -7.0]];
    let place = |object: &[f64; 4], time: f64, seed: usize, error: f64| {
        let [x, y, vx, vy] = *object;
        format!("{:.1},{:.1}", x + vx * time + error * jitter(seed), y + vy * time + error * jitter(seed + 1))
    };
    let mut text = "time,sensor,x,y,identity\n".to_owned();
    for scan in 0..60 {
        let time = 3.0 * scan as f64;
        for (number, object) in objects.iter().enumerate() {
            let seed = 10 * scan + 2 * number;
            writeln!(text, "{time},radar,{},", place(object, time, seed, 25.0)).unwrap();
            // Each ship reports every 12 s, at a time of its own; the last one has no transponder.
            if scan % 4 == number && number < 2 {
                let time = time + 1.0;
                writeln!(text, "{time},ais,{},21900010{number}", place(object, time, seed, 10.0)).unwrap();
            }
        }
    }
    let tracked = Tracked::of_text_with("both.csv", &text, config);
    assert_eq!(tracked.tracks(), 3, "{}\n{}", tracked.summary, tracked.stderr);
    assert!(tracked.updated() >= 205, "{}", tracked.summary);
    let names = tracked.identities();
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(names.values().all(|names| names.len() == 1), "{names:?}");
}
