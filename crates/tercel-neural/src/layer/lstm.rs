//! The long short-term memory.

use super::activation::{sigmoid_pass, tanh_pass};
use super::dispatch::{Arithmetic, Kernel, dispatch};
use super::matrix::Matrix;

/// One layer of long short-term memory.
///
/// ## Recursion
/// With input `x`, output `h`, cell `c` and the gates `i, f, g, o` side by side in the matrices:
/// ```text
/// [i f g o] = x Wx + h Wh + b        i, f, o through σ, g through tanh
/// c' = f c + i g                     h' = o tanh c'
/// ```
/// A model file holds `NAME.input [inputs, 4 h]`, `NAME.hidden [h, 4 h]` and `NAME.bias [4 h]`.
///
/// ## Use it when
/// a filter must remember for long. Stacked layers are one `Lstm` each: the output of one is the input of the next.
///
/// ## Reference
/// Hochreiter and Schmidhuber (1997), with the forget gate of Gers et al. (2000) and without peepholes; one bias.
///
/// ```
/// use tercel_neural::layer::Lstm;
///
/// let layer = Lstm::new(1, 2, &[0.1; 8], &[0.2; 16], &[0.0; 8]);
/// let (mut output, mut cell, mut scratch) = ([0.0; 2], [0.0; 2], vec![0.0; layer.scratch(1)]);
/// layer.step(&[1.0], &mut output, &mut cell, &mut scratch);
/// assert!(cell[0] > output[0] && output[0] > 0.0);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Lstm {
    input: Matrix,
    hidden: Matrix,
    bias: Vec<f32>,
}

impl Lstm {
    /// A layer with these weights, as in a model file.
    ///
    /// # Panics
    /// When a slice has another length.
    pub fn new(inputs: usize, size: usize, input: &[f32], hidden: &[f32], bias: &[f32]) -> Self {
        assert_eq!(bias.len(), 4 * size, "bias of an LSTM");
        let (input, hidden) = (Matrix::new(inputs, 4 * size, input), Matrix::new(size, 4 * size, hidden));
        Lstm { input, hidden, bias: bias.to_vec() }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        self.input.rows()
    }

    /// Width of the output and of the cell.
    pub fn size(&self) -> usize {
        self.hidden.rows()
    }

    /// Numbers of scratch space that a step of this many rows needs.
    pub fn scratch(&self, batch: usize) -> usize {
        4 * self.size() * batch
    }

    /// Moves the output and the cell `[batch, size]` on by one step of the input `[batch, inputs]`.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step(&self, input: &[f32], output: &mut [f32], cell: &mut [f32], scratch: &mut [f32]) {
        let sizes = [(input.len(), self.inputs()), (output.len(), self.size()), (cell.len(), self.size())];
        let batch = super::same_batch(&sizes);
        let gates = &mut scratch[..4 * self.size() * batch];
        dispatch(Step { layer: self, input, output, cell, gates });
    }
}

struct Step<'a> {
    layer: &'a Lstm,
    input: &'a [f32],
    output: &'a mut [f32],
    cell: &'a mut [f32],
    gates: &'a mut [f32],
}

impl Kernel for Step<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, machine: A) {
        let Step { layer, input, output, cell, gates } = self;
        super::fill_rows(&layer.bias, gates);
        layer.input.add_product(machine, input, gates);
        layer.hidden.add_product(machine, output, gates);
        let size = layer.size();
        let rows = gates.chunks_exact_mut(4 * size).zip(cell.chunks_exact_mut(size));
        for ((gates, cell), output) in rows.zip(output.chunks_exact_mut(size)) {
            let (input_and_forget, rest) = gates.split_at_mut(2 * size);
            let (candidate, out) = rest.split_at_mut(size);
            sigmoid_pass::<A>(input_and_forget);
            tanh_pass::<A>(candidate);
            sigmoid_pass::<A>(out);
            let (take, keep) = input_and_forget.split_at(size);
            for (((c, keep), take), candidate) in cell.iter_mut().zip(keep).zip(take).zip(candidate.iter()) {
                *c = A::fused(*keep, *c, take * candidate);
            }
            candidate.copy_from_slice(cell);
            tanh_pass::<A>(candidate);
            for ((h, out), c) in output.iter_mut().zip(out.iter()).zip(candidate.iter()) {
                *h = out * c;
            }
        }
    }
}
