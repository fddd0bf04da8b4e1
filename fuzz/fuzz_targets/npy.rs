//! NumPy arrays: nothing panics, and an array has as many entries as its shape says.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::read_npy_from;

fuzz_target!(|bytes: &[u8]| {
    let Ok(array) = read_npy_from(bytes, "fuzz") else { return };
    assert_eq!(array.shape.iter().product::<usize>(), array.values.len());
});
