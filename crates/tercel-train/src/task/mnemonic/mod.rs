//! Mnemonic Kalman filter: the prediction of a filter, learned by rolling the filter out over whole flights.
//!
//! ## Definition
//!
//! The filter of [`tercel_neural::filter::MnemonicKalman`], differentiable. The loss is the surprise about the truth after each
//! prediction, and the error of the mean after each update, in units `s`:
//!
//! ```text
//! L = n · mean of (eᵀ P⁻¹ e + ln |P|) / 2 + m · mean of ((x̂(t|t) - x(t)) / s)²,    e = x(t) - x̂(t|t-1),  P = P(t|t-1)
//! ```
//!
//! Gradients flow through the recursion of the filter and the memory of the network, within windows of truncated back-propagation;
//! what the network sees counts as given. A filter starts as at run time. The untrained network says nothing, so that training
//! starts from a Kalman filter.
//!
//! ## Use it when
//!
//! a motion model is to be learned and the update kept. Flights are simulated ([`crate::task::plots`]), measured by a
//! [`ConvertedPolar`] sensor.
//!
//! ## Reference
//!
//! S. Jung, I. Schlangen, A. Charlish, "A mnemonic Kalman filter for non-linear systems with extensive temporal dependencies",
//! IEEE Signal Processing Letters 27 (2020). Deviation: trained through the filter from the start, instead of on noisy truth first.

mod data;
mod operations;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Vector2;
use serde::Deserialize;
use tercel_core::sensor::ConvertedPolar;
use tercel_neural::filter::MnemonicHyper;
use tercel_neural::{Card, Model, Scale};

pub use data::Flown;
use operations::Step;

use super::gaussians::{Both, Costs, GAUSSIAN};
use super::plots::{Plots, PlotsConfig};
use crate::backend::{Tensor, apply, constant};
use crate::check::refused;
use crate::layer::{Activation, Linear, Lstm, LstmState, numbered};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The kind `mnemonic` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct MnemonicKind;

impl Kind for MnemonicKind {
    const NAME: &'static str = "mnemonic";
    type Data = PlotsConfig;
    type Model = MnemonicHyper;
    type Loss = MnemonicLoss;
}

/// The section `[loss]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MnemonicLoss {
    /// Weight of the surprise.
    pub surprise: f64,
    /// Weight of the errors.
    pub error: f64,
    /// What errors of the position are divided by, m.
    pub position: f64,
    /// What errors of the velocity are divided by, m/s.
    pub velocity: f64,
    /// Steps between cuts of the back-propagation; 0 cuts nothing.
    pub window: usize,
}

impl MnemonicLoss {
    fn costs(&self) -> Costs {
        Costs { surprise: self.surprise, error: self.error, scales: [self.position, self.velocity] }
    }
}

impl Default for MnemonicLoss {
    fn default() -> Self {
        Self { surprise: 1.0, error: 0.1, position: 250.0, velocity: 50.0, window: 40 }
    }
}

/// A mnemonic Kalman filter in training.
#[derive(Debug)]
pub struct MnemonicTask {
    hyper: Arc<MnemonicHyper>,
    loss: MnemonicLoss,
    plots: Plots,
    sensor: ConvertedPolar,
    recurrent: Vec<Lstm>,
    output: Linear,
}

/// A batch of filters between two steps.
#[derive(Debug, Clone)]
pub struct State {
    both: Both,
    /// Whether there was one.
    seen: Vec<f32>,
    memory: Vec<LstmState>,
}

impl State {
    fn detached(self) -> Self {
        let memory = self.memory.into_iter().map(LstmState::detached).collect();
        Self { both: self.both.detached(), seen: self.seen, memory }
    }
}

