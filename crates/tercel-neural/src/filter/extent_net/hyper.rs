//! Sizes and options of an ExtentNet.

use serde::{Deserialize, Serialize};

use super::frame::{DOUBTED, SEEN, TOLD};
use crate::error::ModelError;
use crate::filter::{checked_positive, checked_sizes, hyper_of};
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of an [`ExtentNet`](super::ExtentNet): the table `hyper` of its card.
///
/// ```toml
/// interval = 1.0          # the time step that the network was trained for, s
/// frame = "residual"      # or "absolute"
/// origin = [0.0, 0.0]     # what positions are relative to in the absolute frame, m
/// position = 2.0          # unit of positions, m
/// velocity = 3.0          # unit of velocities, m/s
/// change = 1.5            # unit of differences of velocities, m/s
/// extent = 3.0            # unit of the factor of the extent, m
/// axes = [6.0, 1.25]      # semi-axes of a new object, m
/// worth = 4.0             # how many points these are worth
/// speed = 5.0             # standard deviation of a new object's velocity, m/s per axis
///
/// [architecture]
/// kind = "transformer"    # or "lstm", with `units`
/// size = 128              # width of a row between the layers
/// heads = 8               # heads of each attention
/// layers = 1
/// feed = 344              # width inside the feed-forward part of a layer
/// window = 64             # scans that are remembered
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtentNetHyper {
    /// The time step that the network was trained for, s.
    pub interval: f64,
    /// What positions and velocities are relative to.
    pub frame: Frame,
    /// What positions are relative to in the absolute frame, m.
    #[serde(default)]
    pub origin: [f64; 2],
    /// Unit of positions, m.
    pub position: f64,
    /// Unit of velocities, m/s.
    pub velocity: f64,
    /// Unit of differences of velocities, and deviation of the jump of the velocity in an interval without a scan, m/s.
    pub change: f64,
    /// Unit of the factor of the extent, m.
    pub extent: f64,
    /// Semi-axes of a new object, along the axes of the plane, m.
    pub axes: [f64; 2],
    /// How many points these are worth.
    pub worth: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// The layers.
    pub architecture: Architecture,
}

/// What positions and velocities are relative to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Frame {
    /// A fixed origin, and rest: as published.
    Absolute,
    /// The centroid of the scan, and its way since the scan before.
    Residual,
}

/// The layers that remember.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Architecture {
    /// One layer of long short-term memory.
    Lstm {
        /// Units of the memory.
        units: usize,
    },
    /// A decoder with a token for each scan.
    Transformer {
        /// Width of a row between the layers.
        size: usize,
        /// Heads of each attention, which cut the size into pieces of an even width.
        heads: usize,
        /// Number of layers.
        layers: usize,
        /// Width inside the feed-forward part of a layer.
        feed: usize,
        /// Scans that are remembered, the present one included.
        window: usize,
    },
}

impl Architecture {
    /// Width of what the heads see.
    pub fn size(&self) -> usize {
        match self {
            Architecture::Lstm { units } => *units,
            Architecture::Transformer { size, .. } => *size,
        }
    }
}

impl Default for ExtentNetHyper {
    fn default() -> Self {
        ExtentNetHyper {
            interval: 1.0,
            frame: Frame::Residual,
            origin: [0.0; 2],
            position: 2.0,
            velocity: 3.0,
            change: 1.5,
            extent: 3.0,
            axes: [6.0, 1.25],
            worth: 4.0,
            speed: 5.0,
            architecture: Architecture::Lstm { units: 64 },
        }
    }
}

impl ExtentNetHyper {
    /// The layers of the network, by name: `memory` (LSTM), or `embed` (linear), `block.N` with its parts and `norm`; then `output`
    /// and `doubt` (linear).
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let linear = |inputs, outputs| LayerShape::Linear { inputs, outputs };
        let mut layers: Vec<(String, LayerShape)> = Vec::new();
        match &self.architecture {
            Architecture::Lstm { units } => {
                layers.push(("memory".into(), LayerShape::Lstm { inputs: SEEN, size: *units }));
            }
            Architecture::Transformer { size, layers: count, feed, .. } => {
                let (size, norm) = (*size, LayerShape::RmsNorm { size: *size });
                layers.push(("embed".into(), linear(SEEN, size)));
                for block in (0..*count).map(|index| format!("block.{index}")) {
                    layers.push((format!("{block}.norm.0"), norm));
                    layers.push((format!("{block}.attention"), LayerShape::Attention { size }));
                    layers.push((format!("{block}.norm.1"), norm));
                    layers.push((format!("{block}.feed"), LayerShape::SwiGlu { size, hidden: *feed }));
                }
                layers.push(("norm".into(), norm));
            }
        }
        let size = self.architecture.size();
        layers.push(("output".into(), linear(size, TOLD)));
        layers.push(("doubt".into(), linear(size, DOUBTED)));
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
        checked_positive(&[
            ("interval", self.interval),
            ("position", self.position),
            ("velocity", self.velocity),
            ("change", self.change),
            ("extent", self.extent),
            ("axes[0]", self.axes[0]),
            ("axes[1]", self.axes[1]),
            ("worth", self.worth),
            ("speed", self.speed),
        ])?;
        if let Some(value) = self.origin.iter().find(|value| !value.is_finite()) {
            return Err(format!("`origin` has {value}; expected finite numbers"));
        }
        match &self.architecture {
            Architecture::Lstm { units } => checked_sizes(&[("architecture.units", *units)]),
            Architecture::Transformer { size, heads, layers, feed, window } => {
                checked_sizes(&[
                    ("architecture.size", *size),
                    ("architecture.heads", *heads),
                    ("architecture.layers", *layers),
                    ("architecture.feed", *feed),
                    ("architecture.window", *window),
                ])?;
                if !size.is_multiple_of(2 * heads) {
                    let expected = "expected a divisor of half of `architecture.size`";
                    return Err(format!("`architecture.heads` is {heads}; {expected}, {size}"));
                }
                Ok(())
            }
        }
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        hyper_of(model, ExtentNetHyper::check)
    }
}
