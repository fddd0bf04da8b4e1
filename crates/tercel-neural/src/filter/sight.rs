//! The frame of the line of sight, in which a radar's errors lie along the axes.

use nalgebra::{Matrix4, Vector2};
use tercel_core::belief::{Cholesky, Gaussian};

/// A frame whose first axis points from the sensor to an object, and the second a quarter turn to the left; or that of the
/// state itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    cosine: f64,
    sine: f64,
    range: f64,
}

impl Sight {
    /// The frame for an object at this place relative to the sensor, m. Without `turned` it is that of the state.
    ///
    /// On top of the sensor there is no line of sight, and the frame is that of the state too.
    pub fn new(place: Vector2<f64>, turned: bool) -> Self {
        let range = place.norm();
        if turned && range > 0.0 && range.is_finite() {
            return Sight { cosine: place.x / range, sine: place.y / range, range };
        }
        Sight { cosine: 1.0, sine: 0.0, range }
    }

    /// Distance of the object from the sensor, m.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// The matrix that takes a state `x, y, vx, vy` into the frame; its transpose takes it back.
    pub fn matrix(&self) -> Matrix4<f64> {
        let (c, s) = (self.cosine, self.sine);
        Matrix4::new(c, s, 0.0, 0.0, -s, c, 0.0, 0.0, 0.0, 0.0, c, s, 0.0, 0.0, -s, c)
    }

    /// A position or velocity in the frame.
    pub fn turned(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cosine * v.x + self.sine * v.y, self.cosine * v.y - self.sine * v.x)
    }

    /// The reverse of [`turned`](Sight::turned).
    pub fn turned_back(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cosine * v.x - self.sine * v.y, self.cosine * v.y + self.sine * v.x)
    }

    /// Lower Cholesky factor of a covariance, in the frame; of a matrix that has none, the roots of its diagonal.
    pub fn root(&self, covariance: &Matrix4<f64>) -> Matrix4<f64> {
        let matrix = self.matrix();
        let turned = matrix * covariance * matrix.transpose();
        match Cholesky::new(&turned, "state covariance") {
            Ok(factor) => *factor.lower(),
            Err(_) => Matrix4::from_diagonal(&turned.diagonal().map(|variance| variance.max(0.0).sqrt())),
        }
    }
}

/// A covariance with its deviations of position and of velocity scaled by `exp` of these.
pub(crate) fn scaled(covariance: &Matrix4<f64>, logarithms: [f64; 2]) -> Matrix4<f64> {
    let scale = |i: usize| logarithms[i / 2].exp();
    // Products in this order are the same on both sides of the diagonal, to the last bit.
    Matrix4::from_fn(|i, j| scale(i) * scale(j) * covariance[(i, j)])
}

/// The place of a state relative to a sensor.
pub(crate) fn place(state: &Gaussian<4>, origin: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(state.mean[0], state.mean[1]) - origin
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector4;

    use super::*;

    #[test]
    fn what_is_turned_comes_back_and_the_place_lies_on_the_first_axis() {
        let place = Vector2::new(-3e4, 4e4);
        let sight = Sight::new(place, true);
        assert!((sight.turned(place) - Vector2::new(5e4, 0.0)).norm() < 1e-9 && sight.range() == 5e4);
        assert!((sight.turned_back(sight.turned(place)) - place).norm() < 1e-9);
        let state = Vector4::new(1.0, -2.0, 3.0, 4.0);
        let turned = sight.matrix() * state;
        assert_eq!(turned.xy(), sight.turned(state.xy()));
        assert!((sight.matrix().transpose() * turned - state).norm() < 1e-12);
        assert_eq!(Sight::new(place, false).matrix(), Matrix4::identity());
        assert_eq!(Sight::new(Vector2::zeros(), true).matrix(), Matrix4::identity());
    }

    #[test]
    fn scales_are_those_of_the_deviations() {
        let scaled = scaled(&Matrix4::identity(), [2.0_f64.ln(), 3.0_f64.ln()]);
        assert!((scaled - Matrix4::from_diagonal(&Vector4::new(4.0, 4.0, 9.0, 9.0))).norm() < 1e-12);
    }
}
