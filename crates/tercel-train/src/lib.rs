//! Training.
pub mod backend;
mod check;
mod error;
mod hash;
pub mod kalman;
pub mod layer;
pub mod optimiser;
mod parameters;

pub mod recipe;
mod store;
pub mod task;
pub mod trainer;

pub use error::TrainError;
pub use parameters::{Initial, Parameter, ParameterId, ParameterSet, Weights};
