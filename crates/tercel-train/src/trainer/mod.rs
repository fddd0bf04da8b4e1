//! The trainer: batches, shards, updates, validation, and files from which it goes on.

mod checkpoint;
mod curve;
mod shards;
mod task;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector4;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

pub use curve::Row;
pub use task::{Draw, Loss, Split, Task};
use tercel_neural::{Card, DataSizes, Model};

use crate::optimiser::{AdamW, Cosine};
use crate::recipe::{Kind, Recipe, ScheduleConfig, UpdateEach};
use crate::{ParameterSet, TrainError, store};
use checkpoint::Checkpoint;
use shards::{Shards, Tally};

/// What the trainer reports while it works.
#[derive(Debug, Clone, Copy)]
pub enum Progress<'a> {
    /// A batch is done.
    Batch {
        /// The epoch, from 0.
        epoch: usize,
        /// Batches done in it.
        done: usize,
        /// Batches in an epoch.
        batches: usize,
        /// The mean loss in it so far.
        loss: f64,
        /// The learning rate.
        rate: f64,
    },
    /// An epoch is done, and all of it is in the checkpoint.
    Epoch {
        /// What the curve says about it.
        row: &'a Row,
        /// Whether no epoch before had a better validation loss.
        best: bool,
    },
}

/// Where a training keeps its files, and what it runs on.
#[derive(Debug, Clone)]
pub struct Run {
    /// The model file. The checkpoint and the curve are beside it, with other endings.
    pub model: PathBuf,
    /// Whether to go on from the checkpoint.
    pub resume: bool,
    /// Threads; there is use for as many as there are shards. The result does not depend on them.
    pub threads: usize,
    /// What the card says of the circumstances.
    pub stamp: Stamp,
    /// Recorded tracks, for recipes that learn from them.
    pub tracks: Option<Tracks>,
}

/// Tracks to learn from: states `x, y, vx, vy` at equal steps of time, in m and m/s.
pub type Tracks = Arc<Vec<Vec<Vector4<f64>>>>;

/// Entries of the model card that only the caller knows. Empty ones stay empty.
#[derive(Debug, Clone, Default)]
pub struct Stamp {
    /// The day: `2026-01-31`.
    pub trained: String,
    /// The git revision of the program.
    pub revision: String,
    /// The licence of the weights.
    pub licence: String,
}

impl Run {
    /// A fresh training on all cores.
    pub fn new(model: impl Into<PathBuf>) -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        Self { model: model.into(), resume: false, threads, stamp: Stamp::default(), tracks: None }
    }

    /// The checkpoint: all that is needed to go on.
    pub fn checkpoint(&self) -> PathBuf {
        self.model.with_extension("checkpoint")
    }

    /// The curve: one JSON object for each epoch, each on its line.
    pub fn curve(&self) -> PathBuf {
        self.model.with_extension("curve.ndjson")
    }
}

/// How a training ended.
#[derive(Debug, Clone)]
pub struct Summary {
    /// The parameters with the best validation loss.
    pub best: ParameterSet,
    /// The parameters after the last epoch.
    pub last: ParameterSet,
    /// The rows of the curve, of all epochs.
    pub curve: Vec<Row>,
    /// The epoch of the best parameters, from 0.
    pub best_epoch: usize,
    /// Why it ended.
    pub end: End,
}

/// Why a training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// All epochs are done.
    Complete,
    /// The validation loss has not improved for long enough.
    Early,
    /// The observer asked for it.
    Stopped,
}

/// Trains a task as a recipe says.
///
/// After each epoch the model is validated. The model file is written when it is the best so far, then the
/// checkpoint and the curve; each appears whole or not at all, so a training that is killed, or whose disk is
/// full, leaves the last good model, and goes on from the last whole epoch with `resume`. All that is random
/// follows from the seed, the epoch and the number of the sample, so a training that was interrupted gives
/// the same weights, bit for bit, as one that was not.
///
/// The observer is called after each batch and epoch, and may end the training.
///
/// # Errors
///
/// If the model file cannot be written (found out before the first step), the checkpoint is missing, damaged
/// or of another recipe, the task fails, or no batch of an epoch had a finite loss and gradient.
pub fn train<K: Kind, T: Task>(
    recipe: &Recipe<K>,
    task: &T,
    initial: ParameterSet,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    for path in [run.model.clone(), run.checkpoint(), run.curve()] {
        store::probe(&path)?;
    }
    for split in [Split::Training, Split::Validation] {
        if task.samples(split) == 0 {
            return Err(TrainError::Data(format!("there is no sample for {split}")));
        }
    }
    recipe.optimiser.validate_groups(&initial)?;
    let state = if run.resume {
        Checkpoint::read(&run.checkpoint(), &recipe.hash(), &initial, &recipe.optimiser)?
    } else {
        Checkpoint::fresh(AdamW::new(recipe.optimiser.clone(), &initial), initial)
    };
    let schedule = &recipe.schedule;
    let card = started_card(recipe, task, run);
    let mut trainer = Trainer { seed: recipe.seed, card, schedule, task, run, state };
    let end = trainer.epochs(observer)?;
    let Checkpoint { parameters: last, best, best_epoch, curve, .. } = trainer.state;
    Ok(Summary { best, last, curve, best_epoch, end })
}

/// The card of the model, with all that is known before the first epoch.
fn started_card<K: Kind, T: Task>(recipe: &Recipe<K>, task: &T, run: &Run) -> Card {
    let samples = |split| task.samples(split) as u64;
    Card {
        name: recipe.name.clone(),
        recipe: recipe.text().to_owned(),
        recipe_hash: recipe.hash(),
        seed: recipe.seed,
        data: DataSizes { training: samples(Split::Training), validation: samples(Split::Validation) },
        note: recipe.note.clone(),
        revision: run.stamp.revision.clone(),
        trained: run.stamp.trained.clone(),
        licence: run.stamp.licence.clone(),
        ..task.card()
    }
}

