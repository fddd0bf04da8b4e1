//! Files as people and other programs write them.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::io::Write;

use tercel_data::ndjson::Scans;
use tercel_data::table::{Detections, Observation, Status};
use tercel_data::{
    Angles, DataError, Format, ReadOptions, read_detections, read_detections_from, read_tracks_from,
    read_truths, write_detections,
};

fn csv(text: &str) -> Detections {
    read_detections_from(text.as_bytes(), Format::Csv, "radar.csv", &ReadOptions::default()).unwrap()
}

fn sizes(detections: &Detections) -> Vec<usize> {
    detections.scans.iter().map(|scan| scan.detections.len()).collect()
}

#[test]
fn without_numbers_a_scan_is_what_has_one_time_and_sensor() {
    let table = csv("time,sensor,x,y\n0,a,1,2\n0,a,3,4\n0,b,1,2\n1,a,1,2\n1,a,,\n2,a,,\n");
    assert_eq!(sizes(&table), [2, 1, 1, 0]);
    let ids: Vec<u64> = table.scans.iter().flat_map(|scan| &scan.detections).map(|d| d.id).collect();
    assert_eq!(ids, [0, 1, 2, 3]);
}

#[test]
fn with_numbers_scans_of_one_time_stay_apart() {
    let table = csv("time,sensor,scan,detection,x,y\n0,a,1,10,1,2\n0,a,2,11,1,2\n0,a,2,12,1,2\n1,a,3,,,\n");
    assert_eq!(sizes(&table), [1, 2, 0]);
}

#[test]
fn each_sensor_may_number_its_own_scans() {
    assert_eq!(sizes(&csv("time,sensor,scan,x,y\n0,a,1,1,2\n0.5,b,1,1,2\n1,a,2,1,2\n")), [1, 1, 1]);
}

#[test]
fn blanks_quotes_carriage_returns_and_a_byte_order_mark_do_not_matter() {
    let table = csv("\u{feff}time, sensor , x, y\r\n 0.0,\"radar\" , 1e1, -2\r\n");
    assert_eq!(table.scans[0].sensor.as_ref(), "radar");
    assert_eq!(table.scans[0].detections[0].observation, Observation::Position { x: 10.0, y: -2.0, z: None });
}

#[test]
fn dates_become_unix_seconds() {
    let table = csv("time,sensor,x,y\n2021-05-04T09:54:51.25+02:00,a,1,2\n2021-05-04 07:54:52Z,a,1,2\n");
    assert_eq!(table.scans.iter().map(|scan| scan.time).collect::<Vec<_>>(), [1620114891.25, 1620114892.0]);
}

#[test]
fn degrees_are_converted_on_request() {
    let options = ReadOptions { angles: Angles::Degrees, ..ReadOptions::default() };
    let text = "# tercel: {\"schema\":1,\"table\":\"detections\",\"units\":{\"bearing\":\"deg\"}}\n\
                time,sensor,bearing,sigma_bearing\n0,a,270,1\n";
    let table = read_detections_from(text.as_bytes(), Format::Csv, "radar.csv", &options).unwrap();
    let detection = &table.scans[0].detections[0];
    let Observation::Polar { bearing, .. } = detection.observation else { panic!("no bearing") };
    assert!((bearing + std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    assert_eq!(detection.noise.bearing, Some(1_f64.to_radians()));
}

#[test]
fn one_nameless_sensor_can_be_named() {
    let options = ReadOptions { sensor: Some("radar".into()), ..ReadOptions::default() };
    for (format, text) in
        [(Format::Csv, "time,x,y\n0,1,2\n"), (Format::Ndjson, "{\"time\":0,\"x\":1,\"y\":2}\n")]
    {
        let table = read_detections_from(text.as_bytes(), format, "radar", &options).unwrap();
        assert_eq!(table.scans[0].sensor.as_ref(), "radar");
    }
}

#[test]
fn columns_of_other_programs_are_passed_over() {
    let table = csv("time,sensor,sensor_id,snr,x,y,quality\n0,a,77,12.5,1,2,good\n");
    assert_eq!(sizes(&table), [1]);
}

#[test]
fn tracks_of_other_programs_need_a_time_a_number_and_a_place() {
    let text = "time,track,y,x,vx,vy\n0,7,2,1,3,4\n";
    let table =
        read_tracks_from(text.as_bytes(), Format::Csv, "tracks.csv", &ReadOptions::default()).unwrap();
    assert_eq!(table.labels, ["x", "y", "vx", "vy"]);
    let row = &table.rows[0];
    assert_eq!((row.track, row.status, row.existence), (7, Status::Confirmed, 1.0));
    assert_eq!(row.state, [1.0, 2.0, 3.0, 4.0]);
    assert!(row.covariance.is_empty());
}

#[test]
fn compressed_files_are_read_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("truth.csv.gz");
    let mut gzip =
        flate2::write::GzEncoder::new(std::fs::File::create(&path).unwrap(), flate2::Compression::best());
    gzip.write_all(b"time,object,x,y\n0,boat,1,2\n").unwrap();
    gzip.finish().unwrap();
    assert_eq!(read_truths(&path, &ReadOptions::default()).unwrap().rows.len(), 1);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 10]).unwrap();
    let error = read_truths(&path, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, DataError::Corrupt { .. }), "{error}");
}

