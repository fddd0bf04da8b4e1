//! Two long short-term memories that read a sequence from both ends.

use super::Lstm;
use crate::backend::Tensor;
use crate::{ParameterSet, TrainError, Weights};

/// Two layers of long short-term memory over a whole sequence: one from its first step to the last, one back.
///
/// Parameters: the layers `NAME.forward` and `NAME.backward`. The outputs of both lie side by side.
///
/// ## Reference
///
/// A. Graves, J. Schmidhuber, "Framewise phoneme classification with bidirectional LSTM", Neural Networks 18 (2005).
#[derive(Debug, Clone)]
pub struct Bidirectional {
    forward: Lstm,
    backward: Lstm,
}

impl Bidirectional {
    /// Adds the parameters of a layer with `size` units in each direction to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, inputs: usize, size: usize) -> Result<Self, TrainError> {
        let forward = Lstm::new(set, &format!("{name}.forward"), inputs, size)?;
        Ok(Self { forward, backward: Lstm::new(set, &format!("{name}.backward"), inputs, size)? })
    }

    /// Width of an output row.
    pub fn outputs(&self) -> usize {
        2 * self.forward.size()
    }

    /// The outputs `[steps * batch, 2 size]` of a sequence.
    pub fn sequence(&self, weights: &Weights, x: Tensor, batch: usize) -> Tensor {
        let forward = self.forward.sequence(weights, x.clone(), batch);
        Tensor::cat(vec![forward, self.backward.reversed(weights, x, batch)], 1)
    }
}
