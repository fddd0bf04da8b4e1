//! Files as people bring them come in whole, or are refused with what helps.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::PathBuf;

use tercel_data::table::Observation;
use tercel_data::{
    Angles, Bearings, Format, ImportOptions, Imported, ReadOptions, Source, import, read_detections_from,
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
}
