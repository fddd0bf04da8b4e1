//! The gated feed-forward part of a transformer.

use super::Linear;
use super::activation::silu;

/// Two layers side by side, of which one opens and shuts the other, and one behind them.
///
/// ## Definition
/// ```text
/// y = (silu(x G + g) ⊙ (x V + v)) O + o          silu(a) = a σ(a)
/// ```
/// A model file holds the [`Linear`] layers `NAME.gate` and `NAME.value`, both `[size, hidden]`, and `NAME.output`.
///
/// ## Use it when
/// a transformer needs its feed-forward part. With two thirds of the width it costs what two plain layers do.
///
/// ## Reference
/// Shazeer (2020), with biases.
///
/// ```
/// use tercel_neural::layer::{Linear, SwiGlu};
///
/// let linear = |weight: f32| Linear::new(1, 1, &[weight], &[0.0]);
/// let layer = SwiGlu::new(linear(1.0), linear(3.0), linear(0.5));
/// let (mut y, mut scratch) = ([0.0], vec![0.0; layer.scratch(1)]);
/// layer.forward(&[2.0], &mut y, &mut scratch);
/// assert!((y[0] - 0.5 * 6.0 * 2.0 / (1.0 + f32::exp(-2.0))).abs() < 1e-5);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SwiGlu {
    gate: Linear,
    value: Linear,
    output: Linear,
}

impl SwiGlu {
    /// A layer of these.
    ///
    /// # Panics
    /// When they do not fit each other.
    pub fn new(gate: Linear, value: Linear, output: Linear) -> Self {
        let sizes = [&gate, &value].map(|layer| [layer.inputs(), layer.outputs()]);
        assert_eq!(sizes[0], sizes[1], "gate and value of a gated layer");
        assert_eq!([output.outputs(), output.inputs()], sizes[0], "output of a gated layer");
        SwiGlu { gate, value, output }
    }

    /// Width of a row.
    pub fn size(&self) -> usize {
        self.gate.inputs()
    }

    /// Numbers of scratch space that this many rows need.
    pub fn scratch(&self, batch: usize) -> usize {
        2 * batch * self.gate.outputs()
    }

    /// Writes the outputs `[batch, size]` of the inputs `[batch, size]`.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn forward(&self, input: &[f32], output: &mut [f32], scratch: &mut [f32]) {
        let batch = super::same_batch(&[(input.len(), self.size()), (output.len(), self.size())]);
        let (open, rest) = scratch.split_at_mut(batch * self.gate.outputs());
        let values = &mut rest[..batch * self.gate.outputs()];
        self.gate.forward(input, open);
        silu(open);
        self.value.forward(input, values);
        open.iter_mut().zip(values).for_each(|(open, value)| *open *= *value);
        self.output.forward(open, output);
    }
}
