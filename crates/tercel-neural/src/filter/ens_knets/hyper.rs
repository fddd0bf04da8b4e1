//! Sizes and options of an ensemble of KalmanNets, as its card holds them.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use tercel_core::motion::{AccelerationNoise, Turn};

use crate::card::Scale;
use crate::error::ModelError;
use crate::filter::kalman_net::KalmanNetHyper;
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of an [`EnsKNets`](super::EnsKNets): the table `hyper` of its card.
///
/// ```toml
/// rates = [0.0, 0.17453, -0.17453]   # turn rate of each KalmanNet, rad/s
/// acceleration = 10.0                # standard deviation, constant within a step, m/s²
/// speed = 300.0                      # standard deviation of a new object's velocity, m/s per axis
/// normalisation = "relative"
/// attention = { sign = "minus", temperature = 0.9 }     # without it: EnsKNets
/// correction = { hidden = 64, layers = 2 }              # without it: the states of the KalmanNets as they are
/// classification = { hidden = 64, layers = 2 }          # without it: the same probability for each
///
/// [[nets]]                           # a `KalmanNetHyper` for each rate
/// ```
///
/// The scales `position` (m) and `velocity` (m/s) of the card are the units of the corrections; those of the
/// KalmanNets have the prefix of their tensors: `net.0.range`.
///
/// ```
/// use tercel_neural::filter::{Architecture, BranchHyper, EnsKNetsHyper, KalmanNetHyper};
///
/// let nets = vec![KalmanNetHyper::paper(Architecture::one()); 3];
/// let parameters = |hyper: &EnsKNetsHyper| -> usize {
///     let branches = hyper.tensors().into_iter().filter(|(name, _)| !name.starts_with("net."));
///     branches.map(|(_, shape)| shape.iter().product::<usize>()).sum()
/// };
/// // One bias for each gate, where PyTorch has two: 1,024 numbers fewer than published counts.
/// assert_eq!(parameters(&EnsKNetsHyper::ens_knets(nets.clone())), 104_911 - 1_024);
/// assert_eq!(parameters(&EnsKNetsHyper::att_ens_knets(nets)), 103_375 - 1_024);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnsKNetsHyper {
    /// Turn rate of each KalmanNet, rad/s, positive to the left.
    pub rates: Vec<f64>,
    /// Standard deviation of the acceleration that is constant within a step, m/s² per axis: it enters the
    /// covariances.
    pub acceleration: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// What the branches see, and how it is made comparable.
    pub normalisation: Normalisation,
    /// How the KalmanNets are weighed before the branches see them; `None` for EnsKNets, which show them all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention: Option<Attention>,
    /// The branch that corrects each KalmanNet's state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<BranchHyper>,
    /// The branch that says how probable each KalmanNet is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub classification: Option<BranchHyper>,
    /// The KalmanNets, one for each rate.
    pub nets: Vec<KalmanNetHyper>,
}

/// What the branches of an [`EnsKNets`](super::EnsKNets) see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normalisation {
    /// States and measurements, each component normalised by its mean and variance since the birth of the
    /// object.
    Running,
    /// What distinguishes the KalmanNets, in the frame of the line of sight and in fixed units; both branches
    /// see the same.
    Relative,
    /// States and measurements, each component normalised over all of a track, its future included, as the
    /// publication does. Only [`OfflineEnsKNets`](super::OfflineEnsKNets) can do that.
    Sequence,
}

/// How an [`EnsKNets`](super::EnsKNets) weighs its KalmanNets by their innovations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Attention {
    /// What the normalised innovation squared (NIS) speaks for.
    pub sign: Sign,
    /// Divides the NIS by `max(1, e / 2)`, with `e` the exponential mean of the smallest NIS of each step, of
    /// which this share is kept. Noises that are stated too small then do not make one KalmanNet win every
    /// step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
    /// Probability that the motion is the same after a second: weights go on from those of the last step, as
    /// in an IMM.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stay: Option<f64>,
}

/// What a large normalised innovation squared (NIS) speaks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sign {
    /// Against a KalmanNet: `softmax(-NIS/2 - ln|S|/2)`, the likelihood of the measurement.
    Minus,
    /// For it: `softmax(NIS)`, as equation 13 is printed.
    Plus,
}

