//! The studies of extended objects: methods, and how they are compared.

mod example;
mod experiment;
pub mod methods;
mod published;
mod recording;
mod scene;
mod score;
mod settings;
pub(crate) mod tables;

pub use experiment::{ExtendedExperiment, SEED};
pub use published::{PUBLISHED, PublishedRow};
pub use recording::{Method, Recording, StepEstimate};
pub use scene::{Aircraft, Held, Scene};
pub use score::METRICS;
