//! Ensembles of KalmanNets: how to correct and weigh the states of nets that are trained already.
//!
//! ## Definition
//!
//! The branches of [`tercel_neural::filter::EnsKNets`]. The KalmanNets come from model files and follow each
//! flight with the very code of the run time; nothing of them is learned, so no gradient flows through them.
//! With the fused estimate `x`, the probabilities `p` and the manoeuvre flown `y`, the loss is that of two
//! tasks,
//!
//! ```text
//! L = L_regr / L̄_regr + λ L_ce / L̄_ce,      L_regr = mean of ‖x - truth‖²,      L_ce = mean of -ln p(y)
//! ```
//!
//! where `L̄` are the same of the plain average of the KalmanNets, found once on training flights. A
//! manoeuvre has the probability of all KalmanNets that turn in its direction. Without a classification
//! branch the second term does not matter. In the place of the mean square the regression may be the mean
//! root of flights ([`Form::Root`]). Flights that come again in every epoch are followed once and kept in
//! memory, about 15 kB each.
//!
//! ## Use it when
//!
//! KalmanNets for several motions are trained, and their ensemble is wanted. Flights are simulated
//! ([`tercel_sim::air_traffic`]).
//!
//! ## Reference
//!
//! "Ensemble of KalmanNets with innovation-based attention for robust target tracking", equations 15 to 19.
//! Deviations: the usual losses are those of some training flights, not of all; classes are directions;
//! measurements may be missing, after which corrections are predicted as states are.

mod data;
mod fusion;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};
use std::path::PathBuf;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;
use tercel_neural::filter::{
    Attention, BranchHyper, EnsKNetsHyper, EnsembleNetwork, GainNetwork, Normalisation,
};
use tercel_neural::{Card, Model, Scale, Tensor as Stored};

use data::EnsembleData;
pub use data::{Accuracy, EnsembleDataConfig};
pub use fusion::Form;
use fusion::{COLUMNS, Flights, Fusion, Plan};

use crate::backend::{Tensor, apply, constant, values};
use crate::check::{at_least, positive, refused, size, within};
use crate::layer::{Activation, Linear, Lstm, dropout, numbered};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The kind `ens-knets` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct EnsKNetsKind;

impl Kind for EnsKNetsKind {
    const NAME: &'static str = "ens-knets";
    type Data = EnsembleDataConfig;
    type Model = EnsembleModel;
    type Loss = EnsembleLoss;
}

/// The section `[model]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnsembleModel {
    /// Model files of the KalmanNets, from the folder in which the training runs. Each says for which turn
    /// rate it is.
    pub nets: Vec<PathBuf>,
    /// Standard deviation of the acceleration in the covariances, m/s² per axis.
    pub acceleration: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// What the branches see.
    pub normalisation: Normalisation,
    /// Attention to innovations, if there is to be any.
    #[serde(default)]
    pub attention: Option<Attention>,
    /// The branch that corrects states, if there is to be one.
    #[serde(default)]
    pub correction: Option<BranchHyper>,
    /// The branch that weighs them, if there is to be one.
    #[serde(default)]
    pub classification: Option<BranchHyper>,
    /// Share of the outputs of each recurrent layer that is dropped in training.
    #[serde(default)]
    pub dropout: f64,
    /// Whether the heads start as zero, so that the ensemble starts as the average of its KalmanNets.
    #[serde(default)]
    pub zero_heads: bool,
}

/// The section `[loss]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnsembleLoss {
    /// What an error costs.
    pub form: Form,
    /// What errors of the position are divided by, m.
    pub position: f64,
    /// What errors of the velocity are divided by, m/s.
    pub velocity: f64,
    /// Weight `λ` of the classification.
    pub entropy: f64,
    /// Steps at the start of a flight that do not count.
    pub skip: usize,
    /// Training flights from which the usual losses are found, at most all.
    pub usual: usize,
}

impl Default for EnsembleLoss {
    fn default() -> Self {
        let form = Form::MeanSquare;
        Self { form, position: 1.0, velocity: 1.0, entropy: 0.1, skip: 0, usual: 512 }
    }
}

