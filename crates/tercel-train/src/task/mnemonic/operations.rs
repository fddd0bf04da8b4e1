//! A step of the filter, as an operation with a backward pass of its own.

use std::sync::Arc;

use nalgebra::{Matrix4, Vector2};
use tercel_core::belief::Gaussian;
use tercel_neural::filter::{MnemonicHyper, Sight};

use crate::backend::{Forward, Matrix, Operation, Past};
use crate::task::gaussians::{GAUSSIAN, Reading, gaussian, push};

/// Prediction and update: of the Gaussians after the last step `[members, 20]` and what the network says `[members, 14]`, gives
/// those before and after the measurement, side by side.
///
/// The direction of the line of sight counts as given.
#[derive(Debug, Clone)]
pub struct Step {
    pub hyper: Arc<MnemonicHyper>,
    pub interval: f64,
    /// First places relative to the sensor, `[members, 2]`.
    pub origins: Arc<Vec<f64>>,
    pub reading: Arc<Reading>,
}

impl Step {
    fn place(&self, member: usize, state: &Gaussian<4>) -> Vector2<f64> {
        Vector2::new(self.origins[2 * member], self.origins[2 * member + 1]) + state.mean.xy()
    }

    fn predicted(&self, member: usize, state: &Gaussian<4>, outputs: &[f32]) -> Gaussian<4> {
        self.hyper.moved(state, self.place(member, state), outputs, self.interval)
    }

    /// From the gradient of a prediction to those of the state and of the outputs.
    fn unmove(
        &self,
        member: usize,
        (state, outputs): (&Gaussian<4>, &[f32]),
        of: &Gaussian<4>,
        of_outputs: &mut [f32],
    ) -> Gaussian<4> {
        let turn = Sight::new(self.place(member, state), self.hyper.sensor_frame).matrix();
        let (_, factor) = self.hyper.said(outputs, self.interval);
        let [means, noises] = self.hyper.units(self.interval);
        let of_residual = turn * of.mean;
        let of_factor = 2.0 * turn * of.covariance * turn.transpose() * factor;
        for (to, (of, unit)) in of_outputs.iter_mut().zip(of_residual.iter().zip(means)) {
            *to = (of * unit) as f32;
        }
        let elements = (0..4).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for ((to, said), (i, j)) in of_outputs[4..].iter_mut().zip(&outputs[4..]).zip(elements) {
            // The slope of softplus is the logistic function.
            let slope =
                if i == j { 1.0 / (1.0 + (-f64::from(*said)).exp()) / std::f64::consts::LN_2 } else { 1.0 };
            *to = (of_factor[(i, j)] * noises[i] * slope) as f32;
        }
        let mut transition = Matrix4::identity();
        (transition[(0, 2)], transition[(1, 3)]) = (self.interval, self.interval);
        Gaussian {
            mean: transition.transpose() * of.mean,
            covariance: transition.transpose() * of.covariance * transition,
        }
    }
}

impl Operation<2> for Step {
    type Saved = ();

    fn forward(&self, [states, outputs]: &[Matrix; 2]) -> Forward<()> {
        let mut values = Vec::with_capacity(2 * GAUSSIAN * states.rows());
        let rows = states.values().chunks_exact(states.columns());
        for (member, (row, said)) in rows.zip(outputs.values().chunks_exact(outputs.columns())).enumerate() {
            let prior = self.predicted(member, &gaussian(row), said);
            self.reading.push(member, &prior, &mut values);
        }
        Forward { values, shape: [states.rows(), 2 * GAUSSIAN], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let [states, outputs] = past.inputs;
        let width = outputs.columns();
        let mut of_states = Vec::with_capacity(GAUSSIAN * states.rows());
        let mut of_outputs = vec![0.0; outputs.rows() * width];
        let rows = states.values().chunks_exact(states.columns()).zip(outputs.values().chunks_exact(width));
        let given = gradient.chunks_exact(2 * GAUSSIAN).zip(of_outputs.chunks_exact_mut(width));
        for (member, ((row, said), (given, of_outputs))) in rows.zip(given).enumerate() {
            let state = gaussian(row);
            let prior = self.predicted(member, &state, said);
            let of_prior = self.reading.retreat(member, &prior, given);
            let of = self.unmove(member, (&state, said), &of_prior, of_outputs);
            push(&mut of_states, &of.mean, &of.covariance);
        }
        [Some(of_states), Some(of_outputs)]
    }
}
