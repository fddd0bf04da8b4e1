//! The LSTM layer.

use super::positive;
use crate::backend::product::{add_product, add_product_transposed, add_transposed_product};
use crate::backend::vector::{add, repeat_row, sigmoid, sum_rows, tanh, vectorised};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply, constant, detached};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// A layer of long short-term memory.
///
/// ## Recursion
///
/// ```text
/// (i, f, g, o) = x_t W + h_{t-1} U + b
/// c_t = sigmoid(f) c_{t-1} + sigmoid(i) tanh(g)
/// h_t = sigmoid(o) tanh(c_t)
/// ```
///
/// Parameters: `NAME.input [inputs, 4h]`, `NAME.hidden [h, 4h]`, `NAME.bias [4h]`, all uniform in
/// `+-1/sqrt(h)` as in PyTorch, whose two biases are one here. The whole sequence is one operation with a
/// backward pass of its own.
///
/// ## Reference
///
/// S. Hochreiter, J. Schmidhuber, "Long short-term memory", Neural Computation 9 (1997); forget gate of F.
/// Gers et al. (2000).
#[derive(Debug, Clone)]
pub struct Lstm {
    input: ParameterId,
    hidden: ParameterId,
    bias: ParameterId,
    size: usize,
}

/// The memory of an LSTM layer: `[batch, h]` each.
#[derive(Debug, Clone)]
pub struct LstmState {
    /// The output of the last step.
    pub hidden: Tensor,
    /// The cell after the last step.
    pub cell: Tensor,
}

impl LstmState {
    /// The memory before the first step: zero.
    pub fn zero(batch: usize, size: usize) -> Self {
        let zero = || constant(vec![0.0; batch * size], [batch, size]);
        Self { hidden: zero(), cell: zero() }
    }

    /// The same values, from which no gradient flows back: truncates back-propagation through time.
    pub fn detached(self) -> Self {
        Self { hidden: detached(self.hidden), cell: detached(self.cell) }
    }
}

