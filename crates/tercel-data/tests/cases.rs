//! Files as people bring them come in whole, or are refused with what helps.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::PathBuf;

use tercel_data::table::Observation;
use tercel_data::{
    Angles, Bearings, DateOrder, Format, ImportOptions, Imported, OnError, ReadOptions, Source, Unit, import,
    import_table_from, read_detections_from, write_detections_to,
};

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn import_as(source: Source, name: &str) -> Imported {
    import(source, &[path(name)], &ImportOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn sizes(imported: &Imported) -> Vec<usize> {
    imported.detections.scans.iter().map(|scan| scan.detections.len()).collect()
}

#[test]
fn tabs_separate_cells() {
    assert_eq!(sizes(&import_as(Source::recognise(path("xy_tab.tsv")).unwrap(), "xy_tab.tsv")), [2; 20]);
}

#[test]
fn utf_16_is_read() {
    assert_eq!(sizes(&import_as(Source::Csv, "xy_utf16.csv")), [2; 20]);
}

#[test]
fn a_file_without_header_is_called_so_and_read_with_names_for_its_columns() {
    let read = |columns: Option<&str>| {
        let columns = columns.map(|names| names.split(',').map(str::to_owned).collect());
        let options =
            ImportOptions { read: ReadOptions { columns, ..ReadOptions::default() }, ..Default::default() };
        import(Source::Csv, &[path("xy_no_header.csv")], &options)
    };
    let error = read(None).unwrap_err();
    assert!(error.to_string().contains("there is no header"), "{error}");
    assert!(error.help().unwrap().contains("--columns time,sensor,x,y"), "{:?}", error.help());
    assert_eq!(sizes(&read(Some("time,sensor,x,y")).unwrap()), [2; 20]);
}

#[test]
fn quotes_that_are_never_closed_swallow_no_rows() {
    let imported = import_as(Source::Ais, "dma_stray_quotes.csv");
    assert_eq!(sizes(&imported).iter().sum::<usize>(), 48);
    assert!(imported.notes[0].contains("2 rows have a quote that is never closed"), "{:?}", imported.notes);
}

#[test]
fn zstd_is_told_from_the_content() {
    assert_eq!(sizes(&import_as(Source::Ais, "marinecadastre_2025.csv.zst")).iter().sum::<usize>(), 48);
}

#[test]
fn every_dialect_says_the_same() {
    let read = |text: &str| {
        read_detections_from(text.as_bytes(), Format::Csv, "xy.csv", &ReadOptions::default()).unwrap()
    };
    let plain = read("time,sensor,x,y\n0.5,radar,1.5,-2\n1.5,radar,3,4.25\n");
    for text in [
        "time;sensor;x;y\r\n0,5;radar;1,5;-2\r\n1,5;radar;3;4,25\r\n",
        "sep=;\r\ntime;sensor;x;y\r\n0.5;radar;1.5;-2\r\n1.5;radar;3;4.25\r\n",
        "time\tsensor\tx\ty\n0.5\tradar\t1.5\t-2\n\n1.5\tradar\t3\t4.25",
        "time|sensor|x|y\n0.5|radar|1.5|-2\n# a remark\n1.5|radar|3|4.25\n",
        "  time   sensor  x     y\n   0.5    radar  1.5  -2\n   1.5    radar  3     4.25\n",
        "# made by hand\n# time sensor x y\n0.5 radar 1.5 -2\n1.5 radar 3 4.25\n",
        "\"time\",\"sensor\",\"x\",\"y\"\n\"0.5\",\"radar\",\"1.5\",\"-2\"\n\"1.5\",\"radar\",\"3\",\"4.25\"\n",
        "time,sensor,x,y\r0.5,radar,1.5,-2\r1.5,radar,3,4.25\r",
        "time,sensor,x,y,\n0.5,radar,1.5,-2,\n1.5,radar,3,4.25,\n",
    ] {
        assert_eq!(read(text), plain, "{text}");
    }
}

#[test]
fn every_compression_says_the_same() {
    let plain = import_as(Source::Csv, "xy_tab.tsv").detections;
    for name in ["xy_tab.tsv.gz", "xy_tab.tsv.xz", "xy_tab.tsv.zst", "xy_tab.zip"] {
        let bytes = std::fs::read(path(&format!("compressed/{name}"))).unwrap();
        // The name says nothing here, and a pipe may be slow.
        let read = |bytes: &[u8]| read_detections_from(bytes, Format::Csv, "stream", &ReadOptions::default());
        assert_eq!(read(&bytes).unwrap(), plain, "{name}");
        assert!(read(&bytes[..bytes.len() - 30]).is_err(), "{name} cut short");
    }
}

/// Numbers of scans and detections of a case that is read under these options.
fn read_with(name: &str, options: ReadOptions) -> Imported {
    let source = Source::recognise(path(name)).unwrap();
    import(source, &[path(name)], &ImportOptions { read: options, ..ImportOptions::default() })
        .unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn positions(imported: &Imported) -> Vec<[f64; 2]> {
    let detections = imported.detections.scans.iter().flat_map(|scan| &scan.detections);
    detections
        .map(|detection| match detection.observation {
            Observation::Position { x, y, .. } => [x, y],
            Observation::Polar { range, bearing, .. } => {
                let range = range.unwrap();
                [range * bearing.cos(), range * bearing.sin()]
            }
        })
        .collect()
}

fn noted(imported: &Imported, what: &str) {
    assert!(imported.notes.iter().any(|note| note.contains(what)), "no `{what}` in {:?}", imported.notes);
}

fn times(imported: &Imported) -> Vec<f64> {
    imported.detections.scans.iter().map(|scan| scan.time).collect()
}

#[test]
fn times_of_every_unit_are_seconds() {
    for (name, note) in [
        ("xy_epoch_ms.csv", "milliseconds"),
        ("xy_epoch_ns.parquet", "nanoseconds"),
        ("xy_excel_serial.csv", "spreadsheets"),
    ] {
        let imported = read_with(name, ReadOptions::default());
        noted(&imported, note);
        assert_eq!(sizes(&imported), [2; 20], "{name}");
        for (i, time) in times(&imported).into_iter().enumerate() {
            assert!((time - 1_709_632_800.0 - i as f64).abs() < 0.04, "{name}: {time}");
        }
    }
}

#[test]
fn an_unsorted_file_is_sorted_and_its_scans_are_joined() {
    let imported = read_with("xy_unsorted.csv", ReadOptions::default());
    assert_eq!(sizes(&imported), [2; 20]);
    assert!(times(&imported).is_sorted());
    noted(&imported, "sorted by time");
    let imported = read_with("two_sensors_one_after_other.csv", ReadOptions::default());
    assert_eq!(sizes(&imported), [2; 40]);
    assert!(times(&imported).is_sorted());
    noted(&imported, "38 of 80 rows");
}

#[test]
fn a_row_without_measurement_says_nothing_and_is_told() {
    let imported = read_with("xy_nan_row.csv", ReadOptions::default());
    assert_eq!(sizes(&imported).iter().sum::<usize>(), 40);
    noted(&imported, "1 of 41 rows have no measurement");
}

#[test]
fn other_names_of_the_columns_are_known() {
    let imported = read_with("xy_timestamp_column.csv", ReadOptions::default());
    noted(&imported, "no column names the sensor");
    assert_eq!(sizes(&imported), [2; 20]);
}

#[test]
fn numbers_are_names_in_parquet_too() {
    for name in ["sensor_number.parquet", "truth_number.parquet"] {
        let imported = read_with(name, ReadOptions::default());
        assert_eq!(sizes(&imported), [2; 20], "{name}");
    }
    let imported = read_with("sensor_number.parquet", ReadOptions::default());
    assert_eq!(imported.detections.scans[0].sensor.as_ref(), "1");
}

#[test]
fn compass_bearings_in_degrees_are_read_on_request_and_told_without() {
    let options = ReadOptions { angles: Angles::Degrees, ..ReadOptions::default() };
    noted(&read_with("polar_compass_degrees.csv", options.clone()), "--bearings compass");
    let options = ReadOptions { bearings: Some(Bearings::Compass), ..options };
    let positions = positions(&read_with("polar_compass_degrees.csv", options));
    let near = |place: [f64; 2]| {
        positions.iter().rev().take(2).any(|p| (p[0] - place[0]).hypot(p[1] - place[1]) < 30.0)
    };
    assert!(near([848.0, 1100.0]) && near([690.0, 895.0]), "{:?}", &positions[positions.len() - 2..]);
}

#[test]
fn plots_in_latitude_and_longitude_lie_in_a_local_frame() {
    let imported = read_with("plots_latlon.csv", ReadOptions::default());
    assert_eq!(sizes(&imported), [1; 48]);
    let origin = imported.detections.origin.unwrap();
    assert!((origin.latitude.to_degrees() - 47.45).abs() < 0.2, "{origin:?}");
    // 230 m/s on 70 degrees, for 5 s.
    let positions = positions(&imported);
    let step = [positions[3][0] - positions[0][0], positions[3][1] - positions[0][1]];
    assert!((step[0] - 1081.0).abs() < 20.0 && (step[1] - 393.0).abs() < 20.0, "{step:?}");
}

#[test]
fn a_radar_that_turns_has_a_time_for_each_plot() {
    let imported = read_with("radar_rotating_scan.csv", ReadOptions::default());
    assert_eq!(imported.detections.scans.len(), 16);
    assert!(imported.detections.scans[0].detections[0].time.is_some());
    assert_eq!(sizes(&read_with("radar_rotating.csv", ReadOptions::default())).iter().sum::<usize>(), 80);
}

#[test]
fn lines_of_reports_on_the_earth_are_read_with_their_identity() {
    let imported = read_with("stream_latlon.ndjson", ReadOptions::default());
    assert_eq!(sizes(&imported), [1; 48]);
    assert_eq!(imported.detections.scans[0].detections[0].identity.as_deref(), Some("4ca2d6"));
}

#[test]
fn lists_go_by_other_names() {
    let imported = read_with("stream_objects_list.ndjson", ReadOptions::default());
    assert_eq!(sizes(&imported), [2; 20]);
    noted(&imported, "`objects`");
}

#[test]
fn a_time_in_the_future_costs_no_other_row() {
    let imported = read_with("stream_one_future_time.ndjson", ReadOptions::default());
    assert_eq!(sizes(&imported).iter().sum::<usize>(), 81);
    assert_eq!(imported.detections.scans.len(), 41);
    noted(&imported, "1 of 41 scans lie");
}

/// A table in CSV, with what was said about it.
fn csv(text: &str, options: &ReadOptions) -> Imported {
    import_table_from(text.as_bytes(), Format::Csv, "a.csv", options)
        .unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn refused(text: &str, options: &ReadOptions) -> String {
    let error = import_table_from(text.as_bytes(), Format::Csv, "a.csv", options).unwrap_err();
    format!("{error}\n{}", error.help().unwrap_or_default())
}

#[test]
fn units_stand_in_the_header_or_are_said() {
    let near = |imported: &Imported, place: [f64; 2]| {
        let position = positions(imported)[0];
        assert!(
            (position[0] - place[0]).hypot(position[1] - place[1]) < 1e-6,
            "{position:?} is not {place:?}"
        );
    };
    for header in [
        "time,range_nm,bearing_deg",
        "Time,Range (NM),Bearing [deg]",
        "t,rangeNm,bearingDeg",
        "time,rng_nmi,brg_deg",
    ] {
        let options = ReadOptions { bearings: Some(Bearings::Math), ..ReadOptions::default() };
        near(&csv(&format!("{header}\n0,10,180\n"), &options), [-18_520.0, 0.0]);
    }
    for header in ["time,range,azimuth_deg", "time,r,az [deg]"] {
        let imported = csv(&format!("{header}\n0,100,90\n"), &ReadOptions::default());
        near(&imported, [100.0, 0.0]);
        noted(&imported, "--bearings math");
    }
    let units = vec![("range".to_owned(), Unit::Kilometre), ("bearing".to_owned(), Unit::Degree)];
    let options = ReadOptions { units, bearings: Some(Bearings::Compass), ..ReadOptions::default() };
    near(&csv("time,range,bearing\n0,2,0\n", &options), [0.0, 2000.0]);
    near(&csv("time,x_km,y (ft)\n0,1.5,1000\n", &ReadOptions::default()), [1500.0, 304.8]);
    let options = ReadOptions { units: vec![("range".to_owned(), Unit::Knot)], ..ReadOptions::default() };
    assert!(refused("time,range,bearing\n0,2,0\n", &options).contains("no such quantity"));
}

#[test]
fn columns_go_by_the_names_that_are_said() {
    let renames =
        [("x", "east_m"), ("y", "b"), ("time", "when")].map(|(to, from)| (to.to_owned(), from.to_owned()));
    let options = ReadOptions { renames: renames.to_vec(), ..ReadOptions::default() };
    let imported = csv("when,a,b,east_m,snr\n0,7,2,1,9\n", &options);
    assert_eq!(positions(&imported), [[1.0, 2.0]]);
    noted(&imported, "not used: `a`, `snr`");
    assert!(refused("t,x,y\n0,1,2\n", &options).contains("the file has no column `east_m`"));
    let options = ReadOptions { ignore: vec!["east".to_owned()], ..ReadOptions::default() };
    assert_eq!(positions(&csv("time,x,y,east\n0,1,2,3\n", &options)), [[1.0, 2.0]]);
}

#[test]
fn identities_are_known_and_doubtful_ones_are_told() {
    let identity = |header: &str| {
        let options = ReadOptions { sensor: Some("radar".into()), ..ReadOptions::default() };
        let imported = csv(&format!("time,x,y,{header}\n0,1,2,219000101\n"), &options);
        (imported.detections.scans[0].detections[0].identity.clone(), imported.notes)
    };
    for name in ["identity", "hex", "ICAO24", "Mode S"] {
        let (known, notes) = identity(name);
        assert_eq!((known.as_deref(), notes.len()), (Some("219000101"), 0), "{name}: {notes:?}");
    }
    for name in ["track_id", "target_id", "squawk", "callsign"] {
        let (known, notes) = identity(name);
        assert!(known.is_some() && notes[0].contains("--ignore"), "{name}: {notes:?}");
    }
    assert_eq!(identity("id").0, None);
}

#[test]
fn dates_and_times_of_day_become_seconds() {
    let seconds = |cells: &[&str], options: &ReadOptions| {
        let rows: String = cells.iter().map(|cell| format!("{cell};1;2\n")).collect();
        times(&csv(&format!("time;x;y\n{rows}"), options))
    };
    let default = ReadOptions::default();
    let t = 1_709_632_800.0;
    assert_eq!(seconds(&["2024-03-05 10:00:00", "2024-03-05 10:00:01,5"], &default), [t, t + 1.5]);
    assert_eq!(seconds(&["05/03/2024 10:00", "13/03/2024 10:00"], &default), [t, t + 8.0 * 86_400.0]);
    assert_eq!(seconds(&["03/05/2024 10:00", "03/13/2024 10:00"], &default), [t, t + 8.0 * 86_400.0]);
    assert_eq!(seconds(&["23:59:59.5", "00:00:00.5", "00:00:01"], &default), [86_399.5, 86_400.5, 86_401.0]);
    let oslo = ReadOptions { time_zone: Some("Europe/Oslo".to_owned()), ..ReadOptions::default() };
    assert_eq!(seconds(&["2024-03-05T11:00"], &oslo), [t]);
    let order = ReadOptions { date_order: Some(DateOrder::MonthFirst), ..ReadOptions::default() };
    assert_eq!(seconds(&["03/05/2024 10:00"], &order), [t]);
    assert!(refused("time,x,y\n03/05/2024 10:00,1,2\n", &default).contains("--date-order"));
    let unit = ReadOptions { time_unit: Some(Unit::Millisecond), ..ReadOptions::default() };
    assert_eq!(seconds(&["0", "1000"], &unit), [0.0, 1.0]);
    assert_eq!(times(&csv("time_ms,x,y\n0,1,2\n1000,1,2\n", &default)), [0.0, 1.0]);
}

#[test]
fn two_sensors_pass_midnight_one_after_the_other() {
    let text = "time,sensor,x,y\n23:59:59,a,1,2\n00:00:01,a,1,2\n23:59:59.5,b,1,2\n00:00:01.5,b,1,2\n";
    assert_eq!(times(&csv(text, &ReadOptions::default())), [86_399.0, 86_399.5, 86_401.0, 86_401.5]);
}

#[test]
fn bad_rows_are_left_out_by_reason_on_request() {
    let text =
        "time,sensor,x,y\n0,a,1,2\n1,a,east,2\n2,a,3\n3,a,nan,2\nsoon,a,1,2\n4,a,west,2\n5,a,1,2\n6,a,1";
    let imported = csv(text, &ReadOptions { on_error: OnError::Skip, ..ReadOptions::default() });
    assert_eq!(times(&imported), [0.0, 5.0]);
    let mut counts: Vec<(String, usize)> =
        imported.left_out.iter().map(|left| (left.reason.to_string(), left.rows)).collect();
    counts.sort();
    assert_eq!(counts.iter().map(|(_, rows)| rows).sum::<usize>(), 6, "{counts:?}");
    assert!(counts.contains(&("`x` is not a finite number".to_owned(), 2)), "{counts:?}");
    assert!(refused(text, &ReadOptions::default()).starts_with("a.csv:3: "));
    assert!(
        refused("time,sensor,x,y\n0,a,1,2\n1,a,2", &ReadOptions::default()).contains("the last line is cut")
    );
}

#[test]
fn repeated_rows_are_told_and_dropped_on_request() {
    let text = "time,x,y\n0,1,2\n0,1,2\n0,3,4\n1,1,2\n1,1,2\n";
    let imported = csv(text, &ReadOptions::default());
    noted(&imported, "2 of 5 rows repeat");
    assert_eq!(sizes(&imported), [3, 2]);
    let imported = csv(text, &ReadOptions { drop_repeated: true, ..ReadOptions::default() });
    assert_eq!(sizes(&imported), [2, 1]);
    assert_eq!(imported.left_out[0].rows, 2);
}

#[test]
fn numbers_of_scans_may_begin_anew_and_rows_of_a_scan_stand_anywhere() {
    let rows: String = (0..40).map(|i| format!("{i}.0,{0},1,2\n{i}.5,{0},1,2\n", i % 16)).collect();
    assert_eq!(sizes(&csv(&format!("time,scan,x,y\n{rows}"), &ReadOptions::default())), [2; 40]);
    let mut rows: Vec<&str> = rows.lines().collect();
    rows.sort_by_key(|row| row.chars().rev().collect::<String>());
    rows.rotate_left(13);
    let shuffled = rows.join("\n");
    assert_eq!(sizes(&csv(&format!("time,scan,x,y\n{shuffled}\n"), &ReadOptions::default())), [2; 40]);
}

#[test]
fn json_is_read_in_every_arrangement() {
    let read = |text: &str| {
        import_table_from(text.as_bytes(), Format::Ndjson, "a.json", &ReadOptions::default())
            .unwrap_or_else(|error| panic!("{error}: {:?}\n{text}", error.help()))
    };
    let plain = read("{\"time\":0,\"x\":1,\"y\":2}\n{\"time\":1,\"x\":3,\"y\":4}\n").detections;
    for text in [
        "[{\"time\":0,\"x\":1,\"y\":2},{\"time\":1,\"x\":3,\"y\":4}]",
        "[\n  {\n    \"time\": 0,\n    \"x\": 1,\n    \"y\": 2\n  },\n  {\"time\": 1, \"x\": 3, \"y\": 4}\n]\n",
        "{\n \"time\": 0, \"x\": 1, \"y\": 2\n}\n{\n \"time\": 1, \"x\": 3, \"y\": 4\n}\n",
        "{\"time\":0,\"targets\":[{\"x\":1,\"y\":2}]}\n{\"time\":1,\"data\":[{\"pos_x\":3,\"pos_y\":4}]}\n",
        "{\"time\":0,\"position\":{\"x\":1,\"y\":2}}\n{\"time\":1,\"position\":[3,4]}\n",
    ] {
        assert_eq!(read(text).detections, plain, "{text}");
    }
    let document = "{\"data\":[{\"time\":0,\"x\":1,\"y\":2},{\"time\":1,\"x\":3,\"y\":4}]}";
    assert_eq!(read(document).detections, plain);
    let nowhere = "{\"time\":0,\"sensor\":\"a\",\"foo\":1,\"bar\":2}\n";
    let error =
        import_table_from(nowhere.as_bytes(), Format::Ndjson, "a.json", &ReadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("the keys are `bar`, `foo`, `sensor`, `time`"), "{error}");
}

#[test]
fn longitudes_may_run_to_360_and_altitudes_give_a_height() {
    let imported =
        csv("time,lat,lon,alt_ft\n0,-17.5,179.99,1000\n1,-17.5,180.01,1000\n", &ReadOptions::default());
    let positions = positions(&imported);
    assert!((positions[1][0] - positions[0][0] - 2123.0).abs() < 5.0, "{positions:?}");
    let Observation::Position { z, .. } = imported.detections.scans[0].detections[0].observation else {
        panic!()
    };
    assert!((z.unwrap() - 304.8).abs() < 1.0, "{z:?}");
    assert!(refused("time,lat,lon\n0,179.9,-17.5\n", &ReadOptions::default()).contains("swapped"));
}

#[test]
fn lines_before_the_header_are_passed_over_and_told() {
    let imported =
        csv("Radar export\nStation 5, north\n\ntime,x,y\n0,1,2\n1,1,2\n2,1,2\n", &ReadOptions::default());
    assert_eq!(times(&imported), [0.0, 1.0, 2.0]);
    noted(&imported, "3 lines before the header");
}

#[test]
fn a_file_with_two_kinds_of_position_uses_the_local_one_and_says_so() {
    let imported = csv("time,x,y,lat,lon\n0,1,2,47,8\n", &ReadOptions::default());
    assert_eq!(positions(&imported), [[1.0, 2.0]]);
    noted(&imported, "latitude and longitude are not used");
    let line = "{\"time\":0,\"x\":1,\"y\":2,\"lat\":47,\"lon\":8}\n";
    let imported = import_table_from(line.as_bytes(), Format::Ndjson, "a", &ReadOptions::default()).unwrap();
    assert_eq!(positions(&imported), [[1.0, 2.0]]);
    noted(&imported, "latitude and longitude are not used");
    let ignore = vec!["x".to_owned(), "y".to_owned()];
    let imported = csv("time,x,y,lat,lon\n0,1,2,47,8\n", &ReadOptions { ignore, ..ReadOptions::default() });
    assert!(imported.detections.origin.is_some());
}

#[test]
fn what_was_read_is_written_and_read_back_the_same() {
    let options = ReadOptions::default();
    for text in [
        "time,scan,x,y\n1,0,,\n0,0,1,2\n2,0,,\n0.5,0,3,4\n3,1,1,2\n",
        "time,sensor,lat,lon\n0,a,47,8\n1,b,47.1,8.1\n0,b,47.1,8\n",
        "time,range (km),azimuth [deg]\n3,1,10\n1,2,350\n1,2,350\n",
    ] {
        let table = csv(text, &options).detections;
        for format in [Format::Csv, Format::Ndjson, Format::Parquet] {
            let mut bytes = Vec::new();
            write_detections_to(&mut bytes, format, "a", &table).unwrap();
            assert_eq!(
                read_detections_from(bytes.as_slice(), format, "a", &options).unwrap(),
                table,
                "{text}"
            );
        }
    }
}

#[test]
fn a_web_page_is_no_table() {
    let error = refused("<!DOCTYPE html><html><body>404</body></html>", &ReadOptions::default());
    assert!(error.contains("a web page"), "{error}");
}
