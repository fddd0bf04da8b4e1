//! Sizes and options of a mnemonic Kalman filter, and what its network sees and says.

use nalgebra::{Matrix4, Vector2, Vector4};
use serde::{Deserialize, Serialize};
use tercel_core::belief::Gaussian;

use crate::error::ModelError;
use crate::filter::sight::Sight;
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of a [`MnemonicKalman`](super::MnemonicKalman): the table `hyper` of its card.
///
/// ```toml
/// interval = 1.0          # time step that it was trained for, s
/// hidden = 64             # width of each recurrent layer
/// layers = 2
/// sensor_frame = true     # inputs and outputs in the frame of the line of sight
/// corrections = true      # the network sees what the last measurement changed
/// acceleration = 10.0     # unit of what it says, m/s²
/// speed = 300.0           # standard deviation of a new object's velocity, m/s per axis
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MnemonicHyper {
    /// The time step that the network was trained for, s.
    pub interval: f64,
    /// Width of each recurrent layer.
    pub hidden: usize,
    /// Number of recurrent layers.
    pub layers: usize,
    /// Whether inputs and outputs are in the frame of the line of sight.
    pub sensor_frame: bool,
    /// Whether the network sees what the last measurement changed, and whether there was one.
    pub corrections: bool,
    /// The acceleration in whose units the network speaks, m/s².
    pub acceleration: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
}

impl Default for MnemonicHyper {
    fn default() -> Self {
        MnemonicHyper { sensor_frame: true, corrections: true, ..MnemonicHyper::paper() }
    }
}

/// Outputs: the residual of the mean, and a lower-triangular factor of the process noise.
pub(super) const OUTPUTS: usize = 4 + 10;

/// Units of the inputs: m, m, m/s, m/s.
const SPREADS: [f64; 4] = [300.0, 300.0, 50.0, 50.0];

impl MnemonicHyper {
    /// As the publication has it: the last estimate and the factor of its covariance alone, in the frame of the state.
    pub fn paper() -> Self {
        MnemonicHyper {
            interval: 1.0,
            hidden: 64,
            layers: 2,
            sensor_frame: false,
            corrections: false,
            acceleration: 10.0,
            speed: 300.0,
        }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        let place = if self.sensor_frame { 1 } else { 2 };
        place + 2 + 10 + if self.corrections { 5 } else { 0 }
    }

    /// Width of an output row.
    pub fn outputs(&self) -> usize {
        OUTPUTS
    }

    /// The layers of the network, by name: `lstm.0`, `lstm.1`, ..., `output` (linear).
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let inputs = |layer| if layer == 0 { self.inputs() } else { self.hidden };
        let recurrent = (0..self.layers).map(|layer| {
            (format!("lstm.{layer}"), LayerShape::Lstm { inputs: inputs(layer), size: self.hidden })
        });
        let output = ("output".to_owned(), LayerShape::Linear { inputs: self.hidden, outputs: OUTPUTS });
        recurrent.chain([output]).collect()
    }

    /// Names and shapes of all tensors of the network.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.layers().iter().flat_map(|(name, shape)| shape.tensors(name)).collect()
    }

    /// Writes what the network sees: of the last estimate, what its measurement changed, and whether there was one. `place`
    /// is the position relative to the sensor.
    ///
    /// # Panics
    /// When `inputs` is shorter than [`inputs`](MnemonicHyper::inputs).
    pub fn see(
        &self,
        state: &Gaussian<4>,
        place: Vector2<f64>,
        (correction, seen): (&Vector4<f64>, bool),
        inputs: &mut [f32],
    ) {
        let sight = Sight::new(place, self.sensor_frame);
        let root = sight.root(&state.covariance);
        let mut next = 0;
        let mut put = |value: f64| {
            inputs[next] = value as f32;
            next += 1;
        };
        if self.sensor_frame {
            put((sight.range().max(1.0) / 100e3).ln());
        } else {
            place.iter().for_each(|x| put(x / 100e3));
        }
        let velocity = sight.turned(Vector2::new(state.mean[2], state.mean[3]));
        velocity.iter().for_each(|v| put(v / 300.0));
        let spread = |row: usize| root.row(row).norm().max(1e-9);
        for row in 0..4 {
            (0..row).for_each(|column| put(root[(row, column)] / spread(row)));
            put((root[(row, row)].max(1e-9) / SPREADS[row]).ln());
        }
        if self.corrections {
            let turned = sight.matrix() * correction;
            (0..4).for_each(|row| put((turned[row] / spread(row)).asinh()));
            put(f64::from(u8::from(seen)));
        }
    }

    /// The prediction of an estimate over `dt` seconds, with what the network said.
    ///
    /// Over other times than [`interval`](MnemonicHyper::interval) the residual is that of an acceleration that stays, and the
    /// noise that of a white one.
    pub fn moved(&self, state: &Gaussian<4>, place: Vector2<f64>, outputs: &[f32], dt: f64) -> Gaussian<4> {
        let sight = Sight::new(place, self.sensor_frame).matrix().transpose();
        let (residual, factor) = self.said(outputs, dt);
        let transition = transition(dt);
        let noise = sight * factor;
        let covariance = transition * state.covariance * transition.transpose() + noise * noise.transpose();
        Gaussian {
            mean: transition * state.mean + sight * residual,
            covariance: 0.5 * (covariance + covariance.transpose()),
        }
    }

    /// What the outputs mean, in the frame of the network: the residual of the mean, and the factor of the noise.
    pub fn said(&self, outputs: &[f32], dt: f64) -> (Vector4<f64>, Matrix4<f64>) {
        let [means, noises] = self.units(dt);
        let residual = Vector4::from_fn(|i, _| means[i] * f64::from(outputs[i]));
        let mut factor = Matrix4::zeros();
        let mut next = 4;
        for row in 0..4 {
            for column in 0..=row {
                let said = f64::from(outputs[next]);
                next += 1;
                factor[(row, column)] = noises[row] * if row == column { diagonal(said) } else { said };
            }
        }
        (residual, factor)
    }

    /// Units of the residual and of the noise factor, row by row, for a step of `dt` seconds.
    pub fn units(&self, dt: f64) -> [[f64; 4]; 2] {
        let share = dt / self.interval;
        let position = 0.5 * self.acceleration * self.interval * self.interval;
        let velocity = self.acceleration * self.interval;
        let pairs = |p: f64, v: f64| [position * p, position * p, velocity * v, velocity * v];
        [pairs(share * share, share), pairs(share * share.sqrt(), share.sqrt())]
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
        crate::filter::checked_sizes(&[("hidden", self.hidden), ("layers", self.layers)])?;
        crate::filter::checked_positive(&[
            ("interval", self.interval),
            ("acceleration", self.acceleration),
            ("speed", self.speed),
        ])
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        crate::filter::hyper_of(model, MnemonicHyper::check)
    }
}

/// The transition of constant velocity.
fn transition(dt: f64) -> Matrix4<f64> {
    let mut transition = Matrix4::identity();
    (transition[(0, 2)], transition[(1, 3)]) = (dt, dt);
    transition
}

/// A diagonal element of the factor, in its unit: 1 where the network says nothing, and never zero.
fn diagonal(said: f64) -> f64 {
    let softplus = if said > 30.0 { said } else { said.exp().ln_1p() };
    FLOOR + softplus / std::f64::consts::LN_2
}

/// The smallest diagonal element of the factor, in its unit.
const FLOOR: f64 = 1e-3;
