//! The GRU layer.

use super::positive;
use crate::backend::product::{add_product, add_product_transposed, add_transposed_product};
use crate::backend::vector::{add, repeat_row, sigmoid, sum_rows, tanh, vectorised};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply, constant};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// A layer of gated recurrent units.
///
/// ## Recursion
///
/// ```text
/// (xr, xz, xn) = x_t W + b          (hr, hz, hn) = h_{t-1} U + d
/// r = sigmoid(xr + hr)              z = sigmoid(xz + hz)
/// n = tanh(xn + r hn)               h_t = (1 - z) n + z h_{t-1}
/// ```
///
/// Parameters: `NAME.input [inputs, 3h]`, `NAME.input_bias [3h]`, `NAME.hidden [h, 3h]`, `NAME.hidden_bias
/// [3h]`, all uniform in `+-1/sqrt(h)` as in PyTorch. A whole sequence is one operation with a backward pass
/// of its own, and so is a single step.
///
/// ## Reference
///
/// K. Cho et al., "Learning phrase representations using RNN encoder-decoder", EMNLP 2014; the reset gate is
/// applied after the product with `U`, as cuDNN and PyTorch have it.
#[derive(Debug, Clone)]
pub struct Gru {
    input: ParameterId,
    input_bias: ParameterId,
    hidden: ParameterId,
    hidden_bias: ParameterId,
    size: usize,
}

impl Gru {
    /// Adds the parameters of a layer with `size` units to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, inputs: usize, size: usize) -> Result<Self, TrainError> {
        positive(name, &[("the number of inputs", inputs), ("the number of units", size)])?;
        let mut add = |part: &str, shape: &[usize]| {
            set.add(&format!("{name}.{part}"), shape, Initial::Uniform { bound: 1.0 / (size as f32).sqrt() })
        };
        Ok(Self {
            input: add("input", &[inputs, 3 * size])?,
            input_bias: add("input_bias", &[3 * size])?,
            hidden: add("hidden", &[size, 3 * size])?,
            hidden_bias: add("hidden_bias", &[3 * size])?,
            size,
        })
    }

    /// The number of units.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The memory before the first step: zero.
    pub fn zero(&self, batch: usize) -> Tensor {
        constant(vec![0.0; batch * self.size], [batch, self.size])
    }

    /// The outputs `[steps * batch, h]` of a sequence that goes on from a memory `[batch, h]`.
    ///
    /// The memory after it is the last `batch` rows. Of one step, the output is the memory after it, so this
    /// also is the step of a recursion in which the output feeds back.
    pub fn forward(&self, weights: &Weights, x: Tensor, memory: Tensor) -> Tensor {
        let [input, input_bias, hidden, hidden_bias] =
            [self.input, self.input_bias, self.hidden, self.hidden_bias].map(|id| weights.get(id));
        apply(Sequence, [x, input, input_bias, hidden, hidden_bias, memory])
    }
}

/// The layer over a sequence, as one operation on `x`, `W`, `b`, `U`, `d` and the first memory.
#[derive(Debug, Clone)]
struct Sequence;

/// What the backward pass needs, for each step and member of the batch.
#[derive(Debug, Clone)]
struct Saved {
    /// `r`, `z` and `n`: `[steps * batch, 3h]`.
    gates: Vec<f32>,
    /// `hn`: `[steps * batch, h]`.
    candidates: Vec<f32>,
}

struct Sizes {
    steps: usize,
    batch: usize,
    inputs: usize,
    size: usize,
}

impl Sizes {
    fn of([x, _, _, hidden, _, first]: &[Matrix; 6]) -> Self {
        let batch = first.rows();
        Self { steps: x.rows() / batch, batch, inputs: x.columns(), size: hidden.rows() }
    }

    fn state(&self) -> usize {
        self.batch * self.size
    }

    fn rows(&self) -> usize {
        self.steps * self.batch
    }
}

impl Operation<6> for Sequence {
    type Saved = Saved;

    fn forward(&self, inputs: &[Matrix; 6]) -> Forward<Saved> {
        let sizes = Sizes::of(inputs);
        let [x, input, input_bias, hidden, hidden_bias, first] = inputs;
        let (state, size) = (sizes.state(), sizes.size);
        let mut gates = repeat_row(input_bias.values(), sizes.rows());
        add_product(&mut gates, x.values(), input.values(), [sizes.rows(), sizes.inputs, 3 * size]);
        let mut candidates = vec![0.0; sizes.steps * state];
        let mut outputs = vec![0.0; sizes.steps * state];
        let mut recurrent = vec![0.0; 3 * state];
        for step in 0..sizes.steps {
            let here = step * state..(step + 1) * state;
            let (past, rest) = outputs.split_at_mut(here.start);
            let before = if step == 0 { first.values() } else { &past[here.start - state..] };
            for row in recurrent.chunks_exact_mut(3 * size) {
                row.copy_from_slice(hidden_bias.values());
            }
            add_product(&mut recurrent, before, hidden.values(), [sizes.batch, size, 3 * size]);
            let gates = &mut gates[3 * here.start..3 * here.end];
            advance(gates, &recurrent, before, &mut candidates[here], &mut rest[..state], size);
        }
        Forward { values: outputs, shape: [sizes.rows(), size], saved: Saved { gates, candidates } }
    }