/// A branch: recurrent layers and a linear head.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BranchHyper {
    /// Width of each recurrent layer.
    pub hidden: usize,
    /// Number of recurrent layers.
    pub layers: usize,
}

impl Default for BranchHyper {
    /// Two layers of 64, as published.
    fn default() -> Self {
        BranchHyper { hidden: 64, layers: 2 }
    }
}

/// Components of the state and of a reading.
pub(super) const STATE: usize = 4;
pub(super) const READING: usize = 2;

/// Relative inputs: for each KalmanNet, with one more under attention; and common to all, with a state more
/// under attention.
const EACH: usize = 7;
const COMMON: usize = 8;

/// Names of the scales, and their units.
const SCALES: [(&str, f64, &str); 2] = [("position", 100.0, "m"), ("velocity", 10.0, "m/s")];

impl EnsKNetsHyper {
    /// EnsKNets with the branches of the publication, causal: three nets for straight flight and turns of ±10
    /// °/s.
    pub fn ens_knets(nets: Vec<KalmanNetHyper>) -> Self {
        let turn = 10.0_f64.to_radians();
        EnsKNetsHyper {
            rates: vec![0.0, turn, -turn],
            acceleration: 10.0,
            speed: 300.0,
            normalisation: Normalisation::Running,
            attention: None,
            correction: Some(BranchHyper::default()),
            classification: Some(BranchHyper::default()),
            nets,
        }
    }

    /// AttEnsKNets with the branches of the publication, causal, and with the sign of equation 13 repaired.
    pub fn att_ens_knets(nets: Vec<KalmanNetHyper>) -> Self {
        let attention = Some(Attention { sign: Sign::Minus, temperature: None, stay: None });
        EnsKNetsHyper { attention, ..Self::ens_knets(nets) }
    }

    /// The usual scales of the corrections, which the card of a model holds: 100 m and 10 m/s.
    pub fn default_scales() -> BTreeMap<String, Scale> {
        let scale = |(name, value, unit): (&str, f64, &str)| {
            (name.to_owned(), Scale { value, unit: unit.to_owned() })
        };
        SCALES.map(scale).into()
    }

    /// The number of KalmanNets.
    pub fn modes(&self) -> usize {
        self.rates.len()
    }

    /// The motion of a KalmanNet.
    pub(super) fn motion(&self, rate: f64) -> Turn {
        Turn::with_noise(rate, AccelerationNoise::Piecewise(self.acceleration)).with_speed(self.speed)
    }

    /// Whether both branches see the same.
    fn shared(&self) -> bool {
        self.attention.is_some() || self.normalisation == Normalisation::Relative
    }

    /// Width of the inputs of both branches together; what both see counts once.
    pub fn inputs(&self) -> usize {
        self.correction_inputs().end.max(self.classification_inputs().end)
    }

    /// Which of the inputs the correction branch sees; nothing if there is none.
    pub fn correction_inputs(&self) -> Range<usize> {
        match self.correction {
            None => 0..0,
            Some(_) if self.shared() => 0..self.shared_inputs(),
            Some(_) => 0..STATE * self.modes(),
        }
    }

    /// Which of the inputs the classification branch sees; nothing if there is none.
    pub fn classification_inputs(&self) -> Range<usize> {
        let start = self.correction_inputs().end;
        match self.classification {
            None => 0..0,
            Some(_) if self.shared() => 0..self.shared_inputs(),
            Some(_) => start..start + READING,
        }
    }

    fn shared_inputs(&self) -> usize {
        let attention = usize::from(self.attention.is_some());
        match self.normalisation {
            Normalisation::Relative => (EACH + attention) * self.modes() + COMMON + STATE * attention,
            Normalisation::Running | Normalisation::Sequence => STATE,
        }
    }

    /// Width of the outputs: a correction `x, y, vx, vy` for each KalmanNet, then a logit for each, as far as
    /// there are branches.
    pub fn outputs(&self) -> usize {
        let modes = self.modes();
        let width = |branch: &Option<BranchHyper>, each| if branch.is_some() { each * modes } else { 0 };
        width(&self.correction, STATE) + width(&self.classification, 1)
    }

