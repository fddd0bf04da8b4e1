//! Training.
pub mod backend;
mod check;
mod error;
mod hash;
pub mod layer;
pub mod optimiser;
mod parameters;

pub use error::TrainError;
pub use parameters::{Initial, Parameter, ParameterId, ParameterSet, Weights};
