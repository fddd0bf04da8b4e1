//! Sizes and options of a KalmanNet, as its card holds them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::card::Scale;
use crate::error::ModelError;
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of a [`KalmanNet`](super::KalmanNet): the table `hyper` of its card.
///
/// ```toml
/// features = ["f2", "f4"]
/// normalise = true
/// magnitudes = false
/// sensor_frame = false
/// covariance = "riccati"
/// gain_offset = [[0.4, 0.0], [0.0, 0.4], [0.1, 0.0], [0.0, 0.1]]   # may be left out: zeros
///
/// [architecture]
/// kind = "architecture-1"
/// input = 480
/// hidden = 200
/// layers = 1
/// head = 32
/// ```
///
/// ```
/// use tercel_neural::filter::{Architecture, KalmanNetHyper};
///
/// let hyper = KalmanNetHyper::paper(Architecture::one());
/// let parameters = |hyper: &KalmanNetHyper| -> usize {
///     hyper.tensors().iter().map(|(_, shape)| shape.iter().product::<usize>()).sum()
/// };
/// assert_eq!(parameters(&hyper), 419_256);
/// assert_eq!(parameters(&KalmanNetHyper::paper(Architecture::two())), 29_088);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KalmanNetHyper {
    /// What the network sees, in the order of its inputs.
    pub features: Vec<Feature>,
    /// Divides each feature by its Euclidean length (at least 1e-12), as the publication does.
    pub normalise: bool,
    /// Appends `ln(1 + |Fᵢ| / sᵢ)` of each feature, in their order, and `ln(range / s)`, with `sᵢ` and `s` the scales `f1` to
    /// `f4` and `range` of the card. The range is that of the predicted position, and counts as one metre below that.
    pub magnitudes: bool,
    /// Turns the features so that the sensor sees the predicted position at an azimuth of zero, and the gain back.
    pub sensor_frame: bool,
    /// How the covariance is carried.
    pub covariance: Covariance,
    /// A gain that is added to that of the network (after which the sensor frame is turned back): rows `x, y, vx, vy`,
    /// columns `x, y`. With it a network that gives zero is an alpha-beta filter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_offset: Option<[[f32; 2]; 4]>,
    /// The network. Last, as TOML wants tables.
    pub architecture: Architecture,
}

/// A difference that the network sees at step `t`; positions and velocities in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Feature {
    /// `y(t) - y(t-1)`: the difference of observations.
    F1,
    /// `y(t) - ŷ(t|t-1)`: the innovation.
    F2,
    /// `x̂(t-1|t-1) - x̂(t-2|t-2)`: the evolution of the estimate.
    F3,
    /// `x̂(t-1|t-1) - x̂(t-1|t-2)`: the last update of the estimate.
    F4,
}

impl Feature {
    /// All four, in order.
    pub const ALL: [Feature; 4] = [Feature::F1, Feature::F2, Feature::F3, Feature::F4];

    /// Number of components.
    pub fn width(self) -> usize {
        match self {
            Feature::F1 | Feature::F2 => 2,
            Feature::F3 | Feature::F4 => 4,
        }
    }

    fn index(self) -> usize {
        self as usize
    }
}

/// How a [`KalmanNet`](super::KalmanNet) carries its covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Covariance {
    /// The recursion of the Kalman filter with the process and measurement noise, whatever the gain was.
    Riccati,
    /// `P = (I - K H) P⁻ (I - K H)ᵀ + K R Kᵀ` with the learned gain.
    Joseph,
}

