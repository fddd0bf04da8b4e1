//! Cells that may take each other's place.

use tercel_neural::layer::CellShape;

use super::{Activation, Cfc, Gru, Linear, Ltc};
use crate::backend::{Tensor, constant};
use crate::{ParameterSet, TrainError, Weights};

/// A layer that is stepped through time: the twin of [`tercel_neural::layer::Cell`].
#[derive(Debug, Clone)]
pub enum Cell {
    /// Liquid time constants.
    Ltc(Ltc),
    /// Closed-form continuous time.
    Cfc(Cfc),
    /// Gated recurrent units.
    Gru(Gru),
    /// Two linear layers with hyperbolic tangents, without a memory.
    Mlp([Linear; 2]),
}

impl Cell {
    /// Adds the parameters of a cell to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(
        set: &mut ParameterSet,
        name: &str,
        inputs: usize,
        shape: CellShape,
    ) -> Result<Self, TrainError> {
        match shape {
            CellShape::Ltc { size, unfolds, solver } => {
                Ltc::new(set, name, [inputs, size], solver, unfolds).map(Self::Ltc)
            }
            CellShape::Cfc { size, backbone } => Cfc::new(set, name, [inputs, size, backbone]).map(Self::Cfc),
            CellShape::Gru { size } => Gru::new(set, name, inputs, size).map(Self::Gru),
            CellShape::Mlp { size, hidden } => {
                let first = Linear::new(set, &format!("{name}.first"), inputs, hidden, Activation::Tanh)?;
                Ok(Self::Mlp([
                    first,
                    Linear::new(set, &format!("{name}.second"), hidden, size, Activation::Tanh)?,
                ]))
            }
        }
    }

    /// A memory `[batch, size]` of zero.
    pub fn zero(batch: usize, shape: CellShape) -> Tensor {
        constant(vec![0.0; batch * shape.size()], [batch, shape.size()])
    }

    /// The memory after a time, measured in the unit of the cell. It is the output.
    pub fn step(&self, weights: &Weights, elapsed: f32, x: Tensor, memory: Tensor) -> Tensor {
        match self {
            Self::Ltc(cell) => cell.step(weights, elapsed, x, memory),
            Self::Cfc(cell) => cell.step(weights, elapsed, x, memory),
            Self::Gru(cell) => cell.forward(weights, x, memory),
            Self::Mlp([first, second]) => second.forward(weights, first.forward(weights, x)),
        }
    }

    /// The outputs `[steps * batch, size]` of a sequence `[steps * batch, inputs]` whose steps take one unit of time each, from
    /// a memory `[batch, size]`.
    pub fn sequence(&self, weights: &Weights, x: Tensor, memory: Tensor) -> Tensor {
        match self {
            // Those take a whole sequence as one operation.
            Self::Gru(_) | Self::Mlp(_) => self.step(weights, 1.0, x, memory),
            Self::Ltc(_) | Self::Cfc(_) => {
                let ([rows, inputs], batch) = (x.dims(), memory.dims()[0]);
                let (mut memory, mut outputs) = (memory, Vec::with_capacity(rows / batch));
                for first in (0..rows).step_by(batch) {
                    let step = x.clone().slice([first..first + batch, 0..inputs]);
                    memory = self.step(weights, 1.0, step, memory);
                    outputs.push(memory.clone());
                }
                Tensor::cat(outputs, 0)
            }
        }
    }
}
