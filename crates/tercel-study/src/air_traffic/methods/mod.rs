//! The methods that the air-traffic studies compare.
//!
//! | method | knows | is |
//! |---|---|---|
//! | `measurement` | | the plot as it came; no velocity |
//! | `ekf`, `ukf` | the radar's accuracy | one straight motion, polar measurements |
//! | `imm-paper` | | the published rival: three modes, a position noise of 35 m |
//! | `imm` | the radar's accuracy | ours: turns to ±20 °/s, polar measurements |
//! | `imm-adaptive` | | the same when the accuracy is not stated: it is estimated |
//! | `imm-wide` | the radar's accuracy | the bank of `neural-imm` alone: two accelerations for each turn |
//! | `neural-imm` | the radar's accuracy | ours: this bank, whose mixture a network corrects |
//! | `neural-imm-adaptive` | | the same when the accuracy is not stated |
//! | `kalman-net` | the radar's accuracy | a learned gain, with our inputs and covariance |
//! | `kalman-net-paper` | | the same as published |
//! | `att-ens-kalmannets` | the radar's accuracy | three KalmanNets with attention to innovations; causal |
//! | `att-ens-kalmannets-paper` | all plots of the flight | as published: it normalises over the whole flight |
//! | `mnemonic` | the radar's accuracy | a learned prediction |
//! | `deep-mtt` | the radar's accuracy | learned residuals of an unscented filter, window of 5 |
//! | `tr-mtt` | | a transformer on the last 25 plots, its last output |
//! | `tr-mtt-window` | up to 24 s of the future | the same, the mean over all windows that cover a step |
//! | `bayes` | the radar's accuracy, the population | the limit of any causal filter |
//! | `oracle` | the radar's accuracy, every manoeuvre | a bound that no filter reaches |
//!
//! The suffix `-paper` is the configuration of the publication; a plain name is what we would fly. One configuration serves every
//! population.

mod bank;
mod learned;
mod limits;
mod single;

use tercel_core::error::FilterError;
use tercel_core::filter::Filter;
use tercel_core::sensor::Measurement;
use tercel_neural::shipped::Models;
use tercel_sim::air_traffic::AirTraffic;

use super::{Method, Recording, StepEstimate};
use crate::error::StudyError;

pub use bank::{AdaptiveBank, Bank};

/// Names of all methods, in the order in which they are best read.
pub const METHODS: [&str; 19] = [
    "measurement",
    "ekf",
    "ukf",
    "imm-paper",
    "imm",
    "imm-adaptive",
    "imm-wide",
    "neural-imm",
    "neural-imm-adaptive",
    "kalman-net",
    "kalman-net-paper",
    "att-ens-kalmannets",
    "att-ens-kalmannets-paper",
    "mnemonic",
    "deep-mtt",
    "tr-mtt",
    "tr-mtt-window",
    "bayes",
    "oracle",
];

/// Names of the methods of the ablation: what the branches of the published ensemble are worth.
pub const ABLATION: [&str; 5] = [
    "average-paper",
    "ens-knets-classification-paper",
    "ens-knets-correction-paper",
    "ens-knets-paper",
    "att-ens-kalmannets-paper",
];

/// The method of that name, for a population (one of [`NAMES`](tercel_sim::air_traffic::NAMES), of which only `bayes` makes use).
///
/// # Errors
/// When there is no such method.
pub fn method(name: &str, population: &AirTraffic, models: &Models) -> Result<Box<dyn Method>, StudyError> {
    Ok(match name {
        "measurement" => Box::new(limits::Measured),
        "ekf" => Box::new(single::StraightExtended),
        "ukf" => Box::new(single::StraightUnscented),
        "imm-paper" => Box::new(bank::Published::new()?),
        "imm" => Box::new(Bank::shipped()?),
        "imm-adaptive" => Box::new(AdaptiveBank::shipped()?),
        "imm-wide" => Box::new(learned::wide_bank(models)?),
        "neural-imm" => learned::neural_imm(models)?,
        "neural-imm-adaptive" => learned::neural_imm_adaptive(models)?,
        "kalman-net" => learned::kalman_net(models)?,
        "kalman-net-paper" => learned::kalman_net_paper(models)?,
        "att-ens-kalmannets" => learned::ensemble(models, "att-ens-kalmannets")?,
        "ens-knets-classification-paper"
        | "ens-knets-correction-paper"
        | "ens-knets-paper"
        | "att-ens-kalmannets-paper" => Box::new(learned::PublishedEnsemble::new(models, name)?),
        "mnemonic" => learned::mnemonic(models)?,
        "deep-mtt" => learned::deep_mtt(models)?,
        "tr-mtt" => learned::tr_mtt(models)?,
        "tr-mtt-window" => Box::new(learned::Windowed::new(models)?),
        "average-paper" => Box::new(learned::PublishedEnsemble::average(models)?),
        "bayes" => Box::new(limits::Bayes::new(population.clone())),
        "oracle" => Box::new(limits::Oracle),
        _ => {
            let known = METHODS.join(", ");
            return Err(StudyError::UnknownMethod { study: "atc", name: name.to_string(), known });
        }
    })
}

/// Runs a filter over a recording. The first plot becomes a measurement by `start`, every other by `measure`, and every
/// belief an estimate by `read`.
fn follow<F: Filter<4>>(
    recording: &Recording,
    filter: &F,
    start: impl FnOnce(&Plot) -> F::Measurement,
    measure: impl Fn(&Plot) -> F::Measurement,
    read: impl Fn(&F::Belief) -> StepEstimate,
) -> Result<Vec<StepEstimate>, FilterError> {
    // A recording begins with a plot.
    let Some((Some(first), rest)) = recording.plots.split_first() else {
        return Ok(Vec::new());
    };
    let mut belief = filter.birth(&start(first))?;
    let mut estimates = Vec::with_capacity(recording.plots.len());
    estimates.push(read(&belief));
    for plot in rest {
        filter.predict(&mut belief, recording.flight.interval());
        if let Some(plot) = plot {
            filter.update(&mut belief, &measure(plot))?;
        }
        estimates.push(read(&belief));
    }
    Ok(estimates)
}

/// Range and bearing.
type Plot = nalgebra::Vector2<f64>;

/// A plot with the accuracy that the radar's data sheet states.
fn stated(plot: &Plot, recording: &Recording) -> Measurement<2> {
    let (range, bearing) = (recording.radar.range(), recording.radar.bearing());
    let variances = nalgebra::Vector2::new(range * range, bearing * bearing);
    Measurement::from(*plot).with_noise(nalgebra::Matrix2::from_diagonal(&variances))
}
