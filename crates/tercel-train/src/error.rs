//! What can go wrong before and during a training.

use std::path::PathBuf;

/// Why a training cannot start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A recipe that does not parse, or has a key or value that is not understood.
    #[error("recipe: {0}")]
    Recipe(String),
    /// A value of the recipe that parses but makes no sense.
    #[error("recipe: {key} is {value}, but {expected}")]
    Value {
        /// The key, with its section.
        key: String,
        /// The value that was given.
        value: String,
        /// What would make sense.
        expected: String,
    },
    /// A parameter that was added twice or with an impossible shape, which is a mistake in a model.
    #[error("parameter {name}: {problem}")]
    Parameter {
        /// The name of the parameter.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Data that a task cannot make or read.
    #[error("training data: {0}")]
    Data(String),
    /// A file that cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A model that cannot be written or read.
    #[error(transparent)]
    Model(#[from] tercel_neural::ModelError),
    /// A checkpoint that cannot be resumed from.
    #[error("checkpoint {path}: {problem}", path = path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and what helps.
        problem: String,
    },
    /// A training in which nothing could be learned from a whole epoch.
    #[error(
        "epoch {epoch}: the loss or its gradient was not finite in all {batches} batches; a lower learning rate or a \
         smaller clipping norm may help"
    )]
    Diverged {
        /// The epoch, from 0.
        epoch: usize,
        /// The number of batches of the epoch.
        batches: usize,
    },
}
