//! What stops a study.

use std::path::PathBuf;

use tercel_core::error::FilterError;
use tercel_data::DataError;
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
    /// A folder holds no recordings of the expected format.
    #[error("{} holds no recording named {expected}", path.display())]
    NoRecordings {
        /// The folder.
        path: PathBuf,
        /// What was looked for.
        expected: &'static str,
    },
    /// A recording has no truth to score against.
    #[error("recording {recording} has no truth beside it; expected a file {recording}_groundTruth.json")]
    NoTruth {
        /// The recording.
        recording: String,
    },
    /// A table could not be read or written.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A configuration or a scan was refused.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// A score could not be computed.
    #[error(transparent)]
    Score(#[from] FilterError),
    /// A report could not be made.
    #[error(transparent)]
    Report(#[from] ReportError),
}
