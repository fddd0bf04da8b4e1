//! RMMNet: a random-matrix filter with a learned memory, trained by rolling it out over whole trajectories.
//!
//! ## Definition
//!
//! The filter of [`tercel_neural::filter::RmmNet`], differentiable, with the costs of [`Costs`]. Its step is written once, over
//! numbers that are plain at run time and record themselves here. Gradients flow through the recursion of the
//! filter and the memory of the network, within windows of truncated back-propagation; what the network sees counts as given. The
//! untrained network says nothing, so training starts from a random-matrix filter in straight motion.
//!
//! ## Use it when
//!
//! extended objects of one kind are to be tracked, of which there is a simulator or there are recorded tracks.
//!
//! ## Reference
//!
//! RMMNet paper, sections III-C and III-D, eq. 37. The likelihood in the loss is ours.

mod aligned;
mod cost;
mod data;
mod head;
mod imitation;
mod operations;
mod published;
mod rows;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::Arc;

use tercel_neural::filter::rmm_net::{Form, Length, RmmNetHyper};
use tercel_neural::{Card, Model, Scale};

pub(super) use cost::{Truth, distance, score};
pub(super) use data::Rides;
pub(super) use operations::Rows;

pub use cost::Costs;
pub use data::{Population, RmmNetData, Source};

use aligned::{AlignedNet, Known};
use operations::Judge;
use published::PublishedNet;
use rows::Layout;

use crate::backend::{Tensor, apply, detached, values};
use crate::layer::LstmState;
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task, Tracks};
use crate::{ParameterSet, TrainError, Weights};

/// The kind `rmmnet` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct RmmNetKind;

impl Kind for RmmNetKind {
    const NAME: &'static str = "rmmnet";
    type Data = RmmNetData;
    type Model = RmmNetHyper;
    type Loss = Costs;
}

/// An RMMNet in training.
#[derive(Debug)]
pub struct RmmNetTask {
    hyper: RmmNetHyper,
    costs: Costs,
    data: RmmNetData,
    tracks: Tracks,
    net: Net,
}

/// A batch of filters between two steps.
#[derive(Debug, Clone)]
pub struct State {
    /// A row for each member, with positions relative to its origin: single precision would not hold those of an object that has
    /// gone far.
    tracks: Tensor,
    /// Where the origins are, m. Each is where the object was expected last.
    origins: Vec<[f64; 2]>,
    memory: LstmState,
    known: Vec<Known>,
}

/// The network of a form.
#[derive(Debug)]
enum Net {
    Aligned(AlignedNet),
    Published(PublishedNet),
}

impl RmmNetTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(
        recipe: &Recipe<RmmNetKind>,
        tracks: Option<Tracks>,
    ) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, costs, data) = (recipe.model.clone(), recipe.loss, recipe.data.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        costs.check()?;
        data.check()?;
        let tracks = data.fit(hyper.interval, tracks)?;
        let window = if costs.window == 0 { data.steps } else { costs.window };
        let mut set = ParameterSet::new(recipe.seed);
        let length = Length { dt: data.interval, share: data.interval / hyper.interval };
        let given = (length, data.scattering()?);
        let net = match &hyper.form {
            Form::Aligned(form) => Net::Aligned(AlignedNet::new(&mut set, form, hyper.memory, given)?),
            Form::Published(form) => {
                Net::Published(PublishedNet::new(&mut set, form, hyper.memory, data.interval, given.1)?)
            }
        };
        let task = Self { costs: Costs { window, ..costs }, hyper, data, tracks, net };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    fn layout(&self) -> Layout {
        match &self.net {
            Net::Aligned(_) => Layout::Aligned,
            Net::Published(_) => Layout::Published,
        }
    }

    /// First semi-axes, m, and the deviation of a first velocity, m/s.
    fn beginning(&self) -> ([f64; 2], f64) {
        match &self.hyper.form {
            Form::Aligned(form) => (form.axes, form.speed),
            Form::Published(form) => {
                let (extent, _) = form.first_extent();
                ([extent.xx.sqrt(), extent.yy.sqrt()], form.speed)
            }
        }
    }

    fn first(&self, rides: &Rides) -> State {
        match &self.net {
            Net::Aligned(net) => net.first(rides),
            Net::Published(net) => net.first(rides),
        }
    }

    /// One step of the batch: the state after it, and its row for the costs.
    fn step(&self, weights: &Weights, rides: &Rides, state: State, step: usize) -> (State, Tensor) {
        match &self.net {
            Net::Aligned(net) => net.step(weights, rides, state, step),
            Net::Published(net) => net.step(weights, rides, state, step),
        }
    }
}

