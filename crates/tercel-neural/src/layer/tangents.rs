//! Derivatives that travel through a layer together with its values.

/// Directions in which the input of a layer changes, and the room for what its output does then: the forward mode of
/// differentiation.
///
/// ## Definition
/// ```text
/// output tangent = ∂y/∂x · input tangent        for each row of a batch and each direction
/// ```
/// With the unit vectors as directions, the output tangents are the columns of the Jacobian. A layer with a memory takes the
/// memory before the step as given.
///
/// ```
/// use tercel_neural::layer::{Gru, Tangents};
///
/// let layer = Gru::new(1, 2, &[0.1; 6], &[0.0; 6], &[0.2; 12], &[0.0; 6]);
/// let (mut memory, mut slope, mut scratch) = ([0.0; 2], [0.0; 2], vec![0.0; layer.scratch_along(1, 1)]);
/// layer.step_along(&[1.0], &mut memory, Tangents { directions: 1, input: &[1.0], output: &mut slope }, &mut scratch);
/// assert!(slope[0] > 0.0 && slope[0] == slope[1]);
/// ```
#[derive(Debug)]
pub struct Tangents<'a> {
    /// Directions for each row.
    pub directions: usize,
    /// Tangents of the input, `[batch, directions, inputs]`.
    pub input: &'a [f32],
    /// Tangents of the output, `[batch, directions, outputs]`.
    pub output: &'a mut [f32],
}

impl Tangents<'_> {
    /// No directions: values alone.
    pub fn none() -> Self {
        Tangents { directions: 0, input: &[], output: &mut [] }
    }

    /// Asserts that there is a tangent of these widths for each row and direction.
    pub(super) fn check(&self, batch: usize, inputs: usize, outputs: usize) {
        let rows = batch * self.directions;
        assert_eq!(self.input.len(), rows * inputs, "{rows} input tangents of {inputs} numbers");
        assert_eq!(self.output.len(), rows * outputs, "{rows} output tangents of {outputs} numbers");
    }
}
