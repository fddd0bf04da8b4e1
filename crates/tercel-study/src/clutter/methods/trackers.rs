//! The trackers that the methods run, with their settings.

use tercel_core::association::Gate;
use tercel_core::error::FilterError;
use tercel_core::multi::{
    Confirmation, Jpda, JpdaConfig, Management, MultiBernoulli, MultiBernoulliConfig, Phd, PhdConfig, Pmbm,
    PmbmConfig,
};

use crate::clutter::Recording;

/// The published gate: a squared distance of 15 in two components.
const GATE: f64 = 0.999_45;

/// The published rule: confirmed by three detections, given up after more than two scans without one.
fn three_hits() -> Management {
    Management {
        confirm: Confirmation::Hits { hits: 3, scans: 8 },
        min_existence: 1e-6,
        lost_existence: Some(1e-6),
        max_misses: 2,
        ..Management::default()
    }
}

/// Probability that an unexplained measurement is a new object. The publication has 0.3, which means twelve new objects a scan.
const BIRTH: f64 = 0.05;

pub(crate) fn phd<B>(_: &Recording) -> Result<Phd<B>, FilterError> {
    Phd::new(PhdConfig {
        gate: Gate::new(GATE)?,
        birth: BIRTH,
        prune: 1e-5,
        merge: 4.0,
        cap: 500,
        extract: 0.5,
        management: three_hits(),
        ..PhdConfig::default()
    })
}

pub(crate) fn multi_bernoulli<B>(_: &Recording) -> Result<MultiBernoulli<B>, FilterError> {
    MultiBernoulli::new(MultiBernoulliConfig {
        gate: Gate::new(GATE)?,
        birth: BIRTH,
        management: three_hits(),
        ..MultiBernoulliConfig::default()
    })
}

pub(crate) fn jpda<B>(_: &Recording) -> Result<Jpda<B>, FilterError> {
    Jpda::new(JpdaConfig {
        gate: Gate::new(GATE)?,
        birth: BIRTH,
        management: Management {
            confirm: Confirmation::Existence(0.9),
            min_existence: 1e-3,
            lost_existence: Some(1e-3),
            max_misses: 5,
            ..Management::default()
        },
        ..JpdaConfig::default()
    })
}

pub(crate) fn jpda_paper<B>(_: &Recording) -> Result<Jpda<B>, FilterError> {
    Jpda::new(JpdaConfig {
        gate: Gate::new(GATE)?,
        birth: BIRTH,
        management: three_hits(),
        ..JpdaConfig::default()
    })
}

/// Objects that are expected in the region at first, and new ones in a second: what an engineer would guess.
const PRESENT: f64 = 6.0;
const BIRTHS: f64 = 0.1;

pub(crate) fn pmbm<B>(recording: &Recording) -> Result<Pmbm<B>, FilterError> {
    let area = recording.scene.area();
    Pmbm::new(PmbmConfig {
        gate: Gate::new(GATE)?,
        undetected: Some(PRESENT / area),
        birth: Some(BIRTHS / area),
        management: Management {
            confirm: Confirmation::Existence(0.5),
            min_existence: 1e-4,
            lost_existence: Some(1e-4),
            ..Management::default()
        },
        ..PmbmConfig::default()
    })
}
