//! The study `paris`: aircraft around Paris as they flew, seen by a simulated radar.

mod experiment;
pub mod methods;
mod traffic;

pub use experiment::{CUTOFF, ParisExperiment, SEED};
pub use traffic::Traffic;
