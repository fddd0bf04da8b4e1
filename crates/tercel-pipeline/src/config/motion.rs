//! The motion section.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{NonNegative, Positive, Probability};
use crate::PipelineError;

/// How an object moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MotionConfig {
    /// Drifts at random. State: x, y.
    RandomWalk {
        /// Variance that each position gathers per second.
        #[schemars(extend("x-unit" = "m²/s"))]
        density: Positive,
    },
    /// Moves straight on. State: x, y, vx, vy.
    ConstantVelocity(AccelerationModel),
    /// Accelerates steadily. State: x, y, vx, vy, ax, ay.
    ConstantAcceleration {
        /// Spectral density of the jerk, per axis.
        #[schemars(extend("x-unit" = "m²/s⁵"))]
        jerk_density: Positive,
        /// Standard deviation of a new object's velocity, per axis.
        #[serde(default = "default_speed")]
        #[schemars(extend("x-unit" = "m/s"))]
        speed: Positive,
        /// Standard deviation of a new object's acceleration, per axis.
        #[serde(default = "default_acceleration")]
        #[schemars(extend("x-unit" = "m/s²"))]
        acceleration: Positive,
    },
    /// Accelerates for a while: the acceleration fades. State: x, y, vx, vy, ax, ay.
    Singer(Singer),
    /// Turns at a known rate. State: x, y, vx, vy.
    Turn(TurnModel),
    /// Turns at a rate that is estimated. State: x, y, vx, vy, turn_rate.
    CoordinatedTurn {
        /// Spectral density of the acceleration noise, per axis.
        #[schemars(extend("x-unit" = "m²/s³"))]
        acceleration_density: Positive,
        /// Variance that the turn rate gathers per second.
        #[schemars(extend("x-unit" = "rad²/s³"))]
        rate_density: Positive,
        /// Standard deviation of a new object's velocity, per axis.
        #[serde(default = "default_speed")]
        #[schemars(extend("x-unit" = "m/s"))]
        speed: Positive,
        /// Standard deviation of a new object's turn rate.
        #[serde(default = "default_rate")]
        #[schemars(extend("x-unit" = "rad/s"))]
        rate: Positive,
    },
    /// Switches between motions: an interacting multiple model filter with one mode for each.
    Switching(Switching),
    /// As a network has learned it. State: x, y, vx, vy.
    Learned(LearnedMotion),
}

/// Straight motion with random accelerations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AccelerationModel {
    /// Spectral density of the acceleration noise, per axis: its root times the root of a time is the velocity change to
    /// expect over that time.
    #[schemars(extend("x-unit" = "m²/s³"))]
    pub acceleration_density: NonNegative,
    /// Standard deviation of a new object's velocity, per axis.
    #[serde(default = "default_speed")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: Positive,
}

/// An acceleration that fades.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Singer {
    /// How long a manoeuvre lasts.
    #[schemars(extend("x-unit" = "s"))]
    pub time: Positive,
    /// Standard deviation of the acceleration, per axis.
    #[schemars(extend("x-unit" = "m/s²"))]
    pub acceleration: Positive,
    /// Standard deviation of a new object's velocity, per axis.
    #[serde(default = "default_speed")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: Positive,
}

/// A turn at a known rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurnModel {
    /// Turn rate, counter-clockwise when positive. Any finite number.
    #[schemars(extend("x-unit" = "rad/s"))]
    pub rate: f64,
    /// Spectral density of the acceleration noise, per axis.
    #[schemars(extend("x-unit" = "m²/s³"))]
    pub acceleration_density: NonNegative,
    /// Standard deviation of a new object's velocity, per axis.
    #[serde(default = "default_speed")]
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: Positive,
}

/// Several motions, one of which holds at a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Switching {
    /// The motions; a smaller state is the beginning of a larger one.
    pub modes: Vec<MotionConfig>,
    /// Probability that a motion is still the same one second later.
    #[schemars(extend("x-unit" = "1/s"))]
    pub stay: Probability,
}

/// A motion that was learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearnedMotion {
    /// A model of the kind `liquid` or `neural-imm`: the name of one that comes with Tercel, or a file that `tercel train` wrote,
    /// from the folder of the configuration.
    pub model: String,
    /// Standard deviation of a new object's velocity, per axis. The default is that of the training.
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: Option<Positive>,
}

fn default_speed() -> Positive {
    Positive::constant(30.0)
}

fn default_acceleration() -> Positive {
    Positive::constant(3.0)
}

fn default_rate() -> Positive {
    Positive::constant(0.1)
}

