//! The sensor sections.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Config, NonNegative, Positive, Probability};
use crate::PipelineError;

/// One sensor: what it measures, how likely it sees an object, and how much clutter it has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// What it measures, and how accurately.
    pub measures: Measures,
    /// What its detections are.
    #[serde(default)]
    pub kind: SensorKind,
    /// How detections with times of their own become scans: an antenna that turns paints its circle over seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scans: Option<TurnConfig>,
    /// What the identities are worth that come with its detections: ship numbers, addresses, codes, the numbers of its tracks.
    #[serde(default)]
    pub identity: IdentityConfig,
    /// Where it stands in the local frame (x, y), unless the data say.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub position: [f64; 2],
    /// Standard deviation of its own position where the data say it, per axis: how well its velocity is known.
    #[serde(default = "five_metres")]
    #[schemars(extend("x-unit" = "m"))]
    pub position_deviation: NonNegative,
    /// How likely it sees an object that is there. Not for reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detection: Option<DetectionConfig>,
    /// How many of its detections come from no object.
    pub clutter: ClutterConfig,
}

fn thirty_metres() -> NonNegative {
    NonNegative::constant(30.0)
}

fn five_metres() -> NonNegative {
    NonNegative::constant(5.0)
}

/// What the detections of a sensor are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// What the recording says; without a word of it, scans.
    #[default]
    Auto,
    /// Scans: a look at a part of the world, in which an object that is not seen was missed.
    Scans,
    /// Reports: each speaks of one object and says nothing of others (AIS, ADS-B, GPS).
    Reports,
}

/// A sensor that turns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurnConfig {
    /// Time for a turn. Plots are gathered sector by sector once their bearings show how the antenna turns, until then turn by turn.
    #[schemars(extend("x-unit" = "s"))]
    pub period: Positive,
}

/// What identities are worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct IdentityConfig {
    /// Probability that a detection names its object rightly; 0 takes no notice of identities.
    #[schemars(extend("x-unit" = "1"))]
    pub reliability: Probability,
}

impl Default for IdentityConfig {
    fn default() -> Self {
        IdentityConfig { reliability: Probability::constant(0.999) }
    }
}

/// What a sensor measures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Measures {
    /// Positions in the local frame.
    Position(PositionSensor),
    /// Range and bearing, and range rate if its deviation is given.
    Polar(Polar),
    /// Bearings alone.
    Bearing(Bearing),
}

/// A sensor of positions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PositionSensor {
    /// Standard deviation of the position, per axis, for detections that do not bring their own.
    #[schemars(extend("x-unit" = "m"))]
    pub deviation: Positive,
    /// Age of the position when it is reported: an object is seen where it was.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub lag: NonNegative,
}

/// A sensor of range and bearing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Polar {
    /// Standard deviation of the range.
    #[schemars(extend("x-unit" = "m"))]
    pub range_deviation: Positive,
    /// Standard deviation of the bearing.
    #[schemars(extend("x-unit" = "rad"))]
    pub bearing_deviation: Positive,
    /// Standard deviation of the range rate; without it range rates are not used.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m/s"))]
    pub range_rate_deviation: Option<Positive>,
    /// Height of the objects above the sensor where the detections do not bring it (`z`): ranges are slant ranges, and are
    /// corrected to ranges over ground. Without either they are taken as ranges over ground.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "m"))]
    pub height: Option<NonNegative>,
    /// Standard deviation of heights that do not bring their own.
    #[serde(default = "thirty_metres")]
    #[schemars(extend("x-unit" = "m"))]
    pub height_deviation: NonNegative,
    /// Turn range and bearing into a position first (debiased, with rotated covariance). Not with range rates.
    #[serde(default)]
    pub convert: bool,
    /// With `convert`: age of the position when it is reported.
    #[serde(default)]
    #[schemars(extend("x-unit" = "s"))]
    pub lag: NonNegative,
}

/// A sensor of bearings alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bearing {
    /// Standard deviation of the bearing.
    #[schemars(extend("x-unit" = "rad"))]
    pub deviation: Positive,
    /// Mean range at which a bearing alone may start an object; without it no object starts.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub start_range: Option<Positive>,
    /// Standard deviation of that range; half of it when it is not given.
    #[serde(default)]
    #[schemars(extend("x-unit" = "m"))]
    pub start_range_deviation: Option<Positive>,
}

