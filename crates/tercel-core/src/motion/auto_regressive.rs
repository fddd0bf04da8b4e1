//! Motion whose velocity depends on the velocities before.

use nalgebra::{SMatrix, SVector};

use super::{DEFAULT_SPEED, LinearMotion, Motion};
use crate::belief::Gaussian;

/// Moves with a velocity that is a weighted sum of the last `B` velocities, and noise.
///
/// State: `x, y`, then the last `B` velocities, the newest first: `vx, vy, vx', vy', ..`, `N = 2 + 2 B`
/// components.
///
/// ## Model
/// ```text
/// v(k) = a₁ v(k-1) + .. + a_B v(k-B) + ε,   ε ~ N(0, σ² I₂)      the same weights on both axes
/// p(k) = p(k-1) + T v(k)                                          backward: with the new velocity
/// p(k) = p(k-1) + T v(k-1)                                        forward: with the old one
/// ```
/// The model is tied to its interval `T`. A longer time is as many steps as come nearest to it; what remains
/// is straight motion.
///
/// ## Use it when
/// motion repeats itself over several scans, and the weights are known or identified: resampled tracks,
/// oscillating courses.
///
/// ## Reference
/// Zaidi and Mark (2010), eq. 1.
///
/// ```
/// use nalgebra::{SVector, vector};
/// use tercel_core::motion::{AutoRegressive, Motion};
///
/// let fading = AutoRegressive::new(vector![0.5, 0.25], 1.0, 0.1);
/// let after: SVector<f64, 6> = fading.transition(&vector![0.0, 0.0, 4.0, 0.0, 8.0, 0.0], 1.0);
/// assert_eq!(after, vector![4.0, 0.0, 4.0, 0.0, 4.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AutoRegressive<const B: usize> {
    coefficients: SVector<f64, B>,
    regression: AutoRegression,
}

/// Whether a position moves with the new velocity or the old one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinematics {
    /// With the velocity at the end of the step: velocities are differences backwards in time.
    Backward,
    /// With the velocity at its start.
    Forward,
}

/// An auto-regressive motion without its weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AutoRegression {
    pub interval: f64,
    pub variance: f64,
    pub kinematics: Kinematics,
    pub speed: f64,
}

/// A prediction over more steps than this is as good as one over so many.
const MOST_STEPS: f64 = 1000.0;

impl AutoRegression {
    pub fn new(interval: f64, deviation: f64) -> Self {
        let variance = deviation * deviation;
        AutoRegression { interval, variance, kinematics: Kinematics::Backward, speed: DEFAULT_SPEED }
    }

    /// How many steps a time is, and what remains of it.
    pub fn steps(&self, dt: f64) -> (u32, f64) {
        let steps = (dt / self.interval).round().clamp(0.0, MOST_STEPS);
        (steps as u32, dt - steps * self.interval)
    }

    /// `F M` for the transition matrix of one step.
    fn advance<const N: usize, const C: usize, const B: usize>(
        &self,
        weights: &SVector<f64, B>,
        matrix: &SMatrix<f64, N, C>,
    ) -> SMatrix<f64, N, C> {
        const { assert!(N == 2 + 2 * B, "the state holds a position and as many velocities as there are weights") };
        let mut next = *matrix;
        for column in 0..C {
            for axis in 0..2 {
                let mut velocity = 0.0;
                for lag in 0..B {
                    velocity += weights[lag] * matrix[(2 + 2 * lag + axis, column)];
                }
                let moving = match self.kinematics {
                    Kinematics::Backward => velocity,
                    Kinematics::Forward => matrix[(2 + axis, column)],
                };
                next[(axis, column)] += self.interval * moving;
                for lag in (1..B).rev() {
                    next[(2 + 2 * lag + axis, column)] = matrix[(2 * lag + axis, column)];
                }
                next[(2 + axis, column)] = velocity;
            }
        }
        next
    }

    /// One step of the belief, with `extra` variance of the new velocity on each axis.
    pub fn step<const N: usize, const B: usize>(
        &self,
        weights: &SVector<f64, B>,
        belief: &mut Gaussian<N>,
        extra: [f64; 2],
    ) {
        belief.mean = self.advance(weights, &belief.mean);
        let half = self.advance(weights, &belief.covariance);
        belief.covariance = self.advance(weights, &half.transpose());
        let reach = match self.kinematics {
            Kinematics::Backward => self.interval,
            Kinematics::Forward => 0.0,
        };
        for (axis, extra) in extra.iter().enumerate() {
            let variance = self.variance + extra;
            let (p, v) = (axis, 2 + axis);
            belief.covariance[(p, p)] += variance * reach * reach;
            belief.covariance[(p, v)] += variance * reach;
            belief.covariance[(v, p)] += variance * reach;
            belief.covariance[(v, v)] += variance;
        }
    }

