//! A step of the filter and its likelihood, as operations with backward passes of their own.
//!
//! A Gaussian is a row of 20 numbers: the mean, then the covariance row by row. Single precision holds it between operations; within
//! one the arithmetic is in double precision, as at run time.

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use tercel_core::belief::Gaussian;
use tercel_neural::filter::{MnemonicHyper, Sight};

use crate::backend::{Forward, Matrix, Operation, Past};

/// Numbers of a Gaussian.
pub const GAUSSIAN: usize = 20;

/// A Gaussian of a row.
pub fn gaussian(row: &[f32]) -> Gaussian<4> {
    let number = |i: usize| f64::from(row[i]);
    Gaussian {
        mean: Vector4::from_fn(|i, _| number(i)),
        covariance: Matrix4::from_fn(|i, j| number(4 + 4 * i + j)),
    }
}

/// Appends a mean and a covariance to rows.
pub fn push(rows: &mut Vec<f32>, mean: &Vector4<f64>, covariance: &Matrix4<f64>) {
    rows.extend(mean.iter().map(|value| *value as f32));
    rows.extend((0..4).flat_map(|i| (0..4).map(move |j| covariance[(i, j)] as f32)));
}

/// What a batch is given at one step.
#[derive(Debug, Clone)]
pub struct Reading {
    /// Places, `[members, 2]`, relative to the first of each.
    pub places: Vec<f32>,
    /// Covariances of their errors, `[members, 4]`.
    pub noises: Vec<f32>,
    /// 1 where there is a measurement.
    pub seen: Vec<f32>,
}

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

/// What an update needs: gain, inverse of the innovation covariance, innovation.
struct Update {
    gain: nalgebra::Matrix4x2<f64>,
    inverse: Matrix2<f64>,
    innovation: Vector2<f64>,
}

impl Step {
    fn place(&self, member: usize, state: &Gaussian<4>) -> Vector2<f64> {
        Vector2::new(self.origins[2 * member], self.origins[2 * member + 1]) + state.mean.xy()
    }

    fn predicted(&self, member: usize, state: &Gaussian<4>, outputs: &[f32]) -> Gaussian<4> {
        self.hyper.moved(state, self.place(member, state), outputs, self.interval)
    }

    /// The update of a member, if it is seen.
    fn update(&self, member: usize, prior: &Gaussian<4>) -> Option<Update> {
        let Reading { places, noises, seen } = &*self.reading;
        if seen[member] == 0.0 {
            return None;
        }
        let place = Vector2::new(f64::from(places[2 * member]), f64::from(places[2 * member + 1]));
        let noise = Matrix2::from_fn(|i, j| f64::from(noises[4 * member + 2 * i + j]));
        let s = prior.covariance.fixed_view::<2, 2>(0, 0) + noise;
        // A covariance that is singular gives what is not finite, and the batch is skipped.
        let inverse = Matrix2::new(s[(1, 1)], -s[(0, 1)], -s[(1, 0)], s[(0, 0)]) / s.determinant();
        let gain = prior.covariance.fixed_columns::<2>(0) * inverse;
        Some(Update { gain, inverse, innovation: place - prior.mean.xy() })
    }

