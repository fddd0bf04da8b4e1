//! From the outputs of the branches to the loss, as one operation with a backward pass of its own.

use std::sync::Arc;

use nalgebra::{Matrix4, Vector4};
use serde::Deserialize;
use tercel_core::motion::{Motion, Turn};

use super::data::{Followed, Instant};
use crate::backend::{Forward, Matrix, Operation, Past};

/// What an error of the state costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// The mean over flights and steps of the sum of the squares: equation 15. Few noisy flights decide it.
    #[default]
    MeanSquare,
    /// The mean over flights of the root of the mean square of an element, which is how filters are compared.
    Root,
}

/// What is the same for all batches.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub rates: Vec<f64>,
    pub interval: f64,
    /// Units of corrections: m, m/s.
    pub units: [f32; 2],
    pub form: Form,
    /// What errors of position and velocity are multiplied by.
    pub weights: [f32; 2],
    /// Weight of the classification.
    pub entropy: f32,
    /// The first step that counts.
    pub first: usize,
    /// What each term is divided by: regression and classification of the plain average.
    pub usual: [f32; 2],
}

/// Some flights, side by side.
#[derive(Debug)]
pub(super) struct Flights {
    pub flights: Vec<Arc<Followed>>,
    /// Most rows of a flight.
    pub rows: usize,
}

/// The loss of corrections `[rows * members, 4 modes]` and logits `[rows * members, modes]`: one row with the
/// total and its parts, of which only the first is differentiated.
#[derive(Debug, Clone)]
pub(super) struct Fusion {
    pub flights: Arc<Flights>,
    pub plan: Arc<Plan>,
}

/// Columns of the value: total, regression, classification, both before they are divided; root mean squares
/// of elements of position and velocity; share of the steps with the right manoeuvre.
pub(super) const COLUMNS: usize = 6;

/// What a step of a flight makes of the outputs.
pub(super) struct Fused {
    /// Probabilities of the KalmanNets.
    pub probabilities: Vec<f32>,
    /// Errors of their corrected states, and of the fused one.
    errors: Vec<Vector4<f32>>,
    pub error: Vector4<f32>,
    /// Probability of what is flown; `None` if no KalmanNet flies so.
    flown: Option<f32>,
}

/// Sums over the steps of a flight.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    count: f32,
    weighted: f32,
    position: f32,
    velocity: f32,
    entropy: f32,
    classified: f32,
    right: f32,
}

impl Plan {
    fn modes(&self) -> usize {
        self.rates.len()
    }

    fn direction(&self, mode: usize) -> u8 {
        let rate = self.rates[mode];
        if rate == 0.0 { 0 } else { 1 + u8::from(rate < 0.0) }
    }

    /// What a correction has become after some steps without a measurement.
    fn transition(&self, mode: usize, held: usize) -> Option<Matrix4<f32>> {
        let over = || {
            let f = Turn::new(self.rates[mode], 0.0).jacobian(&Vector4::zeros(), self.interval * held as f64);
            f.map(|value| value as f32)
        };
        (held > 0).then(over)
    }

    fn units(&self) -> Vector4<f32> {
        let [position, velocity] = self.units;
        Vector4::new(position, position, velocity, velocity)
    }

    /// Squares of the weights of the components.
    fn squares(&self) -> Vector4<f32> {
        let [position, velocity] = self.weights.map(|weight| weight * weight);
        Vector4::new(position, position, velocity, velocity)
    }

    /// What a step makes of outputs of the branches.
    pub fn fuse(&self, instant: &Instant, errors: &[[f32; 4]], corrections: &[f32], logits: &[f32]) -> Fused {
        let mut probabilities = logits.to_vec();
        softmax(&mut probabilities);
        let errors: Vec<Vector4<f32>> = errors
            .iter()
            .zip(corrections.as_chunks::<4>().0)
            .enumerate()
            .map(|(mode, (error, correction))| {
                let correction = Vector4::from(*correction).component_mul(&self.units());
                let correction = match self.transition(mode, instant.held) {
                    Some(transition) => transition * correction,
                    None => correction,
                };
                Vector4::from(*error) + correction
            })
            .collect();
        let error = errors.iter().zip(&probabilities).map(|(error, p)| error * *p).sum();
        let directions = self.directions(&probabilities);
        let flies = (0..self.modes()).any(|mode| self.direction(mode) == instant.manoeuvre);
        let flown = flies.then(|| directions[usize::from(instant.manoeuvre)].max(1e-12));
        Fused { probabilities, errors, error, flown }
    }

