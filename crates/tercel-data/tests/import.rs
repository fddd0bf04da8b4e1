//! The importers for aircraft and ships, on reports made up for the purpose.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;

use tercel_core::geo::{Geodetic, LocalFrame};
use tercel_data::table::{Detections, Observation, Origin, Truth};
use tercel_data::{ImportOptions, Imported, LeftOut, Source, import, import_from, write_detections};

const ORIGIN: Origin = Origin { latitude: 0.9, longitude: 0.05, altitude: 100.0 };

fn options() -> ImportOptions {
    ImportOptions { origin: Some(ORIGIN), ..ImportOptions::default() }
}

fn aircraft(text: &str, options: &ImportOptions) -> Imported {
    import_from(Source::Adsb, text.as_bytes(), "adsb.csv", options).unwrap()
}

fn ships(text: &str) -> Imported {
    import_from(Source::Ais, text.as_bytes(), "ais.csv", &options()).unwrap()
}

fn truths(imported: &Imported) -> &[Truth] {
    &imported.truths.as_ref().unwrap().rows
}

/// Degrees of a place in the local frame.
fn degrees(east: f64, north: f64, up: f64) -> (f64, f64, f64) {
    let frame = LocalFrame::new(Geodetic {
        latitude: ORIGIN.latitude,
        longitude: ORIGIN.longitude,
        altitude: ORIGIN.altitude,
    })
    .unwrap();
    let place = frame.from_enu(&[east, north, up].into());
    (place.latitude.to_degrees(), place.longitude.to_degrees(), place.altitude)
}

#[test]
fn aircraft_are_where_they_say_in_feet_and_knots() {
    let (latitude, longitude, altitude) = degrees(12_000.0, -3_000.0, 4_000.0);
    let text = format!(
        "t_unix,icao24,callsign,lat,lon,alt_ft,gs_kt,track_deg,vr_fpm,fresh\n\
         1600000000,AE0455,TEST1,{latitude},{longitude},{},194.3844492440605,90,0,1\n",
        altitude / 0.3048
    );
    let imported = aircraft(&text, &options());
    assert_eq!(imported.detections.origin, Some(ORIGIN));
    let scan = &imported.detections.scans[0];
    assert_eq!((scan.time, scan.sensor.as_ref()), (1.6e9, "adsb"));
    let Observation::Position { x, y, z: Some(z) } = scan.detections[0].observation else {
        panic!("no position")
    };
    assert!((x - 12_000.0).hypot(y + 3_000.0).hypot(z - 4_000.0) < 1e-3, "{x} {y} {z}");
    assert_eq!(scan.detections[0].truth.as_deref(), Some("ae0455"));
    let [vx, vy] = truths(&imported)[0].velocity.unwrap();
    assert!((vx - 100.0).abs() < 0.01 && vy.abs() < 0.5, "{vx} {vy}");
}

#[test]
fn velocities_are_differences_of_positions() {
    // 200 km from the origin, where north is another direction than at the origin.
    let from = degrees(200_000.0, 100_000.0, -3_000.0);
    let to = degrees(200_000.0 + 150.0, 100_000.0 + 80.0, -3_000.0);
    let there = LocalFrame::new(Geodetic::from_degrees(from.0, from.1, from.2)).unwrap();
    let step = there.to_enu(&Geodetic::from_degrees(to.0, to.1, to.2));
    let (speed, track) = (step.x.hypot(step.y), step.x.atan2(step.y).to_degrees());
    let text = format!(
        "time,icao24,lat,lon,geoaltitude,velocity,heading\n0,a,{},{},{},{speed},{track}\n",
        from.0, from.1, from.2
    );
    let [vx, vy] = truths(&aircraft(&text, &options()))[0].velocity.unwrap();
    assert!((vx - 150.0).abs() < 0.5 && (vy - 80.0).abs() < 0.5, "{vx} {vy}");
}

