//! Motion with an acceleration that fades.

use nalgebra::{SMatrix, SVector};

use super::constant_acceleration::per_axis;
use super::{DEFAULT_SPEED, LinearMotion, Motion, derivative_prior};
use crate::belief::Gaussian;
use crate::error::FilterError;

/// Accelerates for a while: the acceleration is a first-order Markov process that forgets itself.
///
/// State: `D` positions, `D` velocities, `D` accelerations (any `D`).
///
/// ## Model
/// With manoeuvre time `τ`, `ρ = exp(-dt/τ)` and stationary acceleration variance `σ²`, per axis:
/// ```text
/// a' = ρ a + noise        v' = v + τ(1-ρ) a        p' = p + dt v + τ²(dt/τ - 1 + ρ) a
/// ```
/// and the exact covariance of the noise. As `τ` grows it becomes
/// [`ConstantAcceleration`](super::ConstantAcceleration), as it shrinks
/// [`ConstantVelocity`](super::ConstantVelocity).
///
/// ## Use it when
/// one filter must serve straight legs and manoeuvres of known strength and length, and an IMM is too much.
///
/// ## Reference
/// Singer (1970), eqs. 14 to 19; Bar-Shalom, Li and Kirubarajan (2001), section 8.2.2. Below `dt = 0.01 τ` the noise
/// comes from its series, where the closed form loses all digits.
///
/// ```
/// use tercel_core::motion::{Motion, Singer};
/// use nalgebra::vector;
///
/// let fighter = Singer::new(20.0, 30.0)?;
/// let after = fighter.transition(&vector![0.0, 0.0, 9.0], 20.0);
/// assert!((after[2] - 9.0 * (-1.0f64).exp()).abs() < 1e-12);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Singer {
    time: f64,
    acceleration: f64,
    speed: f64,
}

impl Singer {
    /// Manoeuvres that last about `time` seconds, with accelerations of standard deviation `acceleration`, m/s² per axis.
    ///
    /// # Errors
    /// When one of the two is not positive and finite.
    pub fn new(time: f64, acceleration: f64) -> Result<Self, FilterError> {
        Ok(Singer {
            time: FilterError::positive("manoeuvre time", time)?,
            acceleration: FilterError::positive("acceleration deviation", acceleration)?,
            speed: DEFAULT_SPEED,
        })
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        Singer { speed, ..self }
    }

    /// Gains of acceleration into position, velocity and acceleration over `dt`.
    fn gains(&self, dt: f64) -> (f64, f64, f64) {
        let (tau, x) = (self.time, dt / self.time);
        // `exp_m1` keeps the digits that `1 - exp(-x)` would lose for short steps.
        let decay = -(-x).exp_m1();
        let position =
            if x.abs() < 1e-3 { dt * dt * (0.5 - x / 6.0 + x * x / 24.0) } else { tau * tau * (x - decay) };
        (position, tau * decay, 1.0 - decay)
    }

    /// Covariance of position, velocity and acceleration noise of one axis over `dt`, for unit acceleration variance.
    fn unit_noise(&self, dt: f64) -> [[f64; 3]; 3] {
        let (tau, t) = (self.time, dt.abs());
        let x = t / tau;
        if x < 1e-2 {
            // The white-jerk covariance of density 2/τ and its next order in x.
            let q = 2.0 / tau;
            let pp = q * t.powi(5) * (1.0 / 20.0 - x / 36.0);
            let pv = q * t.powi(4) * (1.0 / 8.0 - x / 12.0);
            let pa = q * t.powi(3) * (1.0 / 6.0 - x / 6.0);
            let vv = q * t.powi(3) * (1.0 / 3.0 - x / 4.0);
            let va = q * t.powi(2) * (1.0 / 2.0 - x / 2.0);
            let aa = q * t * (1.0 - x);
            return [[pp, pv, pa], [pv, vv, va], [pa, va, aa]];
        }
        let (e, e2) = ((-x).exp(), (-2.0 * x).exp());
        let pp = tau.powi(4) * (1.0 - e2 + 2.0 * x + 2.0 * x.powi(3) / 3.0 - 2.0 * x * x - 4.0 * x * e);
        let pv = tau.powi(3) * (e2 + 1.0 - 2.0 * e + 2.0 * x * e - 2.0 * x + x * x);
        let pa = tau * tau * (1.0 - e2 - 2.0 * x * e);
        let vv = tau * tau * (4.0 * e - 3.0 - e2 + 2.0 * x);
        let va = tau * (e2 + 1.0 - 2.0 * e);
        let aa = 1.0 - e2;
        [[pp, pv, pa], [pv, vv, va], [pa, va, aa]]
    }
}

impl<const N: usize> Motion<N> for Singer {
    fn transition(&self, state: &SVector<f64, N>, dt: f64) -> SVector<f64, N> {
        const { assert!(N.is_multiple_of(3), "a state has as many velocities and accelerations as positions") };
        let axes = N / 3;
        let (position, velocity, acceleration) = self.gains(dt);
        let mut next = *state;
        for i in 0..axes {
            let a = state[i + 2 * axes];
            next[i] += dt * state[i + axes] + position * a;
            next[i + axes] += velocity * a;
            next[i + 2 * axes] = acceleration * a;
        }
        next
    }

    fn jacobian(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        let (position, velocity, acceleration) = self.gains(dt);
        per_axis(N / 3, &[[1.0, dt, position], [0.0, 1.0, velocity], [0.0, 0.0, acceleration]])
    }

    fn noise(&self, _: &SVector<f64, N>, dt: f64) -> SMatrix<f64, N, N> {
        per_axis(N / 3, &self.unit_noise(dt)) * (self.acceleration * self.acceleration)
    }

    fn prior(&self) -> Gaussian<N> {
        derivative_prior(N / 3, &[self.speed, self.acceleration])
    }
}

impl<const N: usize> LinearMotion<N> for Singer {}
