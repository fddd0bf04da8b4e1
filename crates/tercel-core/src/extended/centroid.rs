//! The scan alone.

use nalgebra::{Matrix2, Vector2};

use super::random_matrix::{centre, position_covariance};
use super::{Points, Scattering, scan_state};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::filter::{Comparison, Estimate, Filter, Innovation, predicted};
use crate::motion::Motion;
use crate::sensor::Sensor;

/// Reads centre and extent off each scan and remembers nothing: the baseline that a filter must beat.
///
/// ## Definition
/// ```text
/// position  z̄ with covariance Y/n,  Y = s X̂ + R         velocity: the prior of the motion
/// X̂ = (Z/(n-1) - R) / s                                   from three points on; with fewer, the extent before
/// ```
/// Between scans the state follows the motion, so that the reach of an object that is not seen grows.
///
/// ## Use it when
/// it is to be known what a filter is worth. Publications omit this row, although it is better than several
/// of theirs.
///
/// ## Reference
/// Principal axes of a sample covariance; the noise is subtracted and thin extents are lifted to 1 % of their
/// length.
///
/// ```
/// use nalgebra::Matrix2;
/// use tercel_core::extended::{Centroid, Points, Scattering};
/// use tercel_core::{filter::Filter, motion::ConstantVelocity};
///
/// let scattering = Scattering::uniform(Matrix2::identity() * 0.01)?;
/// let filter = Centroid::new(ConstantVelocity::new(1.0), scattering, Matrix2::identity())?;
/// let belief: tercel_core::extended::Seen<4> =
///     filter.birth(&Points::from_iter([[0.0, 0.0], [2.0, 0.1], [4.0, -0.1]]))?;
/// assert_eq!(belief.state.mean[0], 2.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centroid<T> {
    motion: T,
    scattering: Scattering,
    prior: Matrix2<f64>,
}

/// What [`Centroid`] holds of one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen<const N: usize> {
    /// The state of its centre.
    pub state: Gaussian<N>,
    /// The extent matrix, m².
    pub extent: Matrix2<f64>,
}

impl<T> Centroid<T> {
    /// A reader of scans whose points spread like this, with the extent matrix (m²) that stands until three
    /// points tell another.
    ///
    /// # Errors
    /// When the extent is not positive definite.
    pub fn new(motion: T, scattering: Scattering, prior: Matrix2<f64>) -> Result<Self, FilterError> {
        crate::belief::Cholesky::new(&prior, "prior extent")?;
        Ok(Centroid { motion, scattering, prior })
    }

    fn extent(&self, before: &Matrix2<f64>, points: &Points) -> Matrix2<f64> {
        match points.count() {
            0..=2 => *before,
            count => self.scattering.extent(&(points.scatter() / (count as f64 - 1.0))),
        }
    }

    fn read<const N: usize>(&self, before: &Matrix2<f64>, points: &Points) -> Result<Seen<N>, FilterError>
    where
        T: Motion<N>,
    {
        let extent = self.extent(before, points);
        // Coincident points and a sensor without noise would leave no width at all.
        let extent = if extent.determinant() > 0.0 { extent } else { *before };
        let (sensor, mean) = centre(&self.scattering.spread(&extent), points)?;
        Ok(Seen { state: sensor.birth(&mean, &self.motion.prior())?, extent })
    }
}

impl<const N: usize, T: Motion<N>> Filter<N> for Centroid<T> {
    type Belief = Seen<N>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<Seen<N>, FilterError> {
        points.check_birth()?;
        self.read(&self.prior, points)
    }

    fn predict(&self, belief: &mut Seen<N>, dt: f64) {
        belief.state = predicted(&self.motion, &belief.state, dt);
    }

    fn update(&self, belief: &mut Seen<N>, points: &Points) -> Result<Innovation, FilterError> {
        points.check()?;
        if points.is_empty() {
            return Ok(Innovation::new(&Vector2::zeros(), 0.0, 0.0));
        }
        let spread = self.scattering.spread(&belief.extent);
        let (sensor, mean) = centre(&spread, points)?;
        let mut innovation = Comparison::new(&sensor, &belief.state, &mean)?.innovation;
        innovation.log_likelihood += super::orientation::ln_scatter(&spread, points);
        *belief = self.read(&belief.extent, points)?;
        Ok(innovation)
    }

    fn merge(&self, belief: &mut Seen<N>, weight: f64, other: &Seen<N>, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        let total = weight + other_weight;
        if total > 0.0 {
            belief.extent = (belief.extent * weight + other.extent * other_weight) / total;
        }
    }

    fn estimate(&self, belief: &Seen<N>) -> Estimate<N> {
        Estimate { extent: Some(belief.extent), ..belief.state.into() }
    }

    fn reach(&self, belief: &Seen<N>, search: &Search) -> Option<Region> {
        let spread = self.scattering.spread(&belief.extent);
        let place = Vector2::new(belief.state.mean[0], belief.state.mean[1]);
        Some(search.around(place, &(position_covariance(&belief.state) + spread)))
    }

    scan_state!();
}
