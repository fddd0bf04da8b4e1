//! What a bank of turns says at one instant, as the network sees it.

use nalgebra::{Matrix4, Vector2, Vector4};
use tercel_core::belief::{Cholesky, Gaussian};
use tercel_core::filter::{ImmBelief, TurnBank};

/// Mean, spread and turn rates of a bank, in the frame of the line of sight: its first axis points from the sensor to the
/// mean position, the second a quarter turn to the left. Where the network looks along the heading, that takes the place of the line
/// of sight, and the speed that of the range.
///
/// Positions are relative to the mean of the bank; units are m and m/s.
#[derive(Debug, Clone, PartialEq)]
pub struct Outlook {
    /// Mean and covariance of the whole bank, in the frame of the state.
    state: Gaussian<4>,
    /// Cosine and sine of the line of sight.
    sight: [f64; 2],
    range: f64,
    root: Matrix4<f64>,
    probabilities: Vec<f64>,
    offsets: Vec<Vector4<f64>>,
    acceleration: f64,
}

/// Smallest probability of a turn rate.
const FLOOR: f64 = 1e-30;

impl Outlook {
    /// An outlook of a bank with this many turn rates, before anything is seen.
    pub(super) fn new(rates: usize) -> Self {
        Outlook {
            state: Gaussian { mean: Vector4::zeros(), covariance: Matrix4::identity() },
            sight: [1.0, 0.0],
            range: 0.0,
            root: Matrix4::identity(),
            probabilities: vec![0.0; rates],
            offsets: vec![Vector4::zeros(); rates],
            acceleration: 0.0,
        }
    }

    /// Takes in what the bank believes now. `modes` are the probabilities of its modes, `state` the moments of all. Without an origin
    /// the frame is that of the heading.
    pub(super) fn look(
        &mut self,
        bank: &TurnBank,
        belief: &ImmBelief<Gaussian<4>, 4>,
        modes: &[f64],
        state: Gaussian<4>,
        origin: Option<&Vector2<f64>>,
    ) {
        let rates = self.probabilities.len();
        self.state = state;
        let away = match origin {
            Some(origin) => state.mean.xy() - origin,
            None => Vector2::new(state.mean[2], state.mean[3]),
        };
        self.range = away.norm();
        // On top of the sensor there is no line of sight.
        let seen = self.range > 0.0 && self.range.is_finite();
        self.sight = if seen { [away.x / self.range, away.y / self.range] } else { [1.0, 0.0] };
        self.root = root(&self.turned_covariance(&state.covariance));
        self.probabilities.fill(0.0);
        self.offsets.fill(Vector4::zeros());
        self.acceleration = 0.0;
        for (index, (mode, probability)) in belief.modes().zip(modes).enumerate() {
            let (rate, noise) = (index % rates, index / rates % bank.noises().len());
            self.probabilities[rate] += probability;
            self.offsets[rate] += (mode.mean - state.mean) * *probability;
            self.acceleration += probability * super::deviation(bank.noises()[noise]);
        }
        for (offset, probability) in self.offsets.iter_mut().zip(&mut self.probabilities) {
            // A rate that nothing speaks for has no state of its own to offer.
            *offset = if *probability > FLOOR { *offset / *probability } else { Vector4::zeros() };
            *probability = probability.max(FLOOR);
        }
        let sight = self.sight;
        self.offsets.iter_mut().for_each(|offset| *offset = turned(sight, offset));
    }

    /// Mean and covariance of the bank, in the frame of the state.
    pub fn state(&self) -> &Gaussian<4> {
        &self.state
    }

    /// Distance of the mean from the sensor, m.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// Mean standard deviation of the acceleration, m/s², under the bank's noises.
    pub fn acceleration(&self) -> f64 {
        self.acceleration
    }

    /// Probability of each turn rate, at least 1e-30.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// What each turn rate adds to the mean of the bank, in the frame of the line of sight.
    pub fn offsets(&self) -> &[Vector4<f64>] {
        &self.offsets
    }

    /// Lower Cholesky factor of the covariance, in the frame of the line of sight.
    pub fn root(&self) -> &Matrix4<f64> {
        &self.root
    }

    /// A state, or a difference of states, of the state's frame in the frame of the line of sight.
    pub fn turned(&self, state: &Vector4<f64>) -> Vector4<f64> {
        turned(self.sight, state)
    }

    /// The reverse of [`turned`](Outlook::turned).
    pub fn turned_back(&self, state: &Vector4<f64>) -> Vector4<f64> {
        turned([self.sight[0], -self.sight[1]], state)
    }

    fn turned_covariance(&self, covariance: &Matrix4<f64>) -> Matrix4<f64> {
        let turn = self.turn();
        turn * covariance * turn.transpose()
    }

    /// The matrix of [`turned`](Outlook::turned).
    pub(super) fn turn(&self) -> Matrix4<f64> {
        let [c, s] = self.sight;
        Matrix4::new(c, s, 0.0, 0.0, -s, c, 0.0, 0.0, 0.0, 0.0, c, s, 0.0, 0.0, -s, c)
    }

    /// Copies another outlook without allocating.
    pub(super) fn copy(&mut self, other: &Outlook) {
        let Outlook { state, sight, range, root, probabilities, offsets, acceleration } = other;
        (self.state, self.sight, self.range, self.root) = (*state, *sight, *range, *root);
        self.probabilities.clone_from(probabilities);
        self.offsets.clone_from(offsets);
        self.acceleration = *acceleration;
    }
}

fn turned([cosine, sine]: [f64; 2], v: &Vector4<f64>) -> Vector4<f64> {
    Vector4::new(
        cosine * v[0] + sine * v[1],
        cosine * v[1] - sine * v[0],
        cosine * v[2] + sine * v[3],
        cosine * v[3] - sine * v[2],
    )
}

/// Lower Cholesky factor; of a matrix that has none, the square roots of its diagonal.
fn root(covariance: &Matrix4<f64>) -> Matrix4<f64> {
    match Cholesky::new(covariance, "state covariance") {
        Ok(factor) => *factor.lower(),
        Err(_) => Matrix4::from_diagonal(&covariance.diagonal().map(|variance| variance.max(0.0).sqrt())),
    }
}
