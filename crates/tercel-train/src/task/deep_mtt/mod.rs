//! DeepMTT: the residuals of an unscented filter, learned from windows of its estimates.
//!
//! ## Definition
//!
//! The network of [`tercel_neural::filter::DeepMtt`]. The front end runs as it does at run time, and with the very code of the run
//! time; nothing of it is learned, so no gradient flows through it. Of each flight some windows are taken that end with a
//! measurement. The network says the residual of each step of a window; [`ResidualLoss`] judges it.
//!
//! ## Use it when
//!
//! an estimate of a simple filter lags in a way that can be recognised. Flights are simulated ([`crate::task::plots`]).
//!
//! ## Reference
//!
//! J. Liu, Z. Wang, M. Xu, "DeepMTT: a deep learning maneuvering target-tracking algorithm based on bidirectional LSTM network",
//! Information Fusion 53 (2020); deviations as at run time.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{Matrix4, Vector2, Vector4};
use tercel_core::belief::Gaussian;
use tercel_core::filter::Filter;
use tercel_core::sensor::RangeBearing;
use tercel_neural::filter::{DeepMtt, DeepMttHyper, ResidualNetwork};
use tercel_neural::{Card, Model, Tensor as Stored};

use super::plots::{Plots, PlotsConfig, Sighting};
use super::residual::{self, Aim, ResidualLoss, Root};
use crate::backend::{Tensor, constant};
use crate::layer::{Activation, Bidirectional, Linear, numbered};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The kind `deep-mtt` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct DeepMttKind;

impl Kind for DeepMttKind {
    const NAME: &'static str = "deep-mtt";
    type Data = PlotsConfig;
    type Model = DeepMttHyper;
    type Loss = ResidualLoss;
}

/// A DeepMTT in training.
#[derive(Debug)]
pub struct DeepMttTask {
    hyper: DeepMttHyper,
    loss: ResidualLoss,
    plots: Plots,
    filter: DeepMtt<RangeBearing>,
    layers: Vec<Bidirectional>,
    dense: Option<Linear>,
    output: Linear,
}

/// A batch of windows.
#[derive(Debug)]
pub struct Windows {
    /// The number of windows.
    pub count: usize,
    /// What the network sees: row `step * count + window`.
    pub inputs: Vec<f32>,
    /// What it should say, in the same rows.
    pub aims: Arc<Vec<Aim>>,
}

impl DeepMttTask {
    /// The task of a recipe, and the parameters with which it starts: those of the front end alone.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(recipe: &Recipe<DeepMttKind>) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, loss) = (recipe.model.clone(), recipe.loss.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        loss.check()?;
        let plots = Plots::new(&recipe.data, recipe.seed, hyper.window.max(2))?;
        let [range, bearing] = plots.assumed();
        let sensor = RangeBearing::new(range, bearing)
            .map_err(|error| TrainError::Recipe(format!("[data]: {error}")))?;
        let filter = DeepMtt::new(Arc::new(smallest(&hyper)?), sensor);
        let mut set = ParameterSet::new(recipe.seed);
        let (mut layers, mut inputs) = (Vec::new(), hyper.inputs());
        for (index, size) in hyper.layers.iter().enumerate() {
            layers.push(Bidirectional::new(&mut set, &numbered("bilstm", index), inputs, *size)?);
            inputs = 2 * size;
        }
        let mut dense = None;
        if hyper.dense > 0 {
            dense = Some(Linear::new(&mut set, "dense", inputs, hyper.dense, Activation::Relu)?);
            inputs = hyper.dense;
        }
        let (sizes, zero) = ([inputs, hyper.outputs()], Initial::Constant(0.0));
        let output =
            Linear::with_initial(&mut set, "output", sizes, Activation::Identity, [zero.clone(), zero])?;
        let task = Self { hyper, loss, plots, filter, layers, dense, output };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    /// Windows of a flight: those that end with a measurement, of which some are chosen.
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
            if let Some(window) = belief.window() {
                let truth = &states[step + 1 - window.len()..=step];
                windows.push(Window { estimates: window.to_vec(), truth: truth.to_vec() });
            }
        }
        let chosen = self.plots.windows(draw, sample, windows.len());
        Ok(chosen.into_iter().map(|index| windows[index].clone()).collect())
    }

    fn aims(&self, window: &Window) -> impl Iterator<Item = Aim> + use<> {
        let Window { estimates, truth } = window.clone();
        let (hyper, loss, last) = (self.hyper.clone(), self.loss.clone(), estimates.len() - 1);
        let sight = hyper.sight(&estimates[last], &Vector2::zeros());
        estimates.into_iter().zip(truth).enumerate().map(move |(index, (state, truth))| {
            let root = sight.root(&state.covariance);
            let unit = if hyper.whitened { root } else { Matrix4::from_diagonal(&Vector4::from(UNITS)) };
            let target = sight.matrix() * (truth - state.mean);
            Aim {
                unit: single(&unit),
                target: std::array::from_fn(|i| target[i] as f32),
                weight: if index == last { 1.0 } else { loss.others as f32 },
                root: (index == last).then(|| single(&root)),
            }
        })
    }

    /// What the network says of windows.
    fn forward(&self, weights: &Weights, windows: &Windows) -> Tensor {
        let rows = windows.count * self.hyper.window;
        let mut x = constant(windows.inputs.clone(), [rows, self.hyper.inputs()]);
        for layer in &self.layers {
            x = layer.sequence(weights, x, windows.count);
        }
        if let Some(dense) = &self.dense {
            x = dense.forward(weights, x);
        }
        self.output.forward(weights, x)
    }
}

