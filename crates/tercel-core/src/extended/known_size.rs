//! An object of known size.

use nalgebra::{Matrix2, Vector2};

use super::orientation::{AngleLikelihood, ln_scatter};
use super::random_matrix::{centre, position_covariance};
use super::{Points, Scattering, scan_state, symmetric::composed};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::filter::{Comparison, Estimate, Filter, Innovation, predicted};
use crate::motion::Motion;
use crate::sensor::Sensor;

/// Estimates motion and direction of an object whose size is known.
///
/// ## Recursion
/// ```text
/// θ: the angle that makes the scatter of the scan most likely, or the direction of the velocity
/// x, P: a Kalman filter on the mean of the points, with noise (s X(θ) + R)/n
/// ```
/// A scan that tells no angle (fewer than two points, a round object) leaves it as it was.
///
/// ## Use it when
/// the type of object is known: its length and width from a register or a data sheet. With [`Pointing::Scan`]
/// no assumption ties the angle to the motion; with [`Pointing::Course`] the object points where it goes.
/// [`Aligned`](super::Aligned) weighs both.
///
/// ## Reference
/// Maximum likelihood of the angle under a normal scatter; own formulation.
///
/// ```
/// use nalgebra::{Matrix2, vector};
/// use tercel_core::extended::{KnownSize, Pointing, Points, Scattering};
/// use tercel_core::{filter::Filter, motion::ConstantVelocity};
///
/// let lidar = Scattering::uniform(Matrix2::identity() * 0.01)?;
/// let filter = KnownSize::new(ConstantVelocity::new(1.0), lidar, vector![2.3, 0.9], Pointing::Scan)?;
/// let belief: tercel_core::extended::Oriented<4> =
///     filter.birth(&Points::from_iter([[0.0, 0.0], [1.0, 1.1], [2.0, 1.9]]))?;
/// assert!((belief.angle - 0.76).abs() < 0.02);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownSize<T> {
    motion: T,
    body: Body,
    pointing: Pointing,
}

/// What tells the angle of an object of known size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pointing {
    /// The scatter of the last scan that told one.
    Scan,
    /// The estimated velocity. The state must have one.
    Course,
}

/// What filters of objects of known size hold of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Oriented<const N: usize> {
    /// The state of its centre.
    pub state: Gaussian<N>,
    /// Direction of the first semi-axis, rad.
    pub angle: f64,
}

/// A size, and how points spread over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Body {
    pub squares: Vector2<f64>,
    pub scattering: Scattering,
}

impl Body {
    pub fn new(axes: Vector2<f64>, scattering: Scattering) -> Result<Self, FilterError> {
        for axis in axes.iter() {
            FilterError::positive("semi-axis", *axis)?;
        }
        Ok(Body { squares: axes.component_mul(&axes), scattering })
    }

    #[inline]
    pub fn extent(&self, angle: f64) -> Matrix2<f64> {
        composed(&self.squares, angle)
    }

    #[inline]
    pub fn spread(&self, angle: f64) -> Matrix2<f64> {
        self.scattering.spread_at(&self.squares, angle)
    }

    pub fn likelihood(&self, points: &Points) -> AngleLikelihood {
        AngleLikelihood::new(&self.squares, &self.scattering, points)
    }

    /// Where points of an object at this state and angle may lie.
    pub fn reach<const N: usize>(&self, state: &Gaussian<N>, angle: f64, search: &Search) -> Option<Region> {
        let place = Vector2::new(state.mean[0], state.mean[1]);
        Some(search.around(place, &(position_covariance(state) + self.spread(angle))))
    }
}

/// The mean of two angles of axes, which are the same half a turn apart.
pub(super) fn axial_mean(angle: f64, weight: f64, other: f64, other_weight: f64) -> f64 {
    let (sine, cosine) = (2.0 * angle).sin_cos();
    let (other_sine, other_cosine) = (2.0 * other).sin_cos();
    let (y, x) = (weight * sine + other_weight * other_sine, weight * cosine + other_weight * other_cosine);
    // Axes at right angles have no mean: the first stays.
    if x.hypot(y) <= 1e-12 * (weight + other_weight) { angle } else { 0.5 * y.atan2(x) }
}

impl<T> KnownSize<T> {
    /// A filter of objects with these semi-axes (m), the one along the direction first.
    ///
    /// # Errors
    /// When an axis is not positive.
    pub fn new(
        motion: T,
        scattering: Scattering,
        axes: Vector2<f64>,
        pointing: Pointing,
    ) -> Result<Self, FilterError> {
        Ok(KnownSize { motion, body: Body::new(axes, scattering)?, pointing })
    }

    fn angle<const N: usize>(&self, state: &Gaussian<N>, before: f64) -> f64 {
        match self.pointing {
            Pointing::Course => course(state).unwrap_or(before),
            Pointing::Scan => before,
        }
    }
}

/// Direction of the velocity, unless there is none.
pub(super) fn course<const N: usize>(state: &Gaussian<N>) -> Option<f64> {
    if N < 4 {
        return None;
    }
    let (vx, vy) = (state.mean[2], state.mean[3]);
    (vx != 0.0 || vy != 0.0).then(|| vy.atan2(vx))
}

impl<const N: usize, T: Motion<N>> Filter<N> for KnownSize<T> {
    type Belief = Oriented<N>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<Oriented<N>, FilterError> {
        points.check_birth()?;
        let angle = self.body.likelihood(points).most_likely().unwrap_or(0.0);
        let (sensor, mean) = centre(&self.body.spread(angle), points)?;
        Ok(Oriented { state: sensor.birth(&mean, &self.motion.prior())?, angle })
    }

    fn predict(&self, belief: &mut Oriented<N>, dt: f64) {
        belief.state = predicted(&self.motion, &belief.state, dt);
        belief.angle = self.angle(&belief.state, belief.angle);
    }

    fn update(&self, belief: &mut Oriented<N>, points: &Points) -> Result<Innovation, FilterError> {
        points.check()?;
        if points.is_empty() {
            return Ok(Innovation::new(&Vector2::zeros(), 0.0, 0.0));
        }
        let mut angle = belief.angle;
        if self.pointing == Pointing::Scan {
            angle = self.body.likelihood(points).most_likely().unwrap_or(angle);
        }
        let spread = self.body.spread(angle);
        let (sensor, mean) = centre(&spread, points)?;
        let comparison = Comparison::new(&sensor, &belief.state, &mean)?;
        comparison.condition(&sensor, &mut belief.state)?;
        belief.angle = self.angle(&belief.state, angle);
        let mut innovation = comparison.innovation;
        innovation.log_likelihood += ln_scatter(&spread, points);
        Ok(innovation)
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
