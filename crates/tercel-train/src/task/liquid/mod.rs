//! Liquid Kalman filter: a motion with a memory, learned by rolling the filter out over trajectories that change how they move.
//!
//! ## Definition
//!
//! The filter of [`tercel_neural::filter::LiquidKalman`], differentiable. The loss is the surprise about the truth after each
//! prediction that the network has made, and the error of the mean after each update, in units `s`:
//!
//! ```text
//! L = n · mean of (eᵀ P⁻¹ e + ln |P|) / 2 + m · mean of ((x̂(t|t) - x(t)) / s)²,    e = x(t) - x̂(t|t-1),  P = P(t|t-1)
//! ```
//!
//! The filter sees its own estimates, so what the network is trained on has the errors that it will have. Where measurements
//! stop for some steps, predictions are predicted on: the loss of several steps is that of these. Gradients flow through the
//! recursion of the filter and the memory of the network, within windows of truncated back-propagation; what the network sees
//! and the Jacobian count as given. The untrained network says nothing, so training starts from a Kalman filter.
//!
//! In the form of the publication the loss is the mean square of the error of the next true state, within limits, given the
//! present true state; there is no filter in the training.
//!
//! ## Use it when
//!
//! objects in clutter manoeuvre, and the components of a mixture must be predicted by something better than straight motion. The
//! section `[model]` chooses the cell, so that the same recipe trains the liquid network and its controls.
//!
//! ## Reference
//!
//! Liu et al., "Hybrid liquid neural network-random finite set filtering for robust maneuvering object tracking", section III-A
//! (eq. 7), for the form of the publication. The loss in closed loop is ours.

mod data;
mod operations;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{Matrix4, Vector4};
use serde::Deserialize;
use tercel_core::belief::Gaussian;
use tercel_neural::filter::{Absolute, Form, LiquidHyper, LiquidNetwork, Seen, Span, surprise, widths};
use tercel_neural::{Card, Model, Scale};

pub use data::{LiquidData, Watched};
use operations::Step;

use super::gaussians::{Both, Costs, GAUSSIAN, mean_squares};
use crate::backend::{Tensor, apply, constant, detached, values};
use crate::check::refused;
use crate::layer::{Activation, Cell, Linear};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The kind `liquid` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct LiquidKind;

impl Kind for LiquidKind {
    const NAME: &'static str = "liquid";
    type Data = LiquidData;
    type Model = LiquidHyper;
    type Loss = LiquidLoss;
}

/// The section `[loss]`. The form of the publication has no use for it but the window.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LiquidLoss {
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

impl LiquidLoss {
    fn costs(&self) -> Costs {
        Costs { surprise: self.surprise, error: self.error, scales: [self.position, self.velocity] }
    }
}

impl Default for LiquidLoss {
    fn default() -> Self {
        Self { surprise: 1.0, error: 0.1, position: 5.0, velocity: 3.0, window: 25 }
    }
}

/// A liquid Kalman filter in training.
#[derive(Debug)]
pub struct LiquidTask {
    hyper: LiquidHyper,
    loss: LiquidLoss,
    data: LiquidData,
    cell: Cell,
    output: Linear,
    /// Names and shapes of the parameters, in order.
    parameters: Vec<(String, Vec<usize>)>,
}

/// A batch of filters between two steps.
#[derive(Debug, Clone)]
pub struct State {
    both: Both,
    /// Whether there was one.
    measured: Vec<f32>,
    memory: Tensor,
}

impl State {
    fn detached(self) -> Self {
        Self { both: self.both.detached(), memory: detached(self.memory), measured: self.measured }
    }
}

