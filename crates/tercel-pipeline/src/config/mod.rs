//! The configuration file: one TOML file describes the sensors, the motion, the filter and the tracker.
//!
//! Every key has a default except the motion and the sensors; `schema` prints them all with units and ranges.

mod check;
mod filter;
mod management;
mod motion;
mod number;
pub mod presets;
mod sensor;
mod tracker;

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::PipelineError;

pub use filter::{Estimator, FilterConfig};
pub use management::{ConfirmConfig, HitsConfig, ManagementConfig};
pub use motion::{AccelerationModel, LearnedMotion, MotionConfig, Singer, Switching, TurnModel};
pub use number::{Count, NonNegative, Positive, Probability};
pub use sensor::{
    Bearing, ClutterConfig, DetectionConfig, IdentityConfig, MapClutter, Measures, Polar, PositionSensor,
    SensorConfig, SensorKind, TurnConfig, UniformClutter,
};
pub use tracker::{
    JpdaConfig, MultiBernoulliConfig, NearestNeighbourConfig, PhdConfig, PmbmConfig, TrackerConfig,
};

/// A whole configuration file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Tercel configuration")]
pub struct Config {
    /// How the objects move.
    pub motion: MotionConfig,
    /// How an object's state is estimated.
    #[serde(default)]
    pub filter: FilterConfig,
    /// How objects are found among the detections.
    #[serde(default)]
    pub tracker: TrackerConfig,
    /// What comes in: the sensors to leave out, and scans that come too late.
    #[serde(default)]
    pub input: InputConfig,
    /// The sensors, by their names in the data. The section `default` serves every sensor without one of its own.
    pub sensors: BTreeMap<String, SensorConfig>,
}

/// What comes in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct InputConfig {
    /// Names of sensors whose scans are left out.
    pub ignore: Vec<String>,
    /// What happens to a scan that is older than one before it.
    pub out_of_order: OutOfOrder,
    /// With `out_of_order = "buffer"`: how long scans are held back, so that late ones can take their place.
    #[schemars(extend("x-unit" = "s"))]
    pub delay: NonNegative,
    /// A single scan that is further ahead of the others is set aside and counted: its time is wrong. One that the next scan
    /// confirms is taken.
    #[schemars(extend("x-unit" = "s"))]
    pub max_jump: Positive,
    /// What happens when a clock is set back, so that all scans come too late.
    pub clock_set_back: ClockSetBack,
}

impl Default for InputConfig {
    fn default() -> Self {
        InputConfig {
            ignore: Vec::new(),
            out_of_order: OutOfOrder::default(),
            delay: NonNegative::constant(0.0),
            max_jump: Positive::constant(3600.0),
            clock_set_back: ClockSetBack::default(),
        }
    }
}

/// What happens when a clock is set back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockSetBack {
    /// The scans are left out and counted until the old time is reached.
    #[default]
    Drop,
    /// Tracking starts anew after three scans in a row that are too late, with new tracks.
    Restart,
}

/// What happens to a scan that is older than one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutOfOrder {
    /// It is left out and counted.
    #[default]
    Drop,
    /// Scans are held back by `delay` and sorted; one that is later than that is left out and counted.
    Buffer,
}

impl Config {
    /// Reads a configuration from TOML.
    ///
    /// # Errors
    /// When the text is not TOML, a key is unknown or missing, or a value lies outside its range. The message points at the
    /// line and the column.
    pub fn parse(text: &str) -> Result<Self, PipelineError> {
        let refused = |error| several_motions(text).unwrap_or(PipelineError::Syntax(Box::new(error)));
        let config: Config = toml::from_str(text).map_err(refused)?;
        config.check()?;
        Ok(config)
    }

    /// The same, with files that are named relative to this folder.
    pub fn in_folder(mut self, folder: &Path) -> Self {
        if let MotionConfig::Learned(motion) = &mut self.motion
            && !tercel_neural::shipped::NAMES.contains(&motion.model.as_str())
        {
            motion.model = folder.join(&motion.model).to_string_lossy().into_owned();
        }
        self
    }

    /// The same for new objects that move at this speed, m/s per axis. One that is no speed changes nothing.
    pub fn with_speed(mut self, speed: f64) -> Self {
        if let Ok(speed) = Positive::try_from(speed) {
            self.motion.set_speed(speed);
        }
        self
    }

    /// The same with no more false detections than this per scan and square metre, where sensors place what they see. A number
    /// that is no density changes nothing.
    pub fn with_clutter_below(mut self, density: f64) -> Self {
        let Ok(density) = Positive::try_from(density) else { return self };
        for sensor in self.sensors.values_mut() {
            if !matches!(sensor.measures, Measures::Bearing(_)) {
                sensor.clutter.limit(density);
            }
        }
        self
    }

    /// The configuration as TOML.
    pub fn to_toml(&self) -> String {
        // Every type here has a TOML form, so serialisation cannot fail; an empty text would say so.
        toml::to_string_pretty(self).unwrap_or_default()
    }

    /// The JSON Schema of the file: every key with its unit, its range and what it does.
    pub fn schema() -> serde_json::Value {
        schemars::schema_for!(Config).to_value()
    }

    /// Checks what no single key can say: that the parts fit together.
    fn check(&self) -> Result<(), PipelineError> {
        if self.sensors.is_empty() {
            return Err(PipelineError::config(
                "sensors",
                "there is no sensor; add a section such as [sensors.radar]",
            ));
        }
        self.motion.check("motion")?;
        for (name, sensor) in &self.sensors {
            sensor.check(&format!("sensors.{name}"), self)?;
        }
        self.check_effects()?;
        self.filter.check(&self.motion, &self.sensors)
    }
}

/// What is wrong with a motion section that holds none or several, which the parser would not say so plainly.
fn several_motions(text: &str) -> Option<PipelineError> {
    let table: toml::Table = text.parse().ok()?;
    let motions: Vec<&str> = table.get("motion")?.as_table()?.keys().map(String::as_str).collect();
    let found = match motions[..] {
        [_] => return None,
        [] => "it is empty".to_owned(),
        _ => format!("it holds {}", motions.join(", ")),
    };
    let reason = format!("there must be exactly one motion, such as constant_velocity; {found}");
    Some(PipelineError::config("motion", &reason))
}

#[cfg(test)]
mod tests;
