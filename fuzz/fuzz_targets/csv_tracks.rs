//! Tracks in CSV: what is read can be written and read back, and what was rounded once stays the same.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_data::table::Tracks;
use tercel_data::{Format, ReadOptions, read_tracks_from, write_tracks_to};

fn there_and_back(table: &Tracks) -> Tracks {
    let mut written = Vec::new();
    write_tracks_to(&mut written, Format::Csv, "fuzz", table).expect("what was read can be written");
    let options = ReadOptions::default();
    read_tracks_from(written.as_slice(), Format::Csv, "fuzz", &options).expect("what was written can be read")
}

fuzz_target!(|bytes: &[u8]| {
    let Ok(table) = read_tracks_from(bytes, Format::Csv, "fuzz", &ReadOptions::default()) else { return };
    let once = there_and_back(&table);
    assert_eq!(there_and_back(&once), once);
});