/// The network of a [`KalmanNet`](super::KalmanNet).
///
/// Tensors are those of [`layer`](crate::layer), named as below. The output of the last layer is the gain, row by row:
/// `[k(x,x), k(x,y), k(y,x), k(y,y), k(vx,x), ...]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", deny_unknown_fields)]
pub enum Architecture {
    /// One stack: `input` (linear, ReLU), `gru.0`, `gru.1`, ..., `head` (linear, ReLU; unless its size is zero), `gain`
    /// (linear). The memory begins as zeros.
    #[serde(rename = "architecture-1")]
    Stacked {
        /// Width of the first layer.
        input: usize,
        /// Width of each recurrent layer.
        hidden: usize,
        /// Number of recurrent layers.
        layers: usize,
        /// Width of the layer after them; zero for none.
        head: usize,
    },
    /// Three small recurrent layers in the places of the process noise (`q`), the state covariance (`sigma`) and the
    /// innovation covariance (`s`), with `m = 4` and `n = 2` components of state and measurement:
    /// ```text
    /// q      = gru_q(fc5 F4)                    fc5: 5 m        gru_q: m²
    /// sigma  = gru_sigma(q, fc6 F3)             fc6: 5 m        gru_sigma: m²
    /// s      = gru_s(fc1 sigma, fc7(F1, F2))    fc1: n²         fc7: 2 · 5 n        gru_s: n²
    /// K      = fc2.1 fc2.0(sigma, s)            fc2.0: 40 (m² + n²)                 fc2.1: m n, no ReLU
    /// sigma' = fc4(sigma, fc3(s, K))            fc3: m²         fc4: m²             the memory of gru_sigma from here on
    /// ```
    /// All but `fc2.1` end in a ReLU; `K` is taken without the gain offset. Needs the features `f1, f2, f3, f4`; magnitudes
    /// go where their features go, that of the range to `fc7`, each behind the features. The memory begins as the identities
    /// for `q` and `s` and as zeros for `sigma`, and lies in the order `q, sigma, s`.
    #[serde(rename = "architecture-2")]
    Branched {
        /// Width of the input layers per component: 5.
        in_mult: usize,
        /// Width of `fc2.0` per number of memory in `sigma` and `s`: 40.
        out_mult: usize,
    },
}

impl Architecture {
    /// The stack of the publication for linear models: 480, one recurrent layer of 200, 32.
    pub fn one() -> Self {
        Architecture::Stacked { input: 480, hidden: 200, layers: 1, head: 32 }
    }

    /// The branched network of the publication.
    pub fn two() -> Self {
        Architecture::Branched { in_mult: 5, out_mult: 40 }
    }
}

/// Components of the state and of a reading.
pub(super) const STATE: usize = 4;
pub(super) const READING: usize = 2;

/// Names of the scales, and their units.
const SCALES: [(&str, f64, &str); 5] =
    [("f1", 100.0, "m"), ("f2", 100.0, "m"), ("f3", 100.0, "1"), ("f4", 100.0, "1"), ("range", 100e3, "m")];

impl KalmanNetHyper {
    /// The options of the publication: normalised features in the frame of the state and no magnitudes, a covariance that
    /// does not know the gain. Architecture #1 sees F2 and F4, #2 all four.
    pub fn paper(architecture: Architecture) -> Self {
        let features = match architecture {
            Architecture::Stacked { .. } => vec![Feature::F2, Feature::F4],
            Architecture::Branched { .. } => Feature::ALL.to_vec(),
        };
        KalmanNetHyper {
            features,
            normalise: true,
            magnitudes: false,
            sensor_frame: false,
            covariance: Covariance::Riccati,
            gain_offset: None,
            architecture,
        }
    }

    /// The usual scales, which the card of a model with magnitudes holds: 100 m, 100 m, 100, 100 and 100 km. `f3` and `f4` mix
    /// metres and metres per second, so their unit is `1`.
    pub fn default_scales() -> BTreeMap<String, Scale> {
        let scale = |(name, value, unit): (&str, f64, &str)| {
            (name.to_owned(), Scale { value, unit: unit.to_owned() })
        };
        SCALES.map(scale).into()
    }

    /// This as the table `hyper` of a card.
    ///
    /// # Errors
    /// When a size does not fit a TOML integer.
    pub fn to_table(&self) -> Result<toml::Table, String> {
        toml::Table::try_from(self).map_err(|error| error.to_string())
    }

    /// Width of an input row of the network.
    pub fn inputs(&self) -> usize {
        let features: usize = self.features.iter().map(|feature| feature.width()).sum();
        features + if self.magnitudes { self.features.len() + 1 } else { 0 }
    }