    /// The layers of the branches, by name: `correction.lstm.0`, `correction.lstm.1`, .., `correction.head`,
    /// and the same of `classification`.
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let modes = self.modes();
        let branches = [
            ("correction", self.correction, self.correction_inputs().len(), STATE * modes),
            ("classification", self.classification, self.classification_inputs().len(), modes),
        ];
        let mut all = Vec::new();
        for (name, branch, inputs, outputs) in branches {
            let Some(BranchHyper { hidden, layers }) = branch else { continue };
            for layer in 0..layers {
                let inputs = if layer == 0 { inputs } else { hidden };
                all.push((format!("{name}.lstm.{layer}"), LayerShape::Lstm { inputs, size: hidden }));
            }
            all.push((format!("{name}.head"), LayerShape::Linear { inputs: hidden, outputs }));
        }
        all
    }

    /// Names and shapes of all tensors: those of the KalmanNets with `net.0.`, `net.1.`, .. before their
    /// names, then those of the branches.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        let nets = self.nets.iter().enumerate().flat_map(|(index, net)| {
            net.tensors().into_iter().map(move |(name, shape)| (format!("net.{index}.{name}"), shape))
        });
        nets.chain(self.layers().iter().flat_map(|(name, shape)| shape.tensors(name))).collect()
    }

    /// This as the table `hyper` of a card.
    ///
    /// # Errors
    /// When a size does not fit a TOML integer.
    pub fn to_table(&self) -> Result<toml::Table, String> {
        toml::Table::try_from(self).map_err(|error| error.to_string())
    }

    /// What cannot be, if anything. The KalmanNets' own options are judged when they are built.
    ///
    /// # Errors
    /// Names the option, what it is and what was expected.
    pub fn check(&self) -> Result<(), String> {
        if self.rates.is_empty() || self.rates.len() > 1000 {
            return Err(format!("there are {} `rates`; expected 1 to 1000", self.rates.len()));
        }
        if let Some(rate) = self.rates.iter().find(|rate| !rate.is_finite()) {
            return Err(format!("`rates` holds {rate}; expected finite rates, rad/s"));
        }
        if self.nets.len() != self.rates.len() {
            return Err(format!("there are {} `nets` for {} `rates`", self.nets.len(), self.rates.len()));
        }
        for (name, value) in [("acceleration", self.acceleration), ("speed", self.speed)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("`{name}` is {value}; expected a positive number"));
            }
        }
        for (name, branch) in [("correction", self.correction), ("classification", self.classification)] {
            let Some(BranchHyper { hidden, layers }) = branch else { continue };
            for (size, most, part) in [(hidden, 1 << 16, "hidden"), (layers, 1000, "layers")] {
                if !(1..=most).contains(&size) {
                    return Err(format!("`{name}.{part}` is {size}; expected 1 to {most}"));
                }
            }
        }
        self.attention.map_or(Ok(()), |attention| attention.check(self.modes()))
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

impl Attention {
    fn check(&self, modes: usize) -> Result<(), String> {
        if let Some(share) = self.temperature
            && !(0.0..1.0).contains(&share)
        {
            return Err(format!(
                "`attention.temperature` is {share}; expected a share, at least 0 and below 1"
            ));
        }
        let Some(stay) = self.stay else { return Ok(()) };
        // Otherwise there is no process in continuous time with these probabilities.
        let least = 1.0 / modes as f64;
        if !(stay > least && stay <= 1.0) && modes > 1 {
            return Err(format!("`attention.stay` is {stay}; expected more than {least:.3} and at most 1"));
        }
        if self.sign == Sign::Plus {
            return Err(
                "`attention.stay` needs the sign `minus`: weights that go on must be likelihoods".into()
            );
        }
        Ok(())
    }
}

/// The units of the corrections, of a model's card.
pub(super) fn scales(model: &Model) -> Result<[f64; 2], ModelError> {
    let mut values = [0.0; 2];
    for (value, (name, _, unit)) in values.iter_mut().zip(SCALES) {
        let refused =
            |reason| Err(ModelError::Scale { file: model.file().clone(), scale: name.to_owned(), reason });
        *value = match model.card().scales.get(name) {
            None => return refused("is missing; it is the unit of a correction".to_owned()),
            Some(scale) if scale.unit != unit => {
                return refused(format!("is in `{}`; expected `{unit}`", scale.unit));
            }
            Some(scale) if scale.value <= 0.0 => {
                return refused(format!("is {}; expected a positive number", scale.value));
            }
            Some(scale) => scale.value,
        };
    }
    Ok(values)
}
