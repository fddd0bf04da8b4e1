//! The multiplicative error model, linearised: MEM-EKF*.

use nalgebra::{Matrix2, Matrix3, RowVector3, SMatrix, Vector2, Vector3};

use super::random_matrix::{centre, position_covariance};
use super::{Ellipse, Points, Scattering, congruent, rotation, scan_state};
use crate::association::{Region, Search};
use crate::belief::{Cholesky, Gaussian};
use crate::error::FilterError;
use crate::filter::{Comparison, Estimate, Filter, Innovation, predicted};
use crate::motion::Motion;
use crate::sensor::{Position, Sensor};

/// Estimates motion, and angle and semi-axes of the extent with a covariance of their own, one point after
/// the other.
///
/// ## Recursion
/// The shape is `p = (α, l₁, l₂)` with covariance `C_p`. A point is `z = H x + S(p) h + e`, `S(p) = R(α)
/// diag(l₁, l₂)`, with a multiplicative error `h` of covariance `s I` and noise `R`. With the rows `S_i` and
/// their Jacobians `J_i`:
/// ```text
/// predict   x, P by the motion;   C_p ← C_p + dt Q_p
/// for each point, everything linearised anew:
///   C_y = H P Hᵀ + s S Sᵀ + C_II + R,    (C_II)_mn = s tr(C_p J_mᵀ J_n)
///   x, P by the innovation ν = z - H x with covariance C_y
///   Y = (ν₁², ν₂², ν₁ν₂) against (C_y11, C_y22, C_y12), with the cross-covariance C_p Mᵀ, M = 2s (S₁J₁; S₂J₂; S₁J₂ + S₂J₁ over 2)
/// ```
///
/// ## Use it when
/// axes and angle are to have priors and noises of their own: a rigid object that turns. The prior has to be
/// fair: a size that is wrong by half is kept for long. Points are worked through in their order, which
/// matters a little.
///
/// ## Reference
/// Yang and Baum (2019), "Tracking the orientation and axes lengths of an elliptical extended object",
/// algorithm 1. Deviations: axes stay above 1 % of their prior; a point after which the shape would have no
/// covariance leaves the shape as it is.
///
/// ```
/// use nalgebra::{Matrix2, Matrix3, vector};
/// use tercel_core::belief::Gaussian;
/// use tercel_core::extended::{MemEkf, Points, Scattering};
/// use tercel_core::{filter::Filter, motion::ConstantVelocity};
///
/// let shape = Gaussian::new(vector![0.0, 3.0, 1.0], Matrix3::from_diagonal(&vector![0.3, 0.5, 0.1]))?;
/// let filter = MemEkf::new(
///     ConstantVelocity::new(1.0), Scattering::uniform(Matrix2::identity() * 0.01)?, shape, vector![0.01, 1e-4, 1e-4])?;
/// let car = |x: f64| Points::from_iter([[x - 2.0, 0.5], [x + 2.0, 0.5], [x - 2.0, -0.5], [x + 2.0, -0.5]]);
/// let mut belief: tercel_core::extended::Shaped<4> = filter.birth(&car(0.0))?;
/// filter.predict(&mut belief, 0.1);
/// filter.update(&mut belief, &car(1.0))?;
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MemEkf<T> {
    motion: T,
    scattering: Scattering,
    prior: Gaussian<3>,
    noise: Vector3<f64>,
}

/// What [`MemEkf`] holds of one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shaped<const N: usize> {
    /// The state of its centre.
    pub state: Gaussian<N>,
    /// Angle (rad) and semi-axes (m), whose covariance may be zero.
    pub shape: Gaussian<3>,
}

/// Smallest semi-axis, as a share of the prior one.
const THINNEST: f64 = 0.01;

impl<T> MemEkf<T> {
    /// A filter that starts with this angle and these semi-axes, to which every second adds these variances
    /// (rad²/s, m²/s).
    ///
    /// # Errors
    /// When an axis is not positive, a number not finite, or a variance negative.
    pub fn new(
        motion: T,
        scattering: Scattering,
        prior: Gaussian<3>,
        noise: Vector3<f64>,
    ) -> Result<Self, FilterError> {
        FilterError::positive("semi-axis", prior.mean[1])?;
        FilterError::positive("semi-axis", prior.mean[2])?;
        for value in noise.iter().copied().chain(prior.covariance.diagonal().iter().copied()) {
            if !(value >= 0.0 && value.is_finite()) {
                let (parameter, expected) = ("variance of a shape", "must be finite and not negative");
                return Err(FilterError::Parameter { parameter, value, expected });
            }
        }
        Ok(MemEkf { motion, scattering, prior, noise })
    }

    fn axes(&self, shape: &Gaussian<3>) -> Matrix2<f64> {
        let [angle, a, b] = [shape.mean[0], shape.mean[1], shape.mean[2]];
        congruent(&rotation(angle), &Matrix2::new(a * a, 0.0, 0.0, b * b))
    }

    /// Keeps the axes positive and their prior thickness.
    fn bound(&self, shape: &mut Gaussian<3>) {
        for axis in 1..3 {
            shape.mean[axis] = shape.mean[axis].abs().max(THINNEST * self.prior.mean[axis]);
        }
    }
}

/// The matrices of the linearised model at a shape.
struct Linearised {
    /// Covariance that the extent adds to a point.
    spread: Matrix2<f64>,
    /// Derivative of the expected squares with respect to the shape.
    slope: Matrix3<f64>,
}

