//! Recordings of ships and aircraft, as people bring them, come in whole.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::collections::BTreeMap;
use std::path::PathBuf;

use tercel_core::geo::{Geodetic, LocalFrame};
use tercel_data::table::{Detection, Observation};
use tercel_data::{
    DateOrder, ImportOptions, Imported, OnError, ReadOptions, Recording, Source, import, import_from,
};

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn skipping() -> ImportOptions {
    ImportOptions {
        read: ReadOptions { on_error: OnError::Skip, ..ReadOptions::default() },
        ..ImportOptions::default()
    }
}

/// A file of the source that it is recognised as.
fn recognised(name: &str, source: Source) -> Imported {
    assert_eq!(Source::recognise(path(name)).unwrap(), source, "{name}");
    import(source, &[path(name)], &ImportOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn detections(imported: &Imported) -> impl Iterator<Item = (f64, &Detection)> {
    let scans = imported.detections.scans.iter();
    scans.flat_map(|scan| scan.detections.iter().map(move |detection| (scan.time, detection)))
}

/// How many detections each object has.
fn objects(imported: &Imported) -> BTreeMap<String, usize> {
    let mut objects = BTreeMap::new();
    for (_, detection) in detections(imported) {
        *objects.entry(detection.identity.as_deref().unwrap_or_default().to_owned()).or_default() += 1;
    }
    objects
}

fn left_out(imported: &Imported) -> Vec<(String, usize)> {
    imported.left_out.iter().map(|left_out| (left_out.reason.to_string(), left_out.rows)).collect()
}

const THREE_SHIPS: [(&str, usize); 3] = [("219000101", 16), ("219000102", 16), ("219000103", 16)];
const THREE_AIRCRAFT: [(&str, usize); 3] = [("3c6444", 16), ("4b1814", 16), ("4ca2d6", 16)];

fn expect(imported: &Imported, expected: &[(&str, usize)]) {
    let expected: BTreeMap<String, usize> =
        expected.iter().map(|(name, count)| ((*name).to_owned(), *count)).collect();
    assert_eq!(objects(imported), expected);
}

/// The first ship is at 56.1 N, 11.2 E at ten o'clock, and 12 knots to the north-east of it later.
fn expect_first_ship(imported: &Imported, begin: f64) {
    let origin = imported.detections.origin.unwrap();
    let frame =
        LocalFrame::new(Geodetic { latitude: origin.latitude, longitude: origin.longitude, altitude: 0.0 })
            .unwrap();
    let mut ship =
        detections(imported).filter(|(_, detection)| detection.identity.as_deref() == Some("219000101"));
    let (time, first) = ship.next().unwrap();
    let place = frame.to_enu(&Geodetic::from_degrees(56.1, 11.2, 0.0));
    let Observation::Position { x, y, z } = first.observation else { panic!("no position") };
    assert_eq!((time, z), (begin, None));
    assert!((x - place.x).hypot(y - place.y) < 1.0, "{x} {y}");
    let (_, last) = ship.last().unwrap();
    let Observation::Position { x: east, y: north, .. } = last.observation else { panic!("no position") };
    let way = 12.0 * 1852.0 / 3600.0 * 150.0;
    assert!(((east - x).hypot(north - y) - way).abs() < 3.0 && ((east - x) - (north - y)).abs() < 5.0);
}

/// Ten o'clock on 5 March 2024.
const TEN: f64 = 1_709_632_800.0;

#[test]
fn every_form_of_the_three_ships_says_the_same() {
    for (name, source) in [
        ("ais_three_ships.csv", Source::Ais),
        ("ais_semicolon.csv", Source::Ais),
        ("ais_pandas.parquet", Source::Ais),
        ("ais_tagged.nmea", Source::Nmea),
        ("marinecadastre_2025.csv.zst", Source::Ais),
        ("dma_stray_quotes.csv", Source::Ais),
        ("ais_two_receivers.csv", Source::Ais),
    ] {
        let imported = recognised(name, source);
        expect(&imported, &THREE_SHIPS);
        expect_first_ship(&imported, TEN);
        assert!(imported.detections.scans.is_sorted_by_key(|scan| scan.time), "{name}");
        let description = &imported.detections.description;
        assert_eq!(description.source.as_deref(), Some("ais"));
        let sensor = &description.sensors["ais"];
        assert!(sensor.reports && sensor.identity && sensor.interval == Some(10.0), "{name}: {sensor:?}");
    }
}

#[test]
fn the_same_report_from_another_receiver_is_left_out_and_counted() {
    let imported = recognised("ais_two_receivers.csv", Source::Ais);
    assert_eq!(left_out(&imported), [("the same report from another receiver".to_owned(), 48)]);
    let apart = "mmsi,time,lat,lon\n219000101,0,56.1,11.2\n219000101,0,56.2,11.2\n219000101,30,56.1,11.2\n";
    let kept = import_from(Source::Ais, apart.as_bytes(), "apart", &ImportOptions::default()).unwrap();
    assert_eq!((objects(&kept)["219000101"], kept.left_out.len()), (3, 0));
    let options = ImportOptions { keep_repeated: true, ..ImportOptions::default() };
    let all = import(Source::Ais, &[path("ais_two_receivers.csv")], &options).unwrap();
    assert_eq!(objects(&all).values().sum::<usize>(), 96);
}

#[test]
fn moored_ships_and_long_intervals_come_in_whole() {
    let harbour = recognised("ais_harbour_60m.csv", Source::Ais);
    assert_eq!(objects(&harbour).len(), 6);
    assert!(harbour.left_out.is_empty());
    let slow = recognised("ais_every_15_min.csv", Source::Ais);
    assert_eq!(slow.detections.description.sensors["ais"].interval, Some(900.0));
}

#[test]
fn longitudes_to_360_are_those_of_the_other_half() {
    let imported = recognised("ais_longitude_360.csv", Source::Ais);
    let x: Vec<f64> = detections(&imported)
        .map(|(_, detection)| match detection.observation {
            Observation::Position { x, .. } => x,
            _ => panic!("no position"),
        })
        .collect();
    assert!(x.windows(2).all(|pair| (90.0..110.0).contains(&(pair[1] - pair[0]))), "{x:?}");
}

#[test]
fn dates_are_read_as_the_whole_file_tells_and_refused_where_nothing_does() {
    let march = recognised("ais_us_dates.csv", Source::Ais);
    assert_eq!(march.detections.scans[0].time, 1_710_287_880.0);
    assert!(march.notes[0].contains("month first"), "{:?}", march.notes);
    let ambiguous = "mmsi,timestamp,lat,lon\n1,03/12/2024 10:00:00,56,11\n1,03/12/2024 10:00:10,56,11.001\n";
    let read = |order| {
        let options = ImportOptions {
            read: ReadOptions { date_order: order, ..ReadOptions::default() },
            ..ImportOptions::default()
        };
        import_from(Source::Ais, ambiguous.as_bytes(), "ships.csv", &options)
    };
    let error = read(None).unwrap_err();
    assert!(error.to_string().contains("day or the month first"), "{error}");
    assert!(error.help().unwrap().contains("--date-order"), "{:?}", error.help());
    let time = |order| read(Some(order)).unwrap().detections.scans[0].time;
    assert_eq!(time(DateOrder::DayFirst) - time(DateOrder::MonthFirst), 266.0 * 86_400.0);
}

#[test]
fn the_second_of_the_minute_is_never_a_time() {
    let imported = recognised("ais_second_of_minute.csv", Source::Ais);
    assert_eq!(objects(&imported).len(), 3);
    assert!((imported.detections.scans[0].time - TEN).abs() < 1.0);
    let alone = "timestamp,mmsi,lat,lon\n50,1,56,11\n0,1,56,11.01\n10,1,56,11.02\n";
    let error =
        import_from(Source::Ais, alone.as_bytes(), "ships.csv", &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains("`timestamp` is the second of the minute"), "{error}");
}

#[test]
fn a_bad_row_is_refused_with_the_way_out_which_counts_it() {
    for (name, rows, problem, reason) in [
        ("ais_one_garbage_row.csv", 48, "95.2", "`LAT` is not degrees in [-90, 90]"),
        ("ais_cut_last_line.csv", 48, "the last line is cut", "the last line is cut"),
    ] {
        let error = import(Source::Ais, &[path(name)], &ImportOptions::default()).unwrap_err();
        assert!(error.to_string().contains(problem), "{error}");
        assert!(error.help().unwrap().contains("--on-error skip"), "{:?}", error.help());
        let imported = import(Source::Ais, &[path(name)], &skipping()).unwrap();
        assert_eq!(objects(&imported).values().sum::<usize>(), rows, "{name}");
        let left_out = left_out(&imported);
        assert!(
            left_out.len() == 1 && left_out[0].0.starts_with(reason) && left_out[0].1 == 1,
            "{left_out:?}"
        );
    }
}

#[test]
fn what_is_no_ship_is_left_out_unless_it_is_asked_for() {
    let text = "mmsi,time,lat,lon,Type of mobile\n\
                219000101,0,56.1,11.2,Class A\n002190017,0,56.2,11.2,Base Station\n\
                992191234,0,56.3,11.2,AtoN\n111219501,0,56.4,11.2,SAR Airborne\n219000102.0,0,56.5,11.2,Class B\n";
    let read = |all_stations| {
        let options = ImportOptions { all_stations, ..ImportOptions::default() };
        import_from(Source::Ais, text.as_bytes(), "ships.csv", &options).unwrap()
    };
    let ships = read(false);
    expect(&ships, &[("219000101", 1), ("219000102", 1)]);
    assert_eq!(ships.left_out.iter().map(|left_out| left_out.rows).sum::<usize>(), 3);
    assert!(ships.left_out.iter().all(|left_out| left_out.reason.contains("--all-stations")));
    assert_eq!(objects(&read(true)).len(), 5);
}

#[test]
fn every_form_of_the_three_aircraft_has_all_reports() {
    for (name, source) in [
        ("readsb_pandas.csv", Source::Adsb),
        ("opensky_python_states.csv", Source::Adsb),
        ("basestation.csv", Source::Sbs),
    ] {
        let imported = recognised(name, source);
        expect(&imported, &THREE_AIRCRAFT);
        assert_eq!(imported.detections.description.source.as_deref(), Some("adsb"));
        assert_eq!(imported.detections.scans[0].time, TEN, "{name}");
    }
}

/// The altitude of the first detection of the first aircraft, and how far its x, y are from the place with that altitude.
fn expect_place(imported: &Imported, identity: &str, (latitude, longitude, altitude): (f64, f64, f64)) {
    let origin = imported.detections.origin.unwrap();
    let frame =
        LocalFrame::new(Geodetic { latitude: origin.latitude, longitude: origin.longitude, altitude: 0.0 })
            .unwrap();
    let place = frame.to_enu(&Geodetic::from_degrees(latitude, longitude, altitude));
    let (_, first) =
        detections(imported).find(|(_, detection)| detection.identity.as_deref() == Some(identity)).unwrap();
    let Observation::Position { x, y, z: Some(z) } = first.observation else { panic!("no altitude") };
    assert!((x - place.x).hypot(y - place.y) < 0.5 && (z - place.z).abs() < 1.0, "{x} {y} {z}, not {place}");
}

#[test]
fn altitudes_are_in_the_unit_that_the_names_and_values_tell() {
    let readsb = recognised("readsb_pandas.csv", Source::Adsb);
    expect_place(&readsb, "4ca2d6", (47.45, 8.55, 36_389.0 * 0.3048));
    expect_place(&recognised("opensky_python_states.csv", Source::Adsb), "4ca2d6", (47.45, 8.55, 11_100.0));
    expect_place(&recognised("basestation.csv", Source::Sbs), "4ca2d6", (47.45, 8.55, 36_089.0 * 0.3048));
    let read = |text: &str| {
        import_from(Source::Adsb, text.as_bytes(), "traffic.csv", &ImportOptions::default()).unwrap()
    };
    let traffic = read(
        "timestamp,icao24,latitude,longitude,geoaltitude,groundspeed,track\n\
                        2024-03-05 10:00:00+00:00,4ca2d6,47.45,8.55,36000,447,70\n",
    );
    expect_place(&traffic, "4ca2d6", (47.45, 8.55, 36_000.0 * 0.3048));
    assert!(traffic.notes[0].contains("feet"), "{:?}", traffic.notes);
    let opensky =
        read("time,icao24,lat,lon,velocity,baroaltitude,geoaltitude\n1,4ca2d6,47.45,8.55,230,11000,11100\n");
    expect_place(&opensky, "4ca2d6", (47.45, 8.55, 11_100.0));
}

#[test]
fn the_export_of_a_flight_page_is_one_aircraft_by_its_callsign() {
    let imported = recognised("fr24_track.csv", Source::Adsb);
    assert_eq!(objects(&imported).len(), 1);
    expect_place(&imported, "ryr12ab", (47.45, 8.55, 36_089.0 * 0.3048));
}

#[test]
fn a_poll_is_at_the_times_of_its_positions() {
    let imported = recognised("aircraft.json", Source::AircraftJson);
    let times: Vec<f64> = detections(&imported).map(|(time, _)| (time * 10.0).round() / 10.0 - TEN).collect();
    assert_eq!(times.len(), 4);
    assert!(times.iter().zip([-0.1, 0.0, 1.2, 2.4]).all(|(a, b)| (a - b).abs() < 1e-6), "{times:?}");
    assert_eq!(left_out(&imported), [("without a time or position".to_owned(), 1)]);
    let on_ground = detections(&imported).find(|(_, it)| it.identity.as_deref() == Some("400abc")).unwrap().1;
    assert!(matches!(on_ground.observation, Observation::Position { z: None, .. }));
}

#[test]
fn polls_on_lines_repeat_no_position() {
    let poll = std::fs::read_to_string(path("aircraft.json")).unwrap().replace('\n', "");
    let later =
        poll.replace("1709632802.9", "1709632803.9").replace("\"seen_pos\": 2.9", "\"seen_pos\": 3.9");
    let moved = later.replace("47.599225", "47.599325").replace("\"seen_pos\": 1.7", "\"seen_pos\": 0.2");
    let lines = format!("{poll}\n{moved}\n");
    let imported =
        import_from(Source::AircraftJson, lines.as_bytes(), "polls", &ImportOptions::default()).unwrap();
    let objects = objects(&imported);
    assert_eq!((objects["3c6444"], objects["4ca2d6"]), (2, 1));
}

#[test]
fn state_vectors_of_opensky_come_in() {
    let imported = recognised("opensky_states.json", Source::OpenSky);
    expect(&imported, &[("3c6444", 1), ("4b1814", 1), ("4ca2d6", 1)]);
    expect_place(&imported, "4ca2d6", (47.45, 8.55, 11_100.0));
}

#[test]
fn boxes_of_the_mot_challenge_are_refused_in_words() {
    let error = Source::recognise(path("mot_det.txt")).unwrap_err();
    assert!(error.to_string().contains("MOT Challenge"), "{error}");
}

#[test]
fn damaged_sentences_are_left_out_and_counted() {
    let good = std::fs::read_to_string(path("ais_tagged.nmea")).unwrap();
    let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
    lines[3] = lines[3].replace("0*17", "0*18");
    lines[5].truncate(40);
    lines.push("$GPGGA,something*00".to_owned());
    let read =
        import_from(Source::Ais, lines.join("\n").as_bytes(), "log", &ImportOptions::default()).unwrap();
    assert_eq!(objects(&read).values().sum::<usize>(), 46);
    assert_eq!(read.left_out.iter().map(|left_out| left_out.rows).sum::<usize>(), 3);
}

#[test]
fn bare_sentences_are_timed_by_the_second_of_the_minute_with_a_note() {
    let good = std::fs::read_to_string(path("ais_tagged.nmea")).unwrap();
    let bare: String = good.lines().map(|line| format!("{}\n", &line[line.find('!').unwrap()..])).collect();
    let read = import_from(Source::Ais, bare.as_bytes(), "log", &ImportOptions::default()).unwrap();
    expect(&read, &THREE_SHIPS);
    expect_first_ship(&read, 0.0);
    assert!(read.notes[0].contains("no sentence has a time"), "{:?}", read.notes);
}

#[test]
fn a_recording_gives_the_scans_of_its_import_whatever_the_order_of_rows() {
    let text = std::fs::read_to_string(path("ais_three_ships.csv")).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines[1..].sort_by_key(|line| line.bytes().map(u64::from).sum::<u64>() * 7919 % 101);
    let folder = tempfile::tempdir().unwrap();
    let shuffled = folder.path().join("shuffled.csv");
    std::fs::write(&shuffled, lines.join("\n")).unwrap();
    let whole = import(Source::Ais, &[path("ais_three_ships.csv")], &ImportOptions::default()).unwrap();
    let options = ImportOptions { truths: false, ..ImportOptions::default() };
    let mut recording = Recording::open(Source::Ais, &[shuffled], &options).unwrap();
    let mut scans: Vec<_> = recording.by_ref().map(Result::unwrap).collect();
    let mut expected = whole.detections.scans.clone();
    for detection in scans.iter_mut().chain(&mut expected).flat_map(|scan| &mut scan.detections) {
        detection.truth = None;
    }
    assert_eq!(scans, expected);
    assert_eq!(recording.origin(), whole.detections.origin);
    assert_eq!(recording.description(), &whole.detections.description);
}

#[test]
fn two_days_in_any_order_are_one_recording() {
    let text = std::fs::read_to_string(path("ais_three_ships.csv")).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let folder = tempfile::tempdir().unwrap();
    let days = [&rows[24..], &rows[..24]].map(|rows| {
        let path = folder.path().join(format!("{}.csv", &rows[0][..40].replace([',', ':'], "_")));
        std::fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
        path
    });
    let whole = import(Source::Ais, &[path("ais_three_ships.csv")], &ImportOptions::default()).unwrap();
    let joined = import(Source::Ais, &days, &ImportOptions::default()).unwrap();
    assert_eq!(joined.detections.scans.len(), whole.detections.scans.len());
    expect(&joined, &THREE_SHIPS);
    expect_first_ship(&joined, TEN);
    let ids: Vec<u64> = detections(&joined).map(|(_, detection)| detection.id).collect();
    assert!(ids.iter().copied().eq(0..48));
}

#[test]
fn columns_units_and_names_may_be_given() {
    let options = |columns: Option<&str>| ImportOptions {
        read: ReadOptions {
            columns: columns.map(|names| names.split(',').map(str::to_owned).collect()),
            renames: vec![("icao24".to_owned(), "who".to_owned())],
            units: vec![("height".to_owned(), "m".parse().unwrap())],
            ..ReadOptions::default()
        },
        ..ImportOptions::default()
    };
    let read = |text: &str, options: &ImportOptions| {
        import_from(Source::Adsb, text.as_bytes(), "own.csv", options).unwrap()
    };
    let with_header = read("time,who,lat,lon,alt\n1,4ca2d6,47.45,8.55,1000\n", &options(None));
    assert_eq!(objects(&with_header)["4ca2d6"], 1);
    expect_place(&with_header, "4ca2d6", (47.45, 8.55, 304.8));
    let mut without = options(Some("time,who,lat,lon,height"));
    without.read.renames.push(("altitude".to_owned(), "height".to_owned()));
    expect_place(&read("1,4ca2d6,47.45,8.55,1000\n", &without), "4ca2d6", (47.45, 8.55, 1000.0));
}