    fn directions(&self, probabilities: &[f32]) -> [f32; 3] {
        let mut directions = [0.0; 3];
        for (mode, probability) in probabilities.iter().enumerate() {
            directions[usize::from(self.direction(mode))] += probability;
        }
        directions
    }

    fn right(&self, fused: &Fused, manoeuvre: u8) -> bool {
        let directions = self.directions(&fused.probabilities);
        // Of equal ones the first counts.
        let best = (0..3).rev().max_by(|a, b| directions[*a].total_cmp(&directions[*b]));
        best == Some(usize::from(manoeuvre))
    }
}

impl Sums {
    fn add(&mut self, plan: &Plan, instant: &Instant, fused: &Fused) {
        let squares = fused.error.component_mul(&fused.error);
        self.count += 1.0;
        self.weighted += squares.dot(&plan.squares());
        self.position += 0.5 * (squares[0] + squares[1]);
        self.velocity += 0.5 * (squares[2] + squares[3]);
        if let Some(flown) = fused.flown {
            self.entropy -= flown.ln();
            self.classified += 1.0;
        }
        self.right += f32::from(plan.right(fused, instant.manoeuvre));
    }

    fn root(&self) -> f32 {
        (0.25 * self.weighted / self.count).sqrt()
    }
}

impl Flights {
    pub fn new(flights: Vec<Arc<Followed>>) -> Self {
        let rows = flights.iter().map(|flight| flight.rows).max().unwrap_or(0);
        Self { flights, rows }
    }

    /// Inputs in these columns, row `step * members + member`; zero after the last row of a flight.
    pub fn inputs(&self, width: usize, columns: std::ops::Range<usize>) -> Vec<f32> {
        let (members, narrow) = (self.flights.len(), columns.len());
        let mut inputs = vec![0.0; self.rows * members * narrow];
        for (member, flight) in self.flights.iter().enumerate() {
            for (row, from) in flight.inputs.chunks_exact(width.max(1)).enumerate() {
                let to = &mut inputs[(row * members + member) * narrow..][..narrow];
                to.copy_from_slice(&from[columns.clone()]);
            }
        }
        inputs
    }
}

impl Fusion {
    /// The steps that count: the flight, the row of its outputs, the step, and the errors of the KalmanNets.
    fn instants(&self) -> impl Iterator<Item = (usize, usize, &Instant, &[[f32; 4]])> {
        let (members, modes) = (self.flights.flights.len(), self.plan.modes());
        let first = self.plan.first;
        self.flights.flights.iter().enumerate().flat_map(move |(member, flight)| {
            let instants = flight.instants.iter().zip(flight.errors.chunks_exact(modes));
            let counting = instants.filter(move |(instant, _)| instant.step >= first);
            counting.map(move |(instant, errors)| (member, instant.row * members + member, instant, errors))
        })
    }

    fn sums(&self, corrections: &Matrix, logits: &Matrix) -> Vec<Sums> {
        let mut sums = vec![Sums::default(); self.flights.flights.len()];
        for (member, row, instant, errors) in self.instants() {
            let fused = self.plan.fuse(instant, errors, of_row(corrections, row), of_row(logits, row));
            sums[member].add(&self.plan, instant, &fused);
        }
        sums
    }