#[test]
fn a_table_without_rows_is_a_table() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["empty.csv", "empty.parquet", "empty.ndjson"] {
        let path = folder.path().join(name);
        write_detections(&path, &Detections::default()).unwrap();
        assert_eq!(read_detections(&path, &ReadOptions::default()).unwrap(), Detections::default());
    }
}

#[test]
fn numbers_of_other_types_in_parquet_are_understood() {
    use arrow_array::TimestampMicrosecondArray;
    use arrow_array::{ArrayRef, Float32Array, Float64Array, Int64Array, LargeStringArray, RecordBatch};
    use std::sync::Arc;
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time", Arc::new(TimestampMicrosecondArray::from(vec![1_500_000, 2_000_000]).with_timezone("UTC"))),
        ("sensor", Arc::new(LargeStringArray::from(vec!["a", "a"]))),
        ("scan", Arc::new(Float64Array::from(vec![1.0, 2.0]))),
        ("detection", Arc::new(Int64Array::from(vec![Some(4), None]))),
        ("x", Arc::new(Float32Array::from(vec![Some(1.5), None]))),
        ("y", Arc::new(Int64Array::from(vec![Some(-2), None]))),
    ];
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let mut bytes = Vec::new();
    let mut writer = parquet::arrow::ArrowWriter::try_new(&mut bytes, batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
    let table =
        read_detections_from(bytes.as_slice(), Format::Parquet, "a", &ReadOptions::default()).unwrap();
    assert_eq!(sizes(&table), [1, 0]);
    assert_eq!((table.scans[0].time, table.scans[1].time), (1.5, 2.0));
    let detection = &table.scans[0].detections[0];
    assert_eq!(
        (detection.id, detection.observation),
        (4, Observation::Position { x: 1.5, y: -2.0, z: None })
    );
}

#[test]
fn both_kinds_of_lines_may_alternate() {
    let lines = r#"{"tercel":{"schema":1,"table":"detections","origin":{"latitude":1,"longitude":0,"altitude":0}}}
{"time":0,"sensor":"a","x":1,"y":2}
{"time":0,"sensor":"a","x":3,"y":4,"colour":"red"}
{"time":0,"sensor":"a","sensor_x":5,"sensor_y":6,"detections":[{"detection":40,"bearing":0.5}]}
{"time":1,"sensor":"a","detections":[]}
{"time":2,"sensor":"a"}
{"time":3,"sensor":"a","x":3,"y":4}"#;
    let mut scans = Scans::new(lines.as_bytes(), "lines", ReadOptions::default());
    let read: Vec<_> = scans.by_ref().map(Result::unwrap).collect();
    assert_eq!(read.iter().map(|scan| scan.detections.len()).collect::<Vec<_>>(), [2, 1, 0, 0, 1]);
    assert_eq!(read[1].position, Some([5.0, 6.0, 0.0]));
    assert_eq!(read[4].detections[0].id, 41, "numbers go on above the highest");
    assert_eq!(scans.origin().map(|origin| origin.latitude), Some(1.0));
}

#[test]
fn a_bad_line_does_not_end_the_scan_around_it() {
    let lines = "{\"time\":0,\"sensor\":\"a\",\"x\":1,\"y\":2}\n{\"time\":0,\n{\"time\":0,\"sensor\":\"a\",\"x\":3,\"y\":4}\n";
    let items: Vec<_> = Scans::new(lines.as_bytes(), "lines", ReadOptions::default()).collect();
    assert_eq!(items.len(), 2);
    assert!(items[0].as_ref().unwrap_err().to_string().starts_with("lines:2: "));
    assert_eq!(items[1].as_ref().unwrap().detections.len(), 2);
}

#[test]
fn a_line_without_end_is_refused_and_passed_over() {
    let long = std::io::repeat(b'x');
    let good = "\n{\"time\":0,\"sensor\":\"a\",\"x\":1,\"y\":2}";
    let input =
        std::io::BufReader::new(std::io::Read::chain(std::io::Read::take(long, 20 << 20), good.as_bytes()));
    let items: Vec<_> = Scans::new(input, "lines", ReadOptions::default()).collect();
    assert_eq!(items.len(), 2);
    assert!(items[0].as_ref().unwrap_err().to_string().contains("longer than"));
    assert_eq!(items[1].as_ref().unwrap().detections.len(), 1);
}

#[test]
fn ten_thousand_detections_are_one_scan() {
    let rows: String = (0..10_000).map(|i| format!("0,radar,{i},{i}\n")).collect();
    assert_eq!(sizes(&csv(&format!("time,sensor,x,y\n{rows}"))), [10_000]);
    let list = (0..10_000).map(|i| format!("{{\"x\":{i},\"y\":0}}")).collect::<Vec<_>>().join(",");
    let line = format!("{{\"time\":0,\"sensor\":\"a\",\"detections\":[{list}]}}");
    let scans: Vec<_> = Scans::new(line.as_bytes(), "lines", ReadOptions::default()).collect();
    assert_eq!(scans[0].as_ref().unwrap().detections.len(), 10_000);
}
