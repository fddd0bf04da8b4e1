//! Motion with a steady acceleration.

use nalgebra::{SMatrix, SVector};

use super::{DEFAULT_SPEED, LinearMotion, Motion, derivative_prior};
use crate::belief::Gaussian;

/// Standard deviation of the acceleration of a new object when nothing is said, m/s² per axis.
const DEFAULT_ACCELERATION: f64 = 3.0;

/// Accelerates steadily, with a jerk that is white noise.
///
/// State: `D` positions, `D` velocities, `D` accelerations (`x, y, vx, vy, ax, ay` in the plane; any `D`).
///
/// ## Model
/// ```text
/// p' = p + dt v + dt²/2 a      v' = v + dt a      a' = a      per axis, with noise covariance
///       [dt⁵/20  dt⁴/8  dt³/6]
/// Q = q [dt⁴/8   dt³/3  dt²/2]        white jerk of density q
///       [dt³/6   dt²/2  dt   ]
/// ```
///
/// ## Use it when
/// manoeuvres last for several scans: a ship that speeds up, a vehicle that brakes. Beside a
/// [`ConstantVelocity`](super::ConstantVelocity) in an IMM rather than alone: alone it is noisy on straight legs.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 6.2.3.
///
/// ```
/// use tercel_core::motion::{ConstantAcceleration, Motion};
/// use nalgebra::vector;
///
/// let braking = ConstantAcceleration::new(0.1);
/// assert_eq!(braking.transition(&vector![0.0, 10.0, -2.0], 3.0), vector![21.0, 4.0, -2.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstantAcceleration {
    density: f64,
    speed: f64,
    acceleration: f64,
}

impl ConstantAcceleration {
    /// White jerk of spectral density `density`, m²/s⁵ per axis.
    pub fn new(density: f64) -> Self {
        ConstantAcceleration { density, speed: DEFAULT_SPEED, acceleration: DEFAULT_ACCELERATION }
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        ConstantAcceleration { speed, ..self }
    }

    /// Sets the standard deviation of a new object's acceleration, m/s² per axis. The default is 3.
    pub fn with_acceleration(self, acceleration: f64) -> Self {
        ConstantAcceleration { acceleration, ..self }
    }
}

impl<const N: usize> Motion<N> for ConstantAcceleration {
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N> {
        const { assert!(N.is_multiple_of(3), "a state has as many velocities and accelerations as positions") };
        let axes = N / 3;
        let mut next = *state;
        for i in 0..axes {
            next[i] += dt * state[i + axes] + 0.5 * dt * dt * state[i + 2 * axes];
            next[i + axes] += dt * state[i + 2 * axes];
        }
        next
    }

    fn jacobian(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        let axes = N / 3;
        let mut jacobian = SMatrix::identity();
        for i in 0..axes {
            jacobian[(i, i + axes)] = dt;
            jacobian[(i, i + 2 * axes)] = 0.5 * dt * dt;
            jacobian[(i + axes, i + 2 * axes)] = dt;
        }
        jacobian
    }

    fn noise(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        let t = dt.abs();
        per_axis(
            N / 3,
            &[
                [t.powi(5) / 20.0, t.powi(4) / 8.0, t.powi(3) / 6.0],
                [t.powi(4) / 8.0, t.powi(3) / 3.0, t * t / 2.0],
                [t.powi(3) / 6.0, t * t / 2.0, t],
            ],
        ) * self.density
    }

    fn prior(&self) -> Gaussian<N> {
        derivative_prior(N / 3, &[self.speed, self.acceleration])
    }
}

impl<const N: usize> LinearMotion<N> for ConstantAcceleration {}

/// The state matrix that holds the same 3 × 3 block (position, velocity, acceleration) for each axis.
pub(super) fn per_axis<const N: usize>(axes: usize, block: &[[f64; 3]; 3]) -> SMatrix<f64, N, N> {
    SMatrix::from_fn(|i, j| if i % axes == j % axes { block[i / axes][j / axes] } else { 0.0 })
}