impl MotionConfig {
    /// Name of the model, as in the file.
    pub fn name(&self) -> &'static str {
        match self {
            MotionConfig::RandomWalk { .. } => "random_walk",
            MotionConfig::ConstantVelocity(_) => "constant_velocity",
            MotionConfig::ConstantAcceleration { .. } => "constant_acceleration",
            MotionConfig::Singer(_) => "singer",
            MotionConfig::Turn(_) => "turn",
            MotionConfig::CoordinatedTurn { .. } => "coordinated_turn",
            MotionConfig::Switching(_) => "switching",
            MotionConfig::Learned(_) => "learned",
        }
    }

    /// Names of the components of the state.
    pub fn labels(&self) -> &'static [&'static str] {
        match self {
            MotionConfig::RandomWalk { .. } => &["x", "y"],
            MotionConfig::ConstantVelocity(_) | MotionConfig::Turn(_) | MotionConfig::Learned(_) => {
                &["x", "y", "vx", "vy"]
            }
            MotionConfig::CoordinatedTurn { .. } => &["x", "y", "vx", "vy", "turn_rate"],
            MotionConfig::ConstantAcceleration { .. } | MotionConfig::Singer(_) => {
                &["x", "y", "vx", "vy", "ax", "ay"]
            }
            MotionConfig::Switching(switching) => switching
                .modes
                .iter()
                .map(MotionConfig::labels)
                .max_by_key(|labels| labels.len())
                .unwrap_or(&[]),
        }
    }

    /// Standard deviation of a new object's velocity, m/s per axis: the largest of its modes. `None` where there is no velocity, or
    /// where a model brings its own.
    pub(crate) fn speed(&self) -> Option<f64> {
        match self {
            MotionConfig::RandomWalk { .. } => None,
            MotionConfig::ConstantVelocity(model) => Some(model.speed.get()),
            MotionConfig::ConstantAcceleration { speed, .. }
            | MotionConfig::CoordinatedTurn { speed, .. } => Some(speed.get()),
            MotionConfig::Singer(model) => Some(model.speed.get()),
            MotionConfig::Turn(model) => Some(model.speed.get()),
            MotionConfig::Learned(model) => model.speed.map(Positive::get),
            MotionConfig::Switching(switching) => {
                switching.modes.iter().filter_map(MotionConfig::speed).reduce(f64::max)
            }
        }
    }

    /// The same for new objects of this speed, m/s per axis, where it has one. Manoeuvres grow with it.
    pub(super) fn set_speed(&mut self, new: Positive) {
        match self {
            MotionConfig::RandomWalk { .. } => {}
            MotionConfig::ConstantVelocity(model) => model.speed = new,
            MotionConfig::ConstantAcceleration { speed, .. }
            | MotionConfig::CoordinatedTurn { speed, .. } => *speed = new,
            MotionConfig::Singer(model) => model.speed = new,
            MotionConfig::Turn(model) => model.speed = new,
            MotionConfig::Learned(model) => model.speed = Some(new),
            MotionConfig::Switching(switching) => {
                switching.modes.iter_mut().for_each(|mode| mode.set_speed(new));
            }
        }
    }

    /// Whether a Kalman filter is exact for it.
    pub(crate) fn is_linear(&self) -> bool {
        match self {
            MotionConfig::CoordinatedTurn { .. } | MotionConfig::Learned(_) => false,
            MotionConfig::Switching(switching) => switching.modes.iter().all(MotionConfig::is_linear),
            _ => true,
        }
    }

    pub(super) fn check(&self, key: &str) -> Result<(), PipelineError> {
        match self {
            MotionConfig::Turn(turn) if !turn.rate.is_finite() => {
                Err(PipelineError::config(&format!("{key}.turn.rate"), "must be finite"))
            }
            MotionConfig::Switching(switching) => switching.check(&format!("{key}.switching")),
            _ => Ok(()),
        }
    }
}

impl Switching {
    /// Names of the modes, unique: the models with a number where one occurs again.
    pub fn mode_names(&self) -> Vec<String> {
        let name = |index: usize| self.modes[index].name();
        (0..self.modes.len())
            .map(|index| match (0..index).filter(|&before| name(before) == name(index)).count() {
                0 => name(index).to_string(),
                earlier => format!("{}_{}", name(index), earlier + 1),
            })
            .collect()
    }

    fn check(&self, key: &str) -> Result<(), PipelineError> {
        if self.modes.len() < 2 {
            return Err(PipelineError::config(&format!("{key}.modes"), "there must be at least two modes"));
        }
        let stay = self.stay.get();
        if stay <= 0.0 || stay >= 1.0 {
            return Err(PipelineError::config(&format!("{key}.stay"), "must lie above 0 and below 1"));
        }
        let whole = MotionConfig::Switching(self.clone());
        for (number, mode) in self.modes.iter().enumerate() {
            let key = format!("{key}.modes[{number}]");
            if matches!(mode, MotionConfig::Switching(_)) {
                return Err(PipelineError::config(&key, "a mode cannot switch itself; list its modes here"));
            }
            if matches!(mode, MotionConfig::Learned(_)) {
                let reason = "a learned motion cannot be a mode; it stands alone as [motion.learned]";
                return Err(PipelineError::config(&key, reason));
            }
            if !whole.labels().starts_with(mode.labels()) {
                let reason = format!(
                    "`{}` has the state {:?}, which is no beginning of {:?}, the largest state of the modes",
                    mode.name(),
                    mode.labels(),
                    whole.labels()
                );
                return Err(PipelineError::config(&key, &reason));
            }
            mode.check(&key)?;
        }
        Ok(())
    }
}
