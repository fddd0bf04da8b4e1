//! Filters whose weak parts are learned. Each is a [`tercel_core::filter::Filter`], so every tracker takes it.
//!
//! | filter | learns | belief |
//! |---|---|---|
//! | [`KalmanNet`] | the gain | Gaussian, last differences, memory of a recurrent network |
//! | [`NeuralImm`] | the mixture of a bank of turns | that of the bank, memory of a recurrent network |
//!
//! A network is loaded once and shared: filters hold it behind an [`Arc`](std::sync::Arc) and are small values beside it, so
//! one may be built for each scan of a moving sensor. What a network remembers of an object is in the belief, as a
//! [`Memory`].

mod kalman_net;
mod memory;
mod neural_imm;

pub use kalman_net::{
    Architecture, Covariance, Feature, GainNetwork, KalmanNet, KalmanNetBelief, KalmanNetHyper,
};
pub use memory::Memory;
pub use neural_imm::{BankNetwork, NeuralImm, NeuralImmBelief, NeuralImmHyper, Outlook};

use crate::error::ModelError;
use crate::model::Model;

/// The kinds of models that there are filters for.
pub const KINDS: [&str; 2] = ["kalman-net", "neural-imm"];

/// Accepts a model of which a filter can be made.
///
/// # Errors
/// When its kind is none of [`KINDS`], or its state, options or tensors are not those of its kind.
pub fn check(model: &Model) -> Result<(), ModelError> {
    match model.card().kind.as_str() {
        "kalman-net" => GainNetwork::from_model(model).map(drop),
        "neural-imm" => BankNetwork::from_model(model).map(drop),
        other => Err(ModelError::Kind {
            file: model.file().clone(),
            found: other.to_owned(),
            expected: KINDS.join("`, `"),
        }),
    }
}
