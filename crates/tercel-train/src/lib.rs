//! Training.
pub mod backend;
mod error;
mod hash;
pub mod layer;
mod parameters;

pub use error::TrainError;
pub use parameters::{Initial, Parameter, ParameterId, ParameterSet, Weights};
