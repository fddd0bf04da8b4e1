//! Layers: what is learned, and how it is applied to tensors.
//!
//! A layer is a small value that knows its sizes and which parameters of a
//! [`ParameterSet`](crate::ParameterSet) are its own. It is applied to tensors with the
//! [`Weights`](crate::Weights) of one graph, so the same model serves any number of threads, in training and
//! in validation.
//!
//! A sequence is one tensor with a row for each step and member of the batch, step after step: row
//! `t * batch + b`. Taking such a tensor apart step by step inside the graph would cost a time that grows with the
//! square of its length, because the gradient of each slice is a tensor of full size. So recurrent layers
//! take whole sequences, and recursions in which an output feeds back take single steps.

mod attention;
mod bidirectional;
mod cell;
#[cfg(test)]
mod cell_tests;
mod cfc;
mod dropout;
mod gru;
mod layer_norm;
mod linear;
mod lstm;
mod ltc;
mod rms_norm;
mod rotary_attention;
mod swi_glu;
mod synapses;
#[cfg(test)]
mod tests;

pub use attention::{Attention, Mask};
pub use bidirectional::Bidirectional;
pub use cell::Cell;
pub use cfc::Cfc;
pub use dropout::dropout;
pub use gru::Gru;
pub use layer_norm::LayerNorm;
pub use linear::{Activation, Linear};
pub use lstm::{Lstm, LstmState};
pub use ltc::Ltc;
pub use rms_norm::RmsNorm;
pub use rotary_attention::{KeyValues, RotaryAttention};
pub use swi_glu::{SwiGlu, silu};

use crate::TrainError;

/// Names the layers of a stack: `NAME.0`, `NAME.1` and so on.
pub fn numbered(name: &str, layer: usize) -> String {
    format!("{name}.{layer}")
}

fn positive(name: &str, sizes: &[(&str, usize)]) -> Result<(), TrainError> {
    match sizes.iter().find(|(_, size)| *size == 0) {
        Some((what, _)) => Err(TrainError::Parameter {
            name: name.to_owned(),
            problem: format!("{what} must be at least 1"),
        }),
        None => Ok(()),
    }
}
