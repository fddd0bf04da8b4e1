//! Two long short-term memories that read a sequence from both ends.

use super::Lstm;

/// Two layers of long short-term memory over a whole sequence: one from its first step to the last, one back.
///
/// ## Definition
/// ```text
/// y(t) = [h→(t) h←(t)]          both from a memory of zero
/// ```
/// A model file holds the layers `NAME.forward` and `NAME.backward`.
///
/// ## Use it when
/// a window is known as a whole, and what came later says something about what came before.
///
/// ## Reference
/// Graves and Schmidhuber (2005).
///
/// ```
/// use tercel_neural::layer::{Bidirectional, Lstm};
///
/// let one = || Lstm::new(1, 2, &[0.1; 8], &[0.2; 16], &[0.0; 8]);
/// let layer = Bidirectional::new(one(), one());
/// let (mut y, mut scratch) = ([0.0; 12], vec![0.0; layer.scratch()]);
/// layer.forward(&[1.0, 0.5, 1.0], &mut y, &mut scratch);
/// assert_eq!(y[0..2], y[10..12]); // the sequence is the same from both ends
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Bidirectional {
    forward: Lstm,
    backward: Lstm,
}

impl Bidirectional {
    /// A layer of these halves.
    ///
    /// # Panics
    /// When their sizes differ.
    pub fn new(forward: Lstm, backward: Lstm) -> Self {
        let sizes = |layer: &Lstm| (layer.inputs(), layer.size());
        assert_eq!(sizes(&forward), sizes(&backward), "halves of a bidirectional layer");
        Bidirectional { forward, backward }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        self.forward.inputs()
    }

    /// Width of an output row: that of both halves.
    pub fn outputs(&self) -> usize {
        2 * self.forward.size()
    }

    /// Numbers of scratch space.
    pub fn scratch(&self) -> usize {
        self.outputs() + self.forward.scratch(1)
    }

    /// Writes the outputs `[steps, 2 size]` of a sequence `[steps, inputs]`.
    ///
    /// # Panics
    /// When the slices do not hold the same number of steps, or the scratch space is too small.
    pub fn forward(&self, input: &[f32], output: &mut [f32], scratch: &mut [f32]) {
        let (inputs, outputs, size) = (self.inputs(), self.outputs(), self.forward.size());
        let steps = super::same_batch(&[(input.len(), inputs), (output.len(), outputs)]);
        let (memory, scratch) = scratch.split_at_mut(outputs);
        let (hidden, cell) = memory.split_at_mut(size);
        for (half, layer) in [&self.forward, &self.backward].into_iter().enumerate() {
            hidden.fill(0.0);
            cell.fill(0.0);
            for step in 0..steps {
                let row = if half == 0 { step } else { steps - 1 - step };
                layer.step(&input[row * inputs..][..inputs], hidden, cell, scratch);
                output[row * outputs + half * size..][..size].copy_from_slice(hidden);
            }
        }
    }
}