/// Mean squares of errors per component, of the shape, and the consistency, for the curve.
fn parts(layout: Layout, rows: &[f32], truth: &[Truth]) -> Vec<(&'static str, f64)> {
    let mut sums = [0.0; 4];
    for (row, truth) in rows.chunks_exact(layout.width()).zip(truth) {
        let row: Vec<f64> = row.iter().map(|x| f64::from(*x)).collect();
        let found = layout.read(&row);
        let e: [f64; 4] = std::array::from_fn(|i| row[i] - truth.state[i]);
        sums[0] += 0.5 * (e[0] * e[0] + e[1] * e[1]);
        sums[1] += 0.5 * (e[2] * e[2] + e[3] * e[3]);
        sums[2] += distance(&found.extent, &truth.extent);
        sums[3] += found.motion.place_covariance.inverse().form([e[0], e[1]], [e[0], e[1]]);
    }
    let count = truth.len() as f64;
    ["position", "velocity", "shape", "nees"].into_iter().zip(sums.map(|sum| sum / count)).collect()
}

impl Task for RmmNetTask {
    type Batch = Rides;
    type Memory = State;

    fn card(&self) -> Card {
        let mut card = Card::new("untrained", RmmNetKind::NAME, &["x", "y", "vx", "vy"]);
        // Options that came from TOML fit into it.
        card.hyper = self.hyper.to_table().unwrap_or_default();
        let interval = Scale { value: self.data.interval, unit: "s".to_owned() };
        card.scales.insert("interval".to_owned(), interval);
        card
    }

    fn samples(&self, split: Split) -> usize {
        self.data.samples(split, &self.tracks)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Rides, TrainError> {
        Rides::new(&self.data, self.beginning(), &self.tracks, draw)
    }

    fn windows(&self, rides: &Rides) -> usize {
        (rides.scans.len() - 1).div_ceil(self.costs.window)
    }

    fn loss(
        &self,
        weights: &Weights,
        rides: &Rides,
        window: usize,
        memory: &mut Option<State>,
    ) -> Result<Loss, TrainError> {
        let first = 1 + window * self.costs.window;
        let last = (first + self.costs.window).min(rides.scans.len());
        let mut state = memory.take().unwrap_or_else(|| self.first(rides));
        let mut rows = Vec::with_capacity(last - first);
        let mut truth = Vec::with_capacity((last - first) * rides.members);
        for step in first..last {
            let (next, row) = self.step(weights, rides, state, step);
            state = next;
            rows.push(row);
            truth.extend(
                rides.truth[step].iter().zip(&state.origins).map(|(truth, origin)| truth.from(*origin)),
            );
        }
        *memory = Some(State { tracks: detached(state.tracks), memory: state.memory.detached(), ..state });
        let rows = Tensor::cat(rows, 0);
        let parts = parts(self.layout(), &values(&rows), &truth);
        let terms = truth.len() as f64;
        let judge = Judge { costs: self.costs, layout: self.layout(), truth: Arc::new(truth) };
        let value = apply(judge, [rows]).mean().reshape([1, 1]);
        Ok(Loss { value, terms, parts })
    }
}

/// Trains an RMMNet as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<RmmNetKind>::parse(text)?;
    let (task, set) = RmmNetTask::new(&recipe, run.tracks.clone())?;
    trainer::train(&recipe, &task, set, run, observer)
}
