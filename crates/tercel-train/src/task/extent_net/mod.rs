//! ExtentNet: state and extent of an object by a network alone, which is fed its own estimates.
//!
//! ## Definition
//!
//! The filter of [`tercel_neural::filter::ExtentNet`], differentiable, with the costs of [`ExtentCosts`], on the objects of
//! [`RmmNetData`]. For some epochs the network is given the truth in the place of its last estimate; then it goes on from what it
//! said, and gradients flow through that and through its memory, within windows of truncated back-propagation.
//!
//! ## Use it when
//!
//! one asks what the model in a filter is worth.
//!
//! ## Reference
//!
//! RMMNet paper, section IV.A and eq. 37. How these methods were trained is not in the paper.

mod cost;
mod network;
mod operations;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::Arc;

use tercel_neural::filter::ExtentNetHyper;
use tercel_neural::filter::extent_net::{DOUBTED, Frame, Scan, TOLD, Told};
use tercel_neural::{Card, Model, Scale};

pub use cost::ExtentCosts;

use cost::Judge;
use network::{Network, Past};
use operations::{Given, See, Tell};

use super::rmm_net::{Rides, RmmNetData, Truth, distance};
use crate::backend::{Tensor, apply, constant, detached, values};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task, Tracks};
use crate::{ParameterSet, TrainError, Weights};

/// The kind `extent-net` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct ExtentNetKind;

impl Kind for ExtentNetKind {
    const NAME: &'static str = "extent-net";
    type Data = RmmNetData;
    type Model = ExtentNetHyper;
    type Loss = ExtentCosts;
}

/// An ExtentNet in training.
#[derive(Debug)]
pub struct ExtentNetTask {
    hyper: Arc<ExtentNetHyper>,
    costs: ExtentCosts,
    data: RmmNetData,
    tracks: Tracks,
    network: Network,
}

/// Objects, and whether the network is given the truth before each step.
#[derive(Debug)]
pub struct Batch {
    rides: Rides,
    forced: bool,
}

/// A batch of filters between two steps.
#[derive(Debug, Clone)]
pub struct State {
    /// The last estimates, relative to the origins: single precision would not hold positions of an object that has gone far.
    rows: Tensor,
    known: Vec<Known>,
    past: Past,
}

/// What is known of a member beside its estimate.
#[derive(Debug, Clone, Copy)]
struct Known {
    /// Where the origin is, m: that of the absolute frame, or the last centroid.
    origin: [f64; 2],
    /// The last centroid, m, and the time since then, s.
    centre: [f64; 2],
    elapsed: f64,
    /// Scans with points so far.
    scans: u64,
}

/// Numbers of a row that is judged.
const JUDGED: usize = TOLD + DOUBTED;

impl ExtentNetTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(
        recipe: &Recipe<ExtentNetKind>,
        tracks: Option<Tracks>,
    ) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, costs, data) = (recipe.model.clone(), recipe.loss, recipe.data.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        costs.check()?;
        data.check()?;
        let tracks = data.fit(hyper.interval, tracks)?;
        let window = if costs.window == 0 { data.steps } else { costs.window };
        let mut set = ParameterSet::new(recipe.seed);
        let network = Network::new(&mut set, &hyper.architecture)?;
        let costs = ExtentCosts { window, ..costs };
        let task = Self { hyper: Arc::new(hyper), costs, data, tracks, network };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    fn first(&self, rides: &Rides) -> State {
        let known: Vec<Known> = rides.scans[0]
            .iter()
            .map(|scan| {
                let centre: [f64; 2] = scan.mean().into();
                Known { origin: self.origin(centre), centre, elapsed: 0.0, scans: 0 }
            })
            .collect();
        let [along, across] = self.hyper.axes;
        let rows = rides.births.iter().zip(&known).flat_map(|((motion, _), known)| {
            let place = [0, 1].map(|i| motion.place[i] - known.origin[i]);
            Told { place, velocity: motion.velocity, factor: [along, 0.0, across] }.numbers()
        });
        State {
            rows: constant(rows.map(|x| x as f32).collect(), [rides.members, TOLD]),
            past: self.network.past(rides.members),
            known,
        }
    }

    /// Where the origin is after a scan with this centroid.
    fn origin(&self, centre: [f64; 2]) -> [f64; 2] {
        match self.hyper.frame {
            Frame::Absolute => self.hyper.origin,
            Frame::Residual => centre,
        }
    }

    /// The truth of a step as the last estimates.
    fn truth(&self, truth: &[Truth], known: &[Known]) -> Tensor {
        let rows = truth.iter().zip(known).flat_map(|(truth, known)| {
            let [x, y, u, v] = truth.from(known.origin).state;
            let first = truth.extent.xx.sqrt();
            let below = truth.extent.xy / first;
            let factor = [first, below, (truth.extent.yy - below * below).max(0.0).sqrt()];
            Told { place: [x, y], velocity: [u, v], factor }.numbers()
        });
        constant(rows.map(|x| x as f32).collect(), [truth.len(), TOLD])
    }

    /// One step of the batch: the state after it, and its row for the costs.
    fn step(&self, weights: &Weights, batch: &Batch, state: State, step: usize) -> (State, Tensor) {
        let State { rows, mut known, past } = state;
        let rides = &batch.rides;
        let before = if batch.forced { self.truth(&rides.truth[step - 1], &known) } else { rows };
        let mut scans = Vec::with_capacity(rides.members);
        let mut numbers = Vec::with_capacity(rides.members);
        for (known, points) in known.iter_mut().zip(&rides.scans[step]) {
            known.elapsed += self.data.interval;
            if points.is_empty() {
                scans.push((None, [0.0; 2]));
                numbers.push(None);
                continue;
            }
            let scan = Scan::new(points, known.origin, known.centre, known.elapsed);
            let centre: [f64; 2] = points.mean().into();
            let origin = self.origin(centre);
            scans.push((Some(scan), [0, 1].map(|i| origin[i] - known.origin[i])));
            numbers.push(Some(known.scans));
            *known = Known { origin, centre, elapsed: 0.0, scans: known.scans + 1 };
        }
        let given = Arc::new(Given { hyper: Arc::clone(&self.hyper), scans });
        let seen = apply(See(Arc::clone(&given)), [before.clone()]);
        let (said, doubt, past) = self.network.step(weights, seen, &Arc::new(numbers), past);
        let rows = apply(Tell(given), [before, said]);
        (State { rows: rows.clone(), known, past }, Tensor::cat(vec![rows, doubt], 1))
    }
}

