//! From the outputs of the network to the loss, as one operation with a backward pass of its own.

use std::sync::Arc;

use super::NeuralImmLoss;
use super::data::{Followed, Instant};
use crate::backend::{Forward, Matrix, Operation, Past};
use crate::task::residual::likelihood;

/// The loss of a batch, of the outputs `[updates * members, rates + 6]`: one row `total, position, velocity, entropy,
/// likelihood`, each the mean over flights, of which only the first is differentiated.
#[derive(Debug, Clone)]
pub(super) struct Mixture {
    pub followed: Arc<Followed>,
    pub loss: NeuralImmLoss,
}

/// Columns of the value.
pub(super) const COLUMNS: usize = 5;

/// What an instant makes of an output row.
struct Estimate {
    /// Probabilities of the turn rates.
    probabilities: Vec<f32>,
    /// Error of the corrected mean.
    error: [f32; 4],
    /// Of the manoeuvre that is flown.
    entropy: f32,
    likelihood: f32,
    /// Derivatives of the likelihood with respect to the logarithms of the scales.
    of_scales: [f32; 2],
}

impl Mixture {
    fn rates(&self) -> usize {
        self.followed.directions.len()
    }

    fn estimate(&self, index: usize, instant: &Instant, output: &[f32]) -> Estimate {
        let rates = self.rates();
        let ln = &self.followed.ln_probabilities[index * rates..][..rates];
        let offsets = &self.followed.offsets[index * rates..][..rates];
        let mut probabilities: Vec<f32> = ln.iter().zip(output).map(|(ln, a)| ln + a).collect();
        softmax(&mut probabilities);
        let correction = &output[rates..rates + 4];
        let mut error = instant.target;
        for (i, error) in error.iter_mut().enumerate() {
            *error -= (0..4).map(|j| instant.root[i][j] * correction[j]).sum::<f32>();
            *error -= probabilities.iter().zip(offsets).map(|(p, x)| p * x[i]).sum::<f32>();
        }
        let flown = self.share(&probabilities, instant.manoeuvre).max(1e-12);
        let scales = [output[rates + 4], output[rates + 5]];
        let (likelihood, of_scales) = likelihood(&error, &instant.root, scales);
        Estimate { probabilities, error, entropy: -flown.ln(), likelihood, of_scales }
    }

    fn estimates(&self, outputs: &Matrix) -> Vec<Estimate> {
        let width = outputs.columns();
        let instants = self.followed.instants.iter().enumerate();
        let output = |instant: &Instant| &outputs.values()[instant.row * width..][..width];
        instants.map(|(index, instant)| self.estimate(index, instant, output(instant))).collect()
    }

    /// Probability of a manoeuvre.
    fn share(&self, probabilities: &[f32], manoeuvre: u8) -> f32 {
        let directions = self.followed.directions.iter().zip(probabilities);
        directions.filter(|(direction, _)| **direction == manoeuvre).map(|(_, p)| p).sum()
    }

    /// For each flight: its instants, and the sums of squares of errors of position and velocity, now and of the bank.
    fn flights(&self, estimates: &[Estimate]) -> Vec<Sums> {
        let mut flights = vec![Sums::default(); self.followed.members];
        for (instant, estimate) in self.followed.instants.iter().zip(estimates) {
            let sums = &mut flights[instant.member];
            sums.count += 1.0;
            let square = |e: &[f32]| e.iter().map(|x| x * x).sum::<f32>();
            sums.position += square(&estimate.error[..2]);
            sums.velocity += square(&estimate.error[2..]);
            sums.bank_position += square(&instant.target[..2]);
            sums.bank_velocity += square(&instant.target[2..]);
        }
        flights
    }
}

/// Sums over the instants of a flight.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f32,
    position: f32,
    velocity: f32,
    bank_position: f32,
    bank_velocity: f32,
}

impl Sums {
    /// Root mean square of an element of position and of velocity.
    fn rmse(&self) -> [f32; 2] {
        [self.position, self.velocity].map(|sum| (sum / (2.0 * self.count)).sqrt())
    }

