//! Sizes and options of DeepMTT, and what its network sees and says.

use nalgebra::{Vector2, Vector4};
use serde::{Deserialize, Serialize};
use tercel_core::belief::Gaussian;

use crate::error::ModelError;
use crate::filter::sight::{Sight, place};
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of a [`DeepMtt`](super::DeepMtt): the table `hyper` of its card.
///
/// ```toml
/// window = 5              # estimates that the network sees
/// layers = [64, 64]       # width of each half of each bidirectional layer
/// dense = 64              # width of the layer before the last; 0 for none
/// sensor_frame = true     # inputs and outputs in the frame of the line of sight
/// context = true          # the network sees range and spread of each estimate
/// whitened = true         # it speaks in standard deviations of the front end
/// scales = true           # it also scales the covariance
/// acceleration = 10.0     # process noise of the front end, m/s² per axis, constant within a step
/// speed = 300.0           # standard deviation of a new object's velocity, m/s per axis
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeepMttHyper {
    /// Estimates that the network sees, the present one included.
    pub window: usize,
    /// Width of each half of each bidirectional layer.
    pub layers: Vec<usize>,
    /// Width of a layer with ReLU before the last; 0 for none.
    pub dense: usize,
    /// Whether inputs and outputs are in the frame of the line of sight.
    pub sensor_frame: bool,
    /// Whether the network sees range and spread of each estimate.
    pub context: bool,
    /// Whether residuals are in standard deviations of the front end (multiplied by the root of its covariance) instead of
    /// 100 m and 10 m/s.
    pub whitened: bool,
    /// Whether the network also says by how much the deviations of the front end are off.
    pub scales: bool,
    /// Standard deviation of the front end's acceleration, constant within a step, m/s² per axis.
    pub acceleration: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
}

impl Default for DeepMttHyper {
    fn default() -> Self {
        DeepMttHyper {
            layers: vec![64, 64],
            sensor_frame: true,
            context: true,
            whitened: true,
            scales: true,
            ..DeepMttHyper::paper()
        }
    }
}

/// Units of the residuals that are not whitened: m, m/s.
const UNITS: [f64; 4] = [100.0, 100.0, 10.0, 10.0];

impl DeepMttHyper {
    /// As the publication has it: layers of 128, 256 and 256, windows of five, estimates alone.
    pub fn paper() -> Self {
        DeepMttHyper {
            window: 5,
            layers: vec![128, 256, 256],
            dense: 64,
            sensor_frame: false,
            context: false,
            whitened: false,
            scales: false,
            acceleration: 10.0,
            speed: 300.0,
        }
    }

    /// Width of an input row: one for each estimate of the window.
    pub fn inputs(&self) -> usize {
        if self.context { 9 } else { 4 }
    }

    /// Width of an output row: one for each estimate of the window.
    pub fn outputs(&self) -> usize {
        if self.scales { 6 } else { 4 }
    }

    /// The layers of the network, by name: `bilstm.0`, `bilstm.1`, ..., `dense` (linear, ReLU) and `output` (linear).
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let mut inputs = self.inputs();
        let mut layers = Vec::new();
        for (index, size) in self.layers.iter().enumerate() {
            layers.push((format!("bilstm.{index}"), LayerShape::Bidirectional { inputs, size: *size }));
            inputs = size.saturating_mul(2);
        }
        if self.dense > 0 {
            layers.push(("dense".to_owned(), LayerShape::Linear { inputs, outputs: self.dense }));
            inputs = self.dense;
        }
        layers.push(("output".to_owned(), LayerShape::Linear { inputs, outputs: self.outputs() }));
        layers
    }

    /// Names and shapes of all tensors of the network.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.layers().iter().flat_map(|(name, shape)| shape.tensors(name)).collect()
    }

    /// The frame in which a window is seen: that of its last estimate. `origin` is where the sensor stands.
    pub fn sight(&self, last: &Gaussian<4>, origin: &Vector2<f64>) -> Sight {
        Sight::new(place(last, origin), self.sensor_frame)
    }

    /// Writes what the network sees of a window of estimates.
    ///
    /// # Panics
    /// When `inputs` holds fewer rows than there are estimates.
    pub fn see(&self, window: &[Gaussian<4>], origin: &Vector2<f64>, inputs: &mut [f32]) {
        let Some(last) = window.last() else { return };
        let sight = self.sight(last, origin);
        let ln = |value: f64, unit: f64| (value.max(1e-9) / unit).ln();
        for (state, row) in window.iter().zip(inputs.chunks_exact_mut(self.inputs())) {
            let away = sight.turned(state.mean.xy() - last.mean.xy()) / 1e3;
            let velocity = sight.turned(Vector2::new(state.mean[2], state.mean[3])) / 100.0;
            let mut values = [away.x, away.y, velocity.x, velocity.y, 0.0, 0.0, 0.0, 0.0, 0.0];
            if self.context {
                let root = sight.root(&state.covariance);
                let spread = |row: usize| root.row(row).norm();
                let range = place(state, origin).norm();
                let context = [
                    ln(range.max(1.0), 100e3),
                    ln(spread(0), 100.0),
                    ln(spread(1), 300.0),
                    ln(spread(2), 50.0),
                    ln(spread(3), 50.0),
                ];
                values[4..].copy_from_slice(&context);
            }
            row.iter_mut().zip(values).for_each(|(to, value)| *to = value as f32);
        }
    }

    /// What a row of outputs means for its estimate: what to add to it, in the frame of the state, and the logarithms by which
    /// the deviations of position and velocity are off.
    pub fn said(&self, state: &Gaussian<4>, sight: &Sight, row: &[f32]) -> (Vector4<f64>, [f64; 2]) {
        let said = Vector4::from_fn(|i, _| f64::from(row[i]));
        let residual = match self.whitened {
            true => sight.root(&state.covariance) * said,
            false => said.component_mul(&Vector4::from(UNITS)),
        };
        let scales = if self.scales { [f64::from(row[4]), f64::from(row[5])] } else { [0.0; 2] };
        (sight.matrix().transpose() * residual, scales)
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
        if self.layers.is_empty() {
            return Err("`layers` is empty; expected the width of at least one".into());
        }
        let layers = self.layers.iter().map(|size| ("layers", *size));
        let sizes: Vec<_> = layers.chain([("window", self.window), ("dense", self.dense.max(1))]).collect();
        crate::filter::checked_sizes(&sizes)?;
        crate::filter::checked_positive(&[("acceleration", self.acceleration), ("speed", self.speed)])
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        crate::filter::hyper_of(model, DeepMttHyper::check)
    }
}