impl MnemonicTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(recipe: &Recipe<MnemonicKind>) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, loss) = (recipe.model.clone(), recipe.loss.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        loss.costs().check()?;
        let plots = Plots::new(&recipe.data, recipe.seed, 2)?;
        if hyper.interval != plots.interval() {
            let expected = format!("the flights have a step of {} s", plots.interval());
            return Err(refused("model.interval", hyper.interval, expected));
        }
        let [range, bearing] = plots.assumed();
        let sensor = ConvertedPolar::new(range, bearing)
            .map_err(|error| TrainError::Recipe(format!("[data]: {error}")))?;
        let mut set = ParameterSet::new(recipe.seed);
        let mut recurrent = Vec::new();
        for layer in 0..hyper.layers {
            let inputs = if layer == 0 { hyper.inputs() } else { hyper.hidden };
            recurrent.push(Lstm::new(&mut set, &numbered("lstm", layer), inputs, hyper.hidden)?);
        }
        let (sizes, zero) = ([hyper.hidden, hyper.outputs()], Initial::Constant(0.0));
        let output =
            Linear::with_initial(&mut set, "output", sizes, Activation::Identity, [zero.clone(), zero])?;
        let window = if loss.window == 0 { plots.steps() } else { loss.window };
        let loss = MnemonicLoss { window, ..loss };
        let task = Self { hyper: Arc::new(hyper), loss, plots, sensor, recurrent, output };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    fn first(&self, flown: &Flown) -> State {
        let births = constant(flown.births.clone(), [flown.members, GAUSSIAN]);
        State {
            both: Both::born(births),
            seen: vec![1.0; flown.members],
            memory: self.recurrent.iter().map(|layer| LstmState::zero(flown.members, layer.size())).collect(),
        }
    }

    /// What the network sees after a step.
    fn see(&self, flown: &Flown, state: &State) -> Tensor {
        let width = self.hyper.inputs();
        let mut inputs = vec![0.0; flown.members * width];
        let members = state.both.pairs().into_iter().zip(inputs.chunks_exact_mut(width));
        for (member, ((prior, posterior), inputs)) in members.enumerate() {
            let origin = Vector2::new(flown.origins[2 * member], flown.origins[2 * member + 1]);
            let seen = state.seen[member] != 0.0;
            self.hyper.see(
                &posterior,
                origin + posterior.mean.xy(),
                (&(posterior.mean - prior.mean), seen),
                inputs,
            );
        }
        constant(inputs, [flown.members, width])
    }

    /// One step of the batch.
    fn step(&self, weights: &Weights, flown: &Flown, state: State, step: usize) -> State {
        let mut x = self.see(flown, &state);
        let mut memory = Vec::with_capacity(state.memory.len());
        for (layer, before) in self.recurrent.iter().zip(state.memory.iter().cloned()) {
            let after = layer.step(weights, x, before);
            x = after.hidden.clone();
            memory.push(after);
        }
        let reading = &flown.readings[step];
        let operation = Step {
            hyper: Arc::clone(&self.hyper),
            interval: self.plots.interval(),
            origins: Arc::clone(&flown.origins),
            reading: Arc::clone(reading),
        };
        let both = Both(apply(operation, [state.both.posterior(), self.output.forward(weights, x)]));
        State { both, seen: reading.seen.clone(), memory }
    }

    /// The loss of some steps, from `first` on.
    fn judge(&self, flown: &Flown, states: &[State], first: usize) -> Loss {
        let truth = &flown.truth[4 * first * flown.members..];
        self.loss.costs().loss(states.iter().map(|state| &state.both), truth)
    }
}

impl Task for MnemonicTask {
    type Batch = Flown;
    type Memory = State;

    fn card(&self) -> Card {
        let mut card = Card::new("untrained", MnemonicKind::NAME, &["x", "y", "vx", "vy"]);
        // Options that came from TOML fit into it.
        card.hyper = self.hyper.to_table().unwrap_or_default();
        let interval = Scale { value: self.plots.interval(), unit: "s".to_owned() };
        card.scales.insert("interval".to_owned(), interval);
        card
    }

    fn samples(&self, split: Split) -> usize {
        self.plots.samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Flown, TrainError> {
        Flown::new(&self.plots, &self.sensor, self.hyper.speed, draw)
    }

    fn windows(&self, flown: &Flown) -> usize {
        (flown.readings.len() - 1).div_ceil(self.loss.window)
    }

    fn loss(
        &self,
        weights: &Weights,
        flown: &Flown,
        window: usize,
        memory: &mut Option<State>,
    ) -> Result<Loss, TrainError> {
        let first = 1 + window * self.loss.window;
        let last = (first + self.loss.window).min(flown.readings.len());
        let mut state = memory.take().unwrap_or_else(|| self.first(flown));
        let mut states = Vec::with_capacity(last - first);
        for step in first..last {
            state = self.step(weights, flown, state, step);
            states.push(state.clone());
        }
        *memory = Some(state.detached());
        Ok(self.judge(flown, &states, first))
    }
}

/// Trains a mnemonic Kalman filter as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<MnemonicKind>::parse(text)?;
    let (task, set) = MnemonicTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
