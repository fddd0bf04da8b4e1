//! Methods that follow one manoeuvring aircraft, compared on simulated flights.

pub mod methods;
mod recording;

pub use recording::{Method, Recording, StepEstimate};
