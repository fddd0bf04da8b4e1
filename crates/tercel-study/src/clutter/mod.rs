//! The studies of many manoeuvring objects in clutter: methods, and how they are compared on simulated scenes.

mod example;
mod experiment;
pub mod methods;
mod recording;
mod recovery;
mod score;
pub mod tables;

pub use experiment::{ClutterExperiment, SEED};
pub(crate) use experiment::{drawn, plan_of};
pub use recording::{Method, Recording, Reported, Tracked};
pub use recovery::recovery;
pub(crate) use score::score;
pub use score::{CUTOFF, METRICS};