    /// From the gradient of the Gaussian after the update to that of the one before it.
    fn retreat(update: &Update, prior: &Gaussian<4>, of: &Gaussian<4>) -> Gaussian<4> {
        let Update { gain, inverse, innovation } = update;
        let (g, h) = (of.mean, of.covariance);
        let columns = prior.covariance.fixed_columns::<2>(0).into_owned();
        let of_columns = g * (inverse * innovation).transpose() - 2.0 * h * gain;
        let of_inverse = columns.transpose() * (g * innovation.transpose() - h * columns);
        let of_s = -(inverse * of_inverse * inverse);
        let mut mean = g;
        let mut measured = mean.fixed_rows_mut::<2>(0);
        measured -= gain.transpose() * g;
        let mut covariance = h;
        let mut first = covariance.fixed_columns_mut::<2>(0);
        first += of_columns;
        let mut corner = covariance.fixed_view_mut::<2, 2>(0, 0);
        corner += of_s;
        Gaussian { mean, covariance: symmetric(&covariance) }
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

fn symmetric(matrix: &Matrix4<f64>) -> Matrix4<f64> {
    0.5 * (matrix + matrix.transpose())
}

impl Operation<2> for Step {
    type Saved = ();

    fn forward(&self, [states, outputs]: &[Matrix; 2]) -> Forward<()> {
        let mut values = Vec::with_capacity(2 * GAUSSIAN * states.rows());
        let rows = states.values().chunks_exact(states.columns());
        for (member, (row, said)) in rows.zip(outputs.values().chunks_exact(outputs.columns())).enumerate() {
            let prior = self.predicted(member, &gaussian(row), said);
            push(&mut values, &prior.mean, &prior.covariance);
            match self.update(member, &prior) {
                None => push(&mut values, &prior.mean, &prior.covariance),
                Some(update) => {
                    let rest = update.gain * prior.covariance.fixed_rows::<2>(0);
                    let mean = prior.mean + update.gain * update.innovation;
                    push(&mut values, &mean, &symmetric(&(prior.covariance - rest)));
                }
            }
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
            let [mut of_prior, mut of_posterior] =
                [gaussian(&given[..GAUSSIAN]), gaussian(&given[GAUSSIAN..])];
            of_prior.covariance = symmetric(&of_prior.covariance);
            of_posterior.covariance = symmetric(&of_posterior.covariance);
            let through = match self.update(member, &prior) {
                None => of_posterior,
                Some(update) => Self::retreat(&update, &prior, &of_posterior),
            };
            of_prior.mean += through.mean;
            of_prior.covariance += through.covariance;
            let of = self.unmove(member, (&state, said), &of_prior, of_outputs);
            push(&mut of_states, &of.mean, &of.covariance);
        }
        [Some(of_states), Some(of_outputs)]
    }
}

/// The mean negative logarithm of the density of the truth under Gaussians `[rows, 20]`, less its constant: `[1, 1]`.
///
/// ```text
/// mean of (eᵀ P⁻¹ e + ln |P|) / 2,   e = x - x̂
/// ```
#[derive(Debug, Clone)]
pub struct Surprise {
    /// True states, `[rows, 4]`.
    pub truth: Arc<Vec<f32>>,
}

impl Surprise {
    /// For a row: the value, and the gradients of mean and covariance. Not a number without a definite covariance.
    fn of(&self, index: usize, row: &[f32]) -> (f64, Gaussian<4>) {
        let Gaussian { mean, covariance } = gaussian(row);
        let error = Vector4::from_fn(|i, _| f64::from(self.truth[4 * index + i])) - mean;
        let Some(factor) = covariance.cholesky() else {
            let nothing = Gaussian { mean: Vector4::zeros(), covariance: Matrix4::zeros() };
            return (f64::NAN, nothing);
        };
        let inverse = factor.inverse();
        let pull = inverse * error;
        let value = 0.5 * error.dot(&pull) + factor.l_dirty().diagonal().map(f64::ln).sum();
        (value, Gaussian { mean: -pull, covariance: 0.5 * (inverse - pull * pull.transpose()) })
    }
}

impl Operation<1> for Surprise {
    type Saved = ();

    fn forward(&self, [rows]: &[Matrix; 1]) -> Forward<()> {
        let each = rows.values().chunks_exact(GAUSSIAN).enumerate();
        let sum: f64 = each.map(|(index, row)| self.of(index, row).0).sum();
        Forward { values: vec![(sum / rows.rows() as f64) as f32], shape: [1, 1], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [rows] = past.inputs;
        let share = f64::from(gradient[0]) / rows.rows() as f64;
        let mut found = Vec::with_capacity(rows.values().len());
        for (index, row) in rows.values().chunks_exact(GAUSSIAN).enumerate() {
            let of = self.of(index, row).1;
            push(&mut found, &(of.mean * share), &(of.covariance * share));
        }
        [Some(found)]
    }
}