impl Linearised {
    fn new(shape: &Gaussian<3>, scale: f64) -> Self {
        let (sine, cosine) = shape.mean[0].sin_cos();
        let (a, b) = (shape.mean[1], shape.mean[2]);
        let rows = Matrix2::new(a * cosine, -b * sine, a * sine, b * cosine);
        let first = SMatrix::<f64, 2, 3>::new(-a * sine, cosine, 0.0, -b * cosine, 0.0, -sine);
        let second = SMatrix::<f64, 2, 3>::new(a * cosine, sine, 0.0, -b * sine, 0.0, cosine);
        let (c1, c2) = (shape.covariance * first.transpose(), shape.covariance * second.transpose());
        let inner = Matrix2::new(
            (first * c1).trace(),
            (first * c2).trace(),
            (second * c1).trace(),
            (second * c2).trace(),
        );
        let spread = (rows * rows.transpose() + inner) * scale;
        let (top, bottom) = (rows.row(0), rows.row(1));
        let slope: [RowVector3<f64>; 3] =
            [top * first * 2.0, bottom * second * 2.0, top * second + bottom * first];
        Linearised { spread, slope: Matrix3::from_rows(&slope) * scale }
    }
}

/// The shape after the squares of an innovation of covariance `c`, if that leaves it a covariance.
fn reshaped(
    shape: &Gaussian<3>,
    slope: &Matrix3<f64>,
    residual: &Vector2<f64>,
    c: &Matrix2<f64>,
) -> Option<Gaussian<3>> {
    let squares = Vector3::new(residual.x * residual.x, residual.y * residual.y, residual.x * residual.y);
    let expected = Vector3::new(c.m11, c.m22, c.m12);
    let (c11, c22, c12) = (c.m11, c.m22, c.m12);
    let covariance = Matrix3::new(
        2.0 * c11 * c11,
        2.0 * c12 * c12,
        2.0 * c11 * c12,
        2.0 * c12 * c12,
        2.0 * c22 * c22,
        2.0 * c22 * c12,
        2.0 * c11 * c12,
        2.0 * c22 * c12,
        c11 * c22 + c12 * c12,
    );
    let factor = Cholesky::new(&covariance, "covariance of the squares").ok()?;
    let cross = shape.covariance * slope.transpose();
    let gain = factor.right_solve(&cross);
    let mean = shape.mean + gain * (squares - expected);
    let after = shape.covariance - gain * cross.transpose();
    let after = (after + after.transpose()) * 0.5;
    let sound = mean.iter().all(|x| x.is_finite())
        && (0..3).all(|i| after[(i, i)] >= 0.0)
        && after.determinant() >= 0.0;
    sound.then_some(Gaussian { mean, covariance: after })
}

impl<const N: usize, T: Motion<N>> Filter<N> for MemEkf<T> {
    type Belief = Shaped<N>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<Shaped<N>, FilterError> {
        points.check_birth()?;
        let (sensor, mean) = centre(&self.scattering.spread(&self.axes(&self.prior)), points)?;
        Ok(Shaped { state: sensor.birth(&mean, &self.motion.prior())?, shape: self.prior })
    }

    fn predict(&self, belief: &mut Shaped<N>, dt: f64) {
        belief.state = predicted(&self.motion, &belief.state, dt);
        belief.shape.covariance += Matrix3::from_diagonal(&(self.noise * dt.abs()));
    }

    fn update(&self, belief: &mut Shaped<N>, points: &Points) -> Result<Innovation, FilterError> {
        points.check()?;
        if points.is_empty() {
            return Ok(Innovation::new(&Vector2::zeros(), 0.0, 0.0));
        }
        let Shaped { mut state, mut shape } = *belief;
        let spread = self.scattering.spread(&self.axes(&shape));
        let (sensor, mean) = centre(&spread, points)?;
        let mut whole = Comparison::new(&sensor, &state, &mean)?.innovation;
        whole.log_likelihood = 0.0;
        for point in points.points() {
            let Linearised { spread, slope } = Linearised::new(&shape, self.scattering.scale());
            let noise = spread + self.scattering.noise();
            let sensor = Position::with_noise(noise)?;
            let expected = position_covariance(&state) + noise;
            let comparison = Comparison::new(&sensor, &state, &(*point).into())?;
            comparison.condition(&sensor, &mut state)?;
            whole.log_likelihood += comparison.innovation.log_likelihood;
            let residual = Vector2::from_column_slice(comparison.innovation.residual());
            if let Some(after) = reshaped(&shape, &slope, &residual, &expected) {
                shape = after;
                self.bound(&mut shape);
            }
        }
        *belief = Shaped { state, shape };
        Ok(whole)
    }

    /// The shapes are merged with the angle of the second as near to that of the first as half turns allow.
    fn merge(&self, belief: &mut Shaped<N>, weight: f64, other: &Shaped<N>, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        let mut near = other.shape;
        let turns = ((belief.shape.mean[0] - near.mean[0]) / std::f64::consts::PI).round();
        near.mean[0] += turns * std::f64::consts::PI;
        belief.shape.merge(weight, &near, other_weight);
    }

    fn estimate(&self, belief: &Shaped<N>) -> Estimate<N> {
        Estimate { extent: Some(self.axes(&belief.shape)), ..belief.state.into() }
    }

    fn reach(&self, belief: &Shaped<N>, search: &Search) -> Option<Region> {
        let state = &belief.state;
        let spread = self.scattering.spread(&self.axes(&belief.shape));
        let place = Vector2::new(state.mean[0], state.mean[1]);
        Some(search.around(place, &(position_covariance(state) + spread)))
    }

    scan_state!();
}

impl<const N: usize> Shaped<N> {
    /// The ellipse of the belief.
    ///
    /// # Errors
    /// When the state is not finite.
    pub fn ellipse(&self) -> Result<Ellipse, FilterError> {
        let (state, shape) = (&self.state.mean, &self.shape.mean);
        Ellipse::new(Vector2::new(state[0], state[1]), Vector2::new(shape[1], shape[2]), shape[0])
    }
}
