//! The linear layer.

use super::activation::relu_pass;
use super::dispatch::{Arithmetic, Kernel, dispatch};
use super::matrix::Matrix;

/// Multiplies by a matrix and adds a bias.
///
/// ## Definition
/// ```text
/// y = x W + b        x [batch, inputs], W [inputs, outputs], b [outputs], y [batch, outputs]
/// ```
/// A model file holds `NAME.weight` and `NAME.bias`.
///
/// ## Use it when
/// features enter a network or results leave it. Rows of a batch are computed independently: each gives the same bits alone.
///
/// ```
/// use tercel_neural::layer::Linear;
///
/// let layer = Linear::new(2, 3, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[0.5, 0.0, 0.0]);
/// let mut y = [0.0; 3];
/// layer.forward(&[1.0, -1.0], &mut y);
/// assert_eq!(y, [-2.5, -3.0, -3.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    weight: Matrix,
    bias: Vec<f32>,
}

impl Linear {
    /// A layer with the weights `[inputs, outputs]`, row by row, and the bias `[outputs]`.
    ///
    /// # Panics
    /// When a slice has another length.
    pub fn new(inputs: usize, outputs: usize, weight: &[f32], bias: &[f32]) -> Self {
        assert_eq!(bias.len(), outputs, "bias of a linear layer");
        Linear { weight: Matrix::new(inputs, outputs, weight), bias: bias.to_vec() }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        self.weight.rows()
    }

    /// Width of an output row.
    pub fn outputs(&self) -> usize {
        self.weight.columns()
    }

    /// Writes the outputs `[batch, outputs]` of the inputs `[batch, inputs]`.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows.
    pub fn forward(&self, input: &[f32], output: &mut [f32]) {
        self.checked(input, output);
        dispatch(Forward { layer: self, input, output, relu: false });
    }

    /// As [`forward`](Linear::forward), with `max(y, 0)` in place of `y`.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows.
    pub fn forward_relu(&self, input: &[f32], output: &mut [f32]) {
        self.checked(input, output);
        dispatch(Forward { layer: self, input, output, relu: true });
    }

    /// Writes the tangents of the outputs along tangents of the inputs: the product with the matrix alone.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows.
    pub fn tangents(&self, input: &[f32], output: &mut [f32]) {
        self.checked(input, output);
        output.fill(0.0);
        dispatch(Product { matrix: &self.weight, input, output });
    }

    fn checked(&self, input: &[f32], output: &[f32]) {
        super::same_batch(&[(input.len(), self.inputs()), (output.len(), self.outputs())]);
    }
}

struct Forward<'a> {
    layer: &'a Linear,
    input: &'a [f32],
    output: &'a mut [f32],
    relu: bool,
}

impl Kernel for Forward<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, machine: A) {
        super::fill_rows(&self.layer.bias, self.output);
        self.layer.weight.add_product(machine, self.input, self.output);
        if self.relu {
            relu_pass(self.output);
        }
    }
}

struct Product<'a> {
    matrix: &'a Matrix,
    input: &'a [f32],
    output: &'a mut [f32],
}

impl Kernel for Product<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, machine: A) {
        self.matrix.add_product(machine, self.input, self.output);
    }
}
