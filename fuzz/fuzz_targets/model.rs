//! Model files: nothing panics, and what is read can be written and read back with the same weights.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tercel_neural::Model;
use tercel_neural::filter::GainNetwork;

fuzz_target!(|bytes: &[u8]| {
    let Ok(model) = Model::from_bytes("fuzz", bytes) else { return };
    let written = model.to_bytes().expect("it can be written");
    let again = Model::from_bytes("fuzz", &written).expect("it can be read again");
    assert_eq!((&again.card().name, again.tensors()), (&model.card().name, model.tensors()));
    let _ = GainNetwork::from_model(&model);
});
