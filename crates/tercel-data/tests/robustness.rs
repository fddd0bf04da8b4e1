//! No input makes a reader panic: neither noise nor a good file with some bytes changed.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use std::io::Write;

use proptest::collection::vec;
use proptest::prelude::*;
use tercel_data::import::autoferry;
use tercel_data::ndjson::Scans;
use tercel_data::{
    Format, ImportOptions, ReadOptions, Source, import_from, read_detections_from, read_metrics_from,
    read_tracks_from, read_truths_from, write_detections_to, write_metrics_to, write_tracks_to,
    write_truths_to,
};

const FORMATS: [Format; 3] = [Format::Csv, Format::Parquet, Format::Ndjson];

/// Reads the bytes as everything; what comes out does not matter.
fn read_as_everything(bytes: &[u8]) {
    for options in
        [ReadOptions::default(), ReadOptions { sensor: Some("s".into()), ..ReadOptions::default() }]
    {
        for format in FORMATS {
            let _ = read_detections_from(bytes, format, "noise", &options);
            let _ = read_truths_from(bytes, format, "noise", &options);
            let _ = read_tracks_from(bytes, format, "noise", &options);
            let _ = read_metrics_from(bytes, format, "noise", &options);
        }
        assert!(Scans::new(bytes, "noise", options).count() <= bytes.len() + 1);
    }
    let _ = autoferry::read_detections_from(bytes, "noise");
    let _ = autoferry::read_truths_from(bytes, "noise");
    for source in Source::ALL {
        let _ = import_from(source, bytes, "noise", &ImportOptions::default());
    }
}

/// Changes of a file: bytes that are replaced, and where it ends.
fn damage() -> impl Strategy<Value = (Vec<(prop::sample::Index, u8)>, Option<prop::sample::Index>)> {
    (vec((any::<prop::sample::Index>(), any::<u8>()), 0..6), prop::option::of(any::<prop::sample::Index>()))
}

fn damaged(bytes: &[u8], changes: &[(prop::sample::Index, u8)], end: Option<prop::sample::Index>) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (at, byte) in changes {
        let at = at.index(bytes.len());
        bytes[at] = *byte;
    }
    if let Some(end) = end {
        bytes.truncate(end.index(bytes.len()));
    }
    bytes
}

const REPORTS: &str = "\
time,icao24,mmsi,lat,lon,velocity,heading,sog,cog,geoaltitude,lastposupdate
1626098400,3c4591,235070762,51.4,-0.4,254.6,99.6,5.9,157.8,10843,1626098398.9
2016-01-12 13:02:11.2,407a19,235013375,53.4,-4.0,,,102.3,360,,
";

/// One recording of each form that is no table.
const FORMS: [&str; 4] = [
    "\\s:rx1,c:1709632800*07\\!AIVDM,1,1,,A,13@ne9OP1p0kA@0P6LH1hP01P000,0*68\n!AIVDM,2,1,3,B,1,0*25\n",
    "MSG,3,1,1,4CA2D6,1,2024/03/05,10:00:00.000,2024/03/05,10:00:00.000,,36089,,,47.45,8.55,,,0,0,0,0\n",
    "{\"now\": 1709632802.9, \"aircraft\": [{\"hex\": \"4ca2d6\", \"lat\": 47.45, \"lon\": 8.55, \"seen_pos\": 1.5}]}\n",
    "{\"time\": 1, \"states\": [[\"4ca2d6\", \"RYR\", \"Ireland\", 1, 1, 8.55, 47.45, 11000.0, false, 230.0, 70.0]]}",
];

const FERRY: &str = r#"[{"sensorID":2,"ownshipPosition":[1.0,2.0],"time":1.6E9,"measurement":[[1,2],[3,4]]},
{"sensorID":3,"ownshipPosition":[1.0,2.0],"time":1.7E9,"measurement":0.5}]"#;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn noise_is_refused(bytes in vec(any::<u8>(), 0..300)) {
        read_as_everything(&bytes);
        let mut parquet = b"PAR1".to_vec();
        parquet.extend(&bytes);
        parquet.extend(b"PAR1");
        read_as_everything(&parquet);
    }

    #[test]
    fn text_noise_is_refused(text in "[0-9a-zA-Z,;\n\r\"{}:\\[\\].#+ \\-]{0,300}") {
        read_as_everything(text.as_bytes());
        read_as_everything(format!("time,sensor,x,y\n{text}").as_bytes());
        read_as_everything(format!("{{\"time\":0,\"sensor\":\"a\",\"detections\":[{text}]}}").as_bytes());
    }

    #[test]
    fn damaged_tables_are_refused_or_read(
        detections in common::detections(),
        tracks in common::tracks(),
        truths in common::truths(),
        metrics in common::metrics(),
        (changes, end) in damage(),
    ) {
        for format in FORMATS {
            let mut files = [const { Vec::new() }; 4];
            write_detections_to(&mut files[0], format, "good", &detections).unwrap();
            write_tracks_to(&mut files[1], format, "good", &tracks).unwrap();
            write_truths_to(&mut files[2], format, "good", &truths).unwrap();
            write_metrics_to(&mut files[3], format, "good", &metrics).unwrap();
            for file in files {
                read_as_everything(&damaged(&file, &changes, end));
            }
        }
    }

    #[test]
    fn damaged_recordings_are_refused_or_read((changes, end) in damage()) {
        read_as_everything(&damaged(REPORTS.as_bytes(), &changes, end));
        read_as_everything(&damaged(FERRY.as_bytes(), &changes, end));
        for form in FORMS {
            read_as_everything(&damaged(form.as_bytes(), &changes, end));
        }
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(REPORTS.as_bytes()).unwrap();
        read_as_everything(&damaged(&gzip.finish().unwrap(), &changes, end));
    }
}

#[test]
fn every_truncation_of_a_parquet_file_is_an_error() {
    let detections = read_detections_from(
        "time,sensor,x,y\n0,radar,1,2\n1,radar,3,4\n".as_bytes(),
        Format::Csv,
        "good",
        &ReadOptions::default(),
    )
    .unwrap();
    let mut bytes = Vec::new();
    write_detections_to(&mut bytes, Format::Parquet, "good", &detections).unwrap();
    for end in 0..bytes.len() {
        assert!(
            read_detections_from(&bytes[..end], Format::Parquet, "cut", &ReadOptions::default()).is_err(),
            "the first {end} of {} bytes were read as a whole file",
            bytes.len()
        );
    }
}