#[test]
fn repeated_positions_are_left_out_and_counted() {
    let fresh = "time,icao24,lat,lon,fresh\n0,a,50,1,1\n1,a,50,1,0\n2,a,50.1,1,1\n";
    let updates =
        "time,icao24,lat,lon,lastposupdate\n10,a,50,1,9.5\n20,a,50,1,9.5\n20,b,50,1,9.5\n30,a,50,1,29\n";
    let places = "time,icao24,lat,lon\n0,a,50,1\n1,a,50,1\n1,b,50,1\n2,a,50,2\n";
    for (text, kept) in [(fresh, 2), (updates, 3), (places, 3)] {
        let imported = aircraft(text, &options());
        assert_eq!(truths(&imported).len(), kept, "{text}");
        assert_eq!(imported.left_out, [LeftOut { reason: "a repeated position".into(), rows: 1 }]);
        let all = aircraft(text, &ImportOptions { keep_repeated: true, ..options() });
        assert_eq!(truths(&all).len(), kept + 1);
    }
}

#[test]
fn reports_take_the_time_of_their_position() {
    let text = "time,icao24,lat,lon,lastposupdate\n10,a,50,1,9.5\n10,b,50,2,8.25\n10,c,50,3,\n";
    let times = |options: &ImportOptions| -> Vec<f64> {
        aircraft(text, options).detections.scans.iter().map(|scan| scan.time).collect()
    };
    assert_eq!(times(&options()), [8.25, 9.5, 10.0]);
    assert_eq!(times(&ImportOptions { reported_time: true, ..options() }), [10.0]);
}

#[test]
fn rows_without_a_position_are_left_out_and_counted() {
    let text = "time,icao24,lat,lon\n0,a,50,1\n1,a,,\n2,a,NaN,nan\n";
    let imported = aircraft(text, &options());
    assert_eq!(imported.left_out, [LeftOut { reason: "without a time or position".into(), rows: 2 }]);
}

#[test]
fn an_aircraft_without_altitude_stays_where_it_was() {
    let (latitude, longitude, altitude) = degrees(50_000.0, 0.0, 9_000.0);
    let text = format!(
        "time,icao24,lat,lon,baroaltitude\n0,a,{latitude},{longitude},{altitude}\n1,a,{},{longitude},\n",
        latitude + 1e-9
    );
    let imported = aircraft(&text, &options());
    let [first, second] = truths(&imported) else { panic!("two rows") };
    assert!((first.position[0] - second.position[0]).abs() < 0.01);
    assert_eq!((first.z.is_some(), second.z), (true, None));
}

#[test]
fn callsigns_part_the_flights_of_an_aircraft_on_request() {
    let text = "time,icao24,callsign,lat,lon\n0,a,OUT1  ,50,1\n1,a,,50,2\n2,a,BACK2,50,3\n";
    let names = |options: &ImportOptions| -> Vec<String> {
        truths(&aircraft(text, options)).iter().map(|truth| truth.object.to_string()).collect()
    };
    assert_eq!(names(&options()), ["a", "a", "a"]);
    assert_eq!(names(&ImportOptions { split_callsigns: true, ..options() }), ["a/OUT1", "a/OUT1", "a/BACK2"]);
}

#[test]
fn without_an_origin_the_frame_lies_in_the_middle_even_at_the_date_line() {
    let text = "time,icao24,lat,lon\n0,a,10,179.8\n1,b,11,-179.9\n2,c,12,-179.7\n";
    let imported = aircraft(text, &ImportOptions::default());
    let origin = imported.detections.origin.unwrap();
    assert!((origin.latitude.to_degrees() - 11.0).abs() < 1e-9);
    assert!((origin.longitude.to_degrees() + 179.9).abs() < 1e-9);
    assert!(truths(&imported).iter().all(|row| row.position[0].abs() < 40_000.0));
}

#[test]
fn ships_of_every_export_are_the_same() {
    let exports = [
        "Time,MMSI,Latitude_degrees,Longitude_degrees,COG_degrees,SOG_knots\n\
         2020-01-31 23:59:58.000,211000001,51.5,2.8,90,10\n",
        "MMSI,BaseDateTime,LAT,LON,SOG,COG,Heading,VesselName\n\
         211000001,2020-01-31T23:59:58,51.5,2.8,10,90,511.0,\"TEST, THE\"\n",
        "# Timestamp,Type of mobile,MMSI,Latitude,Longitude,Navigational status,ROT,SOG,COG\n\
         31/01/2020 23:59:58,Class A,211000001,51.5,2.8,Under way,0,10,90\n",
    ];
    let imported = exports.map(ships);
    assert_eq!(imported[0], imported[1]);
    assert_eq!(imported[0], imported[2]);
    let row = &truths(&imported[0])[0];
    assert_eq!((row.time, row.object.as_ref(), row.z), (1_580_515_198.0, "211000001", None));
    let [vx, vy] = row.velocity.unwrap();
    assert!((vx.hypot(vy) - 10.0 * 1852.0 / 3600.0).abs() < 1e-3);
}

