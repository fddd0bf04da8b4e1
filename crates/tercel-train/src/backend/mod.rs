//! The only module that names burn.
//!
//! Its interface changes every few months, so everything else in this crate is written against what stands
//! here: tensors of two dimensions on one device, leaves whose gradients are wanted, and operations with a
//! backward of our own ([`Operation`]). Shapes are checked by the layers and tasks before they reach burn,
//! which panics on a mismatch.
//!
//! Operations run on the calling thread. Data parallelism is the trainer's (each shard of a batch has a
//! thread and a graph of its own); a product that split itself over threads as well would only compete with
//! that.

mod operation;
pub(crate) mod product;
pub(crate) mod vector;

use burn::tensor::{Gradients, TensorData};

pub use burn::tensor::Device;
pub use operation::{Forward, Matrix, Operation, Past, apply};

/// A matrix with a row for each member of the batch, differentiable or not.
pub type Tensor = burn::tensor::Tensor<2>;

/// The device of all tensors.
pub fn device() -> Device {
    Device::flex()
}

/// A constant: values in row-major order, of which no gradient is taken. Operations on constants alone are
/// not recorded.
///
/// # Panics
///
/// If there are not `shape[0] * shape[1]` values, which is a mistake of the caller and not of the data.
pub fn constant(values: Vec<f32>, shape: [usize; 2]) -> Tensor {
    Tensor::from_data(TensorData::new(values, shape), &device())
}

/// A leaf: a constant whose gradient [`Tape::gradient`] gives after the backward pass.
pub fn leaf(values: Vec<f32>, shape: [usize; 2]) -> Tensor {
    constant(values, shape).autodiff().require_grad()
}

/// The same values as a constant: no gradient flows back from here.
pub fn detached(tensor: Tensor) -> Tensor {
    tensor.without_autodiff()
}

/// The values of a tensor, in row-major order.
pub fn values(tensor: &Tensor) -> Vec<f32> {
    let data = tensor.clone().into_data();
    data.as_slice::<f32>().map(<[f32]>::to_vec).unwrap_or_else(|_| data.iter::<f32>().collect())
}

/// The gradients that one backward pass has found.
pub struct Tape(Gradients);

impl Tape {
    /// Runs the backward pass from a loss of one element; `None` if it depends on no leaf.
    pub fn backward(loss: &Tensor) -> Option<Self> {
        loss.is_tracked().then(|| Self(loss.backward()))
    }

    /// The gradient of a leaf, in row-major order; `None` if the loss does not depend on it.
    pub fn gradient(&mut self, leaf: &Tensor) -> Option<Vec<f32>> {
        leaf.grad_remove(&mut self.0).map(|gradient| values(&gradient))
    }
}
