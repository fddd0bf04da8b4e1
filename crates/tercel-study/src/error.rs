//! What stops a study.

use std::path::PathBuf;

use tercel_core::error::FilterError;
use tercel_data::DataError;
use tercel_neural::ModelError;
use tercel_pipeline::PipelineError;

use crate::report::ReportError;

/// A study that could not be carried out.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// There is no study of this name.
    #[error("there is no study `{name}`; the studies are: {known}")]
    Unknown {
        /// The name that was given.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// There is no method of this name in the study.
    #[error("the study `{study}` has no method `{name}`; its methods are: {known}")]
    UnknownMethod {
        /// The study.
        study: &'static str,
        /// The name that was given.
        name: String,
        /// The names that exist.
        known: String,
    },
    /// A folder could not be listed or written to.
    #[error("cannot use the folder {}: {source}\n  help: say where the recordings are with --data DIR", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Results could not be written.
    #[error("cannot write to {}: {source}", path.display())]
    Output {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A folder holds no recordings of the expected format.
    #[error("{} holds no recording named {expected}", path.display())]
    NoRecordings {
        /// The folder.
        path: PathBuf,
        /// What was looked for.
        expected: &'static str,
    },
    /// A file or folder does not hold the recorded tracks that a study needs.
    #[error("{}: {problem}", path.display())]
    Tracks {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A recording has no truth to score against.
    #[error("recording {recording} has no truth beside it; expected a file {recording}_groundTruth.json")]
    NoTruth {
        /// The recording.
        recording: String,
    },
    /// A number or name that a study cannot use.
    #[error("{0}")]
    Option(String),
    /// The threads of a study could not be started.
    #[error("cannot start the threads of the study: {0}")]
    Threads(String),
    /// A file is no shard, or one that cannot be used.
    #[error("{}: {problem}", path.display())]
    Shard {
        /// The file, or a folder without any.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// There is nothing to merge.
    #[error(
        "there are no shards to merge\n  help: name the files that `tercel study NAME --shard 1/4 -o DIR` wrote, or DIR"
    )]
    NoShards,
    /// Two shards do not belong to the same study.
    #[error("{} and {} cannot be joined: {difference}", first.display(), second.display())]
    DifferentShards {
        /// A file.
        first: PathBuf,
        /// Another file.
        second: PathBuf,
        /// In what they differ.
        difference: String,
    },
    /// A shard is there twice.
    #[error("{} and {} are both shard {shard}; each must be there once", first.display(), second.display())]
    ShardTwice {
        /// A file.
        first: PathBuf,
        /// Another file.
        second: PathBuf,
        /// The shard that they both are.
        shard: String,
    },
    /// Shards are missing.
    #[error("the study {study} is not complete: shard {missing} is missing")]
    MissingShards {
        /// The study.
        study: String,
        /// The missing shards.
        missing: String,
    },
    /// A scenario cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] tercel_sim::SimulationError),
    /// A table could not be read or written.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A configuration or a scan was refused.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// A model could not be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A score could not be computed.
    #[error(transparent)]
    Score(#[from] FilterError),
    /// A report could not be made.
    #[error(transparent)]
    Report(#[from] ReportError),
}