impl Lstm {
    /// Adds the parameters of a layer with `size` units to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, inputs: usize, size: usize) -> Result<Self, TrainError> {
        positive(name, &[("the number of inputs", inputs), ("the number of units", size)])?;
        let initial = Initial::Uniform { bound: 1.0 / (size as f32).sqrt() };
        Ok(Self {
            input: set.add(&format!("{name}.input"), &[inputs, 4 * size], initial.clone())?,
            hidden: set.add(&format!("{name}.hidden"), &[size, 4 * size], initial.clone())?,
            bias: set.add(&format!("{name}.bias"), &[4 * size], initial)?,
            size,
        })
    }

    /// The number of units.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The outputs `[steps * batch, h]` of a sequence that starts with a memory of zero.
    pub fn sequence(&self, weights: &Weights, x: Tensor, batch: usize) -> Tensor {
        self.run(weights, x, LstmState::zero(batch, self.size), Pass::default())
    }

    /// As [`sequence`](Self::sequence), from the last step to the first: the other half of a bidirectional
    /// layer.
    pub fn reversed(&self, weights: &Weights, x: Tensor, batch: usize) -> Tensor {
        self.run(weights, x, LstmState::zero(batch, self.size), Pass { reversed: true, with_cell: false })
    }

    /// The outputs `[steps * batch, h]` of a sequence that goes on from a memory, and the memory after it.
    pub fn resume(&self, weights: &Weights, x: Tensor, state: LstmState) -> (Tensor, LstmState) {
        let [batch, _] = state.hidden.dims();
        let all = self.run(weights, x, state, Pass { reversed: false, with_cell: true });
        let rows = all.dims()[0] - batch;
        let outputs = all.clone().narrow(0, 0, rows);
        let hidden = outputs.clone().narrow(0, rows - batch, batch);
        (outputs, LstmState { hidden, cell: all.narrow(0, rows, batch) })
    }

    /// One step, for recursions in which the output feeds back: the memory after it, whose `hidden` is the
    /// output.
    pub fn step(&self, weights: &Weights, x: Tensor, state: LstmState) -> LstmState {
        let [batch, _] = state.hidden.dims();
        let both = self.run(weights, x, state, Pass { reversed: false, with_cell: true });
        LstmState { hidden: both.clone().narrow(0, 0, batch), cell: both.narrow(0, batch, batch) }
    }

    fn run(&self, weights: &Weights, x: Tensor, state: LstmState, pass: Pass) -> Tensor {
        let parameters = [self.input, self.hidden, self.bias].map(|id| weights.get(id));
        let [input, hidden, bias] = parameters;
        apply(Sequence { pass }, [x, input, hidden, bias, state.hidden, state.cell])
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Pass {
    /// From the last step to the first.
    reversed: bool,
    /// Whether the last cell follows the outputs.
    with_cell: bool,
}

impl Pass {
    /// The steps in the order in which the layer takes them, each with the one before it.
    fn order(self, steps: usize) -> impl DoubleEndedIterator<Item = (usize, Option<usize>)> {
        (0..steps).map(move |n| {
            let place = |n: usize| if self.reversed { steps - 1 - n } else { n };
            (place(n), n.checked_sub(1).map(place))
        })
    }
}

/// The layer over a sequence, as one operation on `x`, `W`, `U`, `b`, the first output and the first cell.
#[derive(Debug, Clone)]
struct Sequence {
    pass: Pass,
}

/// What the backward pass needs, for each step and member of the batch.
#[derive(Debug, Clone)]
struct Saved {
    /// The gates after their activations: `[steps * batch, 4h]`.
    gates: Vec<f32>,
    /// The cells: `[steps * batch, h]`.
    cells: Vec<f32>,
    /// Their hyperbolic tangents.
    bent: Vec<f32>,
}

struct Sizes {
    steps: usize,
    batch: usize,
    inputs: usize,
    size: usize,
}

impl Sizes {
    fn of([x, _, hidden, _, first, _]: &[Matrix; 6]) -> Self {
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
        let [x, input, hidden, bias, first_hidden, first_cell] = inputs;
        let (state, size) = (sizes.state(), sizes.size);
        let mut gates = repeat_row(bias.values(), sizes.rows());
        add_product(&mut gates, x.values(), input.values(), [sizes.rows(), sizes.inputs, 4 * size]);
        let mut cells = vec![0.0; sizes.steps * state];
        let mut bent = vec![0.0; sizes.steps * state];
        let mut outputs = vec![0.0; sizes.steps * state];
        let mut previous = first_cell.values().to_vec();
        for (step, before) in self.pass.order(sizes.steps) {
            let here = step * state..(step + 1) * state;
            let last = before.map_or(first_hidden.values(), |before| &outputs[before * state..][..state]);
            let gates = &mut gates[4 * here.start..4 * here.end];
            add_product(gates, last, hidden.values(), [sizes.batch, size, 4 * size]);
            let (cells, bent) = (&mut cells[here.clone()], &mut bent[here.clone()]);
            advance(gates, &previous, cells, bent, &mut outputs[here], size);
            previous.copy_from_slice(cells);
        }
        let mut rows = sizes.rows();
        if self.pass.with_cell {
            outputs.extend_from_slice(&previous);
            rows += sizes.batch;
        }
        Forward { values: outputs, shape: [rows, size], saved: Saved { gates, cells, bent } }
    }

    fn backward(&self, past: Past<'_, Saved, 6>, gradient: &[f32]) -> [Option<Vec<f32>>; 6] {
        let sizes = Sizes::of(past.inputs);
        let [x, input, hidden, _, first_hidden, first_cell] = past.inputs;
        let (state, size, rows) = (sizes.state(), sizes.size, sizes.rows());
        let Saved { mut gates, cells, bent } = past.saved;
        let outputs = past.value.values();
        let mut of_hidden = vec![0.0; state];
        let mut of_cell =
            if self.pass.with_cell { gradient[rows * size..].to_vec() } else { vec![0.0; state] };
        // The outputs before each step, in the order of the steps: what U was multiplied with.
        let mut before_all = vec![0.0; rows * size];
        for (step, before) in self.pass.order(sizes.steps).rev() {
            let here = step * state..(step + 1) * state;
            let (last, cell) = match before {
                Some(before) => (&outputs[before * state..][..state], &cells[before * state..][..state]),
                None => (first_hidden.values(), first_cell.values()),
            };
            before_all[here.clone()].copy_from_slice(last);
            add(&mut of_hidden, &gradient[here.clone()]);
            let gates = &mut gates[4 * here.start..4 * here.end];
            retreat(gates, cell, &bent[here], &of_hidden, &mut of_cell, size);
            of_hidden.fill(0.0);
            add_product_transposed(&mut of_hidden, gates, hidden.values(), [sizes.batch, 4 * size, size]);
        }
        let of_x = past.wanted[0].then(|| {
            let mut out = vec![0.0; rows * sizes.inputs];
            add_product_transposed(&mut out, &gates, input.values(), [rows, 4 * size, sizes.inputs]);
            out
        });
        let of_weight = |left: &[f32], width: usize| {
            let mut out = vec![0.0; width * 4 * size];
            add_transposed_product(&mut out, left, &gates, [width, rows, 4 * size]);
            out
        };
        [
            of_x,
            past.wanted[1].then(|| of_weight(x.values(), sizes.inputs)),
            past.wanted[2].then(|| of_weight(&before_all, size)),
            past.wanted[3].then(|| sum_rows(&gates, 4 * size)),
            past.wanted[4].then_some(of_hidden),
            past.wanted[5].then_some(of_cell),
        ]
    }
}

vectorised! {
    /// One step of the batch: activates the gates in place and fills cells, their tangents and outputs.
    fn advance<'a>(
        gates: &'a mut [f32],
        previous: &'a [f32],
        cells: &'a mut [f32],
        bent: &'a mut [f32],
        outputs: &'a mut [f32],
        size: usize,
    ) {
        let rows = gates.chunks_exact_mut(4 * size).zip(previous.chunks_exact(size));
        let out =
            cells.chunks_exact_mut(size).zip(bent.chunks_exact_mut(size)).zip(outputs.chunks_exact_mut(size));
        for ((gates, previous), ((cell, bent), output)) in rows.zip(out) {
            // Separate passes: one loop over all slices is not vectorised.
            for gate in &mut gates[..2 * size] {
                *gate = sigmoid(*gate);
            }
            for gate in &mut gates[2 * size..3 * size] {
                *gate = tanh(*gate);
            }
            for gate in &mut gates[3 * size..] {
                *gate = sigmoid(*gate);
            }
            let (i, f) = (&gates[..size], &gates[size..2 * size]);
            let (g, o) = (&gates[2 * size..3 * size], &gates[3 * size..4 * size]);
            let (previous, cell, bent, output) =
                (&previous[..size], &mut cell[..size], &mut bent[..size], &mut output[..size]);
            for k in 0..size {
                cell[k] = f[k] * previous[k] + i[k] * g[k];
            }
            for k in 0..size {
                bent[k] = tanh(cell[k]);
            }
            for k in 0..size {
                output[k] = o[k] * bent[k];
            }
        }
    }
}

