//! The methods that the clutter studies compare: filters in trackers.
//!
//! | method | filter | tracker |
//! |---|---|---|
//! | `gm-phd` | one straight motion | [`Phd`](tercel_core::multi::Phd) |
//! | `imm-phd-paper` | the three modes of the publication with its transitions and noises, the acceleration known | `Phd` |
//! | `imm-phd` | ours: straight, turns at ±5 and ±10 °/s, agile | `Phd` |
//! | `imm-member` | the same | [`MultiBernoulli`](tercel_core::multi::MultiBernoulli) |
//! | `smc-imm-phd`, `smc-imm-member` | the same modes, 500 particles that jump between them | `Phd`, `MultiBernoulli` |
//! | `imm-jpda-paper` | the modes of the publication | [`Jpda`](tercel_core::multi::Jpda), confirmed by three hits |
//! | `imm-jpda` | ours | `Jpda` |
//! | `imm-pmbm` | ours | [`Pmbm`](tercel_core::multi::Pmbm) |
//!
//! The suffix `-paper` is the configuration of the publication, as far as it is stated; a plain name is what we would fly. One
//! configuration serves every scenario. All know the accuracy of the sensor, its detection probability and the density of
//! clutter.
//!
//! A further method is a further pair: [`Tracked`] takes any filter of four components and any tracker.

mod filters;
mod trackers;

use super::{Method, Tracked};
use crate::error::StudyError;

/// Names of all methods, in the order in which they are best read.
pub const METHODS: [&str; 9] = [
    "gm-phd",
    "imm-phd-paper",
    "imm-phd",
    "smc-imm-phd",
    "imm-member",
    "smc-imm-member",
    "imm-jpda-paper",
    "imm-jpda",
    "imm-pmbm",
];

/// The method of that name.
///
/// # Errors
/// When there is no such method.
pub fn method(name: &str) -> Result<Box<dyn Method>, StudyError> {
    Ok(match name {
        "gm-phd" => Box::new(Tracked::new(filters::straight, trackers::phd)),
        "imm-phd-paper" => Box::new(Tracked::new(filters::published, trackers::phd)),
        "imm-phd" => Box::new(Tracked::new(filters::bank, trackers::phd)),
        "imm-member" => Box::new(Tracked::new(filters::bank, trackers::multi_bernoulli)),
        "smc-imm-phd" => Box::new(Tracked::new(filters::cloud, trackers::phd)),
        "smc-imm-member" => Box::new(Tracked::new(filters::cloud, trackers::multi_bernoulli)),
        "imm-jpda-paper" => Box::new(Tracked::new(filters::published, trackers::jpda_paper)),
        "imm-jpda" => Box::new(Tracked::new(filters::bank, trackers::jpda)),
        "imm-pmbm" => Box::new(Tracked::new(filters::bank, trackers::pmbm)),
        _ => {
            let known = METHODS.join(", ");
            return Err(StudyError::UnknownMethod { study: "clutter", name: name.to_owned(), known });
        }
    })
}
