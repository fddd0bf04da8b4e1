//! Keys that cannot have an effect: they are refused, for who sets one expects something of it.

use super::{Config, ConfirmConfig, Measures, OutOfOrder, TrackerConfig};
use crate::PipelineError;

/// Most scans that counting looks back on.
const LONGEST_WINDOW: u32 = 64;

impl Config {
    /// Refuses keys of the input, the sensors and the tracker that others leave without effect.
    pub(super) fn check_effects(&self) -> Result<(), PipelineError> {
        if self.input.delay.get() > 0.0 && self.input.out_of_order == OutOfOrder::Drop {
            return Err(PipelineError::config("input.delay", "needs out_of_order = \"buffer\""));
        }
        for (name, sensor) in &self.sensors {
            if let Measures::Bearing(bearing) = &sensor.measures
                && bearing.start_range.is_none()
                && bearing.start_range_deviation.is_some()
            {
                let key = format!("sensors.{name}.measures.bearing.start_range_deviation");
                return Err(PipelineError::config(&key, "needs start_range"));
            }
        }
        self.tracker.check_effects(&format!("tracker.{}", self.tracker.name()))
    }
}

impl TrackerConfig {
    fn check_effects(&self, key: &str) -> Result<(), PipelineError> {
        let management = self.management();
        if let ConfirmConfig::Hits(rule) = &management.confirm {
            let (hits, scans) = (rule.hits.get(), rule.scans.get());
            let key = format!("{key}.management.confirm.hits");
            if scans > LONGEST_WINDOW {
                let reason = format!("scans = {scans} is too many; the last {LONGEST_WINDOW} are remembered");
                return Err(PipelineError::config(&key, &reason));
            }
            if hits > scans {
                let reason = format!("{hits} of {scans} scans can never be; hits must not exceed scans");
                return Err(PipelineError::config(&key, &reason));
            }
        }
        // What each tracker asks of a new track, and what a new track has at the most.
        let (name, least, birth) = match self {
            TrackerConfig::NearestNeighbour(own) => {
                ("management.min_existence", management.min_existence, own.birth)
            }
            TrackerConfig::Jpda(own) => ("management.min_existence", management.min_existence, own.birth),
            TrackerConfig::Phd(own) => ("prune", own.prune, own.birth),
            TrackerConfig::MultiBernoulli(own) => ("prune", own.prune, own.birth),
            // Its births are densities, which clutter makes a probability: see `advice`.
            TrackerConfig::Pmbm(_) => return Ok(()),
        };
        if birth < least {
            let reason = format!(
                "{} is above birth = {}, with which a track starts, so that none could; lower it, or raise birth",
                least.get(),
                birth.get()
            );
            return Err(PipelineError::config(&format!("{key}.{name}"), &reason));
        }
        Ok(())
    }
}
