//! The tasks: one module for each kind of model.

pub mod deep_mtt;
pub mod ens_knets;
pub mod extent_net;
pub mod flights;
mod gaussians;
pub mod kalman_net;
pub mod liquid;
pub mod mnemonic;
pub mod neural_imm;
pub mod plots;
#[cfg(test)]
mod repository;
pub mod residual;
pub mod rmm_net;
pub mod tr_mtt;

use std::ops::ControlFlow;

use crate::TrainError;
use crate::check::refused;
use crate::recipe;
use crate::trainer::{Progress, Run, Summary};

/// The kinds of recipes.
pub const KINDS: [&str; 9] = [
    <deep_mtt::DeepMttKind as recipe::Kind>::NAME,
    <ens_knets::EnsKNetsKind as recipe::Kind>::NAME,
    <extent_net::ExtentNetKind as recipe::Kind>::NAME,
    <kalman_net::KalmanNetKind as recipe::Kind>::NAME,
    <liquid::LiquidKind as recipe::Kind>::NAME,
    <mnemonic::MnemonicKind as recipe::Kind>::NAME,
    <neural_imm::NeuralImmKind as recipe::Kind>::NAME,
    <rmm_net::RmmNetKind as recipe::Kind>::NAME,
    <tr_mtt::TrMttKind as recipe::Kind>::NAME,
];

/// Trains what a recipe describes; its kind chooses the task.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    recipe: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    match recipe::kind(recipe)?.as_str() {
        "deep-mtt" => deep_mtt::train(recipe, run, observer),
        "ens-knets" => ens_knets::train(recipe, run, observer),
        "extent-net" => extent_net::train(recipe, run, observer),
        "kalman-net" => kalman_net::train(recipe, run, observer),
        "liquid" => liquid::train(recipe, run, observer),
        "mnemonic" => mnemonic::train(recipe, run, observer),
        "neural-imm" => neural_imm::train(recipe, run, observer),
        "rmmnet" => rmm_net::train(recipe, run, observer),
        "tr-mtt" => tr_mtt::train(recipe, run, observer),
        other => {
            Err(refused("kind", format!("{other:?}"), format!("there are the kinds {}", KINDS.join(", "))))
        }
    }
}
