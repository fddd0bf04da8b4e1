//! The gain network of a KalmanNet, differentiable: the layers of [`tercel_neural::filter::Architecture`] by
//! the same names.

use tercel_neural::filter::{Architecture, KalmanNetHyper};

use super::operations::Columns;
use crate::backend::{Tensor, apply, constant};
use crate::layer::{Activation, Gru, Linear, numbered};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// Components of the state and of a reading.
const STATE: usize = 4;
const READING: usize = 2;

/// Sizes of the memories in the places of covariances.
const SIGMA: usize = STATE * STATE;
const S: usize = READING * READING;

/// From features to a gain.
#[derive(Debug)]
pub(super) enum Network {
    /// Architecture #1.
    Stacked { input: Linear, recurrent: Vec<Gru>, head: Option<Linear>, gain: Linear },
    /// Architecture #2.
    Branched(Box<Branched>),
}

/// Architecture #2: three recurrent layers in the places of three covariances.
#[derive(Debug)]
pub(super) struct Branched {
    magnitudes: bool,
    fc1: Linear,
    fc2: [Linear; 2],
    fc3: Linear,
    fc4: Linear,
    fc5: Linear,
    fc6: Linear,
    fc7: Linear,
    gru_q: Gru,
    gru_sigma: Gru,
    gru_s: Gru,
}

/// The layer that gives the gain. It may start as zero, which leaves the gain to the offset.
fn gain(set: &mut ParameterSet, name: &str, inputs: usize, zero: bool) -> Result<Linear, TrainError> {
    let (outputs, activation) = (STATE * READING, Activation::Identity);
    if zero {
        let zeros = [Initial::Constant(0.0), Initial::Constant(0.0)];
        return Linear::with_initial(set, name, [inputs, outputs], activation, zeros);
    }
    Linear::new(set, name, inputs, outputs, activation)
}

impl Network {
    /// Adds the parameters of a network to a set.
    pub(super) fn new(
        set: &mut ParameterSet,
        hyper: &KalmanNetHyper,
        zero: bool,
    ) -> Result<Self, TrainError> {
        let relu = Activation::Relu;
        match hyper.architecture {
            Architecture::Stacked { input, hidden, layers, head } => Ok(Self::Stacked {
                input: Linear::new(set, "input", hyper.inputs(), input, relu)?,
                recurrent: (0..layers)
                    .map(|layer| {
                        let inputs = if layer == 0 { input } else { hidden };
                        Gru::new(set, &numbered("gru", layer), inputs, hidden)
                    })
                    .collect::<Result<_, _>>()?,
                head: match head {
                    0 => None,
                    _ => Some(Linear::new(set, "head", hidden, head, relu)?),
                },
                gain: gain(set, "gain", if head > 0 { head } else { hidden }, zero)?,
            }),
            Architecture::Branched { in_mult, out_mult } => {
                Branched::new(set, hyper.magnitudes, [in_mult, out_mult], zero)
                    .map(|layers| Self::Branched(Box::new(layers)))
            }
        }
    }

    /// The memories before the first step.
    pub(super) fn initial(&self, batch: usize) -> Vec<Tensor> {
        match self {
            Self::Stacked { recurrent, .. } => recurrent.iter().map(|layer| layer.zero(batch)).collect(),
            Self::Branched(layers) => {
                let identity = |n: usize| {
                    let row = (0..n * n).map(|i| if i % (n + 1) == 0 { 1.0 } else { 0.0 });
                    constant(row.collect::<Vec<_>>().repeat(batch), [batch, n * n])
                };
                vec![identity(STATE), layers.gru_sigma.zero(batch), identity(READING)]
            }
        }
    }

    /// The gains `[batch, 8]` for the inputs of a step, and the memories after it.
    pub(super) fn step(&self, weights: &Weights, inputs: Tensor, memory: &[Tensor]) -> (Tensor, Vec<Tensor>) {
        match self {
            Self::Stacked { input, recurrent, head, gain } => {
                let mut value = input.forward(weights, inputs);
                let mut next = Vec::with_capacity(memory.len());
                for (layer, memory) in recurrent.iter().zip(memory) {
                    value = layer.forward(weights, value, memory.clone());
                    next.push(value.clone());
                }
                if let Some(head) = head {
                    value = head.forward(weights, value);
                }
                (gain.forward(weights, value), next)
            }
            Self::Branched(layers) => layers.step(weights, inputs, memory),
        }
    }
}

impl Branched {
    fn new(
        set: &mut ParameterSet,
        magnitudes: bool,
        [in_mult, out_mult]: [usize; 2],
        zero: bool,
    ) -> Result<Self, TrainError> {
        let relu = Activation::Relu;
        let magnitude = usize::from(magnitudes);
        let wide = (SIGMA + S) * out_mult;
        let (state, seen) = (STATE * in_mult, 2 * READING * in_mult);
        let mut linear = |name, inputs, outputs| Linear::new(set, name, inputs, outputs, relu);
        let fc1 = linear("fc1", SIGMA, S)?;
        let fc2_wide = linear("fc2.0", SIGMA + S, wide)?;
        let fc3 = linear("fc3", S + STATE * READING, SIGMA)?;
        let fc4 = linear("fc4", 2 * SIGMA, SIGMA)?;
        let fc5 = linear("fc5", STATE + magnitude, state)?;
        let fc6 = linear("fc6", STATE + magnitude, state)?;
        let fc7 = linear("fc7", 2 * READING + 3 * magnitude, seen)?;
        Ok(Self {
            magnitudes,
            fc1,
            fc2: [fc2_wide, gain(set, "fc2.1", wide, zero)?],
            fc3,
            fc4,
            fc5,
            fc6,
            fc7,
            gru_q: Gru::new(set, "gru_q", state, SIGMA)?,
            gru_sigma: Gru::new(set, "gru_sigma", SIGMA + state, SIGMA)?,
            gru_s: Gru::new(set, "gru_s", S + seen, S)?,
        })
    }

    fn step(&self, weights: &Weights, inputs: Tensor, memory: &[Tensor]) -> (Tensor, Vec<Tensor>) {
        // Features F1 to F4 have 2, 2, 4 and 4 columns; behind them their magnitudes, and that of the range.
        let part = |features: std::ops::Range<usize>, magnitudes: &[usize]| {
            let magnitudes = if self.magnitudes { magnitudes } else { &[] };
            let columns = features.chain(magnitudes.iter().copied()).collect();
            apply(Columns { columns }, [inputs.clone()])
        };
        let [q, sigma, s] = [0, 1, 2].map(|n| memory[n].clone());
        let join = |parts: [&Tensor; 2]| Tensor::cat(parts.map(Tensor::clone).to_vec(), 1);

        let update = self.fc5.forward(weights, part(8..12, &[15]));
        let q = self.gru_q.forward(weights, update, q);
        let evolution = self.fc6.forward(weights, part(4..8, &[14]));
        let sigma = self.gru_sigma.forward(weights, join([&q, &evolution]), sigma);
        let expected = self.fc1.forward(weights, sigma.clone());
        let seen = self.fc7.forward(weights, part(0..4, &[12, 13, 16]));
        let s = self.gru_s.forward(weights, join([&expected, &seen]), s);

        let wide = self.fc2[0].forward(weights, join([&sigma, &s]));
        let gain = self.fc2[1].forward(weights, wide);
        let fed_back = self.fc3.forward(weights, join([&s, &gain]));
        let sigma = self.fc4.forward(weights, join([&sigma, &fed_back]));
        (gain, vec![q, sigma, s])
    }
}
