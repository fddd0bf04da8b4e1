//! Which tensors a layer is made of.

use super::{
    Attention, Bidirectional, Cell, CellShape, Cfc, Gru, LayerNorm, Linear, Lstm, Ltc, LtcWeights, Mlp,
    RmsNorm, RotaryAttention, SwiGlu, SynapseWeights,
};
use crate::error::ModelError;
use crate::model::Weights;

/// The kind and the sizes of a layer, from which its tensors in a model file follow.
///
/// Whoever trains a network makes the tensors of these names and shapes, and whoever runs it reads them.
///
/// ```
/// use tercel_neural::layer::LayerShape;
///
/// let tensors = LayerShape::Linear { inputs: 6, outputs: 8 }.tensors("gain");
/// assert_eq!(tensors, [("gain.weight".to_owned(), vec![6, 8]), ("gain.bias".to_owned(), vec![8])]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LayerShape {
    /// A [`Linear`] layer.
    Linear {
        /// Width of an input row.
        inputs: usize,
        /// Width of an output row.
        outputs: usize,
    },
    /// A [`Gru`] layer.
    Gru {
        /// Width of an input row.
        inputs: usize,
        /// Width of the memory.
        size: usize,
    },
    /// An [`Lstm`] layer.
    Lstm {
        /// Width of an input row.
        inputs: usize,
        /// Width of the output.
        size: usize,
    },
    /// An [`Ltc`] layer.
    Ltc {
        /// Width of an input row.
        inputs: usize,
        /// Number of neurons.
        size: usize,
    },
    /// A [`Cfc`] layer.
    Cfc {
        /// Width of an input row.
        inputs: usize,
        /// Number of neurons.
        size: usize,
        /// Width of the backbone.
        backbone: usize,
    },
    /// An [`Mlp`].
    Mlp {
        /// Width of an input row.
        inputs: usize,
        /// Width of the first layer.
        hidden: usize,
        /// Width of an output row.
        size: usize,
    },
    /// A [`Bidirectional`] layer.
    Bidirectional {
        /// Width of an input row.
        inputs: usize,
        /// Width of the output of each half.
        size: usize,
    },
    /// An [`Attention`] or [`RotaryAttention`] layer.
    Attention {
        /// Width of a row.
        size: usize,
    },
    /// A [`SwiGlu`].
    SwiGlu {
        /// Width of a row.
        size: usize,
        /// Width inside.
        hidden: usize,
    },
    /// An [`RmsNorm`].
    RmsNorm {
        /// Width of a row.
        size: usize,
    },
    /// A [`LayerNorm`].
    LayerNorm {
        /// Width of a row.
        size: usize,
    },
}

/// Numbers of the synapses of an LTC, from its input and among its neurons.
const SYNAPSES: [[&str; 4]; 2] = [
    ["input.strength", "input.slope", "input.centre", "input.reversal"],
    ["hidden.strength", "hidden.slope", "hidden.centre", "hidden.reversal"],
];

impl LayerShape {
    /// Names and shapes of the tensors of a layer of this name.
    pub fn tensors(self, name: &str) -> Vec<(String, Vec<usize>)> {
        // Sizes come from files: those that overflow fit no tensor.
        let times = usize::saturating_mul;
        let within = |parts: &[(&str, LayerShape)]| {
            parts.iter().flat_map(|(part, shape)| shape.tensors(&format!("{name}.{part}"))).collect()
        };
        let parts = match self {
            LayerShape::Bidirectional { inputs, size } => {
                let half = LayerShape::Lstm { inputs, size };
                return within(&[("forward", half), ("backward", half)]);
            }
            LayerShape::Attention { size } => {
                let part = LayerShape::Linear { inputs: size, outputs: size };
                return within(&[("query", part), ("key", part), ("value", part), ("output", part)]);
            }
            LayerShape::SwiGlu { size, hidden } => {
                let part = LayerShape::Linear { inputs: size, outputs: hidden };
                let output = LayerShape::Linear { inputs: hidden, outputs: size };
                return within(&[("gate", part), ("value", part), ("output", output)]);
            }
            LayerShape::Mlp { inputs, hidden, size } => {
                let first = LayerShape::Linear { inputs, outputs: hidden };
                return within(&[
                    ("first", first),
                    ("second", LayerShape::Linear { inputs: hidden, outputs: size }),
                ]);
            }
            LayerShape::Ltc { inputs, size } => {
                let neurons = ["leak", "rest", "capacitance"].map(|part| (part, vec![size]));
                let of_input = SYNAPSES[0].map(|part| (part, vec![inputs, size]));
                let of_hidden = SYNAPSES[1].map(|part| (part, vec![size, size]));
                neurons.into_iter().chain(of_input).chain(of_hidden).collect()
            }
            LayerShape::Cfc { inputs, size, backbone } => {
                let heads = times(4, size);
                vec![
                    ("input", vec![inputs, backbone]),
                    ("hidden", vec![size, backbone]),
                    ("bias", vec![backbone]),
                    ("heads", vec![backbone, heads]),
                    ("heads_bias", vec![heads]),
                ]
            }
            LayerShape::RmsNorm { size } => vec![("weight", vec![size])],
            LayerShape::LayerNorm { size } => vec![("weight", vec![size]), ("bias", vec![size])],
            LayerShape::Linear { inputs, outputs } => {
                vec![("weight", vec![inputs, outputs]), ("bias", vec![outputs])]
            }
            LayerShape::Gru { inputs, size } => {
                let gates = times(3, size);
                vec![
                    ("input", vec![inputs, gates]),
                    ("input_bias", vec![gates]),
                    ("hidden", vec![size, gates]),
                    ("hidden_bias", vec![gates]),
                ]
            }
            LayerShape::Lstm { inputs, size } => {
                let gates = times(4, size);
                vec![("input", vec![inputs, gates]), ("hidden", vec![size, gates]), ("bias", vec![gates])]
            }
        };
        parts.into_iter().map(|(part, shape)| (format!("{name}.{part}"), shape)).collect()
    }
}