    /// The layers of the network, by name.
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        match self.architecture {
            Architecture::Stacked { input, hidden, layers, head } => {
                let mut all = vec![linear("input", self.inputs(), input)];
                for layer in 0..layers {
                    let inputs = if layer == 0 { input } else { hidden };
                    all.push((format!("gru.{layer}"), LayerShape::Gru { inputs, size: hidden }));
                }
                if head > 0 {
                    all.push(linear("head", hidden, head));
                }
                all.push(linear("gain", if head > 0 { head } else { hidden }, STATE * READING));
                all
            }
            Architecture::Branched { in_mult, out_mult } => super::branched::layers(self, in_mult, out_mult),
        }
    }

    /// Names and shapes of all tensors of the network.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.layers().iter().flat_map(|(name, shape)| shape.tensors(name)).collect()
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        let refused = |reason: String| ModelError::Hyper { file: model.file().clone(), reason };
        let table = model.card().hyper.clone();
        let hyper: Self = table.try_into().map_err(|error: toml::de::Error| refused(error.to_string()))?;
        hyper.check().map_err(refused)?;
        Ok(hyper)
    }

    fn check(&self) -> Result<(), String> {
        for (index, feature) in self.features.iter().enumerate() {
            if self.features[..index].contains(feature) {
                return Err(format!("`features` names {feature:?} twice"));
            }
        }
        if self.features.is_empty() {
            return Err("`features` is empty; expected some of f1, f2, f3, f4".into());
        }
        let sizes: &[(&str, usize)] = match &self.architecture {
            Architecture::Stacked { input, hidden, layers, head } => {
                // Without a head its size is zero, which is no error.
                &[("input", *input), ("hidden", *hidden), ("layers", *layers), ("head", (*head).max(1))]
            }
            Architecture::Branched { in_mult, out_mult } => {
                if self.features != Feature::ALL {
                    let found = &self.features;
                    return Err(format!("`features` is {found:?}; architecture-2 needs f1, f2, f3, f4"));
                }
                &[("in_mult", *in_mult), ("out_mult", *out_mult)]
            }
        };
        if let Some((name, _)) = sizes.iter().find(|(_, size)| *size == 0) {
            return Err(format!("`architecture.{name}` is 0; expected at least 1"));
        }
        // Bounds that no network for single objects comes near, so that sizes cannot overflow.
        if let Some((name, size)) = sizes.iter().find(|(_, size)| *size > 1 << 16) {
            return Err(format!("`architecture.{name}` is {size}; expected at most 65536"));
        }
        if self.gain_offset.iter().flatten().flatten().any(|gain| !gain.is_finite()) {
            return Err("`gain_offset` holds a number that is not finite".into());
        }
        Ok(())
    }
}

fn linear(name: &str, inputs: usize, outputs: usize) -> (String, LayerShape) {
    (name.to_owned(), LayerShape::Linear { inputs, outputs })
}

/// What magnitudes are divided by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scales {
    features: [f64; 4],
    pub range: f64,
}

impl Scales {
    pub fn of_feature(&self, feature: Feature) -> f64 {
        self.features[feature.index()]
    }

    /// The scales of a model's card. A model without magnitudes needs none.
    pub fn of(model: &Model, hyper: &KalmanNetHyper) -> Result<Self, ModelError> {
        let mut values = SCALES.map(|(_, value, _)| value);
        for ((name, _, unit), value) in SCALES.iter().zip(&mut values) {
            let needed = *name == "range" || hyper.features.iter().any(|f| SCALES[f.index()].0 == *name);
            if hyper.magnitudes && needed {
                *value = scale(model, name, unit)?;
            }
        }
        let [f1, f2, f3, f4, range] = values;
        Ok(Scales { features: [f1, f2, f3, f4], range })
    }
}

fn scale(model: &Model, name: &str, unit: &str) -> Result<f64, ModelError> {
    let refused = |reason| {
        let (file, scale) = (model.file().clone(), name.to_owned());
        Err(ModelError::Scale { file, scale, reason })
    };
    match model.card().scales.get(name) {
        None => refused("is missing; models with magnitudes have one".into()),
        Some(scale) if scale.unit != unit => refused(format!("is in `{}`; expected `{unit}`", scale.unit)),
        Some(scale) if scale.value <= 0.0 => {
            refused(format!("is {}; expected a positive number", scale.value))
        }
        Some(scale) => Ok(scale.value),
    }
}
