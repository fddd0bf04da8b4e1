//! Filters whose weak parts are learned. Each is a [`tercel_core::filter::Filter`], so every tracker takes it.
//!
//! | filter | learns | belief |
//! |---|---|---|
//! | [`DeepMtt`] | residuals of an unscented filter, from a window | Gaussian, last estimates |
//! | [`ExtentNet`] | everything of an extended object, from what it saw and said | last estimate, extent, cells or keys and values |
//! | [`KalmanNet`] | the gain | Gaussian, last differences, memory of a recurrent network |
//! | [`EnsKNets`] | the mixture of KalmanNets, with or without attention | that of each KalmanNet, memories of two branches |
//! | [`LiquidKalman`] | the motion, in a network of continuous time or a control | Gaussian, memory of the network |
//! | [`MnemonicKalman`] | the prediction | Gaussian, memory of a recurrent network |
//! | [`RmmNet`] | motion, reading of the points and extent of an extended object | Gaussian, extent, memory of a recurrent network |
//! | [`TrMtt`] | everything, from a window of measurements | last measurements, Gaussian |
//! | [`NeuralImm`] | the mixture of a bank of turns | that of the bank, memory of a recurrent network |
//!
//! A network is loaded once and shared: filters hold it behind an [`Arc`](std::sync::Arc) and are small values beside it, so
//! one may be built for each scan of a moving sensor. What a network remembers of an object is in the belief, as a
//! [`Memory`].

mod deep_mtt;
mod ens_knets;
pub mod extent_net;
mod kalman_net;
mod liquid;
mod memory;
mod mnemonic;
mod neural_imm;
pub mod rmm_net;
mod sight;
mod tr_mtt;

pub use deep_mtt::{DeepMtt, DeepMttBelief, DeepMttHyper, ResidualNetwork};
pub use ens_knets::{
    Attention, BranchHyper, EnsKNets, EnsKNetsBelief, EnsKNetsHyper, EnsembleNetwork, Evidence,
    Normalisation, OfflineEnsKNets, Sign,
};
pub use extent_net::{ExtentNet, ExtentNetBelief, ExtentNetHyper, ExtentNetwork};
pub use kalman_net::{
    Architecture, Covariance, Feature, GainNetwork, KalmanNet, KalmanNetBelief, KalmanNetHyper,
};
pub use liquid::{
    Absolute, Derivative, Form, LiquidBelief, LiquidHyper, LiquidKalman, LiquidMemory, LiquidMotion,
    LiquidNetwork, Moved, Predictions, Residual, Seen, Span, surprise, widths,
};
pub use memory::Memory;
pub use mnemonic::{MnemonicBelief, MnemonicHyper, MnemonicKalman, MnemonicNetwork};
pub use neural_imm::{BankNetwork, NeuralImm, NeuralImmBelief, NeuralImmHyper, Outlook, Recurrence};
pub use rmm_net::{RmmNet, RmmNetBelief, RmmNetHyper, RmmNetwork};
pub use sight::Sight;
pub use tr_mtt::{Frame, TrMtt, TrMttBelief, TrMttHyper, TransformerNetwork};

use nalgebra::{Vector2, Vector4};
use serde::de::DeserializeOwned;
use tercel_core::error::FilterError;
use tercel_core::sensor::{Aged, Measurement, Sensor};

use crate::error::ModelError;
use crate::model::Model;

/// The state for which these filters are made.
const LABELS: [&str; 4] = ["x", "y", "vx", "vy"];

/// The kinds of models that there are filters for.
pub const KINDS: [&str; 9] = [
    "deep-mtt",
    "ens-knets",
    "extent-net",
    "kalman-net",
    "liquid",
    "mnemonic",
    "neural-imm",
    "rmmnet",
    "tr-mtt",
];

/// Accepts a model of which a filter can be made.
///
/// # Errors
/// When its kind is none of [`KINDS`], or its state, options or tensors are not those of its kind.
pub fn check(model: &Model) -> Result<(), ModelError> {
    match model.card().kind.as_str() {
        "deep-mtt" => ResidualNetwork::from_model(model).map(drop),
        "ens-knets" => EnsembleNetwork::from_model(model).map(drop),
        "extent-net" => ExtentNetwork::from_model(model).map(drop),
        "kalman-net" => GainNetwork::from_model(model).map(drop),
        "liquid" => LiquidNetwork::from_model(model).map(drop),
        "mnemonic" => MnemonicNetwork::from_model(model).map(drop),
        "neural-imm" => BankNetwork::from_model(model).map(drop),
        "rmmnet" => RmmNetwork::from_model(model).map(drop),
        "tr-mtt" => TransformerNetwork::from_model(model).map(drop),
        other => Err(ModelError::Kind {
            file: model.file().clone(),
            found: other.to_owned(),
            expected: KINDS.join("`, `"),
        }),
    }
}

/// What a sensor would read now of an object that it measured some seconds ago and that is in this state: networks compare the
/// readings of different scans.
fn present(
    sensor: &impl Sensor<4, 2>,
    measurement: &Measurement<2>,
    state: &Vector4<f64>,
) -> Result<Vector2<f64>, FilterError> {
    let then = Aged::new(sensor, measurement.age).expected(state);
    Ok(sensor.read(measurement, Some(&then))?.value + (sensor.expected(state) - then))
}

/// The options of a model's card, if they make sense.
fn hyper_of<H: DeserializeOwned>(
    model: &Model,
    check: impl Fn(&H) -> Result<(), String>,
) -> Result<H, ModelError> {
    let refused = |reason: String| ModelError::Hyper { file: model.file().clone(), reason };
    let table = model.card().hyper.clone();
    let hyper: H = table.try_into().map_err(|error: toml::de::Error| refused(error.to_string()))?;
    check(&hyper).map_err(refused)?;
    Ok(hyper)
}

/// Refuses sizes of which no layer can be made.
fn checked_sizes(sizes: &[(&str, usize)]) -> Result<(), String> {
    match sizes.iter().find(|(_, size)| !(1..=1 << 16).contains(size)) {
        Some((name, size)) => Err(format!("`{name}` is {size}; expected 1 to 65536")),
        None => Ok(()),
    }
}

/// Refuses what is not finite and above zero.
fn checked_positive(values: &[(&str, f64)]) -> Result<(), String> {
    match values.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some((name, value)) => Err(format!("`{name}` is {value}; expected a finite number above 0")),
        None => Ok(()),
    }
}