#[test]
fn what_ships_do_not_know_is_nothing() {
    let imported = ships(
        "time,mmsi,lat,lon,cog,sog\n0,1,91,181,360,102.3\n1,1,51,3,360,5\n2,1,51,3.1,90,102.3\n\
         3,1,51,3.2,90,5\n3,1,51,3.2,90,5\n",
    );
    let known: Vec<bool> = truths(&imported).iter().map(|row| row.velocity.is_some()).collect();
    assert_eq!(known, [false, false, true]);
    assert_eq!(
        imported.left_out,
        [
            LeftOut { reason: "without a time or position".into(), rows: 1 },
            LeftOut { reason: "the same report from another receiver".into(), rows: 1 }
        ]
    );
}

#[test]
fn reports_of_one_time_are_one_scan_and_truth_is_optional() {
    let text = "time,mmsi,lat,lon\n5,1,51,3\n4,2,51,3\n5,2,51,3.1\n";
    let imported = ships(text);
    let sizes: Vec<usize> = imported.detections.scans.iter().map(|scan| scan.detections.len()).collect();
    assert_eq!(sizes, [1, 2]);
    let options = ImportOptions { truths: false, ..options() };
    assert_eq!(import_from(Source::Ais, text.as_bytes(), "ais.csv", &options).unwrap().truths, None);
}

#[test]
fn sources_are_recognised() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let ferry = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/autoferry/scenario2");
    let cases = [
        (write("a.csv", "time,icao24,lat,lon\n"), Source::Adsb),
        (write("b.csv", "# Timestamp,Type of mobile,MMSI,Latitude,Longitude\n"), Source::Ais),
        (write("c.csv", "# tercel: {}\ntime,sensor,x,y\n"), Source::Csv),
        (write("d.csv", ""), Source::Csv),
        (write("e.parquet", ""), Source::Parquet),
        (write("f.ndjson", ""), Source::Ndjson),
        (ferry.with_file_name("scenario2_detections.json.gz"), Source::Autoferry),
        (ferry, Source::Autoferry),
    ];
    for (path, source) in cases {
        assert_eq!(Source::recognise(&path).unwrap(), source, "{}", path.display());
    }
    assert!(Source::recognise(write("g.json", "{}")).is_err());
    assert!(Source::recognise(folder.path().join("missing.csv")).unwrap_err().is_io());
}

#[test]
fn several_files_share_a_frame_and_a_numbering() {
    let folder = tempfile::tempdir().unwrap();
    let paths = [(0, 50.0), (1, 51.0)].map(|(i, latitude)| {
        let path = folder.path().join(format!("{i}.csv"));
        std::fs::write(&path, format!("time,icao24,lat,lon\n{},a,{latitude},1\n2,a,{latitude},2\n", -i))
            .unwrap();
        path
    });
    let imported = import(Source::Adsb, &paths, &ImportOptions::default()).unwrap();
    let scans = &imported.detections.scans;
    assert_eq!(scans.iter().map(|scan| scan.time).collect::<Vec<_>>(), [-1.0, 0.0, 2.0]);
    let ids: Vec<u64> =
        scans.iter().flat_map(|scan| &scan.detections).map(|detection| detection.id).collect();
    assert_eq!(ids, [0, 1, 2, 3]);
    assert_eq!(truths(&imported).len(), 4);
}

#[test]
fn tables_of_other_frames_are_not_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let paths = [None, Some(ORIGIN)].map(|origin| {
        let path = folder.path().join(format!("{}.csv", origin.is_some()));
        write_detections(&path, &Detections { origin, ..Detections::default() }).unwrap();
        path
    });
    let error = import(Source::Csv, &paths, &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains("origin"), "{error}");
}