vectorised! {
    /// One step of the batch backwards: turns gates into the gradients of what was in them before their
    /// activations, and the gradient of the cells after the step into that of the cells before it.
    fn retreat<'a>(
        gates: &'a mut [f32],
        previous: &'a [f32],
        bent: &'a [f32],
        of_hidden: &'a [f32],
        of_cell: &'a mut [f32],
        size: usize,
    ) {
        let known = previous.chunks_exact(size).zip(bent.chunks_exact(size));
        let given = of_hidden.chunks_exact(size).zip(of_cell.chunks_exact_mut(size));
        for ((gates, (previous, bent)), (of_hidden, of_cell)) in
            gates.chunks_exact_mut(4 * size).zip(known).zip(given)
        {
            let (i, rest) = gates.split_at_mut(size);
            let (f, rest) = rest.split_at_mut(size);
            let (g, o) = rest.split_at_mut(size);
            let (previous, bent) = (&previous[..size], &bent[..size]);
            let (of_hidden, of_cell) = (&of_hidden[..size], &mut of_cell[..size]);
            let (i, f, g, o) = (&mut i[..size], &mut f[..size], &mut g[..size], &mut o[..size]);
            for k in 0..size {
                of_cell[k] += of_hidden[k] * o[k] * (1.0 - bent[k] * bent[k]);
            }
            for k in 0..size {
                o[k] = of_hidden[k] * bent[k] * o[k] * (1.0 - o[k]);
            }
            for k in 0..size {
                let (gate, input) = (i[k], g[k]);
                i[k] = of_cell[k] * input * gate * (1.0 - gate);
                g[k] = of_cell[k] * gate * (1.0 - input * input);
            }
            for k in 0..size {
                let gate = f[k];
                f[k] = of_cell[k] * previous[k] * gate * (1.0 - gate);
                of_cell[k] *= gate;
            }
        }
    }
}
