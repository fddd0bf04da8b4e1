//! The network that gives the gain.

use super::branched::Branched;
use super::hyper::{Architecture, KalmanNetHyper, READING, STATE, Scales};
use super::stacked::Stacked;
use super::{KIND, LABELS};
use crate::error::ModelError;
use crate::model::Model;

/// The network of a [`KalmanNet`](super::KalmanNet): from differences of observations and estimates to a gain.
///
/// It is loaded once and shared by all filters of that model. A batch of rows takes one step together; the filter itself steps
/// one object at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct GainNetwork {
    hyper: KalmanNetHyper,
    scales: Scales,
    layers: Layers,
}

// There is one of these per model, so its size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, PartialEq)]
enum Layers {
    Stacked(Stacked),
    Branched(Branched),
}

impl GainNetwork {
    /// Numbers of a gain: its rows `x, y, vx, vy`, each for the readings `x, y`.
    pub const GAIN: usize = STATE * READING;

    /// Builds the network of a model of the kind `kalman-net`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = KalmanNetHyper::of(model)?;
        let scales = Scales::of(model, &hyper)?;
        let mut weights = model.weights();
        let layers = match hyper.architecture {
            Architecture::Stacked { input, hidden, layers, head } => {
                let sizes = [input, hidden, layers, head];
                Layers::Stacked(Stacked::new(&mut weights, hyper.inputs(), sizes)?)
            }
            Architecture::Branched { in_mult, out_mult } => {
                Layers::Branched(Branched::new(&mut weights, &hyper, in_mult, out_mult)?)
            }
        };
        weights.finish()?;
        Ok(GainNetwork { hyper, scales, layers })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &KalmanNetHyper {
        &self.hyper
    }

    pub(super) fn scales(&self) -> &Scales {
        &self.scales
    }

    /// The memory of a new object. A batch holds the memory of each recurrent layer as `[batch, size]`, one after the other.
    pub fn initial(&self) -> Vec<f32> {
        match &self.layers {
            Layers::Stacked(layers) => layers.initial(),
            Layers::Branched(layers) => layers.initial(),
        }
    }

    /// Numbers of scratch space that a step of this many rows needs.
    pub fn scratch(&self, batch: usize) -> usize {
        match &self.layers {
            Layers::Stacked(layers) => layers.scratch(batch),
            Layers::Branched(layers) => layers.scratch(batch),
        }
    }

    /// Moves the memory on by one step of the inputs `[batch, inputs]`, and writes the gains `[batch, 8]` of the network,
    /// without the gain offset.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step(&self, inputs: &[f32], memory: &mut [f32], scratch: &mut [f32], gain: &mut [f32]) {
        match &self.layers {
            Layers::Stacked(layers) => layers.step(inputs, memory, scratch, gain),
            Layers::Branched(layers) => layers.step(inputs, memory, scratch, gain),
        }
    }
}
