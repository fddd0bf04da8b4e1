//! A velocity and the likelihood of its direction, told together.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, SMatrix, Vector2};
use statrs::function::erf::erfc;

use super::orientation::AngleLikelihood;
use super::symmetric::{eigen, inverse, symmetric};
use crate::belief::Gaussian;

/// What velocity and scan say together.
pub(super) struct Fused {
    /// Direction of the axis, rad: the mean of the posterior, half a turn being no difference.
    pub angle: f64,
    /// Mean of the velocity, m/s.
    pub mean: Vector2<f64>,
    /// Its covariance, m²/s².
    pub covariance: Matrix2<f64>,
    /// Logarithm of the likelihood of the scan's scatter, averaged over the headings of the velocity.
    pub ln_evidence: f64,
}

/// Fewest and most headings of the quadrature.
const NODES: (f64, f64) = (32.0, 1024.0);

/// Half width of the headings that count, in standard deviations of the velocity across its direction.
const REACH: f64 = 6.0;

/// Multiplies a normal density of the velocity with the likelihood of its direction, and takes moments.
///
/// ## Definition
/// In polar coordinates the density of heading `θ` and speed `r` is `N(r u(θ); m, P) r`. For each heading the
/// speed is integrated in closed form (moments of a truncated normal), and headings by the trapezoidal rule,
/// which converges exponentially for densities that are periodic or have decayed at the ends. The nodes are
/// as dense as the sharper of the two densities needs.
pub(super) fn fuse(velocity: &Gaussian<2>, likelihood: &AngleLikelihood) -> Option<Fused> {
    let precision = inverse(&velocity.covariance);
    let pull = precision * velocity.mean;
    let square = velocity.mean.dot(&pull);
    let widest = eigen(&velocity.covariance).0.x.sqrt();
    let speed = velocity.mean.norm();
    let sigma = widest / speed.max(f64::MIN_POSITIVE);
    let half = (REACH * sigma).min(PI);
    let sharp = likelihood.resolution().min(sigma);
    let count = (2.0 * half / (0.8 * sharp)).clamp(NODES.0, NODES.1).ceil();
    let step = 2.0 * half / count;
    let start = velocity.mean.y.atan2(velocity.mean.x) - half;
    let mut sums = Sums::default();
    let (mut sine, mut cosine) = (start + 0.5 * step).sin_cos();
    let (turn_sine, turn_cosine) = step.sin_cos();
    for _ in 0..count as usize {
        let heading = Vector2::new(cosine, sine);
        let double = (cosine * cosine - sine * sine, 2.0 * sine * cosine);
        let (a, b) = (heading.dot(&(precision * heading)), heading.dot(&pull));
        let Speed { ln_weight, mean, square } = Speed::along(a, b, square);
        let ln_likelihood = likelihood.ln_of_double(double.0, double.1);
        sums.add(ln_weight, ln_likelihood, &heading, double, mean, square);
        (cosine, sine) = (cosine * turn_cosine - sine * turn_sine, sine * turn_cosine + cosine * turn_sine);
    }
    sums.finish()
}

/// Moments of the speed along a heading.
struct Speed {
    ln_weight: f64,
    mean: f64,
    square: f64,
}

impl Speed {
    /// Of the density `r exp(-(a r² - 2 b r + c)/2)` over positive speeds `r`.
    #[inline]
    fn along(a: f64, b: f64, c: f64) -> Speed {
        let (mean, variance) = (b / a, 1.0 / a);
        let deviation = variance.sqrt();
        let t = mean / deviation;
        let zeroth = deviation * TAU.sqrt() * 0.5 * erfc(-t / std::f64::consts::SQRT_2);
        let edge = variance * (-0.5 * t * t).exp();
        // Far behind the mean the terms cancel; there is no weight left there either.
        let first = mean * zeroth + edge;
        let second = mean * first + variance * zeroth;
        let third = mean * second + 2.0 * variance * first;
        if !(t > -5.0 && first > 0.0) {
            return Speed { ln_weight: f64::NEG_INFINITY, mean: 0.0, square: 0.0 };
        }
        let ln_weight = first.ln() - 0.5 * (c - b * mean);
        Speed { ln_weight, mean: second / first, square: third / first }
    }
}

/// Sums over headings, relative to the largest term so far.
struct Sums {
    top: f64,
    prior_top: f64,
    prior: f64,
    weight: f64,
    mean: Vector2<f64>,
    square: Matrix2<f64>,
    double: Vector2<f64>,
}

impl Default for Sums {
    fn default() -> Self {
        Sums {
            top: f64::NEG_INFINITY,
            prior_top: f64::NEG_INFINITY,
            prior: 0.0,
            weight: 0.0,
            mean: Vector2::zeros(),
            square: Matrix2::zeros(),
            double: Vector2::zeros(),
        }
    }
}