/// An ensemble of KalmanNets in training.
#[derive(Debug)]
pub struct EnsKNetsTask {
    hyper: EnsKNetsHyper,
    scales: BTreeMap<String, Scale>,
    nets: BTreeMap<String, Stored>,
    data: EnsembleData,
    dropout: f32,
    correction: Option<Branch>,
    classification: Option<Branch>,
    plan: Arc<Plan>,
}

/// A branch: recurrent layers and a head.
#[derive(Debug)]
struct Branch {
    inputs: Range<usize>,
    recurrent: Vec<Lstm>,
    head: Linear,
}

impl EnsKNetsTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense, a model file of a KalmanNet cannot be read or used, or no filter could be
    /// made of them; all before anything is trained.
    pub fn new(recipe: &Recipe<EnsKNetsKind>) -> Result<(Self, ParameterSet), TrainError> {
        let models = recipe.model.nets.iter().map(|path| Model::open(path)).collect::<Result<Vec<_>, _>>()?;
        Self::of_nets(recipe, &models)
    }

    /// The same with these KalmanNets in the place of those that the recipe names.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn of_nets(
        recipe: &Recipe<EnsKNetsKind>,
        models: &[Model],
    ) -> Result<(Self, ParameterSet), TrainError> {
        let (model, loss) = (&recipe.model, &recipe.loss);
        within("model.dropout", model.dropout, 0.0..1.0)?;
        positive("loss.position", loss.position)?;
        positive("loss.velocity", loss.velocity)?;
        at_least("loss.entropy", loss.entropy, 0.0)?;
        size("loss.usual", loss.usual, [1, 1_000_000])?;
        let hyper = hyper(model, models)?;
        let (mut scales, nets) = frozen(models);
        scales.extend(EnsKNetsHyper::default_scales());
        let data = EnsembleData::new(&recipe.data, recipe.seed, &hyper, card(&hyper, &scales), &nets)?;
        let (steps, interval) = (data.flights().steps(), data.flights().interval());
        if loss.skip + 1 >= steps {
            let expected = format!("a flight has {} steps after its first", steps - 1);
            return Err(refused("loss.skip", loss.skip, expected));
        }
        check_interval(models, interval)?;
        scales.insert("interval".to_owned(), Scale { value: interval, unit: "s".to_owned() });
        let mut set = ParameterSet::new(recipe.seed);
        let modes = hyper.modes();
        let mut branch = |name: &str, sizes: Option<BranchHyper>, inputs: Range<usize>, outputs| {
            sizes
                .map(|sizes| Branch::new(&mut set, name, sizes, [inputs, 0..outputs], model.zero_heads))
                .transpose()
        };
        let correction = branch("correction", hyper.correction, hyper.correction_inputs(), 4 * modes)?;
        let classification =
            branch("classification", hyper.classification, hyper.classification_inputs(), modes)?;
        if set.is_empty() {
            let expected = "the plain average of KalmanNets has nothing to learn; add [model.correction] or \
                            [model.classification]";
            return Err(refused("model", "without branches", expected));
        }
        let plan = Plan {
            rates: hyper.rates.clone(),
            interval,
            units: ["position", "velocity"].map(|name| scales[name].value as f32),
            form: loss.form,
            weights: [loss.position, loss.velocity].map(|scale| (1.0 / scale) as f32),
            entropy: if hyper.classification.is_some() { loss.entropy as f32 } else { 0.0 },
            first: 1 + loss.skip,
            usual: [1.0, 1.0],
        };
        let (dropout, plan) = (model.dropout as f32, Arc::new(plan));
        let mut task = Self { hyper, scales, nets, data, dropout, correction, classification, plan };
        task.plan = Arc::new(Plan { usual: task.usual(recipe)?, ..(*task.plan).clone() });
        let mut tensors = set.tensors();
        tensors.extend(task.nets.clone());
        EnsembleNetwork::from_model(&Model::new(task.card(), tensors)?)?;
        Ok((task, set))
    }

    /// What the plain average of the KalmanNets costs on training flights: regression and classification.
    fn usual(&self, recipe: &Recipe<EnsKNetsKind>) -> Result<[f32; 2], TrainError> {
        let samples: Vec<u64> = (0..recipe.loss.usual.min(self.samples(Split::Training)) as u64).collect();
        let draw = Draw { split: Split::Training, epoch: 0, seed: recipe.seed, samples: &samples };
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let parts = std::thread::scope(|scope| {
            let part = |samples| scope.spawn(move || self.data.batch(Draw { samples, ..draw }));
            let handles: Vec<_> = samples.chunks(samples.len().div_ceil(threads)).map(part).collect();
            handles
                .into_iter()
                .map(|handle| handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect::<Result<Vec<_>, _>>()
        })?;
        let flights = Arc::new(Flights::new(parts.concat()));
        let [regression, entropy] = Fusion { flights, plan: self.plan.clone() }.usual();
        if !(regression.is_finite() && regression > 0.0) {
            let problem =
                format!("the average of the KalmanNets errs by {regression}; one of them may diverge");
            return Err(TrainError::Data(problem));
        }
        // With one KalmanNet for each direction that is flown there is nothing to classify.
        Ok([regression, if entropy > 0.0 { entropy } else { 1.0 }])
    }
}

