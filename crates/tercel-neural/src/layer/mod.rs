//! Small layers of networks, for one row or a batch of them, that do not allocate.
//!
//! | layer | remembers |
//! |---|---|
//! | [`Linear`] | nothing |
//! | [`Gru`] | one row of its size |
//! | [`Lstm`] | two rows of its size |
//! | [`Ltc`] | one row of its size |
//! | [`Cfc`] | one row of its size |
//! | [`Mlp`] | nothing |
//! | [`Bidirectional`] | nothing: takes a whole window |
//! | [`Attention`] | nothing: takes a whole window |
//! | [`RotaryAttention`] | keys and values of its last rows: [`KeyValues`] |
//! | [`SwiGlu`] | nothing |
//! | [`LayerNorm`], [`RmsNorm`] | nothing |
//! | [`RunningNorm`] | count, means and squares of its channels |
//! | [`activation`] | nothing: passes over a slice |
//!
//! Weights and activations are `f32`. Sizes come with the weights. A batch is `[batch, width]`, row by row; how many rows
//! there are follows from the lengths of the slices. Memories and scratch space belong to the caller.
//!
//! [`Cell`] is any of the layers that a filter may be driven by, with derivatives ([`Tangents`]).
//!
//! ## Arithmetic
//! On x86-64 machines with AVX2 and FMA the layers use them, chosen when the program runs; on Arm they use NEON; elsewhere
//! they are plain. A row gives the same bits alone and in any batch, and on all machines with fused arithmetic. Plain
//! machines round twice where the others round once, which changes the last digits: about 1e-7 in a layer.

pub mod activation;
mod attention;
mod bidirectional;
mod cell;
#[cfg(test)]
mod cell_tests;
mod cfc;
mod dispatch;
mod gru;
mod layer_norm;
mod linear;
mod lstm;
mod ltc;
mod matrix;
mod mlp;
mod rms_norm;
mod rotary_attention;
mod running_norm;
mod shape;
mod swi_glu;
mod synapses;
mod tangents;
#[cfg(test)]
mod tests;

pub use attention::{Attention, positions};
pub use bidirectional::Bidirectional;
pub use cell::{Cell, CellShape};
pub use cfc::Cfc;
pub use gru::Gru;
pub use layer_norm::LayerNorm;
pub use linear::Linear;
pub use lstm::Lstm;
pub use ltc::{Ltc, LtcWeights, Solver};
pub use mlp::Mlp;
pub use rms_norm::RmsNorm;
pub use rotary_attention::{KeyValues, RotaryAttention, rotate};
pub use running_norm::RunningNorm;
pub use shape::LayerShape;
pub use swi_glu::SwiGlu;
pub use synapses::SynapseWeights;
pub use tangents::Tangents;

/// The number of rows in slices of these lengths and widths, which must agree.
fn same_batch(sizes: &[(usize, usize)]) -> usize {
    let batch = sizes[0].0 / sizes[0].1;
    for &(length, width) in sizes {
        assert_eq!(length, batch * width, "{batch} rows of {width} numbers");
    }
    batch
}

/// Copies `row` into every row of `rows`.
#[inline(always)]
fn fill_rows(row: &[f32], rows: &mut [f32]) {
    for to in rows.chunks_exact_mut(row.len()) {
        to.copy_from_slice(row);
    }
}