    fn backward(&self, past: Past<'_, Saved, 6>, gradient: &[f32]) -> [Option<Vec<f32>>; 6] {
        let sizes = Sizes::of(past.inputs);
        let [x, input, _, hidden, _, first] = past.inputs;
        let (state, size, rows) = (sizes.state(), sizes.size, sizes.rows());
        let Saved { mut gates, candidates } = past.saved;
        let outputs = past.value.values();
        let mut of_recurrent = vec![0.0; rows * 3 * size];
        let mut of_memory = vec![0.0; state];
        let mut before_all = first.values().to_vec();
        before_all.extend_from_slice(&outputs[..rows * size - state]);
        for step in (0..sizes.steps).rev() {
            let here = step * state..(step + 1) * state;
            let wide = 3 * here.start..3 * here.end;
            add(&mut of_memory, &gradient[here.clone()]);
            let (before, candidates) = (&before_all[here.clone()], &candidates[here]);
            let of_recurrent = &mut of_recurrent[wide.clone()];
            retreat(&mut gates[wide], before, candidates, &mut of_memory, of_recurrent, size);
            let sizes = [sizes.batch, 3 * size, size];
            add_product_transposed(&mut of_memory, of_recurrent, hidden.values(), sizes);
        }
        let of_x = past.wanted[0].then(|| {
            let mut out = vec![0.0; rows * sizes.inputs];
            add_product_transposed(&mut out, &gates, input.values(), [rows, 3 * size, sizes.inputs]);
            out
        });
        let of_weight = |left: &[f32], width: usize, right: &[f32]| {
            let mut out = vec![0.0; width * 3 * size];
            add_transposed_product(&mut out, left, right, [width, rows, 3 * size]);
            out
        };
        [
            of_x,
            past.wanted[1].then(|| of_weight(x.values(), sizes.inputs, &gates)),
            past.wanted[2].then(|| sum_rows(&gates, 3 * size)),
            past.wanted[3].then(|| of_weight(&before_all, size, &of_recurrent)),
            past.wanted[4].then(|| sum_rows(&of_recurrent, 3 * size)),
            past.wanted[5].then_some(of_memory),
        ]
    }
}

vectorised! {
    /// One step of the batch: turns what the input contributes to the gates into `r`, `z`, `n`, and fills
    /// `hn` and outputs.
    fn advance<'a>(
        gates: &'a mut [f32],
        recurrent: &'a [f32],
        before: &'a [f32],
        candidates: &'a mut [f32],
        outputs: &'a mut [f32],
        size: usize,
    ) {
        let rows = gates.chunks_exact_mut(3 * size).zip(recurrent.chunks_exact(3 * size));
        let out = candidates.chunks_exact_mut(size).zip(outputs.chunks_exact_mut(size));
        let rows = rows.zip(before.chunks_exact(size));
        for (((gates, recurrent), before), (candidate, output)) in rows.zip(out) {
            let (gated, n) = gates.split_at_mut(2 * size);
            let (of_gates, of_candidate) = recurrent.split_at(2 * size);
            for (gate, h) in gated.iter_mut().zip(of_gates) {
                *gate = sigmoid(*gate + h);
            }
            candidate.copy_from_slice(of_candidate);
            let (r, z) = gated.split_at(size);
            let (r, z, n, candidate) = (&r[..size], &z[..size], &mut n[..size], &candidate[..size]);
            for k in 0..size {
                n[k] = tanh(n[k] + r[k] * candidate[k]);
            }
            let (before, output) = (&before[..size], &mut output[..size]);
            for k in 0..size {
                output[k] = n[k] + z[k] * (before[k] - n[k]);
            }
        }
    }
}

vectorised! {
    /// One step of the batch backwards: turns gates into the gradients of `xr`, `xz`, `xn`, fills those of
    /// `hr`, `hz`, `hn`, and leaves in `of_memory` what flows to the memory before the step past the product
    /// with `U`.
    fn retreat<'a>(
        gates: &'a mut [f32],
        before: &'a [f32],
        candidates: &'a [f32],
        of_memory: &'a mut [f32],
        of_recurrent: &'a mut [f32],
        size: usize,
    ) {
        let known = before.chunks_exact(size).zip(candidates.chunks_exact(size));
        let found = of_memory.chunks_exact_mut(size).zip(of_recurrent.chunks_exact_mut(3 * size));
        for ((gates, (before, candidate)), (of_memory, of_recurrent)) in
            gates.chunks_exact_mut(3 * size).zip(known).zip(found)
        {
            let (r, rest) = gates.split_at_mut(size);
            let (z, n) = rest.split_at_mut(size);
            let (r, z, n) = (&mut r[..size], &mut z[..size], &mut n[..size]);
            let (before, candidate) = (&before[..size], &candidate[..size]);
            let of_memory = &mut of_memory[..size];
            for k in 0..size {
                let (gate, value, slope) = (z[k], n[k], of_memory[k]);
                n[k] = slope * (1.0 - gate) * (1.0 - value * value);
                z[k] = slope * (before[k] - value) * gate * (1.0 - gate);
                of_memory[k] = slope * gate;
            }
            let of_candidate = &mut of_recurrent[2 * size..][..size];
            for k in 0..size {
                let gate = r[k];
                of_candidate[k] = n[k] * gate;
                r[k] = n[k] * candidate[k] * gate * (1.0 - gate);
            }
            of_recurrent[..2 * size].copy_from_slice(&gates[..2 * size]);
        }
    }
}
