//! Checkpoints: all that a training needs to go on as if it had not been interrupted.

use std::collections::HashMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::curve::Row;
use crate::optimiser::{AdamW, OptimiserConfig};
use crate::store::{self, Named};
use crate::{ParameterSet, TrainError};

/// The state of a training after some epochs.
#[derive(Debug, Clone)]
pub(super) struct Checkpoint {
    pub(super) parameters: ParameterSet,
    pub(super) optimiser: AdamW,
    /// Updates that were made or skipped.
    pub(super) attempts: u64,
    pub(super) best: ParameterSet,
    pub(super) best_epoch: usize,
    /// The validation loss of the best epoch.
    best_loss: f64,
    pub(super) curve: Vec<Row>,
}

/// What of a checkpoint is not a tensor. Numbers that must come back bit for bit are integers.
#[derive(Serialize, Deserialize)]
struct Header {
    format: u32,
    recipe: String,
    updates: u64,
    attempts: u64,
    best_epoch: usize,
    best_loss: u64,
    curve: Vec<String>,
}

const FORMAT: u32 = 1;
const KEY: &str = "training";

impl Checkpoint {
    /// The state before the first epoch.
    pub(super) fn fresh(optimiser: AdamW, parameters: ParameterSet) -> Self {
        let best = parameters.clone();
        Self {
            parameters,
            optimiser,
            attempts: 0,
            best,
            best_epoch: 0,
            best_loss: f64::INFINITY,
            curve: Vec::new(),
        }
    }

    /// Takes note of an epoch. Gives whether its validation loss is the best.
    pub(super) fn finish(&mut self, row: Row) -> bool {
        let better = row.validation.is_some_and(|loss| loss < self.best_loss);
        if let (true, Some(loss)) = (better, row.validation) {
            self.best_loss = loss;
            self.best_epoch = row.epoch;
            self.best = self.parameters.clone();
        }
        self.curve.push(row);
        better
    }

    /// Epochs since the best one.
    pub(super) fn stale(&self) -> usize {
        match self.best_loss.is_finite() {
            true => self.curve.len().saturating_sub(self.best_epoch + 1),
            false => self.curve.len(),
        }
    }

    pub(super) fn write(&self, path: &Path, recipe: &str) -> Result<(), TrainError> {
        let header = Header {
            format: FORMAT,
            recipe: recipe.to_owned(),
            updates: self.optimiser.updates,
            attempts: self.attempts,
            best_epoch: self.best_epoch,
            best_loss: self.best_loss.to_bits(),
            curve: self.curve.iter().map(Row::line).collect(),
        };
        let fault = |error: serde_json::Error| TrainError::Checkpoint {
            path: path.to_owned(),
            problem: error.to_string(),
        };
        let header = serde_json::to_string(&header).map_err(fault)?;
        let moments = |prefix: &str, moments: &[Vec<f32>]| -> Vec<Named> {
            let entries = self.parameters.iter().zip(moments);
            entries
                .map(|(entry, values)| {
                    (format!("{prefix}{}", entry.name()), entry.shape().to_vec(), values.clone())
                })
                .collect()
        };
        let mut tensors: Vec<Named> = self.parameters.iter().map(|entry| entry.to_named("last/")).collect();
        tensors.extend(self.best.iter().map(|entry| entry.to_named("best/")));
        tensors.extend(moments("first/", &self.optimiser.first));
        tensors.extend(moments("second/", &self.optimiser.second));
        store::write(path, &store::pack(tensors, HashMap::from([(KEY.to_owned(), header)]))?)
    }

    /// Reads the state of a training with the same recipe.
    pub(super) fn read(
        path: &Path,
        recipe: &str,
        layout: &ParameterSet,
        config: &OptimiserConfig,
    ) -> Result<Self, TrainError> {
        let fault = |problem: String| TrainError::Checkpoint { path: path.to_owned(), problem };
        let bytes = std::fs::read(path).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => fault("there is none; start without resuming".to_owned()),
            _ => TrainError::File { path: path.to_owned(), source: error },
        })?;
        let damaged = |problem: String| fault(format!("it is damaged ({problem}); start without resuming"));
        let (tensors, metadata) = store::unpack(&bytes).map_err(damaged)?;
        let header =
            metadata.get(KEY).ok_or_else(|| fault("it is not a checkpoint of a training".to_owned()))?;
        let header: Header = serde_json::from_str(header).map_err(|error| damaged(error.to_string()))?;
        if header.format != FORMAT {
            return Err(fault(format!("it has format {}, but this program reads {FORMAT}", header.format)));
        }
        if header.recipe != recipe {
            let problem = format!(
                "it belongs to a recipe with the hash {}, but this one has {recipe}; a recipe that was changed is a new \
                 training",
                header.recipe
            );
            return Err(fault(problem));
        }
        let part = |prefix: &str| -> Result<ParameterSet, TrainError> {
            let named: Vec<Named> = tensors
                .iter()
                .filter_map(|(name, shape, values)| {
                    Some((name.strip_prefix(prefix)?.to_owned(), shape.clone(), values.clone()))
                })
                .collect();
            let mut set = layout.clone();
            set.assign(&named).map_err(|error| damaged(error.to_string()))?;
            Ok(set)
        };
        let moments = |set: ParameterSet| set.iter().map(|entry| entry.values().to_vec()).collect();
        let mut optimiser = AdamW::new(config.clone(), layout);
        optimiser.updates = header.updates;
        optimiser.first = moments(part("first/")?);
        optimiser.second = moments(part("second/")?);
        let rows: Result<Vec<Row>, _> = header.curve.iter().map(|line| serde_json::from_str(line)).collect();
        Ok(Self {
            parameters: part("last/")?,
            optimiser,
            attempts: header.attempts,
            best: part("best/")?,
            best_epoch: header.best_epoch,
            best_loss: f64::from_bits(header.best_loss),
            curve: rows.map_err(|error| damaged(error.to_string()))?,
        })
    }
}
