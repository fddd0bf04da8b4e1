//! Filters whose weak parts are learned. Each is a [`tercel_core::filter::Filter`], so every tracker takes it.
//!
//! | filter | learns | belief |
//! |---|---|---|
//! | [`KalmanNet`] | the gain | Gaussian, last differences, memory of a recurrent network |
//! | [`EnsKNets`] | the mixture of KalmanNets, with or without attention | that of each KalmanNet, memories of two branches |
//! | [`NeuralImm`] | the mixture of a bank of turns | that of the bank, memory of a recurrent network |
//!
//! A network is loaded once and shared: filters hold it behind an [`Arc`](std::sync::Arc) and are small values beside it, so
//! one may be built for each scan of a moving sensor. What a network remembers of an object is in the belief, as a
//! [`Memory`].

mod ens_knets;
mod kalman_net;
mod memory;
mod neural_imm;

pub use ens_knets::{
    Attention, BranchHyper, EnsKNets, EnsKNetsBelief, EnsKNetsHyper, EnsembleNetwork, Evidence,
    Normalisation, OfflineEnsKNets, Sign,
};
pub use kalman_net::{
    Architecture, Covariance, Feature, GainNetwork, KalmanNet, KalmanNetBelief, KalmanNetHyper,
};
pub use memory::Memory;
pub use neural_imm::{BankNetwork, NeuralImm, NeuralImmBelief, NeuralImmHyper, Outlook};
