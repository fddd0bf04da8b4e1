//! Sizes and options of a liquid Kalman filter.

use serde::{Deserialize, Serialize};

use super::form::{Absolute, Form, Residual};
use crate::error::ModelError;
use crate::filter::{checked_positive, checked_sizes};
use crate::layer::{CellShape, LayerShape, Solver};
use crate::model::Model;

/// Sizes and options of a [`LiquidKalman`](super::LiquidKalman): the table `hyper` of its card.
///
/// ```toml
/// interval = 1.0          # time step that it was trained for, s
/// cell = { kind = "ltc", size = 32, unfolds = 6, solver = "fused" }    # or cfc, gru, mlp
/// carried = true          # each object has a memory, which goes from step to step
/// jacobian = { kind = "exact" }
/// warm_up = 2             # steps after birth that are predicted straight
/// speed = 30.0            # standard deviation of a new object's velocity, m/s per axis
/// [form]
/// kind = "residual"       # see `Residual`; or "absolute", see `Absolute`
/// heading = true
/// learned_noise = true
/// velocity = 30.0
/// correction = [5.0, 2.0]
/// acceleration = 2.0
/// noise = 1.0
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LiquidHyper {
    /// The time step that the network was trained for, s: the unit of time of its cell.
    pub interval: f64,
    /// The cell.
    pub cell: CellShape,
    /// Whether a memory goes from step to step. Without, every prediction starts from zero.
    pub carried: bool,
    /// How the Jacobian of the prediction is found.
    pub jacobian: Derivative,
    /// Steps after birth that are predicted straight, before the network is asked: until there is a velocity.
    pub warm_up: u32,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// What the network sees and says.
    pub form: Form,
}

/// How the Jacobian of a prediction is found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Derivative {
    /// Exactly: derivatives travel through the network with the values.
    Exact,
    /// By forward differences, as published. In single precision they are rough: with positions within a kilometre and a step
    /// of 1e-3 m they are off by some ten percent.
    Difference {
        /// Step, m and m/s.
        step: f64,
    },
}

impl Default for LiquidHyper {
    fn default() -> Self {
        LiquidHyper {
            interval: 1.0,
            cell: CellShape::Ltc { size: 32, unfolds: 6, solver: Solver::Fused },
            carried: true,
            jacobian: Derivative::Exact,
            warm_up: 2,
            speed: 30.0,
            form: Form::Residual(Residual::default()),
        }
    }
}

impl LiquidHyper {
    /// As published: no memory between steps, the whole state within given limits in and out, differences of this step, and
    /// a process noise with these variances.
    pub fn paper(minimum: [f64; 4], maximum: [f64; 4], step: f64, noise: [f64; 4]) -> Self {
        LiquidHyper {
            carried: false,
            jacobian: Derivative::Difference { step },
            warm_up: 0,
            form: Form::Absolute(Absolute { minimum, maximum, noise }),
            ..LiquidHyper::default()
        }
    }

    /// The layers of the network, by name: `cell` and `output` (linear).
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let output = LayerShape::Linear { inputs: self.cell.size(), outputs: self.form.outputs() };
        vec![("cell".to_owned(), self.cell.layer(self.form.inputs())), ("output".to_owned(), output)]
    }

    /// Names and shapes of all tensors of the network.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.layers().iter().flat_map(|(name, shape)| shape.tensors(name)).collect()
    }

    /// This as the table `hyper` of a card.
    ///
    /// # Errors
    /// When a size does not fit a TOML integer.
    pub fn to_table(&self) -> Result<toml::Table, String> {
        toml::Table::try_from(self).map_err(|error| error.to_string())
    }

    /// What cannot be, if anything.
    ///
    /// # Errors
    /// Names the option, what it is and what was expected.
    pub fn check(&self) -> Result<(), String> {
        checked_sizes(&self.cell.sizes())?;
        checked_positive(&[("interval", self.interval), ("speed", self.speed)])?;
        if let Derivative::Difference { step } = self.jacobian {
            checked_positive(&[("jacobian.step", step)])?;
        }
        self.form.check()
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        crate::filter::hyper_of(model, LiquidHyper::check)
    }
}
