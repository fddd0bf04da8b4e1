//! The gated recurrent unit.

use super::activation::{sigmoid_pass, tanh_pass};
use super::dispatch::{Arithmetic, Kernel, dispatch};
use super::matrix::Matrix;
use super::tangents::Tangents;

/// One layer of gated recurrent units.
///
/// ## Recursion
/// With input `x`, memory `h` and the gates `r, z, n` side by side in the matrices:
/// ```text
/// [xr xz xn] = x Wx + bx        [hr hz hn] = h Wh + bh
/// r = σ(xr + hr)                z = σ(xz + hz)
/// n = tanh(xn + r hn)           h' = (1 - z) n + z h
/// ```
/// A model file holds `NAME.input [inputs, 3 h]`, `NAME.input_bias [3 h]`, `NAME.hidden [h, 3 h]`, `NAME.hidden_bias [3 h]`.
///
/// ## Use it when
/// a filter must remember. It has a quarter fewer weights than an [`Lstm`](super::Lstm) of the same width, and one memory.
///
/// ## Reference
/// Cho et al. (2014), eqs. 5 to 8, in the variant of PyTorch: the reset gate scales `h Wh + bh` and `z` keeps the old memory.
///
/// ```
/// use tercel_neural::layer::Gru;
///
/// let layer = Gru::new(1, 2, &[0.1; 6], &[0.0; 6], &[0.2; 12], &[0.0; 6]);
/// let (mut memory, mut scratch) = ([0.0; 2], vec![0.0; layer.scratch(1)]);
/// layer.step(&[1.0], &mut memory, &mut scratch);
/// assert!(memory[0] > 0.0 && memory[0] == memory[1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Gru {
    input: Matrix,
    input_bias: Vec<f32>,
    hidden: Matrix,
    hidden_bias: Vec<f32>,
}

impl Gru {
    /// A layer with these weights, as in a model file.
    ///
    /// # Panics
    /// When a slice has another length.
    pub fn new(
        inputs: usize,
        size: usize,
        input: &[f32],
        input_bias: &[f32],
        hidden: &[f32],
        hidden_bias: &[f32],
    ) -> Self {
        assert_eq!([input_bias.len(), hidden_bias.len()], [3 * size; 2], "biases of a GRU");
        Gru {
            input: Matrix::new(inputs, 3 * size, input),
            input_bias: input_bias.to_vec(),
            hidden: Matrix::new(size, 3 * size, hidden),
            hidden_bias: hidden_bias.to_vec(),
        }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        self.input.rows()
    }

    /// Width of the memory, which is also the output.
    pub fn size(&self) -> usize {
        self.hidden.rows()
    }

    /// Numbers of scratch space that a step of this many rows needs.
    pub fn scratch(&self, batch: usize) -> usize {
        self.scratch_along(batch, 0)
    }

    /// Numbers of scratch space that a step of this many rows along this many directions needs.
    pub fn scratch_along(&self, batch: usize, directions: usize) -> usize {
        (6 + 3 * directions) * self.size() * batch
    }

    /// Moves the memory `[batch, size]` on by one step of the input `[batch, inputs]`. The new memory is the output.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step(&self, input: &[f32], memory: &mut [f32], scratch: &mut [f32]) {
        self.step_along(input, memory, Tangents::none(), scratch);
    }

    /// As [`step`](Gru::step), with derivatives.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step_along(&self, input: &[f32], memory: &mut [f32], tangents: Tangents<'_>, scratch: &mut [f32]) {
        let batch = super::same_batch(&[(input.len(), self.inputs()), (memory.len(), self.size())]);
        tangents.check(batch, self.inputs(), self.size());
        let (from_input, rest) = scratch.split_at_mut(3 * self.size() * batch);
        let (from_memory, rest) = rest.split_at_mut(3 * self.size() * batch);
        let slopes = &mut rest[..3 * self.size() * batch * tangents.directions];
        dispatch(Step { layer: self, input, memory, from_input, from_memory, tangents, slopes });
    }
}

struct Step<'a> {
    layer: &'a Gru,
    input: &'a [f32],
    memory: &'a mut [f32],
    from_input: &'a mut [f32],
    from_memory: &'a mut [f32],
    tangents: Tangents<'a>,
    /// What the input tangents contribute to the gates.
    slopes: &'a mut [f32],
}

impl Kernel for Step<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, machine: A) {
        let Step { layer, input, memory, from_input, from_memory, tangents, slopes } = self;
        super::fill_rows(&layer.input_bias, from_input);
        layer.input.add_product(machine, input, from_input);
        super::fill_rows(&layer.hidden_bias, from_memory);
        layer.hidden.add_product(machine, memory, from_memory);
        slopes.fill(0.0);
        layer.input.add_product(machine, tangents.input, slopes);
        let (size, directions) = (layer.size(), tangents.directions);
        let rows = from_input.chunks_exact_mut(3 * size).zip(from_memory.chunks_exact(3 * size));
        for (row, ((x, h), memory)) in rows.zip(memory.chunks_exact_mut(size)).enumerate() {
            let (gates, candidate) = x.split_at_mut(2 * size);
            let (gate_terms, candidate_terms) = h.split_at(2 * size);
            for (gate, term) in gates.iter_mut().zip(gate_terms) {
                *gate += term;
            }
            sigmoid_pass::<A>(gates);
            let (reset, keep) = gates.split_at(size);
            for ((n, reset), term) in candidate.iter_mut().zip(reset).zip(candidate_terms) {
                *n = A::fused(*reset, *term, *n);
            }
            tanh_pass::<A>(candidate);
            let own = row * directions..(row + 1) * directions;
            let slopes = slopes[own.start * 3 * size..own.end * 3 * size].chunks_exact(3 * size);
            let found = tangents.output[own.start * size..own.end * size].chunks_exact_mut(size);
            for (slope, to) in slopes.zip(found) {
                for i in 0..size {
                    let of_reset = (reset[i] - reset[i] * reset[i]) * slope[i];
                    let of_keep = (keep[i] - keep[i] * keep[i]) * slope[size + i];
                    let inner = A::fused(of_reset, candidate_terms[i], slope[2 * size + i]);
                    let of_candidate = (1.0 - candidate[i] * candidate[i]) * inner;
                    to[i] = (1.0 - keep[i]) * of_candidate + (memory[i] - candidate[i]) * of_keep;
                }
            }
            for ((h, keep), n) in memory.iter_mut().zip(keep).zip(candidate.iter()) {
                *h = A::fused(*keep, *h, (1.0 - keep) * n);
            }
        }
    }
}