/// Units of residuals that are not whitened, as at run time: m, m, m/s, m/s.
const UNITS: [f64; 4] = [100.0, 100.0, 10.0, 10.0];

/// A window of estimates, and what was true.
#[derive(Debug, Clone)]
struct Window {
    estimates: Vec<Gaussian<4>>,
    truth: Vec<Vector4<f64>>,
}

fn single(matrix: &Matrix4<f64>) -> Root {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)] as f32))
}

/// A network of the same inputs that costs next to nothing: the data needs the front end alone.
fn smallest(hyper: &DeepMttHyper) -> Result<ResidualNetwork, TrainError> {
    let hyper = DeepMttHyper { layers: vec![1], dense: 0, ..hyper.clone() };
    let zeros = |shape: Vec<usize>| Stored { values: vec![0.0; shape.iter().product()], shape };
    let tensors: BTreeMap<_, _> =
        hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
    Ok(ResidualNetwork::from_model(&Model::new(card(&hyper), tensors)?)?)
}

fn card(hyper: &DeepMttHyper) -> Card {
    let mut card = Card::new("untrained", DeepMttKind::NAME, &["x", "y", "vx", "vy"]);
    // Options that came from TOML fit into it.
    card.hyper = hyper.to_table().unwrap_or_default();
    card
}

impl Task for DeepMttTask {
    type Batch = Windows;
    type Memory = ();

    fn card(&self) -> Card {
        card(&self.hyper)
    }

    fn samples(&self, split: Split) -> usize {
        self.plots.samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Windows, TrainError> {
        let mut windows = Vec::new();
        for sample in draw.samples {
            windows.extend(self.follow(draw, *sample)?);
        }
        if windows.is_empty() {
            let reason = "no flight of a batch has a full window; longer flights or shorter windows help";
            return Err(TrainError::Data(reason.into()));
        }
        let (count, width, steps) = (windows.len(), self.hyper.inputs(), self.hyper.window);
        let mut inputs = vec![0.0; count * steps * width];
        let mut own = vec![0.0; steps * width];
        let mut aims = vec![None; count * steps];
        for (index, window) in windows.iter().enumerate() {
            self.hyper.see(&window.estimates, &Vector2::zeros(), &mut own);
            for (step, (row, aim)) in own.chunks_exact(width).zip(self.aims(window)).enumerate() {
                let place = step * count + index;
                inputs[place * width..][..width].copy_from_slice(row);
                aims[place] = Some(aim);
            }
        }
        Ok(Windows { count, inputs, aims: Arc::new(aims.into_iter().flatten().collect()) })
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

/// Trains a DeepMTT as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<DeepMttKind>::parse(text)?;
    let (task, set) = DeepMttTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
