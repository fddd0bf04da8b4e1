//! Which tensors a layer is made of.

use super::{Gru, Linear, Lstm};
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
}

impl LayerShape {
    /// Names and shapes of the tensors of a layer of this name.
    pub fn tensors(self, name: &str) -> Vec<(String, Vec<usize>)> {
        // Sizes come from files: those that overflow fit no tensor.
        let times = usize::saturating_mul;
        let parts = match self {
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
}
