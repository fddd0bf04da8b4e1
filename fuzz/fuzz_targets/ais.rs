//! The AIS importers, whose form the content tells: nothing panics, and what comes in can be written.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::{Format, ImportOptions, Source, import_from, write_detections_to};

fuzz_target!(|bytes: &[u8]| {
    let Ok(imported) = import_from(Source::Ais, bytes, "fuzz", &ImportOptions::default()) else { return };
    write_detections_to(Vec::new(), Format::Csv, "fuzz", &imported.detections).expect("it can be written");
});
