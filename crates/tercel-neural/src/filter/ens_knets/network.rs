//! The networks of an ensemble: the KalmanNets', and the two branches that work on their states.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector2;

use super::hyper::{BranchHyper, EnsKNetsHyper, Normalisation, STATE, scales};
use super::{KIND, LABELS};
use crate::card::Card;
use crate::error::ModelError;
use crate::filter::kalman_net::{self, GainNetwork, KalmanNetHyper};
use crate::filter::memory::Room;
use crate::layer::{Linear, Lstm, RunningNorm};
use crate::model::{Model, Weights};

/// The networks of an [`EnsKNets`](super::EnsKNets): those of its KalmanNets, the correction branch and the
/// classification branch.
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct EnsembleNetwork {
    file: Arc<str>,
    hyper: EnsKNetsHyper,
    scales: [f64; 2],
    nets: Vec<Arc<GainNetwork>>,
    branches: Vec<Branch>,
}

/// Recurrent layers and a linear head, between some of the inputs and some of the outputs.
#[derive(Debug, Clone, PartialEq)]
struct Branch {
    inputs: Range<usize>,
    outputs: Range<usize>,
    recurrent: Vec<Lstm>,
    head: Linear,
}

impl EnsembleNetwork {
    /// Builds the networks of a model of the kind `ens-knets`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options or scales
    /// make no sense, or its tensors are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = EnsKNetsHyper::of(model)?;
        let scales = scales(model)?;
        let mut weights = model.weights();
        let mut nets = Vec::with_capacity(hyper.modes());
        for (index, net) in hyper.nets.iter().enumerate() {
            nets.push(Arc::new(gain_network(model, index, net)?));
            for (name, shape) in net.tensors() {
                weights.take(&format!("net.{index}.{name}"), &shape)?;
            }
        }
        let corrections = if hyper.correction.is_some() { STATE * hyper.modes() } else { 0 };
        let parts = [
            ("correction", hyper.correction, hyper.correction_inputs(), 0..corrections),
            (
                "classification",
                hyper.classification,
                hyper.classification_inputs(),
                corrections..hyper.outputs(),
            ),
        ];
        let mut branches = Vec::new();
        for (name, sizes, inputs, outputs) in parts {
            if let Some(sizes) = sizes {
                branches.push(Branch::new(&mut weights, name, sizes, [inputs, outputs])?);
            }
        }
        weights.finish()?;
        Ok(EnsembleNetwork { file: model.file().clone(), hyper, scales, nets, branches })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &EnsKNetsHyper {
        &self.hyper
    }

    /// What errors call the model: its file, or its name.
    pub fn file(&self) -> &Arc<str> {
        &self.file
    }

    /// The gain network of each KalmanNet.
    pub fn nets(&self) -> &[Arc<GainNetwork>] {
        &self.nets
    }

    /// The units of the corrections: m and m/s.
    pub fn scales(&self) -> [f64; 2] {
        self.scales
    }

    /// Normalises each column of a sequence of rows of this width over all of them: the instance
    /// normalisation of the publication, for which the whole track must be there.
    ///
    /// # Panics
    /// When the slice does not hold whole rows.
    pub fn normalise_sequence(rows: &mut [f32], width: usize) {
        assert!(width > 0 && rows.len().is_multiple_of(width), "rows of {width} in {} values", rows.len());
        let count = (rows.len() / width) as f64;
        for column in 0..width {
            let values = || rows[column..].iter().step_by(width).map(|value| f64::from(*value));
            let mean = values().sum::<f64>() / count;
            let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / count;
            let scale = (variance + 1e-5).sqrt();
            for value in rows[column..].iter_mut().step_by(width) {
                *value = ((f64::from(*value) - mean) / scale) as f32;
            }
        }
    }

    fn norm(&self) -> Option<RunningNorm> {
        let width = self.hyper.inputs();
        (self.hyper.normalisation == Normalisation::Running && width > 0).then(|| RunningNorm::new(width))
    }

