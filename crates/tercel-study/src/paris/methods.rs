//! The methods that the study `paris` compares: filters for a radar, in trackers.
//!
//! | method | filter | tracker |
//! |---|---|---|
//! | `gm-phd` | one straight motion | [`Phd`](tercel_core::multi::Phd) |
//! | `imm-phd` | straight, and turns at 1 and 3 °/s to either side, calm or not | `Phd` |
//! | `imm-jpda` | the same | [`Jpda`](tercel_core::multi::Jpda) |
//! | `imm-pmbm` | the same | [`Pmbm`](tercel_core::multi::Pmbm) |
//! | `neural-jpda`, `neural-pmbm` | the bank of `neural-imm` with its network, made for targets that turn harder | `Jpda`, `Pmbm` |
//!
//! Trackers are set as in the clutter studies. All know the accuracy of the radar, its detection probability and the density of
//! clutter.

use std::sync::Arc;

use tercel_core::error::FilterError;
use tercel_core::filter::{Extended, Imm, Transition, TurnBank};
use tercel_core::motion::{AccelerationNoise, ConstantVelocity, Turn};
use tercel_core::sensor::RangeBearing;
use tercel_neural::filter::{BankNetwork, NeuralImm};
use tercel_neural::shipped::Models;
use tercel_sim::clutter::Sensor;

use super::traffic::{BEARING, RANGE};
use crate::clutter::methods::trackers;
use crate::clutter::{Method, Tracked};
use crate::error::StudyError;

/// Names of all methods, in the order in which they are best read.
pub const METHODS: [&str; 6] = ["gm-phd", "imm-phd", "imm-jpda", "imm-pmbm", "neural-jpda", "neural-pmbm"];

/// Standard deviation of a new aircraft's velocity, m/s per axis.
const SPEED: f64 = 150.0;

/// Spectral density of the one straight motion, m²/s³.
const STRAIGHT: f64 = 4.0;

/// Turn rates of the bank, degrees per second, and its accelerations, m/s².
const RATES: [f64; 5] = [0.0, 1.0, -1.0, 3.0, -3.0];
const ACCELERATIONS: [f64; 2] = [0.3, 1.5];

/// Probability of keeping turn rate and acceleration over a second.
const STAY: f64 = 0.98;

fn radar() -> Result<RangeBearing, FilterError> {
    RangeBearing::new(RANGE, BEARING)
}

fn straight(_: &Sensor) -> Result<Extended<ConstantVelocity, RangeBearing>, FilterError> {
    Ok(Extended::new(ConstantVelocity::new(STRAIGHT).with_speed(SPEED), radar()?))
}

fn bank(_: &Sensor) -> Result<Imm<Extended<Turn, RangeBearing>>, FilterError> {
    TurnBank::new(RATES.map(f64::to_radians))?
        .with_speed(SPEED)
        .with_transition(Transition::sticky(STAY).per(1.0))
        .with_noises(ACCELERATIONS.map(AccelerationNoise::Piecewise))?
        .with_noise_transition(Transition::sticky(STAY).per(1.0))
        .filter(radar()?)
}

/// The method of that name.
///
/// # Errors
/// When there is no such method, or its model is refused.
pub fn method(name: &str, models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network =
        || -> Result<_, StudyError> { Ok(Arc::new(BankNetwork::from_model(&models.get("neural-imm")?)?)) };
    let neural = |network: Arc<BankNetwork>| move |_: &Sensor| NeuralImm::new(network.clone(), &[radar()?]);
    Ok(match name {
        "gm-phd" => Box::new(Tracked::new(straight, trackers::phd)),
        "imm-phd" => Box::new(Tracked::new(bank, trackers::phd)),
        "imm-jpda" => Box::new(Tracked::new(bank, trackers::jpda)),
        "imm-pmbm" => Box::new(Tracked::new(bank, trackers::pmbm)),
        "neural-jpda" => Box::new(Tracked::new(neural(network()?), trackers::jpda)),
        "neural-pmbm" => Box::new(Tracked::new(neural(network()?), trackers::pmbm)),
        _ => {
            let known = METHODS.join(", ");
            return Err(StudyError::UnknownMethod { study: "paris", name: name.to_owned(), known });
        }
    })
}
