//! Neural IMM: what a network adds to a bank of turns, learned from flights that the bank has followed.
//!
//! ## Definition
//!
//! The network of [`tercel_neural::filter::NeuralImm`]. The bank runs as it does at run time, and with the very code of the run
//! time; nothing of it is learned, so no gradient flows through it. With the root mean squares `r` of the errors of a flight's
//! estimates, those `b` of the bank, and usual ones `s`, the loss is
//!
//! ```text
//! L = mean over flights of  r_pos / √(b_pos s_pos) + v r_vel / √(b_vel s_vel)
//!     + e · mean of -ln(probability of the manoeuvre flown)
//!     + l · mean of (‖(D L)⁻¹ error‖² / 2 + ln |D|)
//! ```
//!
//! over all steps but the first (`skip`, ten unless the recipe says otherwise), those without a measurement included. The last term teaches the scales `D` of the covariance
//! alone; the error counts as given in it.
//!
//! ## Use it when
//!
//! a bank of models is good, and should be better. Flights are simulated ([`tercel_sim::air_traffic`]), or other objects that are
//! measured as positions ([`LiquidData`](crate::task::liquid::LiquidData)).
//!
//! ## Reference
//!
//! Ours; see [`tercel_neural::filter::NeuralImm`].

mod data;
mod mixture;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use serde::Deserialize;
use tercel_neural::filter::{BankNetwork, NeuralImmHyper, Recurrence};
use tercel_neural::{Card, Model, Tensor as Stored};

use data::{BankData, Followed};
pub use data::{BankDataConfig, Population};
use mixture::{COLUMNS, Mixture};

use crate::backend::{apply, constant, values};
use crate::check::{at_least, positive};
use crate::layer::{Activation, Cell, Linear};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The kind `neural-imm` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct NeuralImmKind;

impl Kind for NeuralImmKind {
    const NAME: &'static str = "neural-imm";
    type Data = BankDataConfig;
    type Model = NeuralImmHyper;
    type Loss = NeuralImmLoss;
}

/// The section `[loss]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NeuralImmLoss {
    /// A usual root mean square of an element of the position, m.
    pub position: f64,
    /// A usual root mean square of an element of the velocity, m/s.
    pub velocity: f64,
    /// Weight of the velocity.
    pub velocity_weight: f64,
    /// Weight of the manoeuvre's entropy.
    pub entropy: f64,
    /// Weight of the likelihood.
    pub likelihood: f64,
}

impl Default for NeuralImmLoss {
    fn default() -> Self {
        Self { position: 250.0, velocity: 45.0, velocity_weight: 0.2, entropy: 0.1, likelihood: 0.05 }
    }
}

/// A neural IMM in training.
#[derive(Debug)]
pub struct NeuralImmTask {
    hyper: NeuralImmHyper,
    loss: NeuralImmLoss,
    data: BankData,
    input: Linear,
    recurrent: Vec<Cell>,
    output: Linear,
}

impl NeuralImmTask {
    /// The task of a recipe, and the parameters with which it starts: those of the bank alone.
    ///
    /// # Errors
    ///
    /// If a value makes no sense, or no filter could be made of the network; all before anything is trained.
    pub fn new(recipe: &Recipe<NeuralImmKind>) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, loss) = (recipe.model.clone(), recipe.loss.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        positive("loss.position", loss.position)?;
        positive("loss.velocity", loss.velocity)?;
        at_least("loss.velocity_weight", loss.velocity_weight, 0.0)?;
        at_least("loss.entropy", loss.entropy, 0.0)?;
        at_least("loss.likelihood", loss.likelihood, 0.0)?;
        let network = Arc::new(smallest(&hyper)?);
        let data = BankData::new(&recipe.data, recipe.seed, &network)?;
        let mut set = ParameterSet::new(recipe.seed);
        let input = Linear::new(&mut set, "input", hyper.inputs(), hyper.input, Activation::Relu)?;
        let recurrent = hyper
            .recurrent()
            .map(|(name, inputs, shape)| Cell::new(&mut set, &name, inputs, shape))
            .collect::<Result<_, _>>()?;
        let (sizes, zeros) =
            ([hyper.hidden, hyper.outputs()], [Initial::Constant(0.0), Initial::Constant(0.0)]);
        let output = Linear::with_initial(&mut set, "output", sizes, Activation::Identity, zeros)?;
        Ok((Self { hyper, loss, data, input, recurrent, output }, set))
    }
}

/// A network of the same inputs and outputs that costs next to nothing: the data needs the bank alone.
fn smallest(hyper: &NeuralImmHyper) -> Result<BankNetwork, TrainError> {
    let hyper = NeuralImmHyper { input: 1, hidden: 1, layers: 1, cell: Recurrence::Gru, ..hyper.clone() };
    let zeros = |shape: Vec<usize>| Stored { values: vec![0.0; shape.iter().product()], shape };
    let tensors: BTreeMap<_, _> =
        hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
    Ok(BankNetwork::from_model(&Model::new(card(&hyper), tensors)?)?)
}

fn card(hyper: &NeuralImmHyper) -> Card {
    let mut card = Card::new("untrained", NeuralImmKind::NAME, &["x", "y", "vx", "vy"]);
    // Options that came from TOML fit into it.
    card.hyper = hyper.to_table().unwrap_or_default();
    card
}

/// A batch of flights that the bank has followed.
#[derive(Debug)]
pub struct NeuralImmBatch(Arc<Followed>);

impl Task for NeuralImmTask {
    type Batch = NeuralImmBatch;
    type Memory = ();

    fn card(&self) -> Card {
        card(&self.hyper)
    }

    fn samples(&self, split: Split) -> usize {
        self.data.samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<NeuralImmBatch, TrainError> {
        Ok(NeuralImmBatch(Arc::new(self.data.batch(draw)?)))
    }

    fn loss(
        &self,
        weights: &Weights,
        NeuralImmBatch(followed): &NeuralImmBatch,
        _: usize,
        _: &mut Option<()>,
    ) -> Result<Loss, TrainError> {
        let rows = followed.updates * followed.members;
        let inputs = constant(followed.inputs.clone(), [rows, followed.width()]);
        let mut x = self.input.forward(weights, inputs);
        for layer in &self.recurrent {
            let memory = Cell::zero(followed.members, self.hyper.cell.shape(self.hyper.hidden));
            x = layer.sequence(weights, x, memory);
        }
        let outputs = self.output.forward(weights, x);
        let mixture = Mixture { followed: followed.clone(), loss: self.loss.clone() };
        let value = apply(mixture, [outputs]);
        let all = values(&value);
        let names = ["rmse_pos", "rmse_vel", "entropy", "likelihood"];
        let parts = names.into_iter().zip(all[1..COLUMNS].iter().map(|value| f64::from(*value))).collect();
        Ok(Loss { value: value.slice([0..1, 0..1]), terms: followed.members as f64, parts })
    }
}

/// Trains a neural IMM as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<NeuralImmKind>::parse(text)?;
    let (task, set) = NeuralImmTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