    /// What the root mean squares are divided by: the geometric mean of that of the bank and of a usual one, so that neither
    /// the noisiest flights nor the calmest rule.
    fn scales(&self, loss: &NeuralImmLoss) -> [f32; 2] {
        let bank = [self.bank_position, self.bank_velocity].map(|sum| (sum / (2.0 * self.count)).sqrt());
        [(bank[0] * loss.position as f32).sqrt().max(1e-3), (bank[1] * loss.velocity as f32).sqrt().max(1e-3)]
    }
}

fn softmax(values: &mut [f32]) {
    let top = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    values.iter_mut().for_each(|value| *value = (*value - top).exp());
    let sum: f32 = values.iter().sum();
    values.iter_mut().for_each(|value| *value /= sum);
}

impl Operation<1> for Mixture {
    type Saved = ();

    fn forward(&self, [outputs]: &[Matrix; 1]) -> Forward<Self::Saved> {
        let estimates = self.estimates(outputs);
        let flights = self.flights(&estimates);
        let members = flights.len() as f32;
        let mut value = [0.0; COLUMNS];
        for sums in &flights {
            let (rmse, scales) = (sums.rmse(), sums.scales(&self.loss));
            value[0] +=
                (rmse[0] / scales[0] + self.loss.velocity_weight as f32 * rmse[1] / scales[1]) / members;
            value[1] += rmse[0] / members;
            value[2] += rmse[1] / members;
        }
        let count = estimates.len() as f32;
        for estimate in &estimates {
            value[3] += estimate.entropy / count;
            value[4] += estimate.likelihood / count;
        }
        value[0] += self.loss.entropy as f32 * value[3] + self.loss.likelihood as f32 * value[4];
        Forward { values: value.to_vec(), shape: [1, COLUMNS], saved: () }
    }

    fn backward(&self, past: Past<'_, Self::Saved, 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [outputs] = past.inputs;
        let (width, rates) = (outputs.columns(), self.rates());
        let estimates = self.estimates(outputs);
        let flights = self.flights(&estimates);
        let weights: Vec<[f32; 2]> =
            flights.iter().map(|sums| self.error_weights(sums, flights.len())).collect();
        let count = estimates.len() as f32;
        let (entropy, likelihood) = (self.loss.entropy as f32 / count, self.loss.likelihood as f32 / count);
        let mut found = vec![0.0; outputs.rows() * width];
        for ((index, instant), estimate) in self.followed.instants.iter().enumerate().zip(&estimates) {
            let row = &mut found[instant.row * width..][..width];
            let [position, velocity] = weights[instant.member];
            let e = estimate.error;
            // The derivative of the loss with respect to the corrected mean.
            let of_mean = [-position * e[0], -position * e[1], -velocity * e[2], -velocity * e[3]];
            let offsets = &self.followed.offsets[index * rates..][..rates];
            let dot = |x: &[f32; 4]| (0..4).map(|i| of_mean[i] * x[i]).sum::<f32>();
            let mean: f32 = estimate.probabilities.iter().zip(offsets).map(|(p, x)| p * dot(x)).sum();
            let flown = self.share(&estimate.probabilities, instant.manoeuvre).max(1e-12);
            for (rate, (p, x)) in estimate.probabilities.iter().zip(offsets).enumerate() {
                let is = f32::from(self.followed.directions[rate] == instant.manoeuvre);
                row[rate] += gradient[0] * p * (dot(x) - mean + entropy * (1.0 - is / flown));
            }
            for (j, value) in row[rates..rates + 4].iter_mut().enumerate() {
                *value += gradient[0] * (j..4).map(|i| of_mean[i] * instant.root[i][j]).sum::<f32>();
            }
            row[rates + 4] += gradient[0] * likelihood * estimate.of_scales[0];
            row[rates + 5] += gradient[0] * likelihood * estimate.of_scales[1];
        }
        [Some(found)]
    }
}

impl Mixture {
    /// What an error is multiplied by to be the derivative of the loss with respect to it: of position and of velocity.
    fn error_weights(&self, sums: &Sums, flights: usize) -> [f32; 2] {
        let (rmse, scales) = (sums.rmse(), sums.scales(&self.loss));
        let common = 1.0 / (flights as f32 * 2.0 * sums.count);
        [
            common / (scales[0] * rmse[0].max(1e-6)),
            self.loss.velocity_weight as f32 * common / (scales[1] * rmse[1].max(1e-6)),
        ]
    }
}