impl LiquidTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(recipe: &Recipe<LiquidKind>) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, loss, data) = (recipe.model.clone(), recipe.loss.clone(), recipe.data.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        loss.costs().check()?;
        data.check()?;
        if hyper.interval != data.interval {
            let expected = format!("the trajectories have a step of {} s", data.interval);
            return Err(refused("model.interval", hyper.interval, expected));
        }
        if data.steps <= hyper.warm_up as usize + 1 {
            return Err(refused("data.steps", data.steps, "it must exceed `model.warm_up` by more than 1"));
        }
        let mut set = ParameterSet::new(recipe.seed);
        let cell = Cell::new(&mut set, "cell", hyper.form.inputs(), hyper.cell)?;
        let sizes = [hyper.cell.size(), hyper.form.outputs()];
        let initial = match hyper.form {
            Form::Residual(_) => Initial::Constant(0.0),
            Form::Absolute(_) => Initial::Uniform { bound: 1.0 / (sizes[0] as f32).sqrt() },
        };
        let output = Linear::with_initial(
            &mut set,
            "output",
            sizes,
            Activation::Identity,
            [initial.clone(), initial],
        )?;
        let parameters = set.iter().map(|entry| (entry.name().to_owned(), entry.shape().to_vec())).collect();
        let window = if loss.window == 0 { data.steps } else { loss.window };
        if window <= hyper.warm_up as usize {
            return Err(refused(
                "loss.window",
                window,
                "it must exceed `model.warm_up`, or nothing is judged in it",
            ));
        }
        let loss = LiquidLoss { window, ..loss };
        let task = Self { hyper, loss, data, cell, output, parameters };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    /// The network of the run time with these weights. `None` if they are not finite.
    fn network(&self, weights: &Weights) -> Option<LiquidNetwork> {
        let tensors = self.parameters.iter().zip(weights.tensors()).map(|((name, shape), tensor)| {
            (name.clone(), tercel_neural::Tensor { shape: shape.clone(), values: values(tensor) })
        });
        let model = Model::new(self.card(), tensors.collect()).ok()?;
        LiquidNetwork::from_model(&model).ok()
    }

    fn span(&self) -> Span {
        Span { dt: self.data.interval, interval: self.hyper.interval }
    }

    fn first(&self, watched: &Watched) -> State {
        let births = constant(watched.births.clone(), [watched.members, GAUSSIAN]);
        State {
            both: Both::born(births),
            measured: vec![1.0; watched.members],
            memory: Cell::zero(watched.members, self.hyper.cell),
        }
    }

    /// What is known of each member.
    fn seen(&self, state: &State) -> Vec<Seen> {
        let members = state.both.pairs().into_iter().zip(&state.measured);
        let of = |((prior, posterior), measured): ((Gaussian<4>, Gaussian<4>), &f32)| Seen {
            mean: posterior.mean,
            correction: posterior.mean - prior.mean,
            measured: *measured != 0.0,
            surprise: surprise(&prior, &posterior),
            widths: widths(&posterior),
        };
        members.map(of).collect()
    }

    /// What the network says of each member, the memory after it, and the Jacobians of the predictions.
    fn said(
        &self,
        weights: &Weights,
        network: Option<&LiquidNetwork>,
        state: &State,
    ) -> (Tensor, Tensor, Vec<Matrix4<f64>>) {
        let (form, seen) = (&self.hyper.form, self.seen(state));
        let memory =
            if self.hyper.carried { state.memory.clone() } else { Cell::zero(seen.len(), self.hyper.cell) };
        let mut inputs = vec![0.0; seen.len() * form.inputs()];
        for (seen, inputs) in seen.iter().zip(inputs.chunks_exact_mut(form.inputs())) {
            form.see(seen, inputs, &mut []);
        }
        let jacobians = match network {
            None => vec![Matrix4::from_element(f64::NAN); seen.len()],
            Some(network) => {
                let remembered = values(&memory);
                let rows =
                    remembered.chunks_exact(self.hyper.cell.size()).map(|row| &row[..network.memory()]);
                let mut room = Vec::new();
                let objects = seen.iter().copied().zip(rows);
                let predictions = network.predict(seen.len(), objects, self.data.interval, &mut room);
                let of = |(number, seen)| {
                    let straight = || form.straight(&Vector4::zeros(), self.span()).jacobian;
                    predictions.get(number, seen).map_or_else(straight, |(moved, _)| moved.jacobian)
                };
                seen.iter().enumerate().map(of).collect()
            }
        };
        let elapsed = (self.data.interval / self.hyper.interval) as f32;
        let x = constant(inputs, [seen.len(), form.inputs()]);
        let memory = self.cell.step(weights, elapsed, x, memory);
        (self.output.forward(weights, memory.clone()), memory, jacobians)
    }

    /// One step of the batch.
    fn step(
        &self,
        weights: &Weights,
        network: Option<&LiquidNetwork>,
        watched: &Watched,
        state: State,
        step: usize,
    ) -> State {
        let form = self.hyper.form;
        let (outputs, memory, jacobians) = if step > self.hyper.warm_up as usize {
            self.said(weights, network, &state)
        } else {
            let nothing =
                constant(vec![0.0; watched.members * form.outputs()], [watched.members, form.outputs()]);
            let straight = form.straight(&Vector4::zeros(), self.span()).jacobian;
            (nothing, state.memory.clone(), vec![straight; watched.members])
        };
        let reading = Arc::clone(&watched.readings[step]);
        let measured = reading.seen.clone();
        let operation = Step { form, span: self.span(), jacobians: Arc::new(jacobians), reading };
        State { both: Both(apply(operation, [state.both.posterior(), outputs])), measured, memory }
    }

    /// The loss of some steps, from `first` on.
    fn judge(&self, watched: &Watched, states: &[State], first: usize) -> Loss {
        let truth = &watched.truth[4 * first * watched.members..];
        self.loss.costs().loss(states.iter().map(|state| &state.both), truth)
    }

    /// The loss of the publication: errors of the next states of some steps.
    fn published(
        &self,
        weights: &Weights,
        watched: &Watched,
        form: &Absolute,
        [first, last]: [usize; 2],
    ) -> Loss {
        let members = watched.members;
        let normalised = |step: usize| -> Vec<f32> {
            let rows = watched.truth[4 * step * members..][..4 * members].as_chunks::<4>().0;
            let place = rows.iter().zip(&watched.origins).map(|(row, origin)| {
                let state = row.map(f64::from);
                form.normalised(&Vector4::new(state[0] + origin.x, state[1] + origin.y, state[2], state[3]))
            });
            place.flatten().collect()
        };
        let rows = (last - first) * members;
        let before: Vec<f32> = (first..last).flat_map(|step| normalised(step - 1)).collect();
        let after: Vec<f32> = (first..last).flat_map(normalised).collect();
        let elapsed = (self.data.interval / self.hyper.interval) as f32;
        let memory = Cell::zero(rows, self.hyper.cell);
        let memory = self.cell.step(weights, elapsed, constant(before, [rows, 4]), memory);
        let errors = self.output.forward(weights, memory) - constant(after, [rows, 4]);
        let range = |i: usize| (form.maximum[i] - form.minimum[i]) as f32;
        let scale = constant((0..4).map(range).collect(), [1, 4]);
        let [position, velocity] = mean_squares(&(errors.clone() * scale));
        let value = (errors.clone() * errors).mean().reshape([1, 1]);
        Loss { value, terms: rows as f64, parts: vec![("position", position), ("velocity", velocity)] }
    }
}

