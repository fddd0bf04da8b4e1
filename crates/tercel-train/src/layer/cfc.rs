//! The closed-form continuous-time layer.

use super::positive;
use crate::backend::product::{add_product, add_product_transposed, add_transposed_product};
use crate::backend::vector::{repeat_row, sigmoid, sum_rows, tanh, vectorised};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// A layer of neurons that follow a closed form.
///
/// ## Recursion
///
/// That of [`tercel_neural::layer::Cfc`]. Parameters are uniform in `+-1/sqrt(n)`, with `n` the width of what they multiply:
/// that of input and memory together, and that of the backbone. A step is one operation.
///
/// ## Reference
///
/// R. Hasani, M. Lechner, A. Amini et al., "Closed-form continuous-time neural networks", Nature Machine Intelligence 4
/// (2022).
#[derive(Debug, Clone)]
pub struct Cfc {
    parameters: [ParameterId; 5],
}

impl Cfc {
    /// Adds the parameters of a layer with `size` neurons and a backbone of this width to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(
        set: &mut ParameterSet,
        name: &str,
        [inputs, size, backbone]: [usize; 3],
    ) -> Result<Self, TrainError> {
        let counts =
            [("the number of inputs", inputs), ("the number of neurons", size), ("the backbone", backbone)];
        positive(name, &counts)?;
        let mut add = |part: &str, shape: &[usize], sources: usize| {
            let initial = Initial::Uniform { bound: 1.0 / (sources as f32).sqrt() };
            set.add(&format!("{name}.{part}"), shape, initial)
        };
        let sources = inputs + size;
        Ok(Self {
            parameters: [
                add("input", &[inputs, backbone], sources)?,
                add("hidden", &[size, backbone], sources)?,
                add("bias", &[backbone], sources)?,
                add("heads", &[backbone, 4 * size], backbone)?,
                add("heads_bias", &[4 * size], backbone)?,
            ],
        })
    }

    /// The memory `[batch, size]` after a time, measured in the unit of the cell.
    pub fn step(&self, weights: &Weights, elapsed: f32, x: Tensor, memory: Tensor) -> Tensor {
        let [input, hidden, bias, heads, heads_bias] = self.parameters.map(|id| weights.get(id));
        apply(Step { elapsed }, [x, memory, input, hidden, bias, heads, heads_bias])
    }
}

/// A step as one operation on the input, the memory and all parameters.
#[derive(Debug, Clone)]
struct Step {
    elapsed: f32,
}

/// What the backward pass needs.
#[derive(Debug, Clone)]
struct Saved {
    /// Outputs of the backbone.
    features: Vec<f32>,
    /// `tanh a`, `tanh b`, the gate, and what was left of the offset.
    heads: Vec<f32>,
}

impl Operation<7> for Step {
    type Saved = Saved;

    fn forward(&self, [x, memory, input, hidden, bias, heads, heads_bias]: &[Matrix; 7]) -> Forward<Saved> {
        let (rows, size, width) = (memory.rows(), memory.columns(), input.columns());
        let mut features = repeat_row(bias.values(), rows);
        add_product(&mut features, x.values(), input.values(), [rows, x.columns(), width]);
        add_product(&mut features, memory.values(), hidden.values(), [rows, size, width]);
        bend(&mut features);
        let mut said = repeat_row(heads_bias.values(), rows);
        add_product(&mut said, &features, heads.values(), [rows, width, 4 * size]);
        let mut values = vec![0.0; rows * size];
        mix(&mut said, &mut values, size, self.elapsed);
        Forward { values, shape: [rows, size], saved: Saved { features, heads: said } }
    }

    fn backward(&self, past: Past<'_, Saved, 7>, gradient: &[f32]) -> [Option<Vec<f32>>; 7] {
        let [x, memory, input, hidden, _, heads, _] = past.inputs;
        let (rows, size, width) = (memory.rows(), memory.columns(), input.columns());
        let Saved { features, heads: mut said } = past.saved;
        unmix(&mut said, gradient, size, self.elapsed);
        let mut of_features = vec![0.0; rows * width];
        add_product_transposed(&mut of_features, &said, heads.values(), [rows, 4 * size, width]);
        for (of, z) in of_features.iter_mut().zip(&features) {
            *of *= 1.0 - z * z;
        }
        let of_weight = |left: &[f32], from: usize, right: &[f32], to: usize| {
            let mut out = vec![0.0; from * to];
            add_transposed_product(&mut out, left, right, [from, rows, to]);
            out
        };
        let of_source = |weight: &Matrix| {
            let mut out = vec![0.0; rows * weight.rows()];
            add_product_transposed(&mut out, &of_features, weight.values(), [rows, width, weight.rows()]);
            out
        };
        [
            past.wanted[0].then(|| of_source(input)),
            past.wanted[1].then(|| of_source(hidden)),
            past.wanted[2].then(|| of_weight(x.values(), x.columns(), &of_features, width)),
            past.wanted[3].then(|| of_weight(memory.values(), size, &of_features, width)),
            past.wanted[4].then(|| sum_rows(&of_features, width)),
            past.wanted[5].then(|| of_weight(&features, width, &said, 4 * size)),
            past.wanted[6].then(|| sum_rows(&said, 4 * size)),
        ]
    }
}

vectorised! {
    fn bend<'a>(values: &'a mut [f32]) {
        for x in values {
            *x = tanh(*x);
        }
    }
}

vectorised! {
    /// Turns what the heads say into their ends and the gate, and mixes the ends.
    fn mix<'a>(heads: &'a mut [f32], values: &'a mut [f32], size: usize, elapsed: f32) {
        for (heads, values) in heads.chunks_exact_mut(4 * size).zip(values.chunks_exact_mut(size)) {
            let (ends, gates) = heads.split_at_mut(2 * size);
            for end in ends.iter_mut() {
                *end = tanh(*end);
            }
            let (gate, offset) = gates.split_at_mut(size);
            for (gate, offset) in gate.iter_mut().zip(offset.iter()) {
                *gate = sigmoid(*gate * elapsed + *offset);
            }
            let (a, b) = (&ends[..size], &ends[size..2 * size]);
            for k in 0..size {
                values[k] = a[k] + gate[k] * (b[k] - a[k]);
            }
        }
    }
}

vectorised! {
    /// Turns ends and gate into the gradients of what the heads said.
    fn unmix<'a>(heads: &'a mut [f32], gradient: &'a [f32], size: usize, elapsed: f32) {
        for (heads, gradient) in heads.chunks_exact_mut(4 * size).zip(gradient.chunks_exact(size)) {
            for (k, g) in gradient.iter().enumerate() {
                let (a, b, t) = (heads[k], heads[size + k], heads[2 * size + k]);
                let of_gate = g * (b - a) * t * (1.0 - t);
                heads[k] = g * (1.0 - t) * (1.0 - a * a);
                heads[size + k] = g * t * (1.0 - b * b);
                heads[2 * size + k] = of_gate * elapsed;
                heads[3 * size + k] = of_gate;
            }
        }
    }
}
