//! Operations whose backward pass is written by hand.

use std::fmt::Debug;

use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::NoCheckpointing;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::{FlexTensor, Layout};
use burn::backend::{Autodiff, Backend, DType, DispatchKindConversion, DispatchTensor, Flex, TensorMetadata};
use burn::tensor::{Bytes, Shape};

use super::Tensor;

/// A matrix in memory, row-major and without gaps: what an [`Operation`] works on.
#[derive(Debug, Clone)]
pub struct Matrix {
    tensor: FlexTensor,
    start: usize,
    shape: [usize; 2],
}

impl Matrix {
    fn new(tensor: &FlexTensor) -> Self {
        let shape = tensor.shape();
        let shape = [shape[0], shape[1]];
        match tensor.layout().contiguous_offsets() {
            Some((start, _)) => Self { tensor: tensor.clone(), start, shape },
            None => Self { tensor: tensor.to_contiguous(), start: 0, shape },
        }
    }

    /// The values, row after row.
    pub fn values(&self) -> &[f32] {
        &self.tensor.storage::<f32>()[self.start..][..self.shape[0] * self.shape[1]]
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.shape[0]
    }

    /// The number of columns.
    pub fn columns(&self) -> usize {
        self.shape[1]
    }
}

/// What the forward pass of an [`Operation`] gives: the value, and what its backward pass needs besides the
/// inputs.
#[derive(Debug)]
pub struct Forward<S> {
    /// Values in row-major order.
    pub values: Vec<f32>,
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Kept until the backward pass.
    pub saved: S,
}

/// What the backward pass of an [`Operation`] knows of the forward pass.
#[derive(Debug)]
pub struct Past<'a, S, const N: usize> {
    /// The inputs.
    pub inputs: &'a [Matrix; N],
    /// The value.
    pub value: &'a Matrix,
    /// What the forward pass saved.
    pub saved: S,
    /// Of which inputs the gradient is wanted; what is given for the others is not read.
    pub wanted: [bool; N],
}

/// An operation on `N` matrices with one matrix as its value, and a backward pass written by hand.
///
/// Worth its code where a composition of small operations is slow: a recurrent layer over a whole sequence,
/// or a step that is taken at every time of a recursion. Its gradient is checked against differences in the
/// tests of its module. An operation with several values puts them side by side, and slices take them apart.
pub trait Operation<const N: usize>: Debug + Clone + Send + 'static {
    /// What the backward pass needs besides the inputs.
    type Saved: Debug + Clone + Send + 'static;

    /// The value.
    fn forward(&self, inputs: &[Matrix; N]) -> Forward<Self::Saved>;

    /// The gradients with respect to those inputs that are wanted, given that of the value.
    fn backward(&self, past: Past<'_, Self::Saved, N>, gradient: &[f32]) -> [Option<Vec<f32>>; N];
}

/// Applies an operation, and records it if a gradient of one of the inputs may be asked for.
///
/// # Panics
///
/// If a tensor does not live on [`device`](super::device), which is where this crate makes all of them.
pub fn apply<const N: usize, O: Operation<N>>(operation: O, inputs: [Tensor; N]) -> Tensor {
    if !inputs.iter().any(Tensor::is_autodiff) {
        let matrices = inputs.map(|input| Matrix::new(&primitive::<Flex>(input)));
        let Forward { values, shape, .. } = operation.forward(&matrices);
        return Tensor::from_primitive::<Flex>(tensor(values, shape));
    }
    let inputs = inputs.map(|input| primitive::<Autodiff<Flex>>(input.autodiff()));
    let matrices = inputs.each_ref().map(|input| Matrix::new(input.primitive()));
    let Forward { values, shape, saved } = operation.forward(&matrices);
    let value = tensor(values, shape);
    let step = Step(operation);
    let nodes = inputs.each_ref().map(|input| input.node());
    let value = match step.prepare::<NoCheckpointing>(nodes).compute_bound().stateful() {
        OpsKind::Tracked(prepared) => {
            let state = State { inputs: matrices, value: Matrix::new(&value), saved };
            prepared.finish(state, value)
        }
        OpsKind::UnTracked(prepared) => prepared.finish(value),
    };
    Tensor::from_primitive::<Autodiff<Flex>>(value)
}

fn primitive<B: Backend>(tensor: Tensor) -> B::FloatTensorPrimitive
where
    DispatchTensor: DispatchKindConversion<B>,
{
    match tensor.try_into_primitive::<B>() {
        Ok(primitive) => primitive,
        Err(error) => unreachable!("a tensor of another device: {error:?}"),
    }
}

fn tensor(values: Vec<f32>, shape: [usize; 2]) -> FlexTensor {
    debug_assert_eq!(values.len(), shape[0] * shape[1]);
    FlexTensor::new(Bytes::from_elems(values), Layout::contiguous(Shape::new(shape)), DType::F32)
}

#[derive(Debug, Clone)]
struct Step<O>(O);

#[derive(Debug, Clone)]
struct State<S, const N: usize> {
    inputs: [Matrix; N],
    value: Matrix,
    saved: S,
}

impl<const N: usize, O: Operation<N>> Backward<Flex, N> for Step<O> {
    type State = State<O::Saved, N>;

    fn backward(self, ops: Ops<Self::State, N>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let gradient = Matrix::new(&gradients.consume::<Flex>(&ops.node));
        let State { inputs, value, saved } = ops.state;
        let wanted = ops.parents.each_ref().map(Option::is_some);
        let past = Past { inputs: &inputs, value: &value, saved, wanted };
        let found = self.0.backward(past, gradient.values());
        for ((parent, found), input) in ops.parents.into_iter().zip(found).zip(&inputs) {
            if let (Some(parent), Some(found)) = (parent, found) {
                gradients.register::<Flex>(parent.id, tensor(found, input.shape));
            }
        }
    }
}