impl Sums {
    #[inline]
    fn add(
        &mut self,
        ln_prior: f64,
        ln_likelihood: f64,
        heading: &Vector2<f64>,
        double: (f64, f64),
        mean: f64,
        square: f64,
    ) {
        if ln_prior == f64::NEG_INFINITY {
            return;
        }
        if ln_prior > self.prior_top {
            self.prior *= (self.prior_top - ln_prior).exp();
            self.prior_top = ln_prior;
        }
        self.prior += (ln_prior - self.prior_top).exp();
        let ln_weight = ln_prior + ln_likelihood;
        if ln_weight > self.top {
            let shrink = (self.top - ln_weight).exp();
            self.weight *= shrink;
            self.mean *= shrink;
            self.square *= shrink;
            self.double *= shrink;
            self.top = ln_weight;
        }
        let weight = (ln_weight - self.top).exp();
        self.weight += weight;
        self.mean += heading * (weight * mean);
        self.square += heading * heading.transpose() * (weight * square);
        self.double += Vector2::new(double.0, double.1) * weight;
    }

    fn finish(self) -> Option<Fused> {
        if !(self.weight > 0.0 && self.weight.is_finite()) {
            return None;
        }
        let mean = self.mean / self.weight;
        Some(Fused {
            angle: 0.5 * self.double.y.atan2(self.double.x),
            mean,
            covariance: symmetric(&(self.square / self.weight - mean * mean.transpose())),
            ln_evidence: self.top - self.prior_top + (self.weight / self.prior).ln(),
        })
    }
}

/// The velocity of a state.
pub(super) fn velocity<const N: usize>(state: &Gaussian<N>) -> Gaussian<2> {
    const { assert!(N >= 4, "an aligned object needs a velocity") };
    Gaussian {
        mean: Vector2::new(state.mean[2], state.mean[3]),
        covariance: SMatrix::from_fn(|i, j| state.covariance[(i + 2, j + 2)]),
    }
}

/// Replaces the velocity of a state by one that something else told as well; what correlates with it follows.
pub(super) fn replace_velocity<const N: usize>(
    state: &mut Gaussian<N>,
    mean: &Vector2<f64>,
    covariance: &Matrix2<f64>,
) {
    let before = velocity(state);
    let cross = state.covariance.fixed_columns::<2>(2).into_owned();
    let gain = cross * inverse(&before.covariance);
    let mut after = *state;
    after.mean += gain * (mean - before.mean);
    after.covariance += gain * (covariance - before.covariance) * gain.transpose();
    // Where the quadrature leaves a covariance that cannot be, the scan told next to nothing new.
    if after.settle().is_ok() {
        *state = after;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extended::{Points, Scattering};
    use nalgebra::{matrix, vector};

    /// Two points say so little about the angle of a nearly round object that the posterior is the prior.
    #[test]
    fn the_quadrature_gives_the_moments_of_the_normal_back() {
        let points = Points::from(vec![vector![1.0, 0.0], vector![-1.0, 0.2]]);
        let scattering = Scattering::uniform(Matrix2::identity()).unwrap();
        let flat = AngleLikelihood::new(&vector![4.0 + 1e-7, 4.0], &scattering, &points);
        for (x, y, spread) in [(10.0, 3.0, 1.0), (0.1, -0.2, 2.0), (-100.0, 5.0, 0.5), (2.0, 2.0, 1.3)] {
            let covariance = matrix![spread * spread, 0.3 * spread; 0.3 * spread, 1.5 * spread * spread];
            let velocity = Gaussian { mean: vector![x, y], covariance };
            let fused = fuse(&velocity, &flat).unwrap();
            assert!(
                (fused.mean - velocity.mean).norm() < 2e-6 * (1.0 + spread),
                "{} of {x}, {y}",
                fused.mean
            );
            assert!(
                (fused.covariance - covariance).norm() < 1e-4 * covariance.norm(),
                "{}",
                fused.covariance
            );
        }
    }

    #[test]
    fn a_sharp_scan_turns_the_velocity_to_its_axis() {
        let axis = vector![0.8, 0.6];
        let points: Points = (-50..=50).map(|i| axis * (0.12 * f64::from(i))).collect();
        let scattering = Scattering::uniform(Matrix2::identity() * 0.01).unwrap();
        let likelihood = AngleLikelihood::new(&vector![36.0, 0.1], &scattering, &points);
        let velocity = Gaussian { mean: vector![9.0, 4.0], covariance: Matrix2::identity() * 9.0 };
        let fused = fuse(&velocity, &likelihood).unwrap();
        assert!((fused.mean.y / fused.mean.x - 0.75).abs() < 0.02, "{}", fused.mean);
        let (values, angle) = eigen(&fused.covariance);
        assert!(values.y < 0.1 && (angle - 0.75_f64.atan()).abs() < 0.02);
    }
}
