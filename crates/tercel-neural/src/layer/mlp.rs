//! Two layers without a memory.

use super::activation;
use super::cfc::bend_tanh;
use super::linear::Linear;
use super::tangents::Tangents;

/// Two linear layers, each followed by the hyperbolic tangent.
///
/// ## Definition
/// ```text
/// y = tanh(tanh(x W + b) V + c)
/// ```
/// A model file holds the [`Linear`] layers `NAME.first` and `NAME.second`.
///
/// ## Use it when
/// one asks what a memory is worth: it takes the place of a [`Gru`](super::Gru) or [`Ltc`](super::Ltc) and forgets everything.
///
/// ```
/// use tercel_neural::layer::{Linear, Mlp};
///
/// let layer = Mlp::new(Linear::new(1, 3, &[0.5; 3], &[0.0; 3]), Linear::new(3, 2, &[0.5; 6], &[0.0; 2]));
/// let (mut y, mut scratch) = ([0.0; 2], vec![0.0; layer.scratch(1, 0)]);
/// layer.forward(&[1.0], &mut y, &mut scratch);
/// assert!(y[0] > 0.5 && y[0] == y[1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mlp {
    first: Linear,
    second: Linear,
}

impl Mlp {
    /// Two layers one after the other.
    ///
    /// # Panics
    /// When the second does not take what the first gives.
    pub fn new(first: Linear, second: Linear) -> Self {
        assert_eq!(first.outputs(), second.inputs(), "layers of an MLP");
        Mlp { first, second }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        self.first.inputs()
    }

    /// Width of an output row.
    pub fn size(&self) -> usize {
        self.second.outputs()
    }

    /// Numbers of scratch space that this many rows along this many directions need.
    pub fn scratch(&self, batch: usize, directions: usize) -> usize {
        batch * (1 + directions) * self.first.outputs()
    }

    /// Writes the outputs `[batch, size]` of the inputs `[batch, inputs]`.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn forward(&self, input: &[f32], output: &mut [f32], scratch: &mut [f32]) {
        self.forward_along(input, output, Tangents::none(), scratch);
    }

    /// As [`forward`](Mlp::forward), with derivatives.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn forward_along(
        &self,
        input: &[f32],
        output: &mut [f32],
        tangents: Tangents<'_>,
        scratch: &mut [f32],
    ) {
        let batch = super::same_batch(&[(input.len(), self.inputs()), (output.len(), self.size())]);
        tangents.check(batch, self.inputs(), self.size());
        let Tangents { directions, input: input_slopes, output: output_slopes } = tangents;
        let width = self.first.outputs();
        let (features, rest) = scratch.split_at_mut(batch * width);
        let slopes = &mut rest[..batch * directions * width];
        self.first.forward(input, features);
        activation::tanh(features);
        self.second.forward(features, output);
        activation::tanh(output);
        if directions > 0 {
            self.first.tangents(input_slopes, slopes);
            bend_rows(features, slopes, width, directions);
            self.second.tangents(slopes, output_slopes);
            bend_rows(output, output_slopes, self.size(), directions);
        }
    }
}

fn bend_rows(values: &[f32], slopes: &mut [f32], width: usize, directions: usize) {
    for (y, slopes) in values.chunks_exact(width).zip(slopes.chunks_exact_mut(directions * width)) {
        slopes.chunks_exact_mut(width).for_each(|slope| bend_tanh(y, slope));
    }
}
