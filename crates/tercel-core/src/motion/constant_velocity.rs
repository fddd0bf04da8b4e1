//! Straight motion.

use nalgebra::{SMatrix, SVector};

use super::{AccelerationNoise, LinearMotion, Motion, derivative_prior};
use crate::belief::Gaussian;

/// Moves straight on with a velocity that small random accelerations change.
///
/// State: `D` positions, then `D` velocities (`x, y, vx, vy` in the plane; any `D`).
///
/// ## Model
/// ```text
/// p' = p + dt v        v' = v        per axis, with noise covariance
/// Q = q [dt³/3  dt²/2]               white acceleration of density q
///       [dt²/2  dt   ]
/// ```
///
/// ## Use it when
/// objects fly or sail straight for most of the time, or turn slowly against the time between scans. The square root of
/// `q dt` is the change of velocity that one should not be surprised by.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 6.2.2 (white) and 6.3.2 (piecewise).
///
/// ```
/// use tercel_core::motion::{ConstantVelocity, Motion};
/// use nalgebra::vector;
///
/// let straight = ConstantVelocity::new(0.5);
/// assert_eq!(straight.transition(&vector![0.0, 0.0, 3.0, -1.0], 2.0), vector![6.0, -2.0, 3.0, -1.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstantVelocity {
    noise: AccelerationNoise,
    speed: f64,
}

impl ConstantVelocity {
    /// White acceleration of spectral density `density`, m²/s³ per axis.
    pub fn new(density: f64) -> Self {
        ConstantVelocity::with_noise(AccelerationNoise::White(density))
    }

    /// Any form of the acceleration noise.
    pub fn with_noise(noise: AccelerationNoise) -> Self {
        ConstantVelocity { noise, speed: super::DEFAULT_SPEED }
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        ConstantVelocity { speed, ..self }
    }
}

impl<const N: usize> Motion<N> for ConstantVelocity {
    #[inline]
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N> {
        const { assert!(N.is_multiple_of(2), "a constant-velocity state has as many velocities as positions") };
        let mut next = *state;
        for i in 0..N / 2 {
            next[i] += dt * state[i + N / 2];
        }
        next
    }

    fn jacobian(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        let mut jacobian = SMatrix::identity();
        for i in 0..N / 2 {
            jacobian[(i, i + N / 2)] = dt;
        }
        jacobian
    }

    fn noise(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        self.noise.covariance(N / 2, dt)
    }

    fn prior(&self) -> Gaussian<N> {
        derivative_prior(N / 2, &[self.speed])
    }

    // The transition only adds velocity rows to position rows, so the products shrink to sums of blocks.
    #[inline]
    fn predict(&self, belief: &Gaussian<N>, dt: f64) -> Gaussian<N> {
        let axes = N / 2;
        let (pp, pv, vv) = self.noise.variances(dt);
        let mut p = belief.covariance;
        // Slices of whole columns, which the compiler turns into vector instructions.
        let columns = &mut p.data.0;
        for column in columns.iter_mut() {
            let (positions, velocities) = column.split_at_mut(axes);
            for (position, velocity) in positions.iter_mut().zip(velocities) {
                *position += dt * *velocity;
            }
        }
        let (positions, velocities) = columns.split_at_mut(axes);
        for (position, velocity) in positions.iter_mut().zip(velocities) {
            for (to, from) in position.iter_mut().zip(velocity) {
                *to += dt * *from;
            }
        }
        for i in 0..axes {
            p[(i, i)] += pp;
            p[(i, i + axes)] += pv;
            p[(i + axes, i)] += pv;
            p[(i + axes, i + axes)] += vv;
        }
        Gaussian { mean: self.transition(&belief.mean, dt), covariance: p }
    }
}

impl<const N: usize> LinearMotion<N> for ConstantVelocity {}