    /// Straight motion over less than a step.
    pub fn drift<const N: usize>(&self, belief: &mut Gaussian<N>, dt: f64) {
        if dt == 0.0 {
            return;
        }
        for axis in 0..2 {
            let velocity = belief.mean[2 + axis];
            belief.mean[axis] += dt * velocity;
        }
        for axis in 0..2 {
            let row = belief.covariance.row(2 + axis) * dt;
            let mut target = belief.covariance.row_mut(axis);
            target += row;
        }
        for axis in 0..2 {
            let column = belief.covariance.column(2 + axis) * dt;
            let mut target = belief.covariance.column_mut(axis);
            target += column;
            belief.covariance[(axis, axis)] += self.variance * dt * dt;
        }
    }

    pub fn prior<const N: usize>(&self) -> Gaussian<N> {
        let speed = self.speed * self.speed;
        let covariance = SMatrix::from_fn(|i, j| match (i == j, i < 2) {
            (false, _) => 0.0,
            (true, true) => 1.0,
            (true, false) => speed,
        });
        Gaussian { mean: SVector::zeros(), covariance }
    }
}

impl<const B: usize> AutoRegressive<B> {
    /// A motion with these weights, `a₁` first, steps of `interval` seconds, and this standard deviation of
    /// each new velocity, m/s per axis.
    pub fn new(coefficients: SVector<f64, B>, interval: f64, deviation: f64) -> Self {
        AutoRegressive { coefficients, regression: AutoRegression::new(interval, deviation) }
    }

    /// Sets which velocity moves the position. The default is [`Kinematics::Backward`].
    pub fn with_kinematics(self, kinematics: Kinematics) -> Self {
        AutoRegressive { regression: AutoRegression { kinematics, ..self.regression }, ..self }
    }

    /// Sets the standard deviation of a new object's velocities, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        AutoRegressive { regression: AutoRegression { speed, ..self.regression }, ..self }
    }

    fn moved<const N: usize>(&self, belief: &Gaussian<N>, dt: f64) -> Gaussian<N> {
        let (steps, rest) = self.regression.steps(dt);
        let mut next = *belief;
        for _ in 0..steps {
            self.regression.step(&self.coefficients, &mut next, [0.0; 2]);
        }
        self.regression.drift(&mut next, rest);
        next
    }
}

impl<const N: usize, const B: usize> Motion<N> for AutoRegressive<B> {
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N> {
        self.moved(&Gaussian { mean: *state, covariance: SMatrix::zeros() }, dt).mean
    }

    fn jacobian(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        SMatrix::from_columns(&std::array::from_fn::<_, N, _>(|column| {
            let unit = SVector::from_fn(|row, _| if row == column { 1.0 } else { 0.0 });
            self.transition(&unit, dt)
        }))
    }

    fn noise(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        self.moved(&Gaussian { mean: SVector::zeros(), covariance: SMatrix::zeros() }, dt).covariance
    }

    fn prior(&self) -> Gaussian<N> {
        self.regression.prior()
    }

    fn predict(&self, belief: &Gaussian<N>, dt: f64) -> Gaussian<N> {
        self.moved(belief, dt)
    }
}

impl<const N: usize, const B: usize> LinearMotion<N> for AutoRegressive<B> {}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn the_sparse_prediction_is_the_dense_one() {
        for kinematics in [Kinematics::Backward, Kinematics::Forward] {
            let motion = AutoRegressive::new(vector![0.9, -0.4, 0.2], 2.0, 0.7).with_kinematics(kinematics);
            let root = SMatrix::<f64, 8, 8>::from_fn(|i, j| ((i * 5 + j * 3) % 7) as f64 - 3.0);
            let covariance = root * root.transpose() + SMatrix::identity();
            let belief = Gaussian { mean: SVector::from_fn(|i, _| i as f64 - 2.0), covariance };
            for dt in [0.0, 0.5, 2.0, 4.3] {
                let sparse = motion.predict(&belief, dt);
                let jacobian = motion.jacobian(&belief.mean, dt);
                let dense = jacobian * covariance * jacobian.transpose() + motion.noise(&belief.mean, dt);
                assert!((sparse.covariance - dense).norm() < 1e-9 * dense.norm(), "{dt} s");
                assert!((sparse.mean - jacobian * belief.mean).norm() < 1e-12);
            }
        }
    }
}