struct Trainer<'a, T: Task> {
    seed: u64,
    card: Card,
    schedule: &'a ScheduleConfig,
    task: &'a T,
    run: &'a Run,
    state: Checkpoint,
}

impl<T: Task> Trainer<'_, T> {
    fn epochs(
        &mut self,
        observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    ) -> Result<End, TrainError> {
        let patience = self.schedule.patience;
        while self.state.curve.len() < self.schedule.epochs {
            if patience > 0 && self.state.stale() >= patience {
                return Ok(End::Early);
            }
            let started = Instant::now();
            let epoch = self.state.curve.len();
            let ControlFlow::Continue((tally, rate)) = self.epoch(epoch, observer)? else {
                return Ok(End::Stopped);
            };
            let validation = self.validate()?;
            let seconds = started.elapsed().as_secs_f64();
            let row = Row::new(epoch, &tally, &validation, rate, seconds);
            let best = self.state.finish(row.clone());
            self.save(&row, best)?;
            if observer(Progress::Epoch { row: &row, best }).is_break() {
                return Ok(End::Stopped);
            }
        }
        Ok(End::Complete)
    }

    /// The batches of an epoch: the samples in an order that follows from the seed and the epoch.
    fn batches(&self, epoch: usize) -> Vec<Vec<u64>> {
        let mut samples: Vec<u64> = (0..self.task.samples(Split::Training) as u64).collect();
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(epoch as u64);
        samples.shuffle(&mut random);
        samples.chunks(self.schedule.batch).map(<[u64]>::to_vec).collect()
    }

    /// One epoch of updates: what was lost, and the last learning rate.
    fn epoch(
        &mut self,
        epoch: usize,
        observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
    ) -> Result<ControlFlow<(), (Tally, f64)>, TrainError> {
        let batches = self.batches(epoch);
        let mut whole = Tally::default();
        let mut rate = 0.0;
        for (done, samples) in batches.iter().enumerate() {
            let draw = Draw { split: Split::Training, epoch, seed: self.seed, samples };
            let mut shards = Shards::new(self.task, draw, self.schedule.shards, self.run.threads)?;
            let mut tally = Tally::default();
            for window in 0..shards.windows() {
                tally.merge(shards.gradients(window, &self.state.parameters)?);
                if self.schedule.update == UpdateEach::Window {
                    rate = self.update(&mut tally, batches.len() * shards.windows());
                    whole.merge(std::mem::take(&mut tally));
                }
            }
            if self.schedule.update == UpdateEach::Batch {
                rate = self.update(&mut tally, batches.len());
                whole.merge(tally);
            }
            let progress =
                Progress::Batch { epoch, done: done + 1, batches: batches.len(), loss: whole.mean(), rate };
            if observer(progress).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        if whole.updates == 0 {
            return Err(TrainError::Diverged { epoch, batches: batches.len() });
        }
        Ok(ControlFlow::Continue((whole, rate)))
    }

    /// Changes the parameters by the mean gradient of a tally, or skips and counts it if it is not finite.
    /// Gives the learning rate.
    fn update(&mut self, tally: &mut Tally, updates_per_epoch: usize) -> f64 {
        let cosine = Cosine {
            top: self.state.optimiser.top_rate(),
            floor: self.schedule.floor,
            warm_up: self.schedule.warm_up as u64,
            total: (updates_per_epoch * self.schedule.epochs) as u64,
        };
        // The schedule goes on over skipped updates too, so it counts attempts.
        let rate = cosine.rate(self.state.attempts);
        self.state.attempts += 1;
        let gradients = tally.take_gradients();
        let norm = match tally.is_finite() {
            true => self.state.optimiser.step(&mut self.state.parameters, &gradients, rate),
            false => None,
        };
        match norm {
            Some(norm) => tally.accepted(norm),
            None => tally.refused(),
        }
        rate
    }

    fn validate(&self) -> Result<Tally, TrainError> {
        let samples: Vec<u64> = (0..self.task.samples(Split::Validation) as u64).collect();
        let mut whole = Tally::default();
        for samples in samples.chunks(self.schedule.batch) {
            let draw = Draw { split: Split::Validation, epoch: 0, seed: self.seed, samples };
            let mut shards = Shards::new(self.task, draw, self.schedule.shards, self.run.threads)?;
            for window in 0..shards.windows() {
                whole.merge(shards.values(window, &self.state.parameters)?);
            }
        }
        Ok(whole)
    }

    /// The parameters as a model, with what is known of them after this epoch.
    fn model(&self, row: &Row) -> Result<Model, TrainError> {
        let mut card = self.card.clone();
        card.epochs = (row.epoch + 1) as u32;
        let parts = row.validation_parts.iter().map(|(name, value)| (format!("validation_{name}"), *value));
        let losses = [("training_loss".to_owned(), row.loss), ("validation_loss".to_owned(), row.validation)];
        card.metrics.extend(losses.into_iter().chain(parts).filter_map(|(name, value)| Some((name, value?))));
        let mut tensors = self.state.parameters.tensors();
        tensors.extend(self.task.frozen());
        Ok(Model::new(card, tensors)?)
    }

    /// The model if it is the best, then the checkpoint, then the curve.
    fn save(&self, row: &Row, best: bool) -> Result<(), TrainError> {
        if best {
            self.model(row)?.save(&self.run.model)?;
        }
        self.state.write(&self.run.checkpoint(), &self.card.recipe_hash)?;
        let lines: Vec<String> = self.state.curve.iter().map(Row::line).collect();
        store::write(&self.run.curve(), lines.concat().as_bytes())
    }
}
