//! The network that finds the residuals of a window.

use super::KIND;
use super::hyper::DeepMttHyper;
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::layer::{Bidirectional, Linear};
use crate::model::Model;

/// The network of a [`DeepMtt`](super::DeepMtt): from a window of estimates to their residuals.
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualNetwork {
    hyper: DeepMttHyper,
    layers: Vec<Bidirectional>,
    dense: Option<Linear>,
    output: Linear,
}

impl ResidualNetwork {
    /// Builds the network of a model of the kind `deep-mtt`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = DeepMttHyper::of(model)?;
        let mut weights = model.weights();
        let (mut layers, mut inputs) = (Vec::new(), hyper.inputs());
        for (index, size) in hyper.layers.iter().enumerate() {
            layers.push(weights.bidirectional(&format!("bilstm.{index}"), inputs, *size)?);
            inputs = 2 * size;
        }
        let mut dense = None;
        if hyper.dense > 0 {
            dense = Some(weights.linear("dense", inputs, hyper.dense)?);
            inputs = hyper.dense;
        }
        let output = weights.linear("output", inputs, hyper.outputs())?;
        weights.finish()?;
        Ok(ResidualNetwork { hyper, layers, dense, output })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &DeepMttHyper {
        &self.hyper
    }

    fn widest(&self) -> usize {
        self.layers
            .iter()
            .map(Bidirectional::outputs)
            .chain([self.hyper.dense, self.hyper.inputs()])
            .max()
            .unwrap_or(0)
    }

    /// Numbers of scratch space for a window.
    pub(super) fn scratch(&self) -> usize {
        let own = self.layers.iter().map(Bidirectional::scratch).max().unwrap_or(0);
        2 * self.widest() * self.hyper.window + own
    }

    /// Writes the outputs of a whole window.
    pub(super) fn forward(&self, inputs: &[f32], outputs: &mut [f32], scratch: &mut [f32]) {
        let steps = self.hyper.window;
        let (mut here, rest) = scratch.split_at_mut(self.widest() * steps);
        let (mut there, scratch) = rest.split_at_mut(self.widest() * steps);
        let mut width = self.hyper.inputs();
        here[..width * steps].copy_from_slice(inputs);
        for layer in &self.layers {
            layer.forward(&here[..width * steps], &mut there[..layer.outputs() * steps], scratch);
            width = layer.outputs();
            std::mem::swap(&mut here, &mut there);
        }
        if let Some(dense) = &self.dense {
            dense.forward_relu(&here[..width * steps], &mut there[..dense.outputs() * steps]);
            width = dense.outputs();
            std::mem::swap(&mut here, &mut there);
        }
        self.output.forward(&here[..width * steps], outputs);
    }
}
