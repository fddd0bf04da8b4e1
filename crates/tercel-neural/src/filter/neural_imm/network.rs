//! The network that corrects the bank.

use super::hyper::NeuralImmHyper;
use super::{KIND, LABELS};
use crate::error::ModelError;
use crate::filter::memory::Room;
use crate::layer::{Cell, Linear, Tangents};
use crate::model::Model;

/// The network of a [`NeuralImm`](super::NeuralImm): from what a bank of filters says before and after a measurement to
/// corrections of it.
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct BankNetwork {
    hyper: NeuralImmHyper,
    input: Linear,
    recurrent: Vec<Cell>,
    output: Linear,
}

impl BankNetwork {
    /// Builds the network of a model of the kind `neural-imm`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = NeuralImmHyper::of(model)?;
        let mut weights = model.weights();
        let input = weights.linear("input", hyper.inputs(), hyper.input)?;
        let recurrent = hyper
            .recurrent()
            .map(|(name, inputs, shape)| weights.cell(&name, inputs, shape))
            .collect::<Result<_, _>>()?;
        let output = weights.linear("output", hyper.hidden, hyper.outputs())?;
        weights.finish()?;
        Ok(BankNetwork { hyper, input, recurrent, output })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &NeuralImmHyper {
        &self.hyper
    }

    /// Numbers of memory for one object.
    pub(super) fn memory(&self) -> usize {
        self.recurrent.iter().map(Cell::size).sum()
    }

    /// Numbers of scratch space for a step of one object.
    pub(super) fn scratch(&self) -> usize {
        self.hyper.input + self.recurrent.iter().map(|layer| layer.scratch(1, 0)).max().unwrap_or(0)
    }

    /// Moves the memory of one object on by one step, and writes the outputs.
    pub(super) fn step(&self, inputs: &[f32], memory: &mut [f32], scratch: &mut [f32], outputs: &mut [f32]) {
        let mut room = Room(scratch);
        let first = room.take(self.hyper.input);
        self.input.forward_relu(inputs, first);
        let (mut before, mut memory): (&[f32], &mut [f32]) = (first, memory);
        for layer in &self.recurrent {
            let (own, rest) = memory.split_at_mut(layer.size());
            layer.step_along(1.0, before, own, Tangents::none(), room.0);
            (before, memory) = (own, rest);
        }
        self.output.forward(before, outputs);
    }
}
