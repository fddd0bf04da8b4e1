//! The methods that the studies of extended objects compare.
//!
//! | method | knows | is |
//! |---|---|---|
//! | `centroid` | | the mean of the points, and the ellipse of their scatter |
//! | `b-rmm`, `b-rmm-paper` | | random matrix, the extent as covariance of the points (Koch) |
//! | `ffk-rmm` | | random matrix with scatter scale and sensor noise (Feldmann, Fränken and Koch) |
//! | `vb-rmm`, `vb-rmm-paper` | | random matrix, variational (Orguner) |
//! | `lan-li`, `lan-li-paper` | | random matrix, Wishart prediction; exact and printed degrees of freedom |
//! | `imm-rmm`, `imm-rmm-paper` | | the same in four interacting modes: straight, accelerating, turning left and right |
//! | `mem-ekf`, `mem-ekf-paper` | | multiplicative error, linearised (Yang and Baum) |
//! | `mem-rbpf`, `mem-rbpf-paper` | | multiplicative error with particles of the angle (Steuernagel and Baum) |
//! | `lstm-paper`, `transformer-paper` | | networks alone as published: absolute positions in and out |
//! | `lstm`, `transformer` | | the same, relative to the centroid and its way |
//! | `rmmnet-paper` | | RMMNet as published |
//! | `rmmnet` | | random matrix with a learned memory, which also sees the points themselves |
//! | `rmmnet-imitation-1`, `-3`, `-5`, `-10` | | the same, trained on tracks that were simulated from so many weights of recorded ones |
//! | `known-size` | the size | the angle of the scan's greatest likelihood; for aircraft that of the course |
//! | `aligned` | the size | the angle of velocity and scan together |
//! | `aligned-ar` | the size | the same with an auto-regressive motion of order 10 that is identified on line |
//! | `oracle` | the size, the motion | the same with the true motion: the limit of filters on count, mean and scatter |
//!
//! The suffix `-paper` is the configuration of the RMMNet paper; a plain name is what we would fly, tuned on
//! other recordings with scatter scale and sensor noise inside.

mod known;
mod learned;
mod matrix;
mod shape;

use tercel_neural::shipped::Models;

use super::settings::Settings;
use super::{Method, Recording, StepEstimate};
use crate::error::StudyError;

/// Names of all methods of the study `vehicle`, in the order in which they are best read.
pub const VEHICLE_METHODS: [&str; 24] = [
    "centroid",
    "b-rmm-paper",
    "vb-rmm-paper",
    "lan-li-paper",
    "imm-rmm-paper",
    "mem-ekf-paper",
    "mem-rbpf-paper",
    "lstm-paper",
    "transformer-paper",
    "rmmnet-paper",
    "b-rmm",
    "ffk-rmm",
    "vb-rmm",
    "lan-li",
    "imm-rmm",
    "mem-ekf",
    "mem-rbpf",
    "lstm",
    "transformer",
    "rmmnet",
    "known-size",
    "aligned",
    "aligned-ar",
    "oracle",
];

/// Networks that learned from imitations of recorded tracks: models and methods have the same names.
const IMITATIONS: [&str; 4] =
    ["rmmnet-imitation-1", "rmmnet-imitation-3", "rmmnet-imitation-5", "rmmnet-imitation-10"];

/// Names of all methods of the study `aircraft`: those of vehicles but the last, since nobody knows the true motion there, and the
/// imitations.
pub const AIRCRAFT_METHODS: [&str; 27] = {
    let shared = VEHICLE_METHODS.len() - 1;
    let mut all = [""; 27];
    let mut place = 0;
    while place < all.len() {
        all[place] = if place < shared { VEHICLE_METHODS[place] } else { IMITATIONS[place - shared] };
        place += 1;
    }
    all
};

/// Names of all methods of the study `vehicle-ablation`: RMMNet as published, small, and without some of its blocks.
pub const ABLATION: [&str; 6] =
    ["full", "without-prediction", "without-update", "without-memory", "only-update", "only-prediction"];

