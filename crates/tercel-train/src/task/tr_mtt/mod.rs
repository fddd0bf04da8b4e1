//! TrMTT: a transformer that reads windows of measurements.
//!
//! ## Definition
//!
//! The network of [`tercel_neural::filter::TrMtt`]. Windows and the carrier's covariances come from the code of the run time. Of each
//! flight some windows are taken that end with a measurement, those at its start included, which are partly empty. The network
//! says the state of each step of a window; [`ResidualLoss`] judges it, in metres and metres a second.
//!
//! ## Use it when
//!
//! an end-to-end network is wanted for comparison. Flights are simulated ([`crate::task::plots`]), measured by a [`ConvertedPolar`]
//! sensor.
//!
//! ## Reference
//!
//! Y. Zhang, G. Li, X.-P. Zhang, Y. He, "A deep learning model based on transformer structure for radar tracking of maneuvering
//! targets", Information Fusion 103 (2024); deviations as at run time.

mod network;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{Matrix4, Vector2, Vector4};
use tercel_core::filter::Filter;
use tercel_core::sensor::ConvertedPolar;
use tercel_neural::filter::{TrMtt, TrMttHyper, TransformerNetwork};
use tercel_neural::{Card, Model, Tensor as Stored};

use super::plots::{Plots, PlotsConfig, Sighting};
use super::residual::{self, Aim, ResidualLoss, Root};
use crate::backend::{Tensor, constant};
use crate::layer::Mask;
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{ParameterSet, TrainError, Weights};
use network::Transformer;

/// The kind `tr-mtt` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct TrMttKind;

impl Kind for TrMttKind {
    const NAME: &'static str = "tr-mtt";
    type Data = PlotsConfig;
    type Model = TrMttHyper;
    type Loss = ResidualLoss;
}

/// A TrMTT in training.
#[derive(Debug)]
pub struct TrMttTask {
    hyper: TrMttHyper,
    loss: ResidualLoss,
    plots: Plots,
    filter: TrMtt<ConvertedPolar>,
    network: Transformer,
}

/// A batch of windows.
#[derive(Debug)]
pub struct Windows {
    /// What the network sees: row `window * steps + step`.
    pub inputs: Vec<f32>,
    /// Which of these rows have a reading.
    pub mask: Arc<Mask>,
    /// What it should say, in the same rows.
    pub aims: Arc<Vec<Aim>>,
}

/// A window of readings with what was true, and the covariance of the carrier at its end. Steps before the flight have no truth.
#[derive(Debug, Clone)]
struct Window {
    readings: Vec<Option<Vector2<f64>>>,
    truth: Vec<Option<Vector4<f64>>>,
    covariance: Matrix4<f64>,
}