    /// Numbers of memory for one object.
    pub(super) fn memory(&self) -> usize {
        self.norm().map_or(0, |norm| norm.memory()) + self.branches.iter().map(Branch::memory).sum::<usize>()
    }

    /// Moves all positions that a memory knows, m.
    pub(super) fn shift(&self, memory: &mut [f32], by: Vector2<f64>) {
        if self.norm().is_none() {
            return;
        }
        // The means follow the count. States begin with their position, and a reading is one.
        let means = &mut memory[1..][..self.hyper.inputs()];
        for state in means.chunks_mut(STATE) {
            for (mean, by) in state.iter_mut().zip(by.iter()) {
                *mean += *by as f32;
            }
        }
    }

    /// Numbers of scratch space for a step of one object.
    pub(super) fn scratch(&self) -> usize {
        let layers = self.branches.iter().flat_map(|branch| &branch.recurrent);
        layers.map(|layer| layer.scratch(1)).max().unwrap_or(0)
    }

    /// Takes the features of one object into the normalisation, moves the memory on by one step, and writes
    /// what the branches saw and answered.
    pub(super) fn step(
        &self,
        features: &[f32],
        memory: &mut [f32],
        scratch: &mut [f32],
        inputs: &mut [f32],
        outputs: &mut [f32],
    ) {
        let mut memory = Room(memory);
        match self.norm() {
            Some(norm) => norm.step(features, memory.take(norm.memory()), inputs),
            None => inputs.copy_from_slice(features),
        }
        for branch in &self.branches {
            let own = memory.take(branch.memory());
            branch.step(&inputs[branch.inputs.clone()], own, scratch, &mut outputs[branch.outputs.clone()]);
        }
    }
}

/// One KalmanNet of the ensemble, as a model of its own.
fn gain_network(model: &Model, index: usize, net: &KalmanNetHyper) -> Result<GainNetwork, ModelError> {
    let prefix = format!("net.{index}.");
    let own = |name: &String| name.strip_prefix(&prefix).map(str::to_owned);
    let mut card =
        Card::new(&format!("{}, net.{index}", model.file()), kalman_net::KIND, &kalman_net::LABELS);
    card.hyper = net.to_table().map_err(|reason| ModelError::Hyper { file: model.file().clone(), reason })?;
    let scales = model.card().scales.iter();
    card.scales = scales.filter_map(|(name, scale)| Some((own(name)?, scale.clone()))).collect();
    let tensors = model.tensors().iter();
    let tensors = tensors.filter_map(|(name, tensor)| Some((own(name)?, tensor.clone()))).collect();
    GainNetwork::from_model(&Model::new(card, tensors)?)
}

impl Branch {
    fn new(
        weights: &mut Weights<'_>,
        name: &str,
        sizes: BranchHyper,
        [inputs, outputs]: [Range<usize>; 2],
    ) -> Result<Self, ModelError> {
        let recurrent: Result<Vec<Lstm>, ModelError> = (0..sizes.layers)
            .map(|layer| {
                let width = if layer == 0 { inputs.len() } else { sizes.hidden };
                weights.lstm(&format!("{name}.lstm.{layer}"), width, sizes.hidden)
            })
            .collect();
        let recurrent = recurrent?;
        let head = weights.linear(&format!("{name}.head"), sizes.hidden, outputs.len())?;
        Ok(Branch { inputs, outputs, recurrent, head })
    }

    /// Output and cell of each layer.
    fn memory(&self) -> usize {
        self.recurrent.iter().map(|layer| 2 * layer.size()).sum()
    }

    fn step(&self, inputs: &[f32], memory: &mut [f32], scratch: &mut [f32], outputs: &mut [f32]) {
        let mut memory = Room(memory);
        let mut value = inputs;
        for layer in &self.recurrent {
            let (output, cell) = (memory.take(layer.size()), memory.take(layer.size()));
            layer.step(value, output, cell, scratch);
            value = output;
        }
        self.head.forward(value, outputs);
    }
}
