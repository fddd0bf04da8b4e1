//! How objects move: the mean map, its Jacobian and the process noise over any time step.
//!
//! | model | state | moves |
//! |---|---|---|
//! | [`RandomWalk`] | positions | by chance alone |
//! | [`ConstantVelocity`] | positions, velocities | straight on |
//! | [`ConstantAcceleration`] | positions, velocities, accelerations | with a steady acceleration |
//! | [`Singer`] | positions, velocities, accelerations | with an acceleration that fades |
//! | [`Turn`] | `x, y, vx, vy` | on a circle, at a known rate |
//! | [`AutoRegressive`] | `x, y`, velocities of the last steps | with a velocity that depends on those before |
//! | [`PaddedMotion`] | that of a larger model | as a model with a smaller state |
//! | [`CoordinatedTurn`] | `x, y, vx, vy, turn rate` | on a circle, at a rate that is estimated |
//!
//! The first four work in any number of dimensions: one per axis, two in the plane, three in space.

mod auto_regressive;
mod constant_acceleration;
mod constant_velocity;
mod coordinated_turn;
mod padded;
mod random_walk;
mod sampled;
mod singer;
mod turn;

use nalgebra::{SMatrix, SVector};

use crate::belief::Gaussian;

pub(crate) use auto_regressive::AutoRegression;
pub use auto_regressive::{AutoRegressive, Kinematics};
pub use constant_acceleration::ConstantAcceleration;
pub use constant_velocity::ConstantVelocity;
pub use coordinated_turn::CoordinatedTurn;
pub use padded::PaddedMotion;
pub use random_walk::RandomWalk;
pub(crate) use sampled::Noise;
pub use sampled::Sampled;
pub use singer::Singer;
pub use turn::Turn;

/// A model of how a state of `N` components moves over a time step.
///
/// The components are ordered as [`Gaussian`] says. Every method takes the step `dt` in seconds, which may be any
/// number: zero leaves the state as it is, and a negative one runs the mean backwards.
pub trait Motion<const N: usize> {
    /// The state after `dt` without noise.
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N>;

    /// Derivative of [`transition`](Motion::transition) with respect to the state.
    fn jacobian(&self, state: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N>;

    /// Covariance of the process noise gathered over `|dt|`.
    fn noise(&self, state: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N>;

    /// What is believed of a new object before it is measured: mean and covariance of everything that a position
    /// does not say, such as its velocity. The position part is a placeholder.
    fn prior(&self) -> Gaussian<N>;

    /// The belief after `dt`, to first order.
    ///
    /// Models whose Jacobian is sparse override this to save the two dense products.
    #[inline]
    fn predict(&self, belief: &Gaussian<N>, dt: f64) -> Gaussian<N> {
        let jacobian = self.jacobian(&belief.mean, dt);
        Gaussian {
            mean: self.transition(&belief.mean, dt),
            covariance: jacobian * belief.covariance * jacobian.transpose() + self.noise(&belief.mean, dt),
        }
    }
}

/// Motion whose [`jacobian`](Motion::jacobian) and [`noise`](Motion::noise) do not depend on the state, which makes
/// the Kalman filter exact.
pub trait LinearMotion<const N: usize>: Motion<N> {}

/// A borrowed model is a model.
impl<const N: usize, T: Motion<N> + ?Sized> Motion<N> for &T {
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N> {
        (**self).transition(state, dt)
    }
    fn jacobian(&self, state: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        (**self).jacobian(state, dt)
    }
    fn noise(&self, state: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        (**self).noise(state, dt)
    }
    fn prior(&self) -> Gaussian<N> {
        (**self).prior()
    }
    fn predict(&self, belief: &Gaussian<N>, dt: f64) -> Gaussian<N> {
        (**self).predict(belief, dt)
    }
}

impl<const N: usize, T: LinearMotion<N> + ?Sized> LinearMotion<N> for &T {}

/// How accelerations that the model does not know enter a state of positions and velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AccelerationNoise {
    /// White acceleration of this spectral density, in m²/s³ per axis. Two steps of `dt` are one of `2 dt`.
    White(f64),
    /// An acceleration with this standard deviation, in m/s² per axis, that is constant within each step and drawn
    /// anew for the next. The covariance has rank one per axis, and depends on how time is cut into steps.
    Piecewise(f64),
    /// A jump of the velocity with this standard deviation, in m/s per axis, at the beginning of each step: the position moves
    /// with the new velocity, as in data whose velocities are differences backwards in time. The covariance has rank one per
    /// axis, and depends on how time is cut into steps.
    Jump(f64),
}

impl AccelerationNoise {
    /// Variances of position, of position and velocity, and of velocity, gathered by one axis over `dt`.
    #[inline]
    pub fn variances(self, dt: f64) -> (f64, f64, f64) {
        let dt = dt.abs();
        match self {
            AccelerationNoise::White(density) => {
                (density * dt * dt * dt / 3.0, density * dt * dt / 2.0, density * dt)
            }
            AccelerationNoise::Piecewise(deviation) => {
                let (p, v) = (0.5 * deviation * dt * dt, deviation * dt);
                (p * p, p * v, v * v)
            }
            AccelerationNoise::Jump(_) if dt == 0.0 => (0.0, 0.0, 0.0),
            AccelerationNoise::Jump(deviation) => {
                let variance = deviation * deviation;
                (variance * dt * dt, variance * dt, variance)
            }
        }
    }

    /// The same over a whole state whose first `D` components are positions and whose next `D` are velocities.
    #[inline]
    pub fn covariance<const N: usize>(self, axes: usize, dt: f64) -> SMatrix<f64, N, N> {
        let (pp, pv, vv) = self.variances(dt);
        let mut noise = SMatrix::zeros();
        for i in 0..axes {
            noise[(i, i)] = pp;
            noise[(i, i + axes)] = pv;
            noise[(i + axes, i)] = pv;
            noise[(i + axes, i + axes)] = vv;
        }
        noise
    }
}

/// Standard deviation of the velocity of a new object when nothing is said, m/s per axis.
const DEFAULT_SPEED: f64 = 30.0;

/// A prior with zero mean, positions of placeholder variance 1 and this standard deviation for each further
/// derivative of the position.
fn derivative_prior<const N: usize>(axes: usize, deviations: &[f64]) -> Gaussian<N> {
    let covariance = SMatrix::from_fn(|i, j| match (i == j, i / axes) {
        (false, _) => 0.0,
        (true, 0) => 1.0,
        (true, order) => deviations[order - 1] * deviations[order - 1],
    });
    Gaussian { mean: SVector::zeros(), covariance }
}

#[cfg(test)]
mod tests;
