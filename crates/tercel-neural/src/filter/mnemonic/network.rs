//! The network that predicts.

use super::KIND;
use super::hyper::MnemonicHyper;
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::layer::{Linear, Lstm};
use crate::model::Model;

/// The network of a [`MnemonicKalman`](super::MnemonicKalman): from the last estimate to what a straight motion misses.
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct MnemonicNetwork {
    hyper: MnemonicHyper,
    recurrent: Vec<Lstm>,
    output: Linear,
}

impl MnemonicNetwork {
    /// Builds the network of a model of the kind `mnemonic`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = MnemonicHyper::of(model)?;
        let mut weights = model.weights();
        let mut recurrent = Vec::new();
        for layer in 0..hyper.layers {
            let inputs = if layer == 0 { hyper.inputs() } else { hyper.hidden };
            recurrent.push(weights.lstm(&format!("lstm.{layer}"), inputs, hyper.hidden)?);
        }
        let output = weights.linear("output", hyper.hidden, hyper.outputs())?;
        weights.finish()?;
        Ok(MnemonicNetwork { hyper, recurrent, output })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &MnemonicHyper {
        &self.hyper
    }

    /// Numbers of memory for one object: output and cell of each layer.
    pub(super) fn memory(&self) -> usize {
        self.recurrent.iter().map(|layer| 2 * layer.size()).sum()
    }

    /// Numbers of scratch space for a step of one object.
    pub(super) fn scratch(&self) -> usize {
        self.recurrent.iter().map(|layer| layer.scratch(1)).max().unwrap_or(0)
    }

    /// Moves the memory of one object on by one step, and writes the outputs.
    pub(super) fn step(&self, inputs: &[f32], memory: &mut [f32], scratch: &mut [f32], outputs: &mut [f32]) {
        let (mut before, mut memory): (&[f32], &mut [f32]) = (inputs, memory);
        for layer in &self.recurrent {
            let (own, rest) = memory.split_at_mut(2 * layer.size());
            let (output, cell) = own.split_at_mut(layer.size());
            layer.step(before, output, cell, scratch);
            (before, memory) = (output, rest);
        }
        self.output.forward(before, outputs);
    }
}
