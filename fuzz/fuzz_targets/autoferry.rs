//! Autoferry recordings: nothing panics.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::import::autoferry;

fuzz_target!(|bytes: &[u8]| {
    let _ = autoferry::read_detections_from(bytes, "fuzz");
    let _ = autoferry::read_truths_from(bytes, "fuzz");
});
