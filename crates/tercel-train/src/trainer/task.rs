//! What is trained, as the trainer sees it.

use std::collections::BTreeMap;
use std::fmt;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tercel_neural::Card;

use crate::backend::Tensor;
use crate::{TrainError, Weights};

/// Which data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Split {
    /// What the parameters are fitted to.
    Training,
    /// What chooses among them.
    Validation,
}

impl fmt::Display for Split {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Training => "training",
            Self::Validation => "validation",
        })
    }
}

/// Samples that a task is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Draw<'a> {
    /// Which data.
    pub split: Split,
    /// The epoch, from 0; of validation always 0, so that epochs are compared on the same data.
    pub epoch: usize,
    /// The seed of the recipe.
    pub seed: u64,
    /// The numbers of the samples, below what [`Task::samples`] says.
    pub samples: &'a [u64],
}

impl Draw<'_> {
    /// Random numbers for one sample, for what is drawn anew in each epoch: noise, missed measurements,
    /// dropout.
    pub fn random(&self, sample: u64) -> ChaCha8Rng {
        let split = match self.split {
            Split::Training => 0x7261_696e,
            Split::Validation => 0x7661_6c69,
        };
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ split);
        random.set_stream((self.epoch as u64) << 40 ^ sample);
        random
    }
}

/// The loss of a batch, or of a window of it.
#[derive(Debug, Clone)]
pub struct Loss {
    /// The mean over its terms, of one element: what is minimised.
    pub value: Tensor,
    /// The number of terms. Shards of a batch are weighed by it.
    pub terms: f64,
    /// Means over the same terms, under names, for the curve.
    pub parts: Vec<(&'static str, f64)>,
}

/// A task: a model, its data and its loss.
///
/// A task is a plain value that any number of threads read at a time. The crate's documentation has an
/// example.
pub trait Task: Sync {
    /// The data of one shard of a batch.
    type Batch: Send;
    /// What is carried from one window of truncated back-propagation to the next: detached states. `()`
    /// without windows.
    type Memory: Send;

    /// The card of the model as far as the task knows it: kind, state, sizes and options, scales. The trainer
    /// fills in the rest.
    fn card(&self) -> Card;

    /// Tensors of the model that are not trained: those of networks that this one builds on.
    fn frozen(&self) -> BTreeMap<String, tercel_neural::Tensor> {
        BTreeMap::new()
    }

    /// The number of samples of a split.
    fn samples(&self, split: Split) -> usize;

    /// The data of some samples. Must depend on nothing but the draw.
    ///
    /// # Errors
    ///
    /// If data cannot be made or read.
    fn batch(&self, draw: Draw<'_>) -> Result<Self::Batch, TrainError>;

    /// The number of windows into which a batch is cut; the same for all batches of a split.
    fn windows(&self, _batch: &Self::Batch) -> usize {
        1
    }

    /// The loss of a window.
    ///
    /// The memory is `None` in the first window. What is left in it is given to the next one, of the same
    /// batch; it must be detached, or the gradient would reach into a graph that is gone.
    ///
    /// # Errors
    ///
    /// If the data does not fit the model.
    fn loss(
        &self,
        weights: &Weights,
        batch: &Self::Batch,
        window: usize,
        memory: &mut Option<Self::Memory>,
    ) -> Result<Loss, TrainError>;
}
