//! Motion on a circle at a known rate.

use nalgebra::{Matrix4, Vector4, matrix, vector};

use super::{AccelerationNoise, DEFAULT_SPEED, LinearMotion, Motion, derivative_prior};
use crate::belief::Gaussian;

/// Turns at a known rate; a positive rate turns counter-clockwise. A rate of zero is straight motion.
///
/// State: `x, y, vx, vy`.
///
/// ## Model
/// With turn rate `ω`, `s = sin ω dt` and `c = cos ω dt`:
/// ```text
/// x'  = x + s/ω vx - (1-c)/ω vy        vx' = c vx - s vy
/// y'  = y + (1-c)/ω vx + s/ω vy        vy' = s vx + c vy
/// ```
/// with the acceleration noise of [`ConstantVelocity`](super::ConstantVelocity).
///
/// ## Use it when
/// a bank of models covers the turn rates that an object may fly; a grid of these in an
/// [`Imm`](crate::filter::Imm) is the workhorse for manoeuvring aircraft.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), eq. 11.7.1-4. Near a rate of zero the series replaces `s/ω` and `(1-c)/ω`.
///
/// ```
/// use tercel_core::motion::{Motion, Turn};
/// use nalgebra::vector;
/// use std::f64::consts::FRAC_PI_2;
///
/// let quarter = Turn::new(FRAC_PI_2, 1.0).transition(&vector![0.0, 0.0, 10.0, 0.0], 1.0);
/// assert!((quarter[3] - 10.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    rate: f64,
    noise: AccelerationNoise,
    speed: f64,
}

impl Turn {
    /// A turn rate in rad/s and white acceleration of spectral density `density`, m²/s³ per axis.
    pub fn new(rate: f64, density: f64) -> Self {
        Turn::with_noise(rate, AccelerationNoise::White(density))
    }

    /// A turn rate in rad/s and any form of the acceleration noise.
    pub fn with_noise(rate: f64, noise: AccelerationNoise) -> Self {
        Turn { rate, noise, speed: DEFAULT_SPEED }
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        Turn { speed, ..self }
    }

    /// The turn rate, rad/s.
    pub fn rate(&self) -> f64 {
        self.rate
    }
}

impl Motion<4> for Turn {
    #[inline]
    fn transition(&self, state: &Vector4<f64>, dt: f64) -> Vector4<f64> {
        turned(state, &Arc::new(self.rate, dt))
    }

    #[inline]
    fn jacobian(&self, _: &Vector4<f64>, dt: f64) -> Matrix4<f64> {
        let Arc { sine, cosine, along, across } = Arc::new(self.rate, dt);
        matrix![
            1.0, 0.0, along, -across;
            0.0, 1.0, across, along;
            0.0, 0.0, cosine, -sine;
            0.0, 0.0, sine, cosine
        ]
    }

    #[inline]
    fn noise(&self, _: &Vector4<f64>, dt: f64) -> Matrix4<f64> {
        self.noise.covariance(2, dt)
    }

    fn prior(&self) -> Gaussian<4> {
        derivative_prior(2, &[self.speed])
    }

    // In blocks of positions and velocities F = [I U; 0 W], so a quarter of the dense products is left.
    #[inline]
    fn predict(&self, belief: &Gaussian<4>, dt: f64) -> Gaussian<4> {
        let arc = Arc::new(self.rate, dt);
        let (path, turn) = (
            matrix![arc.along, -arc.across; arc.across, arc.along],
            matrix![arc.cosine, -arc.sine; arc.sine, arc.cosine],
        );
        let p = &belief.covariance;
        let (cross, velocity) = (p.fixed_view::<2, 2>(0, 2), p.fixed_view::<2, 2>(2, 2));
        let moved = cross + path * velocity;
        let position = p.fixed_view::<2, 2>(0, 0) + path * cross.transpose() + moved * path.transpose();
        let (cross, velocity) = (moved * turn.transpose(), turn * velocity * turn.transpose());
        let (pp, pv, vv) = self.noise.variances(dt);
        let covariance = matrix![
            position[(0, 0)] + pp, position[(0, 1)], cross[(0, 0)] + pv, cross[(0, 1)];
            position[(1, 0)], position[(1, 1)] + pp, cross[(1, 0)], cross[(1, 1)] + pv;
            cross[(0, 0)] + pv, cross[(1, 0)], velocity[(0, 0)] + vv, velocity[(0, 1)];
            cross[(0, 1)], cross[(1, 1)] + pv, velocity[(1, 0)], velocity[(1, 1)] + vv
        ];
        Gaussian { mean: turned(&belief.mean, &arc), covariance }
    }
}

impl LinearMotion<4> for Turn {}

/// A turn by `ω dt`: its sine and cosine, and the path along and across the first heading per unit of speed.
pub(super) struct Arc {
    pub sine: f64,
    pub cosine: f64,
    pub along: f64,
    pub across: f64,
}

impl Arc {
    #[inline]
    pub fn new(rate: f64, dt: f64) -> Self {
        let angle = rate * dt;
        let (half_sine, half_cosine) = (0.5 * angle).sin_cos();
        let sine = 2.0 * half_sine * half_cosine;
        let cosine = (half_cosine - half_sine) * (half_cosine + half_sine);
        if angle.abs() < 1e-6 {
            // The quotients below lose half their digits here; two terms of the series lose none.
            return Arc { sine, cosine, along: dt * (1.0 - angle * angle / 6.0), across: dt * angle / 2.0 };
        }
        // 1 - cos a = 2 sin²(a/2) without the cancellation.
        Arc { sine, cosine, along: sine / rate, across: 2.0 * half_sine * half_sine / rate }
    }
}

pub(super) fn turned(state: &Vector4<f64>, arc: &Arc) -> Vector4<f64> {
    let (vx, vy) = (state[2], state[3]);
    vector![
        state[0] + arc.along * vx - arc.across * vy,
        state[1] + arc.across * vx + arc.along * vy,
        arc.cosine * vx - arc.sine * vy,
        arc.sine * vx + arc.cosine * vy
    ]
}
