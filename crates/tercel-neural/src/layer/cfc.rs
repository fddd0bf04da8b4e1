//! The closed-form continuous-time cell.

use super::activation::{sigmoid_pass, tanh_pass};
use super::dispatch::{Arithmetic, Kernel, dispatch};
use super::matrix::Matrix;
use super::tangents::Tangents;

/// One layer of neurons that follow a closed form instead of a differential equation.
///
/// ## Recursion
/// With input `x`, memory `h` and the heads `a, b, s, o` side by side in the matrix `V`:
/// ```text
/// z = tanh(x Wx + h Wh + b)            [a b s o] = z V + c
/// t = σ(s elapsed + o)                 h' = (1 - t) tanh a + t tanh b
/// ```
/// A model file holds `NAME.input [inputs, n]`, `NAME.hidden [h, n]`, `NAME.bias [n]` for the backbone of width `n`, and
/// `NAME.heads [n, 4 h]`, `NAME.heads_bias [4 h]`.
///
/// ## Use it when
/// steps have different lengths and an [`Ltc`](super::Ltc) is too slow: nothing is solved, so a step costs what one of a
/// [`Gru`](super::Gru) of twice the width does.
///
/// ## Reference
/// Hasani, Lechner, Amini et al., "Closed-form continuous-time neural networks", Nature Machine Intelligence 4 (2022), eq. 4,
/// with the sign of the gate inside its weights. Deviations: the backbone is one layer with a plain hyperbolic tangent.
///
/// ```
/// use tercel_neural::layer::Cfc;
///
/// let layer = Cfc::new(1, 2, 3, &[0.5; 3], &[0.1; 6], &[0.0; 3], &[0.4; 24], &[0.0; 8]);
/// let (mut memory, mut scratch) = ([0.0; 2], vec![0.0; layer.scratch(1, 0)]);
/// layer.step(1.0, &[1.0], &mut memory, &mut scratch);
/// assert!(memory[0] > 0.1 && memory[0] == memory[1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Cfc {
    input: Matrix,
    hidden: Matrix,
    bias: Vec<f32>,
    heads: Matrix,
    heads_bias: Vec<f32>,
}

impl Cfc {
    /// A layer with these weights, as in a model file.
    ///
    /// # Panics
    /// When a slice has another length.
    #[expect(clippy::too_many_arguments, reason = "sizes and tensors in the order of a model file")]
    pub fn new(
        inputs: usize,
        size: usize,
        backbone: usize,
        input: &[f32],
        hidden: &[f32],
        bias: &[f32],
        heads: &[f32],
        heads_bias: &[f32],
    ) -> Self {
        assert_eq!([bias.len(), heads_bias.len()], [backbone, 4 * size], "biases of a CfC");
        Cfc {
            input: Matrix::new(inputs, backbone, input),
            hidden: Matrix::new(size, backbone, hidden),
            bias: bias.to_vec(),
            heads: Matrix::new(backbone, 4 * size, heads),
            heads_bias: heads_bias.to_vec(),
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

    /// Numbers of scratch space that a step of this many rows along this many directions needs.
    pub fn scratch(&self, batch: usize, directions: usize) -> usize {
        batch * (1 + directions) * (self.input.columns() + self.heads.columns())
    }

    /// Moves the memory `[batch, size]` on by the time `elapsed` with the input `[batch, inputs]`. The new memory is the
    /// output.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step(&self, elapsed: f32, input: &[f32], memory: &mut [f32], scratch: &mut [f32]) {
        self.step_along(elapsed, input, memory, Tangents::none(), scratch);
    }

    /// As [`step`](Cfc::step), with derivatives.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step_along(
        &self,
        elapsed: f32,
        input: &[f32],
        memory: &mut [f32],
        tangents: Tangents<'_>,
        scratch: &mut [f32],
    ) {
        let batch = super::same_batch(&[(input.len(), self.inputs()), (memory.len(), self.size())]);
        tangents.check(batch, self.inputs(), self.size());
        dispatch(Step { layer: self, elapsed, input, memory, tangents, scratch });
    }
}

struct Step<'a> {
    layer: &'a Cfc,
    elapsed: f32,
    input: &'a [f32],
    memory: &'a mut [f32],
    tangents: Tangents<'a>,
    scratch: &'a mut [f32],
}

impl Kernel for Step<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, machine: A) {
        let Step { layer, elapsed, input, memory, tangents, scratch } = self;
        let (width, size, directions) = (layer.input.columns(), layer.size(), tangents.directions);
        let rows = memory.len() / size;
        let (features, rest) = scratch.split_at_mut(rows * width);
        let (heads, rest) = rest.split_at_mut(rows * 4 * size);
        let (slopes, rest) = rest.split_at_mut(rows * directions * width);
        let head_slopes = &mut rest[..rows * directions * 4 * size];
        super::fill_rows(&layer.bias, features);
        layer.input.add_product(machine, input, features);
        layer.hidden.add_product(machine, memory, features);
        tanh_pass::<A>(features);
        super::fill_rows(&layer.heads_bias, heads);
        layer.heads.add_product(machine, features, heads);
        slopes.fill(0.0);
        layer.input.add_product(machine, tangents.input, slopes);
        if directions > 0 {
            for (z, slopes) in features.chunks_exact(width).zip(slopes.chunks_exact_mut(directions * width)) {
                slopes.chunks_exact_mut(width).for_each(|slope| bend_tanh(z, slope));
            }
        }
        head_slopes.fill(0.0);
        layer.heads.add_product(machine, slopes, head_slopes);
        for (row, (heads, memory)) in
            heads.chunks_exact_mut(4 * size).zip(memory.chunks_exact_mut(size)).enumerate()
        {
            let (ends, gates) = heads.split_at_mut(2 * size);
            let (speed, offset) = gates.split_at_mut(size);
            tanh_pass::<A>(ends);
            for (speed, offset) in speed.iter_mut().zip(offset.iter()) {
                *speed = A::fused(*speed, elapsed, *offset);
            }
            sigmoid_pass::<A>(speed);
            let (a, b) = ends.split_at(size);
            let own = row * directions..(row + 1) * directions;
            let found = tangents.output[own.start * size..own.end * size].chunks_exact_mut(size);
            let given = head_slopes[own.start * 4 * size..own.end * 4 * size].chunks_exact(4 * size);
            for (to, of) in found.zip(given) {
                for i in 0..size {
                    let [da, db] = [(a[i], of[i]), (b[i], of[size + i])].map(|(y, d)| (1.0 - y * y) * d);
                    let t = speed[i];
                    let dt = (t - t * t) * A::fused(of[2 * size + i], elapsed, of[3 * size + i]);
                    to[i] = da + t * (db - da) + (b[i] - a[i]) * dt;
                }
            }
            for i in 0..size {
                memory[i] = A::fused(speed[i], b[i] - a[i], a[i]);
            }
        }
    }
}

/// Turns a tangent of what a hyperbolic tangent was taken of into that of its value `y`.
#[inline(always)]
pub(super) fn bend_tanh(y: &[f32], slope: &mut [f32]) {
    for (slope, y) in slope.iter_mut().zip(y) {
        *slope *= 1.0 - y * y;
    }
}
