//! Every table in Parquet: nothing panics.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::{Format, ReadOptions, read_detections_from, read_metrics_from, read_tracks_from, read_truths_from};

fuzz_target!(|bytes: &[u8]| {
    let options = ReadOptions::default();
    let _ = read_detections_from(bytes, Format::Parquet, "fuzz", &options);
    let _ = read_tracks_from(bytes, Format::Parquet, "fuzz", &options);
    let _ = read_truths_from(bytes, Format::Parquet, "fuzz", &options);
    let _ = read_metrics_from(bytes, Format::Parquet, "fuzz", &options);
});
