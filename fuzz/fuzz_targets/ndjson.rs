//! Lines of JSON: the stream ends, and has no more items than lines and scans.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::ndjson::Scans;
use tercel_data::{Format, ReadOptions, read_tracks_from};

fuzz_target!(|bytes: &[u8]| {
    let items = Scans::new(bytes, "fuzz", ReadOptions::default()).count();
    assert!(items <= bytes.len() + 1);
    let _ = read_tracks_from(bytes, Format::Ndjson, "fuzz", &ReadOptions::default());
});