/// Names of all methods of the study `aircraft-random`: those that learned nothing from tracks, and `rmmnet`, which learned from the
/// tracks that this study leaves for it.
pub const RANDOM_METHODS: [&str; 18] = [
    "centroid",
    "b-rmm-paper",
    "vb-rmm-paper",
    "lan-li-paper",
    "imm-rmm-paper",
    "mem-ekf-paper",
    "mem-rbpf-paper",
    "b-rmm",
    "ffk-rmm",
    "vb-rmm",
    "lan-li",
    "imm-rmm",
    "mem-ekf",
    "mem-rbpf",
    "rmmnet",
    "known-size",
    "aligned",
    "aligned-ar",
];

/// Names of all methods of the study `vehicle-data`: networks, and the best filters without one that know as much and more.
pub const DATA_METHODS: [&str; 5] = ["vb-rmm", "lstm", "transformer", "rmmnet", "aligned-ar"];

/// From how many vehicles the networks of the study `vehicle-data` learned, with their models: `lstm`, `transformer` and `rmmnet`.
pub(super) const DATA_MODELS: [(u32, [&str; 3]); 5] = [
    (100, ["lstm-data-100", "transformer-data-100", "rmmnet-data-100"]),
    (300, ["lstm-data-300", "transformer-data-300", "rmmnet-data-300"]),
    (1_000, ["lstm-data-1000", "transformer-data-1000", "rmmnet-data-1000"]),
    (5_000, ["lstm-data-5000", "transformer-data-5000", "rmmnet-data-5000"]),
    (20_000, ["lstm-data-20000", "transformer-data-20000", "rmmnet-data-20000"]),
];

/// The method of that name, with these numbers.
///
/// # Errors
/// When there is no such method.
pub(crate) fn method(
    study: &'static str,
    name: &str,
    settings: &Settings,
    models: &Models,
) -> Result<Box<dyn Method>, StudyError> {
    let settings = *settings;
    Ok(match name {
        "centroid" => Box::new(matrix::Mean(settings)),
        "b-rmm" => Box::new(matrix::Matrix::direct(settings)),
        "ffk-rmm" => Box::new(matrix::Matrix::distorted(settings)),
        "vb-rmm" => Box::new(matrix::Matrix::variational(settings)),
        "lan-li" => Box::new(matrix::Matrix::lan_li(settings)),
        "b-rmm-paper" => Box::new(matrix::PaperMatrix::direct(settings)),
        "vb-rmm-paper" => Box::new(matrix::PaperMatrix::variational(settings)),
        "lan-li-paper" => Box::new(matrix::PaperMatrix::lan_li(settings)),
        "imm-rmm" => Box::new(matrix::Interacting { settings, paper: false }),
        "imm-rmm-paper" => Box::new(matrix::Interacting { settings, paper: true }),
        "mem-ekf" => Box::new(shape::Linearised { settings, paper: false }),
        "mem-ekf-paper" => Box::new(shape::Linearised { settings, paper: true }),
        "mem-rbpf" => Box::new(shape::Sampled { settings, paper: false }),
        "mem-rbpf-paper" => Box::new(shape::Sampled { settings, paper: true }),
        "lstm-paper" => Box::new(learned::Alone::new(models, settings.lstm_paper)?),
        "lstm" => Box::new(learned::Alone::new(models, settings.lstm)?),
        "transformer-paper" => Box::new(learned::Alone::new(models, settings.transformer_paper)?),
        "transformer" => Box::new(learned::Alone::new(models, settings.transformer)?),
        "rmmnet-paper" => Box::new(learned::Remembering::new(models, settings.rmmnet_paper)?),
        name if ABLATION.contains(&name) => {
            Box::new(learned::Remembering::new(models, &format!("rmmnet-ablation-{name}"))?)
        }
        "rmmnet" => Box::new(learned::Remembering::new(models, settings.rmmnet)?),
        name if IMITATIONS.contains(&name) => Box::new(learned::Remembering::new(models, name)?),
        "known-size" => Box::new(known::Sized(settings)),
        "aligned" => Box::new(known::Straight(settings)),
        "aligned-ar" => Box::new(known::Regressive(settings)),
        "oracle" => Box::new(known::Oracle),
        _ => {
            let known = match study {
                "vehicle-ablation" => ABLATION.join(", "),
                "vehicle-data" => DATA_METHODS.join(", "),
                _ => VEHICLE_METHODS.join(", "),
            };
            return Err(StudyError::UnknownMethod { study, name: name.to_owned(), known });
        }
    })
}
