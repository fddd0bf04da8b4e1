//! What objects do for a while.

use nalgebra::{Vector2, Vector4};
use tercel_core::motion::{Motion, Turn};

/// A motion without noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Manoeuvre {
    /// Straight on.
    Straight,
    /// A steady acceleration, m/s² along x and y.
    Accelerate(Vector2<f64>),
    /// A circle at this rate, rad/s, positive counter-clockwise.
    Turn(f64),
}

impl Manoeuvre {
    /// An acceleration of `x` and `y` m/s².
    pub(crate) const fn accelerate(x: f64, y: f64) -> Self {
        Manoeuvre::Accelerate(Vector2::new(x, y))
    }

    /// A turn at this rate, degrees per second.
    pub(crate) const fn turn(degrees: f64) -> Self {
        Manoeuvre::Turn(degrees.to_radians())
    }

    /// The state `x, y, vx, vy` after `dt` seconds.
    pub fn step(&self, state: &Vector4<f64>, dt: f64) -> Vector4<f64> {
        let straight = |a: Vector2<f64>| {
            let (v, half) = (Vector2::new(state[2], state[3]), a * (0.5 * dt * dt));
            Vector4::new(
                state[0] + v.x * dt + half.x,
                state[1] + v.y * dt + half.y,
                v.x + a.x * dt,
                v.y + a.y * dt,
            )
        };
        match *self {
            Manoeuvre::Straight => straight(Vector2::zeros()),
            Manoeuvre::Accelerate(a) => straight(a),
            Manoeuvre::Turn(rate) => Turn::new(rate, 0.0).transition(state, dt),
        }
    }
}
