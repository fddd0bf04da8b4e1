//! Heads of a network.

use crate::backend::Tensor;
use crate::layer::{Activation, Linear};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// A layer with the hyperbolic tangent, and a linear one that says nothing at first.
#[derive(Debug)]
pub struct Head {
    hidden: Linear,
    output: Linear,
}

impl Head {
    pub fn new(set: &mut ParameterSet, name: &str, sizes: [usize; 3]) -> Result<Self, TrainError> {
        let [_, _, said] = sizes;
        Self::saying(set, name, sizes, vec![0.0; said])
    }

    /// One that says this at first, whatever it sees.
    pub fn saying(
        set: &mut ParameterSet,
        name: &str,
        [seen, hidden, said]: [usize; 3],
        first: Vec<f32>,
    ) -> Result<Self, TrainError> {
        Ok(Head {
            hidden: Linear::new(set, &format!("{name}.hidden"), seen, hidden, Activation::Tanh)?,
            output: Linear::with_initial(
                set,
                &format!("{name}.output"),
                [hidden, said],
                Activation::Identity,
                [Initial::Constant(0.0), Initial::Values(first)],
            )?,
        })
    }

    /// What the layer before the output holds, and what is said.
    pub fn say(&self, weights: &Weights, seen: Vec<Tensor>) -> (Tensor, Tensor) {
        let hidden = self.hidden.forward(weights, Tensor::cat(seen, 1));
        (hidden.clone(), self.output.forward(weights, hidden))
    }
}