impl Task for LiquidTask {
    type Batch = Watched;
    type Memory = State;

    fn card(&self) -> Card {
        let mut card = Card::new("untrained", LiquidKind::NAME, &["x", "y", "vx", "vy"]);
        // Options that came from TOML fit into it.
        card.hyper = self.hyper.to_table().unwrap_or_default();
        let interval = Scale { value: self.data.interval, unit: "s".to_owned() };
        card.scales.insert("interval".to_owned(), interval);
        card
    }

    fn samples(&self, split: Split) -> usize {
        self.data.samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Watched, TrainError> {
        Watched::new(&self.data, self.hyper.speed, draw)
    }

    fn windows(&self, watched: &Watched) -> usize {
        (watched.readings.len() - 1).div_ceil(self.loss.window)
    }

    fn loss(
        &self,
        weights: &Weights,
        watched: &Watched,
        window: usize,
        memory: &mut Option<State>,
    ) -> Result<Loss, TrainError> {
        let first = 1 + window * self.loss.window;
        let last = (first + self.loss.window).min(watched.readings.len());
        if let Form::Absolute(form) = &self.hyper.form {
            return Ok(self.published(weights, watched, form, [first, last]));
        }
        let network = self.network(weights);
        let mut state = memory.take().unwrap_or_else(|| self.first(watched));
        let mut states = Vec::with_capacity(last - first);
        for step in first..last {
            state = self.step(weights, network.as_ref(), watched, state, step);
            if step > self.hyper.warm_up as usize {
                states.push(state.clone());
            }
        }
        *memory = Some(state.detached());
        Ok(self.judge(watched, &states, last - states.len()))
    }
}

/// Trains a liquid Kalman filter as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<LiquidKind>::parse(text)?;
    let (task, set) = LiquidTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
