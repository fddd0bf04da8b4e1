//! Detections in CSV: what is read is written and read back the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::{Format, ReadOptions, read_detections_from, write_detections_to};

fuzz_target!(|bytes: &[u8]| {
    let options = ReadOptions::default();
    let Ok(table) = read_detections_from(bytes, Format::Csv, "fuzz", &options) else { return };
    let mut written = Vec::new();
    write_detections_to(&mut written, Format::Csv, "fuzz", &table).expect("what was read can be written");
    let back = read_detections_from(written.as_slice(), Format::Csv, "fuzz", &options).expect("what was written can be read");
    assert_eq!(back, table);
});