/// Mean squares of errors per component, of the shape, and the consistency, for the curve.
fn parts(hyper: &ExtentNetHyper, rows: &[f32], truth: &[Truth]) -> Vec<(&'static str, f64)> {
    let mut sums = [0.0; 4];
    for (row, truth) in rows.chunks_exact(JUDGED).zip(truth) {
        let row: [f64; JUDGED] = std::array::from_fn(|i| f64::from(row[i]));
        let (told, doubt) = (Told::of(&row), hyper.doubt(&row[TOLD..]));
        let e: [f64; 4] = std::array::from_fn(|i| row[i] - truth.state[i]);
        let place = e[0] * e[0] + e[1] * e[1];
        sums[0] += 0.5 * place;
        sums[1] += 0.5 * (e[2] * e[2] + e[3] * e[3]);
        sums[2] += distance(&told.extent(), &truth.extent);
        sums[3] += place * (-2.0 * doubt.ln_place).exp();
    }
    let count = truth.len() as f64;
    ["position", "velocity", "shape", "nees"].into_iter().zip(sums.map(|sum| sum / count)).collect()
}

impl Task for ExtentNetTask {
    type Batch = Batch;
    type Memory = State;

    fn card(&self) -> Card {
        let mut card = Card::new("untrained", ExtentNetKind::NAME, &["x", "y", "vx", "vy"]);
        // Options that came from TOML fit into it.
        card.hyper = self.hyper.to_table().unwrap_or_default();
        let interval = Scale { value: self.data.interval, unit: "s".to_owned() };
        card.scales.insert("interval".to_owned(), interval);
        card
    }

    fn samples(&self, split: Split) -> usize {
        self.data.samples(split, &self.tracks)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Batch, TrainError> {
        let rides = Rides::new(&self.data, (self.hyper.axes, self.hyper.speed), &self.tracks, draw)?;
        Ok(Batch { rides, forced: draw.split == Split::Training && draw.epoch < self.costs.forced })
    }

    fn windows(&self, batch: &Batch) -> usize {
        (batch.rides.scans.len() - 1).div_ceil(self.costs.window)
    }

    fn loss(
        &self,
        weights: &Weights,
        batch: &Batch,
        window: usize,
        memory: &mut Option<State>,
    ) -> Result<Loss, TrainError> {
        let rides = &batch.rides;
        let first = 1 + window * self.costs.window;
        let last = (first + self.costs.window).min(rides.scans.len());
        let mut state = memory.take().unwrap_or_else(|| self.first(rides));
        let mut rows = Vec::with_capacity(last - first);
        let mut truth = Vec::with_capacity((last - first) * rides.members);
        for step in first..last {
            let (next, row) = self.step(weights, batch, state, step);
            state = next;
            rows.push(row);
            truth.extend(
                rides.truth[step].iter().zip(&state.known).map(|(truth, known)| truth.from(known.origin)),
            );
        }
        let next: Vec<u64> = state.known.iter().map(|known| known.scans).collect();
        let past = self.network.detached(state.past, &next);
        *memory = Some(State { rows: detached(state.rows), past, ..state });
        let rows = Tensor::cat(rows, 0);
        let parts = parts(&self.hyper, &values(&rows), &truth);
        let terms = truth.len() as f64;
        let judge = Judge { hyper: Arc::clone(&self.hyper), costs: self.costs, truth: Arc::new(truth) };
        let value = apply(judge, [rows]).mean().reshape([1, 1]);
        Ok(Loss { value, terms, parts })
    }
}

/// Trains an ExtentNet as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<ExtentNetKind>::parse(text)?;
    let (task, set) = ExtentNetTask::new(&recipe, run.tracks.clone())?;
    trainer::train(&recipe, &task, set, run, observer)
}
