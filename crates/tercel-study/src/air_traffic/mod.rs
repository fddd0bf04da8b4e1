//! The studies of one manoeuvring aircraft: methods, and how they are compared on simulated flights.

mod example;
mod experiment;
pub mod methods;
mod published;
mod recording;
mod score;
mod simulate;
pub mod tables;

pub use experiment::{AirTrafficExperiment, SEED};
pub use published::{PUBLISHED, PublishedFigures};
pub use recording::{Method, Recording, StepEstimate};
pub use score::{METRICS, WARM_UP};
pub use simulate::Simulation;
pub use tercel_sim::air_traffic::{AirTraffic, NAMES as POPULATIONS};
