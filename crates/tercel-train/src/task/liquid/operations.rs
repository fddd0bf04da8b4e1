//! A step of the filter, as an operation with a backward pass of its own.

use std::sync::Arc;

use nalgebra::{Matrix4, Vector2, Vector4};
use tercel_core::belief::Gaussian;
use tercel_neural::filter::{Form, Moved, Seen, Span};

use crate::backend::{Forward, Matrix, Operation, Past};
use crate::task::gaussians::{GAUSSIAN, Reading, gaussian, push};

/// Prediction and update: of the Gaussians after the last step `[members, 20]` and what the network says, gives those before and
/// after the measurement, side by side.
///
/// The frame of the heading and the Jacobian of the prediction count as given.
#[derive(Debug, Clone)]
pub struct Step {
    pub form: Form,
    pub span: Span,
    /// Jacobians of the prediction, one for each member.
    pub jacobians: Arc<Vec<Matrix4<f64>>>,
    pub reading: Arc<Reading>,
}

impl Step {
    fn moved(&self, state: &Gaussian<4>, outputs: &[f32]) -> Moved {
        // Of what is known only the mean counts for what outputs mean.
        let seen = Seen {
            mean: state.mean,
            correction: Vector4::zeros(),
            measured: false,
            surprise: Vector2::zeros(),
            widths: [0.0; 2],
        };
        self.form.moved(&seen, outputs, &[], self.span)
    }

    fn predicted(&self, member: usize, state: &Gaussian<4>, outputs: &[f32]) -> Gaussian<4> {
        Moved { jacobian: self.jacobians[member], ..self.moved(state, outputs) }.of(state)
    }

    /// From the gradient of a prediction to that of the outputs.
    ///
    /// Mean and noise are smooth in one output at a time, so their slopes are those of the run time: that of the mean is what one
    /// unit adds, that of the noise is known in closed form.
    fn of_outputs(&self, state: &Gaussian<4>, outputs: &[f32], of: &Gaussian<4>, found: &mut [f32]) {
        let nothing = vec![0.0; outputs.len()];
        let origin = self.moved(state, &nothing).mean;
        for (i, found) in found.iter_mut().enumerate() {
            let mut unit = nothing.clone();
            unit[i] = 1.0;
            *found = if i < 4 {
                (self.moved(state, &unit).mean - origin).dot(&of.mean) as f32
            } else {
                let slope = self.form.noise_slope(&state.mean, outputs, i - 4, self.span);
                slope.component_mul(&of.covariance).sum() as f32
            };
        }
    }
}

impl Operation<2> for Step {
    type Saved = ();

    fn forward(&self, [states, outputs]: &[Matrix; 2]) -> Forward<()> {
        let mut values = Vec::with_capacity(2 * GAUSSIAN * states.rows());
        let rows = states.values().chunks_exact(GAUSSIAN);
        for (member, (row, said)) in rows.zip(outputs.values().chunks_exact(outputs.columns())).enumerate() {
            self.reading.push(member, &self.predicted(member, &gaussian(row), said), &mut values);
        }
        Forward { values, shape: [states.rows(), 2 * GAUSSIAN], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let [states, outputs] = past.inputs;
        let width = outputs.columns();
        let mut of_states = Vec::with_capacity(GAUSSIAN * states.rows());
        let mut of_outputs = vec![0.0; outputs.rows() * width];
        let mut transition = Matrix4::identity();
        (transition[(0, 2)], transition[(1, 3)]) = (self.span.dt, self.span.dt);
        let rows = states.values().chunks_exact(GAUSSIAN).zip(outputs.values().chunks_exact(width));
        let given = gradient.chunks_exact(2 * GAUSSIAN).zip(of_outputs.chunks_exact_mut(width));
        for (member, ((row, said), (given, of_outputs))) in rows.zip(given).enumerate() {
            let state = gaussian(row);
            let prior = self.predicted(member, &state, said);
            let of = self.reading.retreat(member, &prior, given);
            self.of_outputs(&state, said, &of, of_outputs);
            let jacobian = self.jacobians[member];
            let of_covariance = jacobian.transpose() * of.covariance * jacobian;
            push(&mut of_states, &(transition.transpose() * of.mean), &of_covariance);
        }
        [Some(of_states), Some(of_outputs)]
    }
}