impl Weights<'_> {
    fn layer(&mut self, name: &str, shape: LayerShape) -> Result<Vec<&[f32]>, ModelError> {
        shape.tensors(name).iter().map(|(tensor, shape)| self.take(tensor, shape)).collect()
    }

    /// Takes a linear layer.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn linear(&mut self, name: &str, inputs: usize, outputs: usize) -> Result<Linear, ModelError> {
        let parts = self.layer(name, LayerShape::Linear { inputs, outputs })?;
        Ok(Linear::new(inputs, outputs, parts[0], parts[1]))
    }

    /// Takes a GRU layer.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn gru(&mut self, name: &str, inputs: usize, size: usize) -> Result<Gru, ModelError> {
        let parts = self.layer(name, LayerShape::Gru { inputs, size })?;
        Ok(Gru::new(inputs, size, parts[0], parts[1], parts[2], parts[3]))
    }

    /// Takes an LSTM layer.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn lstm(&mut self, name: &str, inputs: usize, size: usize) -> Result<Lstm, ModelError> {
        let parts = self.layer(name, LayerShape::Lstm { inputs, size })?;
        Ok(Lstm::new(inputs, size, parts[0], parts[1], parts[2]))
    }

    /// Takes a cell with this many inputs.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn cell(&mut self, name: &str, inputs: usize, shape: CellShape) -> Result<Cell, ModelError> {
        match shape {
            CellShape::Gru { size } => self.gru(name, inputs, size).map(Cell::Gru),
            CellShape::Mlp { size, hidden } => {
                let first = self.linear(&format!("{name}.first"), inputs, hidden)?;
                let second = self.linear(&format!("{name}.second"), hidden, size)?;
                Ok(Cell::Mlp(Mlp::new(first, second)))
            }
            CellShape::Cfc { size, backbone } => {
                let p = self.layer(name, shape.layer(inputs))?;
                Ok(Cell::Cfc(Cfc::new(inputs, size, backbone, p[0], p[1], p[2], p[3], p[4])))
            }
            CellShape::Ltc { size, unfolds, solver } => {
                let p = self.layer(name, shape.layer(inputs))?;
                let synapses = |at: usize| SynapseWeights {
                    strength: p[at],
                    slope: p[at + 1],
                    centre: p[at + 2],
                    reversal: p[at + 3],
                };
                let (input, hidden) = (synapses(3), synapses(7));
                let weights = LtcWeights { leak: p[0], rest: p[1], capacitance: p[2], input, hidden };
                Ok(Cell::Ltc(Ltc::new(inputs, size, solver, unfolds, weights)))
            }
        }
    }

    /// Takes a bidirectional layer.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn bidirectional(
        &mut self,
        name: &str,
        inputs: usize,
        size: usize,
    ) -> Result<Bidirectional, ModelError> {
        let forward = self.lstm(&format!("{name}.forward"), inputs, size)?;
        Ok(Bidirectional::new(forward, self.lstm(&format!("{name}.backward"), inputs, size)?))
    }

    /// Takes an attention layer, whose heads divide its size.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn attention(&mut self, name: &str, size: usize, heads: usize) -> Result<Attention, ModelError> {
        let mut part = |part: &str| self.linear(&format!("{name}.{part}"), size, size);
        Ok(Attention::new(heads, part("query")?, part("key")?, part("value")?, part("output")?))
    }

    /// Takes an attention layer of a stream, whose heads cut its size into pieces of an even width.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn rotary_attention(
        &mut self,
        name: &str,
        size: usize,
        heads: usize,
    ) -> Result<RotaryAttention, ModelError> {
        let mut part = |part: &str| self.linear(&format!("{name}.{part}"), size, size);
        Ok(RotaryAttention::new(heads, part("query")?, part("key")?, part("value")?, part("output")?))
    }

    /// Takes a gated feed-forward part.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn swi_glu(&mut self, name: &str, size: usize, hidden: usize) -> Result<SwiGlu, ModelError> {
        let gate = self.linear(&format!("{name}.gate"), size, hidden)?;
        let value = self.linear(&format!("{name}.value"), size, hidden)?;
        Ok(SwiGlu::new(gate, value, self.linear(&format!("{name}.output"), hidden, size)?))
    }

    /// Takes a normalisation by the root mean square.
    ///
    /// # Errors
    /// When its tensor is missing or has another shape.
    pub fn rms_norm(&mut self, name: &str, size: usize) -> Result<RmsNorm, ModelError> {
        let parts = self.layer(name, LayerShape::RmsNorm { size })?;
        Ok(RmsNorm::new(parts[0]))
    }

    /// Takes a layer normalisation.
    ///
    /// # Errors
    /// When one of its tensors is missing or has another shape.
    pub fn layer_norm(&mut self, name: &str, size: usize) -> Result<LayerNorm, ModelError> {
        let parts = self.layer(name, LayerShape::LayerNorm { size })?;
        Ok(LayerNorm::new(parts[0], parts[1]))
    }
}