/// The options of the ensemble, which takes those of its KalmanNets from their files.
fn hyper(model: &EnsembleModel, models: &[Model]) -> Result<EnsKNetsHyper, TrainError> {
    let (mut rates, mut nets) = (Vec::new(), Vec::new());
    for model in models {
        nets.push(GainNetwork::from_model(model)?.hyper().clone());
        let rate = model.card().scales.get("turn_rate").filter(|scale| scale.unit == "rad/s");
        let expected = "its card must have the scale `turn_rate` in rad/s";
        rates.push(rate.ok_or_else(|| refused("model.nets", model.file(), expected))?.value);
    }
    let hyper = EnsKNetsHyper {
        rates,
        acceleration: model.acceleration,
        speed: model.speed,
        normalisation: model.normalisation,
        attention: model.attention,
        correction: model.correction,
        classification: model.classification,
        nets,
    };
    hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
    Ok(hyper)
}

/// Scales and tensors of KalmanNets, with the prefixes that they have in an ensemble.
fn frozen(models: &[Model]) -> (BTreeMap<String, Scale>, BTreeMap<String, Stored>) {
    let (mut scales, mut tensors) = (BTreeMap::new(), BTreeMap::new());
    for (index, model) in models.iter().enumerate() {
        let name = |name: &String| format!("net.{index}.{name}");
        scales.extend(model.card().scales.iter().map(|(key, scale)| (name(key), scale.clone())));
        tensors.extend(model.tensors().iter().map(|(key, tensor)| (name(key), tensor.clone())));
    }
    (scales, tensors)
}

fn check_interval(models: &[Model], interval: f64) -> Result<(), TrainError> {
    for model in models {
        if let Some(scale) = model.card().scales.get("interval")
            && (scale.value - interval).abs() > 1e-9
        {
            let expected =
                format!("it was trained for steps of {} s, and flights have {interval} s", scale.value);
            return Err(refused("model.nets", model.file(), expected));
        }
    }
    Ok(())
}

fn card(hyper: &EnsKNetsHyper, scales: &BTreeMap<String, Scale>) -> Card {
    let mut card = Card::new("untrained", EnsKNetsKind::NAME, &["x", "y", "vx", "vy"]);
    // Options that came from TOML fit into it.
    card.hyper = hyper.to_table().unwrap_or_default();
    card.scales = scales.clone();
    card
}

impl Branch {
    fn new(
        set: &mut ParameterSet,
        name: &str,
        BranchHyper { hidden, layers }: BranchHyper,
        [inputs, outputs]: [Range<usize>; 2],
        zero: bool,
    ) -> Result<Self, TrainError> {
        let recurrent = (0..layers)
            .map(|layer| {
                let width = if layer == 0 { inputs.len() } else { hidden };
                Lstm::new(set, &numbered(&format!("{name}.lstm"), layer), width, hidden)
            })
            .collect::<Result<_, _>>()?;
        let bound = 1.0 / (hidden as f32).sqrt();
        let initial = if zero { Initial::Constant(0.0) } else { Initial::Uniform { bound } };
        let sizes = [hidden, outputs.len()];
        let initial = [initial.clone(), initial];
        let head = Linear::with_initial(set, &format!("{name}.head"), sizes, Activation::Identity, initial)?;
        Ok(Self { inputs, recurrent, head })
    }

