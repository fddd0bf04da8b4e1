//! KalmanNet: the gain of a filter, learned by rolling the filter out over whole flights.
//!
//! ## Definition
//!
//! The filter of [`tercel_neural::filter::KalmanNet`], differentiable: prediction with a fixed turn rate,
//! features, gain network, correction. The loss is the mean square of the scaled errors of all posterior
//! states,
//!
//! ```text
//! L = mean over flights, steps and components of ((x̂(t|t) - x(t)) / s)²,   s = (position, position, velocity, velocity)
//! ```
//!
//! and its gradient flows through the recursion of the filter, within windows of truncated back-propagation
//! if they are asked for. A filter starts as at run time, with the first reading and no velocity. Positions
//! are relative to the first reading, for single precision. In the frame of the sensor, the direction of the
//! line of sight counts as given.
//!
//! ## Use it when
//!
//! a gain is to be learned without a noise model. Flights are simulated ([`tercel_sim::air_traffic`]).
//!
//! ## Reference
//!
//! G. Revach et al., "KalmanNet: neural network aided Kalman filtering for partially known dynamics", IEEE
//! TSP 70 (2022). Deviations: the first state is not known; measurements may be missing in training; gain
//! offset, magnitudes and sensor frame as at run time. Windows as in X. Song et al. (2024).

mod filter;
mod network;
mod operations;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use serde::Deserialize;
use tercel_neural::filter::{GainNetwork, KalmanNetHyper};
use tercel_neural::{Card, Model, Scale};

use filter::Options;
pub use filter::State;
use network::Network;

use crate::backend::{Tensor, constant, values};
use crate::check::{positive, refused};
use crate::recipe::{Kind, Recipe};
use crate::task::flights::{Flights, FlightsConfig, Rollout};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{ParameterSet, TrainError, Weights};

/// The kind `kalman-net` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct KalmanNetKind;

impl Kind for KalmanNetKind {
    const NAME: &'static str = "kalman-net";
    type Data = FlightsConfig;
    type Model = KalmanNetModel;
    type Loss = KalmanNetLoss;
}

/// The section `[model]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KalmanNetModel {
    /// Turn rate of the predictions, rad/s, positive to the left.
    #[serde(default)]
    pub turn_rate: f64,
    /// Whether the last layer starts as zero, so that the filter starts with the gain offset alone.
    #[serde(default)]
    pub zero_gain: bool,
    /// Sizes and options, as the model card has them.
    pub network: KalmanNetHyper,
}

/// The section `[loss]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KalmanNetLoss {
    /// What errors of the position are divided by, m.
    pub position: f64,
    /// What errors of the velocity are divided by, m/s.
    pub velocity: f64,
    /// Steps at the start that do not count.
    pub skip: usize,
    /// Steps between cuts of the back-propagation; 0 cuts nothing.
    pub window: usize,
}

impl Default for KalmanNetLoss {
    fn default() -> Self {
        Self { position: 100.0, velocity: 10.0, skip: 0, window: 0 }
    }
}

/// A KalmanNet in training.
#[derive(Debug)]
pub struct KalmanNetTask {
    model: KalmanNetModel,
    loss: KalmanNetLoss,
    flights: Flights,
    network: Network,
    options: Options,
}

