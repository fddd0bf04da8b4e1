//! Gaussians in rows, their update with a measured position, and how much they are surprised.
//!
//! A Gaussian is a row of 20 numbers: the mean, then the covariance row by row. Single precision holds it between operations; within
//! one the arithmetic is in double precision, as at run time.

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use tercel_core::belief::Gaussian;

use crate::TrainError;
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply, constant, detached, values};
use crate::check::{at_least, positive};
use crate::trainer::Loss;

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

/// Gaussians of a batch before and after its last measurement: rows `[members, 40]`.
#[derive(Debug, Clone)]
pub struct Both(pub Tensor);

impl Both {
    /// Of new objects, `[members, 20]`: the birth is both.
    pub fn born(births: Tensor) -> Self {
        Self(Tensor::cat(vec![births.clone(), births], 1))
    }

    /// Before the last measurement.
    pub fn prior(&self) -> Tensor {
        self.0.clone().narrow(1, 0, GAUSSIAN)
    }

    /// After it.
    pub fn posterior(&self) -> Tensor {
        self.0.clone().narrow(1, GAUSSIAN, GAUSSIAN)
    }

    /// The same, through which no gradient flows back.
    pub fn detached(self) -> Self {
        Self(detached(self.0))
    }

    /// What is known of each member before and after the last measurement.
    pub fn pairs(&self) -> Vec<(Gaussian<4>, Gaussian<4>)> {
        let of = |row: &[f32]| (gaussian(&row[..GAUSSIAN]), gaussian(&row[GAUSSIAN..]));
        values(&self.0).chunks_exact(2 * GAUSSIAN).map(of).collect()
    }
}

/// What predictions and estimates cost.
#[derive(Debug, Clone, Copy)]
pub struct Costs {
    /// Weight of the surprise by the truth, of predictions.
    pub surprise: f64,
    /// Weight of the squared errors of estimates.
    pub error: f64,
    /// What errors of the position (m) and the velocity (m/s) are divided by.
    pub scales: [f64; 2],
}

impl Costs {
    /// Refuses weights and scales of `[loss]` that make no sense.
    pub fn check(&self) -> Result<(), TrainError> {
        at_least("loss.surprise", self.surprise, 0.0)?;
        at_least("loss.error", self.error, 0.0)?;
        positive("loss.position", self.scales[0])?;
        positive("loss.velocity", self.scales[1])?;
        Ok(())
    }

    /// The loss of some steps with their true states, `[steps * members, 4]`.
    pub fn loss<'a>(&self, steps: impl Iterator<Item = &'a Both> + Clone, truth: &[f32]) -> Loss {
        let priors = Tensor::cat(steps.clone().map(Both::prior).collect(), 0);
        let posteriors = Tensor::cat(steps.map(Both::posterior).collect(), 0);
        let [rows, _] = priors.dims();
        let truth = truth[..4 * rows].to_vec();
        let surprise = apply(Surprise { truth: Arc::new(truth.clone()) }, [priors]);
        let errors = posteriors.narrow(1, 0, 4) - constant(truth, [rows, 4]);
        let [position, velocity] = mean_squares(&errors);
        let [p, v] = self.scales.map(|scale| (1.0 / scale) as f32);
        let scaled = errors * constant(vec![p, p, v, v], [1, 4]);
        let squares = (scaled.clone() * scaled).mean().reshape([1, 1]);
        let parts = vec![
            ("surprise", f64::from(values(&surprise)[0])),
            ("position", position),
            ("velocity", velocity),
        ];
        let value = surprise * self.surprise as f32 + squares * self.error as f32;
        Loss { value, terms: rows as f64, parts }
    }
}

/// Mean squares of rows of errors, of position and velocity.
pub fn mean_squares(errors: &Tensor) -> [f64; 2] {
    let [rows, _] = errors.dims();
    let mut sums = [0.0; 2];
    for row in values(errors).as_chunks::<4>().0 {
        let square = |a: f32, b: f32| (f64::from(a).powi(2) + f64::from(b).powi(2)) / (2 * rows) as f64;
        sums[0] += square(row[0], row[1]);
        sums[1] += square(row[2], row[3]);
    }
    sums
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

/// What an update needs: gain, inverse of the innovation covariance, innovation.
struct Update {
    gain: nalgebra::Matrix4x2<f64>,
    inverse: Matrix2<f64>,
    innovation: Vector2<f64>,
}

impl Reading {
    /// The update of a member, if it is seen.
    fn update(&self, member: usize, prior: &Gaussian<4>) -> Option<Update> {
        let Reading { places, noises, seen } = self;
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

    /// Appends a Gaussian before and after the measurement of a member.
    pub fn push(&self, member: usize, prior: &Gaussian<4>, rows: &mut Vec<f32>) {
        push(rows, &prior.mean, &prior.covariance);
        match self.update(member, prior) {
            None => push(rows, &prior.mean, &prior.covariance),
            Some(update) => {
                let rest = update.gain * prior.covariance.fixed_rows::<2>(0);
                let mean = prior.mean + update.gain * update.innovation;
                push(rows, &mean, &symmetric(&(prior.covariance - rest)));
            }
        }
    }

    /// The gradient of the Gaussian before the measurement of a member, given those of what [`push`](Reading::push) wrote.
    pub fn retreat(&self, member: usize, prior: &Gaussian<4>, given: &[f32]) -> Gaussian<4> {
        let [mut of_prior, mut of_posterior] = [gaussian(&given[..GAUSSIAN]), gaussian(&given[GAUSSIAN..])];
        of_prior.covariance = symmetric(&of_prior.covariance);
        of_posterior.covariance = symmetric(&of_posterior.covariance);
        let through = match self.update(member, prior) {
            None => of_posterior,
            Some(update) => update.retreat(prior, &of_posterior),
        };
        of_prior.mean += through.mean;
        of_prior.covariance += through.covariance;
        of_prior
    }
}

impl Update {
    /// From the gradient of the Gaussian after the update to that of the one before it.
    fn retreat(&self, prior: &Gaussian<4>, of: &Gaussian<4>) -> Gaussian<4> {
        let Update { gain, inverse, innovation } = self;
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
}

/// The symmetric part of a matrix.
pub fn symmetric(matrix: &Matrix4<f64>) -> Matrix4<f64> {
    0.5 * (matrix + matrix.transpose())
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
