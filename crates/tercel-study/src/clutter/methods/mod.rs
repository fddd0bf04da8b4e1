//! The methods that the clutter studies compare: filters in trackers.
//!
//! A method is a filter in a tracker, `filter-tracker`:
//!
//! | filter | what it is |
//! |---|---|
//! | `gm` | one straight motion |
//! | `imm` | ours: straight, turns at ±5 and ±10 °/s, agile |
//! | `imm..-paper` | the three modes of the publication with its transitions and noises, the acceleration known |
//! | `lnn` | motion learned by a liquid network: [`LiquidKalman`](tercel_neural::filter::LiquidKalman) |
//! | `lnn..-paper` | the same as published: no memory, fixed noise |
//! | `cfc` | the same with liquid neurons in closed form |
//! | `gru`, `mlp` | controls of the same size: gated units, and no memory |
//! | `smc-imm`, `smc-lnn` | the modes of `imm`, and the motion of `cfc` (`-paper`: that of `lnn`), with 500 particles |
//! | `lnn-imm` | a wide bank of turns whose estimate a liquid network corrects: [`NeuralImm`](tercel_neural::filter::NeuralImm) |
//! | `neural` | its control: the same with gated units |
//! | `wide` | that bank without a network |
//!
//! | tracker | |
//! |---|---|
//! | `phd` | [`Phd`](tercel_core::multi::Phd) |
//! | `member` | [`MultiBernoulli`](tercel_core::multi::MultiBernoulli) |
//! | `jpda` | [`Jpda`](tercel_core::multi::Jpda); as `-paper` confirmed by three hits |
//! | `pmbm` | [`Pmbm`](tercel_core::multi::Pmbm) |
//!
//! The suffix `-paper` is the configuration of the publication, as far as it is stated; a plain name is what we would fly. One
//! configuration serves every scenario. All know the accuracy of the sensor, its detection probability and the density of
//! clutter.
//!
//! A further method is a further pair: [`Tracked`] takes any filter of four components and any tracker.

mod filters;
pub(crate) mod trackers;

use super::{Method, Tracked};
use tercel_neural::shipped::Models;

use crate::error::StudyError;

/// Names of all methods, in the order in which they are best read.
pub const METHODS: [&str; 29] = [
    "gm-phd",
    "imm-phd-paper",
    "lnn-phd-paper",
    "imm-phd",
    "lnn-phd",
    "cfc-phd",
    "gru-phd",
    "mlp-phd",
    "lnn-imm-phd",
    "neural-phd",
    "smc-imm-phd",
    "smc-lnn-phd-paper",
    "smc-lnn-phd",
    "imm-member",
    "lnn-member-paper",
    "lnn-member",
    "lnn-imm-member",
    "smc-imm-member",
    "smc-lnn-member-paper",
    "smc-lnn-member",
    "imm-jpda-paper",
    "imm-jpda",
    "neural-jpda",
    "imm-pmbm",
    "wide-pmbm",
    "gru-pmbm",
    "lnn-pmbm",
    "lnn-imm-pmbm",
    "neural-pmbm",
];

/// The method of that name.
///
/// # Errors
/// When there is no such method.
pub fn method(name: &str, models: &Models) -> Result<Box<dyn Method>, StudyError> {
    use filters::{bank, cloud, published, straight};
    use trackers::{jpda, jpda_paper, multi_bernoulli, phd, pmbm};
    let liquid = |model| filters::liquid(models, model);
    let liquid_cloud = |model| filters::liquid_cloud(models, model);
    let neural = || filters::neural(models, "neural-imm-position");
    let liquid_bank = || filters::neural(models, "neural-imm-liquid");
    Ok(match name {
        "gm-phd" => Box::new(Tracked::new(straight, phd)),
        "imm-phd-paper" => Box::new(Tracked::new(published, phd)),
        "lnn-phd-paper" => Box::new(Tracked::new(liquid("liquid-paper")?, phd)),
        "imm-phd" => Box::new(Tracked::new(bank, phd)),
        "lnn-phd" => Box::new(Tracked::new(liquid("liquid")?, phd)),
        "cfc-phd" => Box::new(Tracked::new(liquid("liquid-cfc")?, phd)),
        "gru-phd" => Box::new(Tracked::new(liquid("liquid-gru")?, phd)),
        "mlp-phd" => Box::new(Tracked::new(liquid("liquid-mlp")?, phd)),
        "lnn-imm-phd" => Box::new(Tracked::new(liquid_bank()?, phd)),
        "neural-phd" => Box::new(Tracked::new(neural()?, phd)),
        "smc-imm-phd" => Box::new(Tracked::new(cloud, phd)),
        "smc-lnn-phd-paper" => Box::new(Tracked::new(liquid_cloud("liquid-paper")?, phd)),
        "smc-lnn-phd" => Box::new(Tracked::new(liquid_cloud("liquid-cfc")?, phd)),
        "imm-member" => Box::new(Tracked::new(bank, multi_bernoulli)),
        "lnn-member-paper" => Box::new(Tracked::new(liquid("liquid-paper")?, multi_bernoulli)),
        "lnn-member" => Box::new(Tracked::new(liquid("liquid")?, multi_bernoulli)),
        "lnn-imm-member" => Box::new(Tracked::new(liquid_bank()?, multi_bernoulli)),
        "smc-imm-member" => Box::new(Tracked::new(cloud, multi_bernoulli)),
        "smc-lnn-member-paper" => Box::new(Tracked::new(liquid_cloud("liquid-paper")?, multi_bernoulli)),
        "smc-lnn-member" => Box::new(Tracked::new(liquid_cloud("liquid-cfc")?, multi_bernoulli)),
        "imm-jpda-paper" => Box::new(Tracked::new(published, jpda_paper)),
        "imm-jpda" => Box::new(Tracked::new(bank, jpda)),
        "neural-jpda" => Box::new(Tracked::new(neural()?, jpda)),
        "imm-pmbm" => Box::new(Tracked::new(bank, pmbm)),
        "wide-pmbm" => Box::new(Tracked::new(filters::wide(models)?, pmbm)),
        "gru-pmbm" => Box::new(Tracked::new(liquid("liquid-gru")?, pmbm)),
        "lnn-pmbm" => Box::new(Tracked::new(liquid("liquid")?, pmbm)),
        "lnn-imm-pmbm" => Box::new(Tracked::new(liquid_bank()?, pmbm)),
        "neural-pmbm" => Box::new(Tracked::new(neural()?, pmbm)),
        _ => {
            let known = METHODS.join(", ");
            return Err(StudyError::UnknownMethod { study: "clutter", name: name.to_owned(), known });
        }
    })
}
