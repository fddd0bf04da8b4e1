//! Sizes and options of a neural IMM, as its card holds them.

use serde::{Deserialize, Serialize};
use tercel_core::error::FilterError;
use tercel_core::filter::{Transition, TurnBank};
use tercel_core::motion::AccelerationNoise;

use crate::error::ModelError;
use crate::filter::checked_positive;
use crate::layer::{CellShape, LayerShape, Solver};
use crate::model::Model;

/// Sizes and options of a [`NeuralImm`](super::NeuralImm): the table `hyper` of its card.
///
/// ```toml
/// rates = [0.0, 0.1, -0.1]        # turn rates of the bank, rad/s
/// accelerations = [7.0, 14.0]     # standard deviations, constant within a step, m/s²
/// stay = 0.985                    # probability of the same turn rate after a second
/// noise_stay = 1.0                # probability of the same acceleration after a second
/// speed = 300.0                   # standard deviation of a new object's velocity, m/s per axis
/// heading = false                 # whether the network looks along the heading, or along the line of sight
/// unit = 1.0                      # what the network takes for a metre, m
/// input = 64                      # width of the first layer
/// hidden = 64                     # width of each recurrent layer
/// layers = 1                      # recurrent layers
/// cell = { kind = "gru" }         # what they are made of; or { kind = "cfc", backbone = 64 }, or
///                                 # { kind = "ltc", unfolds = 6, solver = "fused" }
/// ```
///
/// ```
/// use tercel_neural::filter::NeuralImmHyper;
///
/// let hyper = NeuralImmHyper { hidden: 32, ..NeuralImmHyper::default() };
/// assert_eq!(hyper.bank()?.rates().len(), 21);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeuralImmHyper {
    /// Turn rates of the bank, rad/s.
    pub rates: Vec<f64>,
    /// Standard deviations of the acceleration, constant within a step, of which an object has one, m/s² per axis.
    pub accelerations: Vec<f64>,
    /// Probability of keeping the turn rate over a second.
    pub stay: f64,
    /// Probability of keeping the acceleration over a second.
    #[serde(default = "one")]
    pub noise_stay: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// Whether the network looks along the heading of the object, as suits a sensor of positions, or along the line of sight from
    /// the sensor.
    #[serde(default)]
    pub heading: bool,
    /// What the network takes for a metre, m: its inputs are made for aircraft far from a radar, and slower objects that are seen
    /// better look like those when they are measured with a shorter rule.
    #[serde(default = "one")]
    pub unit: f64,
    /// Width of the first layer.
    pub input: usize,
    /// Width of each recurrent layer.
    pub hidden: usize,
    /// Number of recurrent layers.
    pub layers: usize,
    /// What the recurrent layers are made of.
    #[serde(default)]
    pub cell: Recurrence,
}

/// What the recurrent layers of a network are made of. A step of them is a measurement, however long it was waited for: that is among
/// the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Recurrence {
    /// Gated recurrent units.
    #[default]
    Gru,
    /// Liquid neurons in closed form.
    Cfc {
        /// Width of the backbone.
        backbone: usize,
    },
    /// Liquid neurons, whose equation is solved.
    Ltc {
        /// Steps in which it is solved.
        unfolds: usize,
        /// How it is solved.
        solver: Solver,
    },
}

impl Recurrence {
    /// What the names of such layers begin with.
    pub fn name(self) -> &'static str {
        match self {
            Recurrence::Gru => "gru",
            Recurrence::Cfc { .. } => "cfc",
            Recurrence::Ltc { .. } => "ltc",
        }
    }

    /// A layer of this width.
    pub fn shape(self, size: usize) -> CellShape {
        match self {
            Recurrence::Gru => CellShape::Gru { size },
            Recurrence::Cfc { backbone } => CellShape::Cfc { size, backbone },
            Recurrence::Ltc { unfolds, solver } => CellShape::Ltc { size, unfolds, solver },
        }
    }
}