/// Probability of detection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected a probability, 0 to 1, or a table of ranges (m) and probabilities such as [[60.0, 0.9], [110.0, 0.0]]"
)]
pub enum DetectionConfig {
    /// The same everywhere, 0 to 1.
    Uniform(#[schemars(extend("x-unit" = "1"))] Probability),
    /// By range: pairs of a range (m, rising) and the probability there (0 to 1); linear in between.
    ByRange(#[schemars(extend("x-unit" = "m, 1"))] Vec<(NonNegative, Probability)>),
}

impl Default for DetectionConfig {
    fn default() -> Self {
        DetectionConfig::Uniform(Probability::constant(0.9))
    }
}

/// Clutter: detections that come from no object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ClutterConfig {
    /// The same everywhere.
    Uniform(UniformClutter),
    /// Learned where it stays in place, scan by scan.
    Map(MapClutter),
}

/// Clutter that is the same everywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UniformClutter {
    /// Expected clutter detections per scan and m² (per rad for bearings alone): ten a scan on a square kilometre are 1e-5.
    #[schemars(extend("x-unit" = "1/m²"))]
    pub density: Positive,
}

/// Clutter that stays in place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapClutter {
    /// Expected clutter detections per scan and m² where nothing was learned.
    #[schemars(extend("x-unit" = "1/m²"))]
    pub background: Positive,
    /// Width of a cell of the map: a few times the accuracy of the sensor.
    #[schemars(extend("x-unit" = "m"))]
    pub cell: Positive,
    /// Number of scans over which a cell averages.
    #[schemars(extend("x-unit" = "1"))]
    pub memory: Positive,
}

impl ClutterConfig {
    /// Lowers the density to this one, if it is higher.
    pub(super) fn limit(&mut self, limit: Positive) {
        let density = match self {
            ClutterConfig::Uniform(uniform) => &mut uniform.density,
            ClutterConfig::Map(map) => &mut map.background,
        };
        if density.get() > limit.get() {
            *density = limit;
        }
    }
}

impl Measures {
    pub(super) fn is_linear(&self) -> bool {
        match self {
            Measures::Position(_) => true,
            Measures::Polar(polar) => polar.convert,
            Measures::Bearing(_) => false,
        }
    }
}

impl SensorConfig {
    pub(super) fn check(&self, key: &str, config: &Config) -> Result<(), PipelineError> {
        if !self.position.iter().all(|x| x.is_finite()) {
            return Err(PipelineError::config(&format!("{key}.position"), "must be finite"));
        }
        if self.identity.reliability.get() >= 1.0 {
            let reason = "must be below 1: a sensor that cannot err leaves no way to correct it; 0.999999 is nearly sure";
            return Err(PipelineError::config(&format!("{key}.identity.reliability"), reason));
        }
        if self.kind == SensorKind::Reports && (self.scans.is_some() || self.detection.is_some()) {
            let without = if self.scans.is_some() { "scans" } else { "detection" };
            let reason = "has no effect on reports, none of which is ever missed; leave it out, or the kind";
            return Err(PipelineError::config(&format!("{key}.{without}"), reason));
        }
        if let Some(DetectionConfig::ByRange(table)) = &self.detection {
            let key = format!("{key}.detection");
            if table.is_empty() {
                return Err(PipelineError::config(&key, "the table is empty"));
            }
            if table.windows(2).any(|pair| pair[1].0 <= pair[0].0) {
                return Err(PipelineError::config(&key, "the ranges of the table must rise"));
            }
        }
        let Measures::Polar(polar) = &self.measures else { return Ok(()) };
        let key = format!("{key}.measures.polar");
        if polar.convert && polar.range_rate_deviation.is_some() {
            return Err(PipelineError::config(
                &format!("{key}.convert"),
                "range rates cannot be converted into positions; leave out range_rate_deviation or convert",
            ));
        }
        if polar.lag.get() > 0.0 && !polar.convert {
            return Err(PipelineError::config(&format!("{key}.lag"), "needs convert = true"));
        }
        if polar.range_rate_deviation.is_some() && config.motion.labels().len() < 4 {
            return Err(PipelineError::config(
                &format!("{key}.range_rate_deviation"),
                "a range rate needs a motion with velocities, and random_walk has none",
            ));
        }
        Ok(())
    }
}
