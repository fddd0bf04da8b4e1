//! The gated feed-forward part of a transformer.

use super::{Activation, Linear};
use crate::backend::vector::{sigmoid, vectorised};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{ParameterSet, TrainError, Weights};

/// Two layers side by side, of which one opens and shuts the other, and one behind them.
///
/// ## Definition
///
/// ```text
/// y = (silu(x G + g) ⊙ (x V + v)) O + o          silu(a) = a σ(a)
/// ```
///
/// Parameters: the linear layers `NAME.gate`, `NAME.value` and `NAME.output`.
///
/// ## Reference
///
/// N. Shazeer, "GLU variants improve transformer", arXiv 2002.05202 (2020), with biases.
#[derive(Debug, Clone)]
pub struct SwiGlu {
    gate: Linear,
    value: Linear,
    output: Linear,
}

impl SwiGlu {
    /// Adds the parameters of a layer for rows of `size` numbers to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, size: usize, hidden: usize) -> Result<Self, TrainError> {
        let mut part = |part: &str, inputs, outputs| {
            Linear::new(set, &format!("{name}.{part}"), inputs, outputs, Activation::Identity)
        };
        Ok(Self {
            gate: part("gate", size, hidden)?,
            value: part("value", size, hidden)?,
            output: part("output", hidden, size)?,
        })
    }

    /// Applies the layer to each row.
    pub fn forward(&self, weights: &Weights, x: Tensor) -> Tensor {
        let open = silu(self.gate.forward(weights, x.clone()));
        self.output.forward(weights, open * self.value.forward(weights, x))
    }
}

/// `x σ(x)` of each element.
pub fn silu(x: Tensor) -> Tensor {
    apply(Silu, [x])
}

#[derive(Debug, Clone)]
struct Silu;

impl Operation<1> for Silu {
    type Saved = ();

    fn forward(&self, [x]: &[Matrix; 1]) -> Forward<()> {
        let mut values = x.values().to_vec();
        opened(&mut values);
        Forward { values, shape: [x.rows(), x.columns()], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let mut found = gradient.to_vec();
        slope(&mut found, past.inputs[0].values());
        [Some(found)]
    }
}

vectorised! {
    fn opened<'a>(values: &'a mut [f32]) {
        for x in values {
            *x *= sigmoid(*x);
        }
    }
}

vectorised! {
    fn slope<'a>(gradient: &'a mut [f32], x: &'a [f32]) {
        for (g, x) in gradient.iter_mut().zip(x) {
            let open = sigmoid(*x);
            *g *= open * (1.0 + x * (1.0 - open));
        }
    }
}