    /// The columns of the value.
    fn value(&self, sums: &[Sums]) -> [f32; COLUMNS] {
        let flights = sums.iter().filter(|sums| sums.count > 0.0);
        let many = flights.clone().count().max(1) as f32;
        let total = |of: fn(&Sums) -> f32| flights.clone().map(of).sum::<f32>();
        let count = total(|sums| sums.count).max(1.0);
        let regression = match self.plan.form {
            Form::MeanSquare => total(|sums| sums.weighted) / count,
            Form::Root => total(Sums::root) / many,
        };
        let entropy = total(|sums| sums.entropy) / total(|sums| sums.classified).max(1.0);
        [
            regression / self.plan.usual[0] + self.plan.entropy * entropy / self.plan.usual[1],
            regression,
            entropy,
            total(|sums| (sums.position / sums.count).sqrt()) / many,
            total(|sums| (sums.velocity / sums.count).sqrt()) / many,
            total(|sums| sums.right) / count,
        ]
    }

    /// What the plain average of the KalmanNets would cost: regression and classification.
    pub fn usual(&self) -> [f32; 2] {
        let modes = self.plan.modes();
        let mut sums = vec![Sums::default(); self.flights.flights.len()];
        for (member, _, instant, errors) in self.instants() {
            let fused = self.plan.fuse(instant, errors, &vec![0.0; 4 * modes], &vec![0.0; modes]);
            sums[member].add(&self.plan, instant, &fused);
        }
        let value = self.value(&sums);
        [value[1], value[2]]
    }
}

fn of_row(matrix: &Matrix, row: usize) -> &[f32] {
    &matrix.values()[row * matrix.columns()..][..matrix.columns()]
}

fn softmax(values: &mut [f32]) {
    let top = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    values.iter_mut().for_each(|value| *value = (*value - top).exp());
    let sum: f32 = values.iter().sum();
    values.iter_mut().for_each(|value| *value /= sum);
}

impl Operation<2> for Fusion {
    type Saved = Vec<Sums>;

    fn forward(&self, [corrections, logits]: &[Matrix; 2]) -> Forward<Self::Saved> {
        let sums = self.sums(corrections, logits);
        let values = self.value(&sums).to_vec();
        Forward { values, shape: [1, COLUMNS], saved: sums }
    }

    fn backward(&self, past: Past<'_, Self::Saved, 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let ([corrections, logits], plan) = (past.inputs, &self.plan);
        let (modes, units) = (plan.modes(), plan.units());
        let mut of_corrections = vec![0.0; corrections.rows() * corrections.columns()];
        let mut of_logits = vec![0.0; logits.rows() * logits.columns()];
        let all = |of: fn(&Sums) -> f32| past.saved.iter().map(of).sum::<f32>().max(1.0);
        let (count, classified) = (all(|sums| sums.count), all(|sums| sums.classified));
        let many = past.saved.iter().filter(|sums| sums.count > 0.0).count().max(1) as f32;
        let entropy = gradient[0] * plan.entropy / (plan.usual[1] * classified);
        for (member, row, instant, errors) in self.instants() {
            let fused = plan.fuse(instant, errors, of_row(corrections, row), of_row(logits, row));
            let sums = &past.saved[member];
            let share = match plan.form {
                Form::MeanSquare => 2.0 / count,
                Form::Root => 0.25 / (sums.root().max(1e-6) * sums.count * many),
            };
            let share = gradient[0] * share / plan.usual[0];
            let of_error = fused.error.component_mul(&plan.squares()) * share;
            let mean = fused.error.dot(&of_error);
            for mode in 0..modes {
                let probability = fused.probabilities[mode];
                let of_state = match plan.transition(mode, instant.held) {
                    Some(transition) => transition.transpose() * of_error,
                    None => of_error,
                };
                let of_unit = of_state.component_mul(&units) * probability;
                let to = &mut of_corrections[4 * (row * modes + mode)..][..4];
                to.iter_mut().zip(of_unit.iter()).for_each(|(to, value)| *to += value);
                let mut of_logit = fused.errors[mode].dot(&of_error) - mean;
                if let Some(flown) = fused.flown {
                    let is = f32::from(plan.direction(mode) == instant.manoeuvre);
                    of_logit += entropy * (1.0 - is / flown);
                }
                of_logits[row * modes + mode] += probability * of_logit;
            }
        }
        [past.wanted[0].then_some(of_corrections), past.wanted[1].then_some(of_logits)]
    }
}
