//! What a scan says about the angle of an ellipse of known size.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Vector2};

use super::{Points, Scattering};

/// Logarithm of the density of at least one point around their own mean, for points of this covariance.
/// Together with the density of the mean it is that of the points:
/// ```text
/// Π N(z_j; p, Σ) = N(z̄; p, Σ/n) · (2π)^(1-n) n⁻¹ |Σ|^((1-n)/2) exp(-tr(Σ⁻¹ Z)/2)
/// ```
#[inline]
pub(super) fn ln_scatter(spread: &Matrix2<f64>, points: &Points) -> f64 {
    ln_constant(points) + ln_shape(spread, points.count() as f64, &points.scatter())
}

/// The part of [`ln_scatter`] that does not depend on the covariance.
pub(super) fn ln_constant(points: &Points) -> f64 {
    let n = points.count() as f64;
    (1.0 - n) * TAU.ln() - n.ln()
}

/// The part of [`ln_scatter`] that depends on the covariance.
#[inline]
fn ln_shape(spread: &Matrix2<f64>, n: f64, z: &Matrix2<f64>) -> f64 {
    let determinant = spread.determinant();
    let square = spread.m22 * z.m11 + spread.m11 * z.m22 - 2.0 * spread.m12 * z.m12;
    -0.5 * ((n - 1.0) * determinant.ln() + square / determinant)
}

/// The likelihood of the angle, given the scatter of a scan.
pub(super) struct AngleLikelihood {
    /// `Σ(θ) = centre + amplitude [cos 2θ, sin 2θ; sin 2θ, -cos 2θ]`.
    centre: Matrix2<f64>,
    amplitude: f64,
    count: f64,
    scatter: Matrix2<f64>,
}

impl AngleLikelihood {
    pub fn new(squares: &Vector2<f64>, scattering: &Scattering, points: &Points) -> Self {
        let half = 0.5 * scattering.scale();
        AngleLikelihood {
            centre: Matrix2::from_diagonal_element(half * (squares.x + squares.y)) + scattering.noise(),
            amplitude: half * (squares.x - squares.y),
            count: points.count() as f64,
            scatter: points.scatter(),
        }
    }

    /// Whether all angles are equally likely.
    pub fn is_flat(&self) -> bool {
        self.amplitude.abs() <= 1e-9 * self.centre.trace() || self.count < 2.0
    }

    /// Logarithm of the likelihood, up to a constant, for the cosine and sine of twice the angle.
    #[inline]
    pub fn ln_of_double(&self, cosine: f64, sine: f64) -> f64 {
        let (c, s) = (self.amplitude * cosine, self.amplitude * sine);
        let spread = self.centre + Matrix2::new(c, s, s, -c);
        ln_shape(&spread, self.count, &self.scatter)
    }

    /// The least standard deviation that the angle can have after the scan, rad.
    pub fn resolution(&self) -> f64 {
        let mean = 0.5 * self.centre.trace();
        let (large, small) = (mean + self.amplitude.abs(), mean - self.amplitude.abs());
        (large * small.max(1e-12 * large) / self.count.max(1.0)).sqrt() / (large - small)
    }

    /// The most likely angle in `[0, π)`, unless all are alike.
    pub fn most_likely(&self) -> Option<f64> {
        if self.is_flat() {
            return None;
        }
        const NODES: usize = 24;
        const STEP: f64 = PI / NODES as f64;
        let ln = |angle: f64| {
            let (sine, cosine) = (2.0 * angle).sin_cos();
            self.ln_of_double(cosine, sine)
        };
        let (mut best, mut top) = (0.0, f64::NEG_INFINITY);
        for node in 0..NODES {
            let angle = node as f64 * STEP;
            let value = ln(angle);
            if value > top {
                (best, top) = (angle, value);
            }
        }
        // A parabola through three points, in ever narrower brackets.
        let mut width = STEP;
        for _ in 0..4 {
            let (low, middle, high) = (ln(best - width), ln(best), ln(best + width));
            let bend = low - 2.0 * middle + high;
            if bend < 0.0 {
                best += (0.5 * width * (low - high) / bend).clamp(-width, width);
            }
            width *= 0.2;
        }
        best.is_finite().then(|| best.rem_euclid(PI))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extended::symmetric::{composed, eigen};
    use nalgebra::vector;

    #[test]
    fn with_round_noise_the_most_likely_angle_is_that_of_the_scatter() {
        let scattering = Scattering::uniform(Matrix2::identity() * 0.3).unwrap();
        let points: Points =
            [[0.0, 0.0], [2.0, 1.1], [4.0, 2.3], [1.0, 0.0], [3.0, 2.2]].into_iter().collect();
        let likelihood = AngleLikelihood::new(&vector![36.0, 1.5], &scattering, &points);
        let (_, angle) = eigen(&points.scatter());
        assert!((likelihood.most_likely().unwrap() - angle).abs() < 1e-6);
    }

    #[test]
    fn no_angle_nearby_is_more_likely_under_lopsided_noise() {
        let scattering = Scattering::uniform(Matrix2::new(4.0, 0.0, 0.0, 0.1)).unwrap();
        for turn in 0..20 {
            let spread = composed(&vector![9.0 + f64::from(turn), 3.0], 0.3 * f64::from(turn));
            let root = crate::extended::root(&spread);
            let points: Points = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]
                .map(|unit| root * Vector2::from(unit))
                .into_iter()
                .collect();
            let likelihood = AngleLikelihood::new(&vector![36.0, 1.5], &scattering, &points);
            let best = likelihood.most_likely().unwrap();
            let ln = |angle: f64| likelihood.ln_of_double((2.0 * angle).cos(), (2.0 * angle).sin());
            for node in 0..2000 {
                assert!(ln(best) >= ln(f64::from(node) * PI / 2000.0) - 1e-6, "turn {turn}");
            }
        }
    }

    #[test]
    fn a_circle_and_a_single_point_have_no_angle() {
        let scattering = Scattering::uniform(Matrix2::identity()).unwrap();
        let two: Points = [[0.0, 0.0], [2.0, 1.0]].into_iter().collect();
        let one: Points = [[0.0, 0.0]].into_iter().collect();
        assert_eq!(AngleLikelihood::new(&vector![4.0, 4.0], &scattering, &two).most_likely(), None);
        assert_eq!(AngleLikelihood::new(&vector![4.0, 1.0], &scattering, &one).most_likely(), None);
        assert!(AngleLikelihood::new(&vector![4.0, 1.0], &scattering, &two).most_likely().is_some());
    }
}
