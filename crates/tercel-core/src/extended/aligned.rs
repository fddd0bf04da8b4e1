//! An object of known size that points where it goes.

use nalgebra::Vector2;

use super::heading::{fuse, replace_velocity, velocity};
use super::known_size::{Body, Oriented, axial_mean, course};
use super::orientation::{ln_constant, ln_scatter};
use super::random_matrix::centre;
use super::{Points, Scattering, scan_state};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::filter::{Comparison, Estimate, Filter, Innovation, predicted};
use crate::motion::Motion;
use crate::sensor::Sensor;

/// Estimates motion and direction of an object of known size whose long axis lies along its velocity, so that
/// the shape of a scan tells where the object is going.
///
/// ## Recursion
/// ```text
/// x, P: a Kalman filter on the mean of the points, with noise (s X(θ) + R)/n
/// p(θ, r | scan) ∝ N(r u(θ); v, P_v) r · p(Z | θ)          heading θ, speed r > 0, scatter Z
/// v, P_v ← moments of r u(θ);  the rest of the state follows by regression
/// ```
/// The density of heading and speed is integrated numerically, so a slow object whose course is anybody's
/// guess is handled as well as a fast one.
///
/// ## Use it when
/// road vehicles, ships under way and aircraft in calm air are seen, and their type is known. An object that
/// slides, drifts or reverses its extent breaks the assumption; use [`KnownSize`](super::KnownSize) then.
///
/// ## Reference
/// Own formulation; the tie between velocity and extent is that of trajectory-aligned random matrices (Sahin,
/// Balci and Özkan (2024)).
///
/// ```
/// use nalgebra::{Matrix2, vector};
/// use tercel_core::extended::{Aligned, Points, Scattering};
/// use tercel_core::{filter::Filter, motion::ConstantVelocity};
///
/// let lidar = Scattering::uniform(Matrix2::identity() * 0.01)?;
/// let filter = Aligned::new(ConstantVelocity::new(1.0), lidar, vector![2.3, 0.9])?;
/// let car = |x: f64| Points::from_iter([[x - 1.0, -0.5], [x + 1.0, 0.5], [x, 0.2], [x, -0.2]]);
/// let mut belief: tercel_core::extended::Oriented<4> = filter.birth(&car(0.0))?;
/// filter.predict(&mut belief, 0.1);
/// filter.update(&mut belief, &car(1.0))?;
/// assert!(belief.state.mean[2] > 5.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aligned<T> {
    motion: T,
    body: Body,
}

impl<T> Aligned<T> {
    /// A filter of objects with these semi-axes (m), the one along the velocity first.
    ///
    /// # Errors
    /// When an axis is not positive.
    pub fn new(motion: T, scattering: Scattering, axes: Vector2<f64>) -> Result<Self, FilterError> {
        Ok(Aligned { motion, body: Body::new(axes, scattering)? })
    }
}

/// Starts a state and an angle from a scan.
pub(super) fn begin<const N: usize>(
    body: &Body,
    prior: &Gaussian<N>,
    points: &Points,
) -> Result<Oriented<N>, FilterError> {
    points.check_birth()?;
    let angle = body.likelihood(points).most_likely().unwrap_or(0.0);
    let (sensor, mean) = centre(&body.spread(angle), points)?;
    Ok(Oriented { state: sensor.birth(&mean, prior)?, angle })
}

/// Conditions a state and an angle on a scan, which may be empty.
pub(super) fn condition<const N: usize>(
    body: &Body,
    belief: &mut Oriented<N>,
    points: &Points,
) -> Result<Innovation, FilterError> {
    points.check()?;
    if points.is_empty() {
        return Ok(Innovation::new(&Vector2::zeros(), 0.0, 0.0));
    }
    let likelihood = body.likelihood(points);
    let blind = likelihood.is_flat();
    let before = if blind { None } else { fuse(&velocity(&belief.state), &likelihood) };
    let angle = before.as_ref().map_or(belief.angle, |fused| fused.angle);
    let spread = body.spread(angle);
    let (sensor, mean) = centre(&spread, points)?;
    let comparison = Comparison::new(&sensor, &belief.state, &mean)?;
    let mut state = belief.state;
    comparison.condition(&sensor, &mut state)?;
    let mut innovation = comparison.innovation;
    innovation.log_likelihood += match &before {
        Some(fused) => fused.ln_evidence + ln_constant(points),
        None => ln_scatter(&spread, points),
    };
    let after = if blind { None } else { fuse(&velocity(&state), &likelihood) };
    let angle = match after {
        Some(fused) => {
            replace_velocity(&mut state, &fused.mean, &fused.covariance);
            fused.angle
        }
        None => course(&state).unwrap_or(belief.angle),
    };
    *belief = Oriented { state, angle };
    Ok(innovation)
}

impl<const N: usize, T: Motion<N>> Filter<N> for Aligned<T> {
    type Belief = Oriented<N>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<Oriented<N>, FilterError> {
        begin(&self.body, &self.motion.prior(), points)
    }

    fn predict(&self, belief: &mut Oriented<N>, dt: f64) {
        belief.state = predicted(&self.motion, &belief.state, dt);
        belief.angle = course(&belief.state).unwrap_or(belief.angle);
    }

    fn update(&self, belief: &mut Oriented<N>, points: &Points) -> Result<Innovation, FilterError> {
        condition(&self.body, belief, points)
    }

    fn merge(&self, belief: &mut Oriented<N>, weight: f64, other: &Oriented<N>, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        belief.angle = axial_mean(belief.angle, weight, other.angle, other_weight);
    }

    fn estimate(&self, belief: &Oriented<N>) -> Estimate<N> {
        Estimate { extent: Some(self.body.extent(belief.angle)), ..belief.state.into() }
    }

    fn reach(&self, belief: &Oriented<N>, search: &Search) -> Option<Region> {
        self.body.reach(&belief.state, belief.angle, search)
    }

    scan_state!();
}
