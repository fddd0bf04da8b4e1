//! The linear layer.

use serde::{Deserialize, Serialize};

use super::positive;
use crate::backend::product::{add_product, add_product_transposed, add_transposed_product};
use crate::backend::vector::{repeat_row, sigmoid, sum_rows, tanh, vectorised};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// What is applied to each element of the output of a layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// Nothing.
    #[default]
    Identity,
    /// `max(x, 0)`.
    Relu,
    /// The hyperbolic tangent.
    Tanh,
    /// The logistic function.
    Sigmoid,
}

impl Activation {
    fn apply(self, values: &mut [f32]) {
        match self {
            Self::Identity => {}
            Self::Relu => relu(values),
            Self::Tanh => all_tanh(values),
            Self::Sigmoid => all_sigmoid(values),
        }
    }

    /// Turns the gradient with respect to the output into that with respect to what the activation was
    /// applied to.
    fn backward(self, value: &[f32], gradient: &[f32]) -> Vec<f32> {
        let mut inner = gradient.to_vec();
        match self {
            Self::Identity => {}
            Self::Relu => relu_slope(&mut inner, value),
            Self::Tanh => tanh_slope(&mut inner, value),
            Self::Sigmoid => sigmoid_slope(&mut inner, value),
        }
        inner
    }
}

vectorised! {
    fn relu<'a>(values: &'a mut [f32]) {
        for x in values {
            // Not `max`, which would turn what is not a number into zero and hide it.
            *x = if *x < 0.0 { 0.0 } else { *x };
        }
    }
}

vectorised! {
    fn all_tanh<'a>(values: &'a mut [f32]) {
        for x in values {
            *x = tanh(*x);
        }
    }
}

vectorised! {
    fn all_sigmoid<'a>(values: &'a mut [f32]) {
        for x in values {
            *x = sigmoid(*x);
        }
    }
}

vectorised! {
    fn relu_slope<'a>(gradient: &'a mut [f32], value: &'a [f32]) {
        for (g, y) in gradient.iter_mut().zip(value) {
            *g = if *y > 0.0 { *g } else { 0.0 };
        }
    }
}

vectorised! {
    fn tanh_slope<'a>(gradient: &'a mut [f32], value: &'a [f32]) {
        for (g, y) in gradient.iter_mut().zip(value) {
            *g *= 1.0 - y * y;
        }
    }
}

vectorised! {
    fn sigmoid_slope<'a>(gradient: &'a mut [f32], value: &'a [f32]) {
        for (g, y) in gradient.iter_mut().zip(value) {
            *g *= y * (1.0 - y);
        }
    }
}

/// A linear layer with a bias and an activation.
///
/// ## Definition
///
/// ```text
/// y = f(x W + b),   W: [inputs, outputs]
/// ```
///
/// Parameters: `NAME.weight`, `NAME.bias`, both uniform in `+-1/sqrt(inputs)` as in PyTorch.
///
/// ```
/// use tercel_train::backend::{constant, values};
/// use tercel_train::layer::{Activation, Linear};
/// use tercel_train::{ParameterSet, Weights};
///
/// let mut set = ParameterSet::new(1);
/// let layer = Linear::new(&mut set, "head", 3, 2, Activation::Tanh)?;
/// let y = layer.forward(&Weights::frozen(&set), constant(vec![0.1, -0.2, 0.3], [1, 3]));
/// assert_eq!(y.dims(), [1, 2]);
/// # Ok::<(), tercel_train::TrainError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Linear {
    weight: ParameterId,
    bias: ParameterId,
    activation: Activation,
}

impl Linear {
    /// Adds the parameters of a layer to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn new(
        set: &mut ParameterSet,
        name: &str,
        inputs: usize,
        outputs: usize,
        activation: Activation,
    ) -> Result<Self, TrainError> {
        positive(name, &[("the number of inputs", inputs), ("the number of outputs", outputs)])?;
        let initial = Initial::Uniform { bound: 1.0 / (inputs as f32).sqrt() };
        Self::with_initial(set, name, [inputs, outputs], activation, [initial.clone(), initial])
    }

    /// Adds a layer whose weight and bias start as given.
    ///
    /// # Errors
    ///
    /// If a size is zero or the name is taken.
    pub fn with_initial(
        set: &mut ParameterSet,
        name: &str,
        [inputs, outputs]: [usize; 2],
        activation: Activation,
        [weight, bias]: [Initial; 2],
    ) -> Result<Self, TrainError> {
        Ok(Self {
            weight: set.add(&format!("{name}.weight"), &[inputs, outputs], weight)?,
            bias: set.add(&format!("{name}.bias"), &[outputs], bias)?,
            activation,
        })
    }

    /// Applies the layer to each row.
    pub fn forward(&self, weights: &Weights, x: Tensor) -> Tensor {
        apply(Affine { activation: self.activation }, [x, weights.get(self.weight), weights.get(self.bias)])
    }
}

/// `f(x W + b)` in one operation: of inputs `x`, `W`, `b`.
#[derive(Debug, Clone)]
struct Affine {
    activation: Activation,
}

impl Operation<3> for Affine {
    type Saved = ();

    fn forward(&self, [x, weight, bias]: &[Matrix; 3]) -> Forward<()> {
        let sizes = [x.rows(), x.columns(), weight.columns()];
        let mut values = repeat_row(bias.values(), x.rows());
        add_product(&mut values, x.values(), weight.values(), sizes);
        self.activation.apply(&mut values);
        Forward { values, shape: [sizes[0], sizes[2]], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 3>, gradient: &[f32]) -> [Option<Vec<f32>>; 3] {
        let [x, weight, _] = past.inputs;
        let [rows, inputs, outputs] = [x.rows(), x.columns(), weight.columns()];
        let inner = self.activation.backward(past.value.values(), gradient);
        let of_x = past.wanted[0].then(|| {
            let mut out = vec![0.0; rows * inputs];
            add_product_transposed(&mut out, &inner, weight.values(), [rows, outputs, inputs]);
            out
        });
        let of_weight = past.wanted[1].then(|| {
            let mut out = vec![0.0; inputs * outputs];
            add_transposed_product(&mut out, x.values(), &inner, [inputs, rows, outputs]);
            out
        });
        [of_x, of_weight, past.wanted[2].then(|| sum_rows(&inner, outputs))]
    }
}
