//! The same reports in text, JSON and Parquet are the same detections.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::sync::Arc;

use arrow_array::{
    ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray, TimestampMicrosecondArray,
    TimestampMillisecondArray, TimestampNanosecondArray,
};
use parquet::arrow::ArrowWriter;
use tercel_data::{ImportOptions, Imported, Source, import_from};

/// Ten o'clock on 5 March 2024.
const TEN: i64 = 1_709_632_800;

fn read(source: Source, bytes: &[u8]) -> Imported {
    import_from(source, bytes, "reports", &ImportOptions::default()).unwrap()
}

fn parquet(columns: Vec<(&str, ArrayRef)>) -> Vec<u8> {
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    bytes
}

#[test]
fn times_of_every_unit_in_parquet_are_the_same() {
    let csv = "mmsi,time,lat,lon\n219000101,1709632800,56.1,11.2\n219000101,1709632810,56.2,11.3\n";
    let expected = read(Source::Ais, csv.as_bytes());
    let at = |unit: i64| vec![TEN * unit, (TEN + 10) * unit];
    let texts = ["2024-03-05T10:00:00Z", "2024-03-05T10:00:10Z"];
    let times: [ArrayRef; 7] = [
        Arc::new(TimestampMillisecondArray::from(at(1_000))),
        Arc::new(TimestampMicrosecondArray::from(at(1_000_000))),
        Arc::new(TimestampNanosecondArray::from(at(1_000_000_000)).with_timezone("UTC")),
        Arc::new(Int64Array::from(at(1))),
        Arc::new(Int64Array::from(at(1_000_000_000))),
        Arc::new(Float64Array::from(vec![TEN as f64, TEN as f64 + 10.0])),
        Arc::new(StringArray::from(texts.to_vec())),
    ];
    for time in times {
        let kind = time.data_type().clone();
        let bytes = parquet(vec![
            ("MMSI", Arc::new(Int64Array::from(vec![219_000_101; 2]))),
            ("BaseDateTime", time),
            ("Name", Arc::new(StringArray::from(vec!["A", "B"]))),
            ("LAT", Arc::new(Float64Array::from(vec![56.1, 56.2]))),
            ("LON", Arc::new(Float64Array::from(vec![11.2, 11.3]))),
        ]);
        assert_eq!(read(Source::Ais, &bytes), expected, "{kind}");
    }
}

#[test]
fn tables_of_traffic_in_parquet_are_in_feet_and_knots() {
    let times = TimestampNanosecondArray::from(vec![TEN * 1_000_000_000]).with_timezone("UTC");
    let bytes = parquet(vec![
        ("timestamp", Arc::new(times)),
        ("icao24", Arc::new(StringArray::from(vec!["4CA2D6"]))),
        ("latitude", Arc::new(Float64Array::from(vec![47.45]))),
        ("longitude", Arc::new(Float64Array::from(vec![8.55]))),
        ("altitude", Arc::new(Float64Array::from(vec![36_000.0]))),
        ("geoaltitude", Arc::new(Float64Array::from(vec![36_400.0]))),
        ("groundspeed", Arc::new(Float64Array::from(vec![447.0]))),
        ("track", Arc::new(Float64Array::from(vec![70.0]))),
    ]);
    let csv = "time,icao24,lat,lon,altitude_m,gs_kn,track\n1709632800,4ca2d6,47.45,8.55,10972.8,447,70\n";
    let (parquet, csv) = (read(Source::Adsb, &bytes), read(Source::Adsb, csv.as_bytes()));
    assert_eq!(parquet.detections, csv.detections);
    assert_eq!(parquet.truths, csv.truths);
}

#[test]
fn json_of_every_shape_is_the_same_as_text() {
    let expected = read(
        Source::Ais,
        b"mmsi,timestampExternal,lat,lon\n219000101,1709632800000,56.1,11.2\n219000102,1709632810000,56.2,11.3\n",
    );
    let objects = [
        r#"{"mmsi": 219000101, "timestamp": 0, "timestampExternal": 1709632800000, "lat": 56.1, "lon": 11.2}"#,
        r#"{"mmsi": 219000102, "timestamp": 10, "timestampExternal": 1709632810000, "lat": 56.2, "lon": 11.3}"#,
    ];
    let features = [
        r#"{"mmsi": 219000101, "geometry": {"type": "Point", "coordinates": [11.2, 56.1]},
            "properties": {"timestamp": 0, "timestampExternal": 1709632800000}}"#,
        r#"{"mmsi": 219000102, "geometry": {"type": "Point", "coordinates": [11.3, 56.2]},
            "properties": {"timestamp": 10, "timestampExternal": 1709632810000}}"#,
    ];
    for json in [
        objects.join("\n"),
        format!("[{}]", objects.join(",\n")),
        format!("{{\"type\": \"FeatureCollection\",\n \"features\": [{}]}}", features.join(",\n")),
    ] {
        assert_eq!(read(Source::Ais, json.as_bytes()), expected, "{json}");
    }
}

#[test]
fn bad_lines_of_json_are_refused_with_their_number() {
    let lines = "{\"mmsi\": 1, \"time\": 0, \"lat\": 56, \"lon\": 11}\n{\"mmsi\": 1, \"time\n";
    let error = import_from(Source::Ais, lines.as_bytes(), "ships", &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().starts_with("ships:2: the line is not JSON"), "{error}");
    assert!(error.help().unwrap().contains("--on-error skip"));
}

#[test]
fn velocities_of_a_basestation_feed_belong_to_the_positions_around_them() {
    let message = |kind: u8, second: u8, cells: &str| {
        format!(
            "MSG,{kind},1,1,4CA2D6,1,2024/03/05,10:00:{second:02}.000,2024/03/05,10:00:{second:02}.500,{cells}\n"
        )
    };
    let feed = [
        message(3, 0, ",36000,,,47.45,8.55,,,0,0,0,0"),
        message(4, 1, ",,447,70,,,0,,0,0,0,0"),
        message(1, 1, "RYR12AB ,,,,,,,,,,,"),
        message(3, 2, ",36000,,,47.46,8.56,,,0,0,0,0"),
        message(3, 20, ",,,,47.47,8.57,,,0,0,0,-1"),
        "STA,,5,179,400AE7,10103,2024/03/05,10:00:21.000,2024/03/05,10:00:21.000,RM\n".to_owned(),
    ]
    .concat();
    let imported = read(Source::Adsb, feed.as_bytes());
    let truths = imported.truths.unwrap().rows;
    let known: Vec<(f64, bool, bool)> =
        truths.iter().map(|row| (row.time - TEN as f64, row.velocity.is_some(), row.z.is_some())).collect();
    assert_eq!(known, [(0.0, false, true), (2.0, true, true), (20.0, false, false)]);
    assert_eq!(imported.left_out.iter().map(|left_out| left_out.rows).sum::<usize>(), 3);
    let options = ImportOptions { split_callsigns: true, ..ImportOptions::default() };
    let split = import_from(Source::Sbs, feed.as_bytes(), "feed", &options).unwrap().truths.unwrap().rows;
    assert_eq!(split[2].object.as_ref(), "4ca2d6/RYR12AB");
}