impl TrMttTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(recipe: &Recipe<TrMttKind>) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, loss) = (recipe.model.clone(), recipe.loss.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        loss.check()?;
        let plots = Plots::new(&recipe.data, recipe.seed, 3)?;
        let [range, bearing] = plots.assumed();
        let sensor = ConvertedPolar::new(range, bearing)
            .map_err(|error| TrainError::Recipe(format!("[data]: {error}")))?;
        let filter = TrMtt::new(Arc::new(smallest(&hyper)?), sensor);
        let mut set = ParameterSet::new(recipe.seed);
        let network = Transformer::new(&mut set, &hyper)?;
        let task = Self { hyper, loss, plots, filter, network };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    fn follow(&self, draw: Draw<'_>, sample: u64) -> Result<Vec<Window>, TrainError> {
        let fault = |error| TrainError::Data(format!("flight {sample}: {error}"));
        let Sighting { states, plots, interval } = &self.plots.sighting(draw, sample)?;
        let Some(Some(first)) = plots.first() else {
            return Err(TrainError::Data(format!("flight {sample}: its first step was not seen")));
        };
        let mut belief = self.filter.birth(first).map_err(fault)?;
        let mut windows = Vec::new();
        for (step, plot) in plots.iter().enumerate().skip(1) {
            self.filter.predict(&mut belief, *interval);
            let Some(plot) = plot else { continue };
            self.filter.update(&mut belief, plot).map_err(fault)?;
            let readings = belief.window().to_vec();
            if self.hyper.frame(&readings, &Vector2::zeros()).is_none() {
                continue;
            }
            let place = |index: usize| (step + 1 + index).checked_sub(readings.len());
            let truth = (0..readings.len()).map(|index| place(index).map(|step| states[step])).collect();
            // The smallest network scales nothing, so this is the carrier's own.
            let covariance = self.filter.state(&belief).covariance;
            windows.push(Window { readings, truth, covariance });
        }
        let chosen = self.plots.windows(draw, sample, windows.len());
        Ok(chosen.into_iter().map(|index| windows[index].clone()).collect())
    }

    /// Adds a window to a batch.
    fn take(&self, window: &Window, inputs: &mut Vec<f32>, seen: &mut Vec<f32>, aims: &mut Vec<Aim>) {
        // Windows without a frame are left out before.
        let Some(frame) = self.hyper.frame(&window.readings, &Vector2::zeros()) else { return };
        let steps = self.hyper.window;
        let (first, row) = (seen.len(), inputs.len());
        seen.resize(first + steps, 0.0);
        inputs.resize(row + steps * self.hyper.inputs(), 0.0);
        self.hyper.see(&window.readings, &frame, &mut inputs[row..], &mut seen[first..]);
        let units = frame.units();
        let unit = single(&Matrix4::from_diagonal(&Vector4::from(units)));
        let sight = frame.sight();
        for (index, truth) in window.truth.iter().enumerate() {
            let last = index + 1 == steps;
            let Some(truth) = truth else {
                aims.push(Aim { unit, target: [0.0; 4], weight: 0.0, root: None });
                continue;
            };
            let turned = frame.turned(truth);
            aims.push(Aim {
                unit,
                target: std::array::from_fn(|i| turned[i] * units[i] as f32),
                weight: if last { 1.0 } else { self.loss.others as f32 },
                root: last.then(|| single(&sight.root(&window.covariance))),
            });
        }
    }

    /// What the network says of windows.
    fn forward(&self, weights: &Weights, windows: &Windows) -> Tensor {
        let inputs = constant(windows.inputs.clone(), [windows.mask.seen.len(), self.hyper.inputs()]);
        self.network.forward(weights, inputs, &windows.mask)
    }
}

fn single(matrix: &Matrix4<f64>) -> Root {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)] as f32))
}

/// A network of the same window that costs next to nothing: the data needs the carrier alone.
fn smallest(hyper: &TrMttHyper) -> Result<TransformerNetwork, TrainError> {
    let hyper = TrMttHyper { size: 1, heads: 1, encoder: 1, decoder: 1, feed: 1, ..hyper.clone() };
    let zeros = |shape: Vec<usize>| Stored { values: vec![0.0; shape.iter().product()], shape };
    let tensors: BTreeMap<_, _> =
        hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
    Ok(TransformerNetwork::from_model(&Model::new(card(&hyper), tensors)?)?)
}

fn card(hyper: &TrMttHyper) -> Card {
    let mut card = Card::new("untrained", TrMttKind::NAME, &["x", "y", "vx", "vy"]);
    // Options that came from TOML fit into it.
    card.hyper = hyper.to_table().unwrap_or_default();
    card
}

impl Task for TrMttTask {
    type Batch = Windows;
    type Memory = ();

    fn card(&self) -> Card {
        card(&self.hyper)
    }

    fn samples(&self, split: Split) -> usize {
        self.plots.samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Windows, TrainError> {
        let (mut inputs, mut seen, mut aims) = (Vec::new(), Vec::new(), Vec::new());
        for sample in draw.samples {
            for window in self.follow(draw, *sample)? {
                self.take(&window, &mut inputs, &mut seen, &mut aims);
            }
        }
        if seen.is_empty() {
            let reason = "no flight of a batch has two measurements; longer flights help";
            return Err(TrainError::Data(reason.into()));
        }
        let mask = Arc::new(Mask { steps: self.hyper.window, seen });
        Ok(Windows { inputs, mask, aims: Arc::new(aims) })
    }

    fn loss(
        &self,
        weights: &Weights,
        windows: &Windows,
        _: usize,
        _: &mut Option<()>,
    ) -> Result<Loss, TrainError> {
        Ok(residual::loss(self.forward(weights, windows), &windows.aims, &self.loss))
    }
}

/// Trains a TrMTT as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<TrMttKind>::parse(text)?;
    let (task, set) = TrMttTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
