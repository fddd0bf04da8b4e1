//! Figures of a tracker that was tuned on the other recordings.

use tercel_pipeline::{Config, PipelineError};
use toml::Table;

use super::{Recording, Scored};
use crate::error::StudyError;
use crate::tune::{Knob, descend};

/// A method that is tuned anew for each recording.
pub(super) struct Tuned {
    name: &'static str,
    /// Where tuning starts: plain numbers that the data sheets and a glance at the boats suggest, not the shipped configuration,
    /// which has seen all of the recordings.
    start: &'static str,
    /// What tuning may change of motion and tracker.
    motion: &'static [Knob],
    tracker: &'static [Knob],
}

/// All of them.
const TUNED: [Tuned; 2] = [
    Tuned {
        name: "nearest-neighbour-loo",
        start: include_str!("start.toml"),
        motion: &STRAIGHT,
        tracker: &NEAREST_NEIGHBOUR,
    },
    Tuned {
        name: "imm-pmbm-loo",
        start: include_str!("start_pmbm.toml"),
        motion: &SWITCHING,
        tracker: &PMBM,
    },
];

impl Tuned {
    /// The method of this name, if there is one that is tuned.
    pub fn find(name: &str) -> Option<&'static Tuned> {
        static ALL: &[Tuned] = &TUNED;
        ALL.iter().find(|tuned| tuned.name == name)
    }

    /// Scores each recording with the configuration that fits the others best.
    pub fn leave_one_out(
        &self,
        recordings: &[Recording],
        progress: &dyn Fn(&str),
    ) -> Result<Vec<Scored>, StudyError> {
        let start: Table = self.start.parse().map_err(|error| PipelineError::Syntax(Box::new(error)))?;
        let knobs: Vec<Knob> =
            RADAR.iter().chain(self.motion).chain(&SENSORS).chain(self.tracker).copied().collect();
        let mut results = Vec::new();
        for (out, recording) in recordings.iter().enumerate() {
            progress(&format!("tuning on all recordings but {}", recording.name));
            let others = || recordings.iter().enumerate().filter(|&(number, _)| number != out);
            let cost = |config: &Config| {
                let scores = others().map(|(_, other)| Some(cost_of(&other.score(config).ok()?)));
                let scores: Option<Vec<f64>> = scores.collect();
                scores.map_or(f64::INFINITY, |scores| scores.iter().sum::<f64>() / scores.len() as f64)
            };
            let best = descend(&start, &knobs, 4, cost);
            results.push(recording.score(&Config::parse(&best.to_string())?)?);
        }
        Ok(results)
    }
}

/// What tuning minimises: both forms of GOSPA, lost objects, switches and errors of the position, in metres.
fn cost_of(scored: &Scored) -> f64 {
    let mean = |name| scored.evaluation.mean(name).unwrap_or(f64::NAN);
    let cost = 0.5 * (mean("gospa") + mean("gospa_near"))
        + 50.0 * (1.0 - mean("covered"))
        + 3.0 * mean("switches")
        + 2.0 * mean("rmse_pos_norm");
    if cost.is_finite() { cost } else { 1e3 }
}

/// What tuning may change of the sensors, before the motion and after it.
const RADAR: [Knob; 2] = [
    Knob { key: "sensors.radar.measures.position.lag", values: &[1.0, 1.5, 1.8, 2.0, 2.2, 2.5, 2.8] },
    Knob { key: "sensors.radar.measures.position.deviation", values: &[2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0] },
];

const SENSORS: [Knob; 8] = [
    Knob { key: "sensors.radar.detection", values: &[0.5, 0.6, 0.7, 0.8, 0.85, 0.9] },
    Knob { key: "sensors.radar.clutter.map.background", values: &[1e-5, 2e-5, 5e-5, 1e-4, 2e-4] },
    Knob { key: "sensors.radar.clutter.map.cell", values: &[10.0, 15.0, 20.0, 25.0, 30.0, 40.0] },
    Knob { key: "sensors.radar.clutter.map.memory", values: &[20.0, 30.0, 50.0, 75.0, 100.0, 150.0] },
    Knob { key: "sensors.lidar.measures.position.lag", values: &[0.0, 0.2, 0.4, 0.6, 0.8] },
    Knob { key: "sensors.lidar.measures.position.deviation", values: &[1.5, 2.0, 2.5, 3.0, 4.0] },
    Knob { key: "sensors.lidar.detection.0.1", values: &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6] },
    Knob { key: "sensors.lidar.clutter.map.background", values: &[1e-6, 1e-5, 3e-5, 1e-4, 3e-4] },
];

const STRAIGHT: [Knob; 2] = [
    Knob { key: "motion.constant_velocity.acceleration_density", values: &[0.02, 0.05, 0.1, 0.2, 0.4, 0.8] },
    Knob { key: "motion.constant_velocity.speed", values: &[3.0, 4.0, 5.0, 6.0, 8.0] },
];

const NEAREST_NEIGHBOUR: [Knob; 4] = [
    Knob { key: "tracker.nearest_neighbour.merge", values: &[0.2, 0.5, 1.0, 2.0, 4.0, 8.0] },
    Knob { key: "tracker.nearest_neighbour.birth", values: &[0.02, 0.05, 0.1, 0.2, 0.3] },
    Knob {
        key: "tracker.nearest_neighbour.management.confirm.existence",
        values: &[0.95, 0.98, 0.99, 0.995, 0.999, 0.9995],
    },
    Knob {
        key: "tracker.nearest_neighbour.management.min_existence",
        values: &[0.003, 0.01, 0.02, 0.05, 0.1],
    },
];

const SWITCHING: [Knob; 2] = [
    Knob {
        key: "motion.switching.modes.0.constant_velocity.acceleration_density",
        values: &[0.02, 0.05, 0.1, 0.2, 0.4],
    },
    Knob {
        key: "motion.switching.modes.1.constant_velocity.acceleration_density",
        values: &[0.5, 1.0, 2.0, 4.0],
    },
];

const PMBM: [Knob; 6] = [
    Knob { key: "tracker.pmbm.survival", values: &[0.97, 0.98, 0.985, 0.99, 0.995] },
    Knob { key: "tracker.pmbm.birth", values: &[3e-8, 1e-7, 2e-7, 3e-7, 1e-6] },
    Knob { key: "tracker.pmbm.merge", values: &[0.2, 0.5, 1.0, 2.0, 4.0, 8.0] },
    Knob {
        key: "tracker.pmbm.management.confirm.existence",
        values: &[0.98, 0.99, 0.995, 0.999, 0.9995, 0.9999],
    },
    Knob { key: "tracker.pmbm.management.min_existence", values: &[1e-4, 3e-4, 1e-3, 3e-3] },
    Knob { key: "tracker.pmbm.management.max_coast", values: &[6.0, 8.0, 10.0, 12.0] },
];