impl Default for NeuralImmHyper {
    /// 21 turn rates to ±20 °/s, accelerations of 7 and 14 m/s², one recurrent layer of 64.
    fn default() -> Self {
        NeuralImmHyper {
            rates: (-10..=10).map(|i| f64::from(2 * i).to_radians()).collect(),
            accelerations: vec![7.0, 14.0],
            stay: 0.985,
            noise_stay: 1.0,
            speed: 300.0,
            heading: false,
            unit: 1.0,
            input: 64,
            hidden: 64,
            layers: 1,
            cell: Recurrence::Gru,
        }
    }
}

fn one() -> f64 {
    1.0
}

/// Inputs of the network beside two for each turn rate.
const FEATURES: usize = 17;

/// Outputs of the network beside one for each turn rate: a correction of the state, and two scales of the covariance.
pub(super) const CORRECTIONS: usize = 4;
pub(super) const SCALES: usize = 2;

impl NeuralImmHyper {
    /// The bank of filters.
    ///
    /// # Errors
    /// When a rate is not finite or there is none, or another number of the bank cannot be.
    pub fn bank(&self) -> Result<TurnBank, FilterError> {
        for value in &self.accelerations {
            FilterError::positive("acceleration of the bank", *value)?;
        }
        let speed = FilterError::positive("speed of the bank", self.speed)?;
        TurnBank::new(self.rates.iter().copied())?
            .with_speed(speed)
            .with_transition(Transition::sticky(self.stay).per(1.0))
            .with_noise_transition(self.noise_transition())
            .with_noises(self.accelerations.iter().map(|value| AccelerationNoise::Piecewise(*value)))
    }

    fn noise_transition(&self) -> Transition {
        let stay = Transition::sticky(self.noise_stay);
        // One that never changes needs no roots of it.
        if self.noise_stay < 1.0 { stay.per(1.0) } else { stay }
    }

    /// Width of an input row of the network.
    pub fn inputs(&self) -> usize {
        2 * self.rates.len() + FEATURES
    }

    /// Width of an output row of the network: a logit for each turn rate, the correction of the state in standard deviations of
    /// the bank, and the logarithms of the scales of its position and velocity deviations.
    pub fn outputs(&self) -> usize {
        self.rates.len() + CORRECTIONS + SCALES
    }

    /// The recurrent layers: name, width of an input row, and shape.
    pub fn recurrent(&self) -> impl Iterator<Item = (String, usize, CellShape)> + '_ {
        (0..self.layers).map(|layer| {
            let inputs = if layer == 0 { self.input } else { self.hidden };
            (format!("{}.{layer}", self.cell.name()), inputs, self.cell.shape(self.hidden))
        })
    }

    /// The layers of the network, by name: `input` (linear, ReLU), `gru.0`, `gru.1`, ..., `output` (linear).
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let linear = |name: &str, inputs, outputs| (name.to_owned(), LayerShape::Linear { inputs, outputs });
        let mut layers = vec![linear("input", self.inputs(), self.input)];
        layers.extend(self.recurrent().map(|(name, inputs, cell)| (name, cell.layer(inputs))));
        layers.push(linear("output", self.hidden, self.outputs()));
        layers
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
        self.bank().map_err(|error| error.to_string())?;
        checked_positive(&[("unit", self.unit)])?;
        let sizes = [("input", self.input), ("hidden", self.hidden), ("layers", self.layers)];
        // The size of a cell is `hidden`.
        let cells = self.cell.shape(self.hidden).sizes().into_iter().skip(1);
        for (name, size) in sizes.into_iter().chain(cells) {
            if !(1..=1 << 16).contains(&size) {
                return Err(format!("`{name}` is {size}; expected 1 to 65536"));
            }
        }
        if self.rates.len() * self.accelerations.len() > 10_000 {
            return Err("`rates` and `accelerations` make more than 10,000 filters".into());
        }
        Ok(())
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        let refused = |reason: String| ModelError::Hyper { file: model.file().clone(), reason };
        let table = model.card().hyper.clone();
        let hyper: Self = table.try_into().map_err(|error: toml::de::Error| refused(error.to_string()))?;
        hyper.check().map_err(refused)?;
        Ok(hyper)
    }
}
