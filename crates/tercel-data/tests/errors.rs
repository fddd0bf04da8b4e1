//! What the errors say: where, what, what was expected, and what helps.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;

use tercel_data::ndjson::Scans;
use tercel_data::table::{Detection, Detections, Observation, Scan, Tracks};
use tercel_data::{
    Angles, DataError, Format, ImportOptions, ReadOptions, TracksWriter, import, read_detections,
    read_detections_from, read_metrics_from, read_tracks_from, read_truths_from, write_detections,
    write_detections_to,
};

fn told(error: &DataError) -> String {
    match error.help() {
        Some(help) => format!("{error}\n  help: {help}"),
        None => error.to_string(),
    }
}

/// One paragraph per case: its name, and what the error says.
fn report<T: std::fmt::Debug>(cases: &[(&str, &str)], read: impl Fn(&str) -> Result<T, DataError>) -> String {
    cases.iter().fold(String::new(), |mut text, (case, content)| {
        let error = read(content).expect_err(case);
        writeln!(text, "[{case}]\n{}\n", told(&error)).unwrap();
        text
    })
}

fn described(json: &str) -> String {
    format!("# tercel: {json}\ntime,sensor,x,y,bearing\n0,radar,1,2,\n")
}

#[test]
fn detections_in_csv() {
    let units =
        |units: &str| described(&format!(r#"{{"schema":1,"table":"detections","units":{{{units}}}}}"#));
    let cases = [
        ("empty file", ""),
        ("only comments", "# tercel\n"),
        ("position twice", "time,sensor,x,y,east\n0,radar,1,2,3\n"),
        ("unknown unit", "time,sensor,x [cells],y\n0,radar,1,2\n"),
        ("half a place on Earth", "time,sensor,lat\n0,radar,1\n"),
        ("swapped", "time,sensor,lat,lon\n0,radar,170.1,5\n"),
        ("milliseconds", "time,sensor,x,y\n0,radar,1,2\n1000,radar,1,2\n2000,radar,1,2\n"),
        ("days or seconds", "time,sensor,x,y\n45356.00,radar,1,2\n45356.01,radar,1,2\n"),
        ("day or month", "time,sensor,x,y\n05/03/2024 10:00:00,radar,1,2\n"),
        ("JSON", "{\"time\": 0, \"x\": 1, \"y\": 2}\n"),
        ("near names", "Time,senser,X,Y\n0,radar,1,2\n"),
        ("no measurement", "time,sensor,snr\n0,radar,1\n"),
        ("range without bearing", "time,sensor,range\n0,radar,1\n"),
        ("y is missing", "time,sensor,x,easting\n0,radar,1,4\n"),
        ("slip in an optional column", "time,sensor,x,y,simga_x\n0,radar,1,2,3\n"),
        ("column twice", "time,sensor,x,y,x\n0,radar,1,2,3\n"),
        ("degrees", "time,sensor,range,bearing\n0,radar,100,1.5\n0,radar,100,271.4\n"),
        ("not a number", "time,sensor,x,y\n0,radar,1,2\n1,radar,east,2\n"),
        ("decimal comma", "time,sensor,x,y\n0,radar,\"1,5\",2\n"),
        ("half NaN", "time,sensor,x,y\n0,radar,NaN,2\n"),
        ("infinite time", "time,sensor,x,y\ninf,radar,1,2\n"),
        ("no time", "time,sensor,x,y\n,radar,1,2\n"),
        ("no date", "time,sensor,x,y\n2026-13-22T10:00:00,radar,1,2\n"),
        ("no name of the sensor", "time,sensor,x,y\n0,,1,2\n"),
        ("x without y", "time,sensor,x,y\n0,radar,1,\n"),
        ("position and bearing", "time,sensor,x,y,bearing\n0,radar,1,2,0.5\n"),
        ("negative range", "time,sensor,range,bearing\n0,radar,-1,0.5\n"),
        ("deviation of zero", "time,sensor,x,y,sigma_x\n0,radar,1,2,0\n"),
        ("detection twice", "time,sensor,detection,x,y\n0,radar,7,1,2\n1,radar,7,1,2\n"),
        ("measurement without number", "time,sensor,detection,x,y\n0,radar,,1,2\n"),
        ("number without measurement", "time,sensor,detection,x,y\n0,radar,3,,\n"),
        ("number with a fraction", "time,sensor,detection,x,y\n0,radar,1.5,1,2\n"),
        ("two places in a scan", "time,sensor,x,y,sensor_x,sensor_y\n0,radar,1,2,0,0\n0,radar,1,2,0,9\n"),
        ("half a place", "time,sensor,x,y,sensor_x,sensor_y\n0,radar,1,2,0,\n"),
        ("short line", "time,sensor,x,y\n0,radar,1,2\n1,rad"),
        ("units: degrees", &units(r#""bearing":"deg""#)),
        ("units: feet", &units(r#""x":"ft""#)),
        ("another table", &described(r#"{"schema":1,"table":"tracks"}"#)),
        ("a later version", &described(r#"{"schema":2,"table":"detections","colour":"red"}"#)),
        ("an unknown key", &described(r#"{"schema":1,"table":"detections","colour":"red"}"#)),
        ("broken description", &described(r#"{"schema":1,"#)),
        (
            "origin in degrees",
            &described(
                r#"{"schema":1,"table":"detections","origin":{"latitude":63.4,"longitude":10.4,"altitude":0}}"#,
            ),
        ),
        (
            "lines before the broken one count",
            "# tercel: {\"schema\":1,\"table\":\"detections\"}\n# by hand\ntime,sensor,x,y\n0,radar,1,2\n0,radar,?,2\n",
        ),
    ];
    insta::assert_snapshot!(report(&cases, |content| {
        read_detections_from(content.as_bytes(), Format::Csv, "radar.csv", &ReadOptions::default())
    }));
}

#[test]
fn text_that_is_no_text() {
    let options = ReadOptions::default();
    let read =
        |bytes: &[u8]| told(&read_detections_from(bytes, Format::Csv, "radar.csv", &options).unwrap_err());
    insta::assert_snapshot!(read(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"), @r"
    radar.csv: this is no text but a picture (PNG)
      help: save the table as CSV with a header, as Parquet, or as lines of JSON
    ");
    insta::assert_snapshot!(read(b"PAR1\x15\x04"), @r"
    radar.csv: this is no text but a Parquet file
      help: name the format: --from parquet
    ");
}

#[test]
fn radians_that_the_file_claims_are_not_read_as_degrees() {
    let options = ReadOptions { angles: Angles::Degrees, ..ReadOptions::default() };
    let content = described(r#"{"schema":1,"table":"detections","units":{"bearing":"rad"}}"#);
    let error = read_detections_from(content.as_bytes(), Format::Csv, "radar.csv", &options).unwrap_err();
    insta::assert_snapshot!(told(&error), @r"
    radar.csv: column `bearing` is in `rad`; expected `deg`
      help: the file says radians: leave out --angles degrees
    ");
}

#[test]
fn other_tables() {
    let options = ReadOptions::default();
    let mut text = report(
        &[
            ("truth without objects", "time,x,y\n0,1,2\n"),
            ("half a velocity", "time,object,x,y,vx,vy\n0,a,1,2,3,\n"),
        ],
        |content| read_truths_from(content.as_bytes(), Format::Csv, "truth.csv", &options),
    );
    text += &report(
        &[
            ("tracks without a place", "time,track,vx\n0,1,2\n"),
            ("unknown status", "time,track,status,x,y\n0,1,dead,1,2\n"),
            ("existence in percent", "time,track,existence,x,y\n0,1,98,1,2\n"),
            ("half a covariance", "time,track,x,y,cov_x_x,cov_x_y,cov_y_y\n0,1,1,2,4,,4\n"),
            (
                "components of one name",
                "# tercel: {\"schema\":1,\"table\":\"tracks\",\"labels\":[\"x\",\"y\",\"x\"]}\ntime,track,x,y\n0,1,1,2\n",
            ),
            ("mode without probability", "time,track,x,y,mode_turn\n0,1,1,2,\n"),
        ],
        |content| read_tracks_from(content.as_bytes(), Format::Csv, "tracks.csv", &options),
    );
    text += &report(&[("metrics without a name", "study,method,run,metric,value\ns,m,1,,2\n")], |content| {
        read_metrics_from(content.as_bytes(), Format::Csv, "metrics.csv", &options)
    });
    insta::assert_snapshot!(text);
}

#[test]
fn lines_of_json() {
    let cases = [
        ("not JSON", "{\"time\":0\n"),
        ("a list", "[1,2]\n"),
        ("no time", "{\"sensor\":\"radar\",\"x\":1,\"y\":2}\n"),
        ("text for a number", "\n{\"time\":0,\"sensor\":\"radar\",\"x\":\"east\",\"y\":2}\n"),
        ("no position", "{\"time\":0,\"sensor\":\"radar\",\"u\":1,\"v\":2}\n"),
        ("an unknown list", "{\"time\":0,\"sensor\":\"radar\",\"things\":[{\"x\":1,\"y\":2}]}\n"),
        ("a table of cells", "time,sensor,x,y\n0,radar,1,2\n"),
        ("a slip", "{\"time\":0,\"sensor\":\"radar\",\"x\":1,\"y\":2,\"simga_x\":3}\n"),
        ("detections are no list", "{\"time\":0,\"sensor\":\"radar\",\"detections\":3}\n"),
        ("detection is no object", "{\"time\":0,\"sensor\":\"radar\",\"detections\":[3]}\n"),
        ("detection without measurement", "{\"time\":0,\"sensor\":\"radar\",\"detections\":[{\"z\":3}]}\n"),
        ("empty detection", "{\"time\":0,\"sensor\":\"radar\",\"detections\":[{}]}\n"),
        (
            "detection twice",
            "{\"time\":0,\"sensor\":\"r\",\"detections\":[{\"detection\":1,\"x\":1,\"y\":1},{\"detection\":1,\"x\":1,\"y\":1}]}\n",
        ),
        ("feet", "{\"tercel\":{\"schema\":1,\"table\":\"detections\",\"units\":{\"x\":\"ft\"}}}\n"),
    ];
    insta::assert_snapshot!(report(&cases, |content| {
        Scans::new(content.as_bytes(), "standard input", ReadOptions::default())
            .collect::<Result<Vec<_>, _>>()
    }));
}

#[test]
fn parquet_files() {
    let options = ReadOptions::default();
    let noise = read_detections_from(&b"time,x,y\n"[..], Format::Parquet, "radar.parquet", &options);
    insta::assert_snapshot!(told(&noise.unwrap_err()), @r"
    radar.parquet: this is no Parquet file but text
      help: name the format: --from csv
    ");
    let mut bytes = Vec::new();
    write_detections_to(&mut bytes, Format::Parquet, "radar.parquet", &Detections::default()).unwrap();
    let cut = read_detections_from(&bytes[..bytes.len() - 9], Format::Parquet, "radar.parquet", &options);
    let cut = told(&cut.unwrap_err());
    assert!(cut.starts_with("radar.parquet: this is not a whole Parquet file: "), "{cut}");
    let tracks = read_tracks_from(bytes.as_slice(), Format::Parquet, "radar.parquet", &options);
    insta::assert_snapshot!(told(&tracks.unwrap_err()), @r"
    radar.parquet: in the description of the table, the table is `detections`; expected `tracks`
      help: give the tracks file here
    ");
}

#[test]
fn files_that_cannot_be_read_or_written() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("radar.csv");
    let error = read_detections(&missing, &ReadOptions::default()).unwrap_err();
    assert!(error.is_io() && error.to_string().contains("radar.csv: cannot open: "), "{error}");
    let error = read_detections("radar.xls", &ReadOptions::default()).unwrap_err();
    insta::assert_snapshot!(told(&error), @r"
    radar.xls: the name does not tell the format; known are .csv, .parquet and .ndjson (and .csv.gz and .ndjson.gz when reading)
      help: rename the file, or name the format: --from csv
    ");
    let error =
        write_detections(folder.path().join("no/such/folder.csv"), &Detections::default()).unwrap_err();
    assert!(error.is_io(), "{error}");
    let error = write_detections("radar.csv.gz", &Detections::default()).unwrap_err();
    assert!(!error.to_string().contains("when reading"), "{error}");
}

fn one(sensor: &str, x: f64, ids: &[u64]) -> Detections {
    let observation = Observation::Position { x, y: 0.0, z: None };
    let detection = |&id: &u64| Detection::new(id, observation);
    let detections = ids.iter().map(detection).collect();
    Detections { scans: vec![Scan::new(0.0, sensor, detections)], ..Detections::default() }
}

#[test]
fn a_table_that_no_reader_would_take_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    for table in [one("radar", f64::NAN, &[1]), one("", 0.0, &[1]), one("radar", 0.0, &[1, 1])] {
        for name in ["bad.csv", "bad.parquet", "bad.ndjson"] {
            let path = folder.path().join(name);
            let error = write_detections(&path, &table).unwrap_err();
            assert!(error.to_string().contains("row "), "{error}");
        }
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "something was left behind");
}

#[test]
fn names_of_states_that_are_columns_already_are_refused() {
    let head =
        Tracks { labels: vec!["x".to_owned(), "y".to_owned(), "time".to_owned()], ..Tracks::default() };
    let error = TracksWriter::to(Vec::new(), Format::Csv, "tracks", &head).err().unwrap();
    insta::assert_snapshot!(told(&error), @r"
    tracks: column `time` would be there twice
      help: give components and modes of the state names of their own
    ");
}

#[test]
fn importers() {
    let folder = tempfile::tempdir().unwrap();
    let read = |source, name: &str| {
        let source: tercel_data::Source = source;
        let path = folder.path().join(name);
        move |content: &str| {
            std::fs::write(&path, content).unwrap();
            import(source, &[&path], &ImportOptions::default())
        }
    };
    use tercel_data::Source::{Adsb, Ais, Autoferry};
    let mut text = report(
        &[
            ("not ADS-B", "t,x\n0,1\n"),
            ("latitude out of range", "time,icao24,lat,lon\n0,a,514000,1\n"),
            ("day or month", "time,icao24,lat,lon\n05/03/2024 10:00:00,a,51,1\n"),
            ("no time", "time,icao24,lat,lon\nyesterday,a,51,1\n"),
        ],
        read(Adsb, "adsb.csv"),
    );
    text += &report(&[("not AIS", "time,lat,lon\n0,1,2\n"), ("empty", "")], read(Ais, "ais.csv"));
    text += &report(
        &[
            ("empty", ""),
            ("not Autoferry", "{}"),
            ("unknown sensor", r#"[{"sensorID":9,"ownshipPosition":[0,0],"time":0,"measurement":[]}]"#),
            ("three numbers", r#"[{"sensorID":2,"ownshipPosition":[0,0],"time":0,"measurement":[1,2,3]}]"#),
        ],
        read(Autoferry, "x_detections.json"),
    );
    insta::assert_snapshot!(text.replace(&folder.path().display().to_string(), "DIR"));
}