impl KalmanNetTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense, or no filter could be made of the network; all before anything is trained.
    pub fn new(recipe: &Recipe<KalmanNetKind>) -> Result<(Self, ParameterSet), TrainError> {
        let (model, loss) = (recipe.model.clone(), recipe.loss.clone());
        if !(model.turn_rate.is_finite() && model.turn_rate.abs() <= std::f64::consts::PI) {
            return Err(refused("model.turn_rate", model.turn_rate, "it must lie between -pi and pi rad/s"));
        }
        positive("loss.position", loss.position)?;
        positive("loss.velocity", loss.velocity)?;
        let flights = Flights::new(&recipe.data, recipe.seed)?;
        let steps = flights.steps() - 1;
        let window = if loss.window == 0 { steps } else { loss.window };
        if loss.skip >= window.min(steps) {
            let expected = format!("a window has {} steps after the first reading", window.min(steps));
            return Err(refused("loss.skip", loss.skip, expected));
        }
        // The run time judges the options, before the network is built for training.
        check(&model.network)?;
        let mut set = ParameterSet::new(recipe.seed);
        let network = Network::new(&mut set, &model.network, model.zero_gain)?;
        let options = Options::new(&model.network, model.turn_rate, flights.interval());
        let task = Self { model, loss: KalmanNetLoss { window, ..loss }, flights, network, options };
        GainNetwork::from_model(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    /// The mean of the scaled squares of the errors of some steps, and of the plain squares of positions and
    /// velocities.
    fn judge(&self, rollout: &Rollout, estimates: Vec<Tensor>, first: usize) -> Loss {
        let (members, skipped) = (rollout.members, self.loss.skip.saturating_sub(first - 1));
        let first = first + skipped;
        let estimates = Tensor::cat(estimates.into_iter().skip(skipped).collect(), 0);
        let [rows, _] = estimates.dims();
        let truth = rollout.truth[4 * first * members..][..4 * rows].to_vec();
        let errors = estimates - constant(truth, [rows, 4]);
        let [mut position, mut velocity] = [0.0, 0.0];
        for row in values(&errors).as_chunks::<4>().0 {
            let square = |a: f32, b: f32| f64::from(a).powi(2) + f64::from(b).powi(2);
            position += square(row[0], row[1]) / (2 * rows) as f64;
            velocity += square(row[2], row[3]) / (2 * rows) as f64;
        }
        let [p, v] = [self.loss.position, self.loss.velocity].map(|scale| (1.0 / scale) as f32);
        let scaled = errors * constant(vec![p, p, v, v], [1, 4]);
        let value = (scaled.clone() * scaled).mean().reshape([1, 1]);
        Loss { value, terms: (4 * rows) as f64, parts: vec![("position", position), ("velocity", velocity)] }
    }
}

/// Refuses options of which no filter can be made.
fn check(hyper: &KalmanNetHyper) -> Result<(), TrainError> {
    let empty = Model::new(card(hyper), BTreeMap::new())?;
    match GainNetwork::from_model(&empty) {
        // The tensors are still to come, so their absence says that everything else is in order.
        Ok(_) | Err(tercel_neural::ModelError::Missing { .. }) => Ok(()),
        Err(error) => Err(TrainError::Recipe(format!("[model.network]: {error}"))),
    }
}

fn card(hyper: &KalmanNetHyper) -> Card {
    let mut card = Card::new("untrained", KalmanNetKind::NAME, &["x", "y", "vx", "vy"]);
    // Options that came from TOML fit into it.
    card.hyper = hyper.to_table().unwrap_or_default();
    card.scales = KalmanNetHyper::default_scales();
    card
}

impl Task for KalmanNetTask {
    type Batch = Rollout;
    type Memory = State;

    fn card(&self) -> Card {
        let mut card = card(&self.model.network);
        let turn_rate = Scale { value: self.model.turn_rate, unit: "rad/s".to_owned() };
        card.scales.insert("turn_rate".to_owned(), turn_rate);
        let interval = Scale { value: self.flights.interval(), unit: "s".to_owned() };
        card.scales.insert("interval".to_owned(), interval);
        card
    }

    fn samples(&self, split: Split) -> usize {
        self.flights.samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Rollout, TrainError> {
        self.flights.rollout(draw)
    }

    fn windows(&self, rollout: &Rollout) -> usize {
        (rollout.steps() - 1).div_ceil(self.loss.window)
    }

    fn loss(
        &self,
        weights: &Weights,
        rollout: &Rollout,
        window: usize,
        memory: &mut Option<State>,
    ) -> Result<Loss, TrainError> {
        let first = 1 + window * self.loss.window;
        let last = (first + self.loss.window).min(rollout.steps());
        let mut state = memory.take().unwrap_or_else(|| State::first(&self.network, rollout.members));
        let mut estimates = Vec::with_capacity(last - first);
        for step in first..last {
            state = self.options.step(&self.network, weights, state, rollout, step);
            estimates.push(state.estimate().clone());
        }
        *memory = Some(state.detached());
        Ok(self.judge(rollout, estimates, first))
    }
}

/// Trains a KalmanNet as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<KalmanNetKind>::parse(text)?;
    let (task, set) = KalmanNetTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
