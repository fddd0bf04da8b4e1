//! Motion on a circle at a rate that is estimated.

use nalgebra::{SMatrix, SVector, vector};

use super::turn::{Arc, turned};
use super::{AccelerationNoise, DEFAULT_SPEED, Motion};
use crate::belief::Gaussian;

/// Turns at a rate that is part of the state and drifts slowly.
///
/// State: `x, y, vx, vy, turn rate`; a positive rate turns counter-clockwise.
///
/// ## Model
/// The transition of [`Turn`](super::Turn) with the rate of the state, white acceleration of density `q` per axis and
/// a turn rate that walks at random: `ω' = ω`, with variance `q_ω dt`.
///
/// ## Use it when
/// turns last for many scans and their rates are not known; the model is not linear, so it goes with an extended or an
/// unscented filter. For short turns a bank of [`Turn`](super::Turn)s reacts faster.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), eqs. 11.7.1-4 and 11.7.2-1. The derivative with respect to `ω` comes from its
/// series when the turn over a step is small.
///
/// ```
/// use tercel_core::motion::{CoordinatedTurn, Motion};
/// use nalgebra::vector;
///
/// let turn = CoordinatedTurn::new(0.5, 1e-4);
/// let after = turn.transition(&vector![0.0, 0.0, 10.0, 0.0, 0.1], 1.0);
/// assert!(after[1] > 0.0 && after[4] == 0.1);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoordinatedTurn {
    noise: AccelerationNoise,
    rate_density: f64,
    speed: f64,
    rate: f64,
}

impl CoordinatedTurn {
    /// White acceleration of spectral density `density` (m²/s³ per axis) and a turn rate that gathers variance at
    /// `rate_density` (rad²/s³).
    pub fn new(density: f64, rate_density: f64) -> Self {
        CoordinatedTurn::with_noise(AccelerationNoise::White(density), rate_density)
    }

    /// Any form of the acceleration noise, and the density of the turn-rate noise (rad²/s³).
    pub fn with_noise(noise: AccelerationNoise, rate_density: f64) -> Self {
        CoordinatedTurn { noise, rate_density, speed: DEFAULT_SPEED, rate: 0.1 }
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        CoordinatedTurn { speed, ..self }
    }

    /// Sets the standard deviation of a new object's turn rate, rad/s. The default is 0.1.
    pub fn with_rate(self, rate: f64) -> Self {
        CoordinatedTurn { rate, ..self }
    }
}

impl Motion<5> for CoordinatedTurn {
    fn transition(&self, state: &SVector<f64, 5>, dt: f64) -> SVector<f64, 5> {
        let moved = turned(&state.fixed_rows::<4>(0).into_owned(), &Arc::new(state[4], dt));
        vector![moved[0], moved[1], moved[2], moved[3], state[4]]
    }

    fn jacobian(&self, state: &SVector<f64, 5>, dt: f64) -> SMatrix<f64, 5, 5> {
        let (vx, vy, rate) = (state[2], state[3], state[4]);
        let Arc { sine, cosine, along, across } = Arc::new(rate, dt);
        let (d_along, d_across) = path_derivatives(rate, dt, along, across);
        let mut jacobian = SMatrix::identity();
        let block = [[along, -across], [across, along], [cosine, -sine], [sine, cosine]];
        let by_rate = [
            d_along * vx - d_across * vy,
            d_across * vx + d_along * vy,
            -dt * (sine * vx + cosine * vy),
            dt * (cosine * vx - sine * vy),
        ];
        for row in 0..4 {
            jacobian[(row, 2)] = block[row][0];
            jacobian[(row, 3)] = block[row][1];
            jacobian[(row, 4)] = by_rate[row];
        }
        jacobian
    }

    fn noise(&self, _: &SVector<f64, 5>, dt: f64) -> SMatrix<f64, 5, 5> {
        let mut noise = self.noise.covariance(2, dt);
        noise[(4, 4)] = self.rate_density * dt.abs();
        noise
    }

    fn prior(&self) -> Gaussian<5> {
        let (v, w) = (self.speed * self.speed, self.rate * self.rate);
        Gaussian { mean: SVector::zeros(), covariance: SMatrix::from_diagonal(&vector![1.0, 1.0, v, v, w]) }
    }
}

/// Derivatives of the path along and across the first heading with respect to the turn rate.
fn path_derivatives(rate: f64, dt: f64, along: f64, across: f64) -> (f64, f64) {
    let angle = rate * dt;
    if angle.abs() < 1e-3 {
        let (second, third) = (dt * dt, dt * dt * dt);
        return (
            -rate * third * (1.0 / 3.0 - angle * angle / 30.0),
            second * (0.5 - angle * angle / 8.0 + angle.powi(4) / 144.0),
        );
    }
    ((dt * angle.cos() - along) / rate, (dt * angle.sin() - across) / rate)
}