    fn forward(
        &self,
        weights: &Weights,
        inputs: Tensor,
        members: usize,
        drop: &mut Option<(f32, ChaCha8Rng)>,
    ) -> Tensor {
        let mut x = inputs;
        for layer in &self.recurrent {
            x = layer.sequence(weights, x, members);
            if let Some((probability, random)) = drop {
                x = dropout(x, *probability, random);
            }
        }
        self.head.forward(weights, x)
    }
}

/// A batch of flights that the KalmanNets have followed.
#[derive(Debug)]
pub struct EnsembleBatch {
    flights: Arc<Flights>,
    /// Random numbers for what is dropped; none in the validation.
    random: Option<ChaCha8Rng>,
}

/// Keeps the random numbers of dropout apart from those of the flights.
const DROPOUT: u64 = 0x6472_6f70_0000_0000;

impl EnsKNetsTask {
    /// Corrections and logits of a batch; zero without the branch.
    fn outputs(&self, weights: &Weights, batch: &EnsembleBatch) -> [Tensor; 2] {
        let (members, modes) = (batch.flights.flights.len(), self.hyper.modes());
        let rows = batch.flights.rows * members;
        let mut drop = batch.random.clone().map(|random| (self.dropout, random));
        let branches = [(&self.correction, 4 * modes), (&self.classification, modes)];
        branches.map(|(branch, outputs)| match branch {
            None => constant(vec![0.0; rows * outputs], [rows, outputs]),
            Some(branch) => {
                let inputs = batch.flights.inputs(self.hyper.inputs(), branch.inputs.clone());
                let inputs = constant(inputs, [rows, branch.inputs.len()]);
                branch.forward(weights, inputs, members, &mut drop)
            }
        })
    }
}

impl Task for EnsKNetsTask {
    type Batch = EnsembleBatch;
    type Memory = ();

    fn card(&self) -> Card {
        card(&self.hyper, &self.scales)
    }

    fn frozen(&self) -> BTreeMap<String, Stored> {
        self.nets.clone()
    }

    fn samples(&self, split: Split) -> usize {
        self.data.flights().samples(split)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<EnsembleBatch, TrainError> {
        let flights = Arc::new(Flights::new(self.data.batch(draw)?));
        if flights.rows == 0 {
            return Err(TrainError::Data("no flight of a batch was seen twice".to_owned()));
        }
        let random = (draw.split == Split::Training && self.dropout > 0.0).then(|| {
            let mut random = ChaCha8Rng::seed_from_u64(draw.seed ^ DROPOUT);
            random.set_stream((draw.epoch as u64) << 40 ^ draw.samples[0]);
            random
        });
        Ok(EnsembleBatch { flights, random })
    }

    fn loss(
        &self,
        weights: &Weights,
        batch: &EnsembleBatch,
        _: usize,
        _: &mut Option<()>,
    ) -> Result<Loss, TrainError> {
        let fusion = Fusion { flights: batch.flights.clone(), plan: self.plan.clone() };
        let value = apply(fusion, self.outputs(weights, batch));
        let all = values(&value);
        let names = ["regression", "classification", "rmse_pos", "rmse_vel", "accuracy"];
        let parts = names.into_iter().zip(all[1..COLUMNS].iter().map(|value| f64::from(*value))).collect();
        let terms = batch.flights.flights.len() as f64;
        Ok(Loss { value: value.slice([0..1, 0..1]), terms, parts })
    }
}

/// Trains the branches of an ensemble as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<EnsKNetsKind>::parse(text)?;
    let (task, set) = EnsKNetsTask::new(&recipe)?;
    trainer::train(&recipe, &task, set, run, observer)
}
