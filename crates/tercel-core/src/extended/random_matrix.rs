//! Random-matrix filters: a Gaussian for the motion, an inverse Wishart for the extent.

mod likelihood;
mod variational;

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::symmetric::{congruent, inverse_root, root, rotation};
use super::{Freedom, InverseWishart, Points, Rate, Scattering, scan_state};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::filter::{Comparison, Estimate, Filter, Innovation, predicted};
use crate::motion::Motion;
use crate::sensor::{Measurement, Position, Sensor};

/// Estimates motion and extent of an object that gives many points a scan: the family of random-matrix
/// filters.
///
/// ## Recursion
/// The belief is a Gaussian `(x, P)` and an [`InverseWishart`] `(X̂, λ)`. With the count `n`, mean `z̄` and
/// scatter `Z` of the [`Points`], and the covariance `Y` of one point around the centre:
/// ```text
/// predict   x, P by the motion;   X̂, λ by the Evolution
/// update    S = H P Hᵀ + Y/n,   ε = z̄ - H x,   x, P as a Kalman filter with the noise Y/n
///           N = X̂^½ S^-½ ε εᵀ S^-½ X̂^½,        T = X̂^½ Y^-½
///           λ X̂ ← λ X̂ + N + T Z Tᵀ,   λ ← λ + n
/// ```
/// | [`Rule`] | covariance of a point | known as |
/// |---|---|---|
/// | `Direct` | `Y = X̂`: the matrix is the covariance of the points, and the extent is read off it | Koch; B-RMM |
/// | `Distorted` | `Y = s X̂ + R` | Feldmann, Fränken and Koch; Lan and Li with `B = Y^½ X̂^-½` |
/// | `Variational` | the true position of every point is estimated, too | Orguner; VB-RMM |
///
/// The likelihood integrates over the extent, so that hypotheses and modes that differ in it can be compared.
/// Without points an update changes nothing but the [`Rate`], if there is one.
///
/// ## Use it when
/// the sensor resolves the object: some five points a scan or more. The motion may be any; modes of an
/// [`Imm`](crate::filter::Imm) mix their extents. `Distorted` costs least and is hard to beat when the extent
/// is forgotten slowly; `Variational` is better when sensor noise and extent are of one size, or the extent
/// turns fast.
///
/// ## Reference
/// Koch (2008), eqs. 27 to 45 with the full covariance `P` instead of `P̃ ⊗ X`; Feldmann, Fränken and Koch
/// (2011), eqs. 20 to 31; Orguner (2012); Lan and Li (2012), eqs. 10 to 25. Deviations: extents keep their
/// mean when they are forgotten, with a weight `λ` that stays positive where the printed degrees of freedom
/// would not; the likelihood is derived for this form.
///
/// ```
/// use nalgebra::{Matrix2, matrix};
/// use tercel_core::extended::{Evolution, InverseWishart, Points, RandomMatrix, Rule, Scattering};
/// use tercel_core::{filter::Filter, motion::ConstantVelocity};
///
/// let lidar = Scattering::uniform(Matrix2::identity() * 0.04)?;
/// let size = InverseWishart::new(matrix![9.0, 0.0; 0.0, 4.0], 10.0)?;
/// let filter = RandomMatrix::new(ConstantVelocity::new(1.0), lidar, size, Evolution::forget(20.0)?, Rule::Distorted);
/// let car = |x: f64| Points::from_iter([[x - 2.0, 0.9], [x + 2.0, 0.9], [x - 2.0, -0.9], [x + 2.0, -0.9]]);
/// let mut belief: tercel_core::extended::GaussianInverseWishart<4> = filter.birth(&car(0.0))?;
/// for second in 1..=20 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &car(10.0 * second as f64))?;
/// }
/// let extent = filter.estimate(&belief).extent.unwrap();
/// assert!(extent[(0, 0)] > 3.0 * extent[(1, 1)]);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomMatrix<T> {
    motion: T,
    scattering: Scattering,
    prior: InverseWishart,
    evolution: Evolution,
    rule: Rule,
    rate: Option<(Rate, f64)>,
}

/// How points change the belief about the extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rule {
    /// The matrix is the covariance of the points; the extent is what is left of it without the sensor noise,
    /// over the scale.
    Direct,
    /// The covariance of the points is `s X + R` with the predicted extent.
    Distorted,
    /// Variational: the true positions of the points, the state and the extent are estimated in turns.
    Variational {
        /// Largest number of turns.
        sweeps: u32,
        /// The turns end when the extent changes by less than this share; 0 takes them all.
        tolerance: f64,
    },
}

/// How the extent changes from scan to scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evolution {
    fading: Fading,
    turn_rate: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Fading {
    Exponential { time: f64 },
    Wishart { delta: f64, freedom: Freedom, shrink: f64 },
}

impl Evolution {
    /// The weight of the extent falls to `1/e` in `time` seconds; infinity for a rigid object whose direction
    /// is fixed.
    ///
    /// # Errors
    /// When the time is not positive.
    pub fn forget(time: f64) -> Result<Self, FilterError> {
        if time > 0.0 {
            return Ok(Evolution { fading: Fading::Exponential { time }, turn_rate: 0.0 });
        }
        let (parameter, expected) = ("time over which an extent is forgotten", "must be positive");
        Err(FilterError::Parameter { parameter, value: time, expected })
    }

    /// The extent after a step is Wishart with `delta` degrees of freedom around the one before: Lan and Li.
    /// The step is that between scans, whatever its length.
    ///
    /// # Errors
    /// Unless `delta` is above 1.
    pub fn wishart(delta: f64, freedom: Freedom) -> Result<Self, FilterError> {
        if !(delta > 1.0 && delta.is_finite()) {
            let (parameter, expected) =
                ("degrees of freedom of the next extent", "must be above 1 and finite");
            return Err(FilterError::Parameter { parameter, value: delta, expected });
        }
        Ok(Evolution { fading: Fading::Wishart { delta, freedom, shrink: 1.0 }, turn_rate: 0.0 })
    }

    /// Multiplies the mean extent by this factor in every step, as a transition `A = I/δ` does with the
    /// factor `1/δ`. Only for comparison with publications: extents do not shrink by themselves.
    pub fn with_shrinking(self, factor: f64) -> Self {
        match self.fading {
            Fading::Wishart { delta, freedom, .. } => {
                Evolution { fading: Fading::Wishart { delta, freedom, shrink: factor }, ..self }
            }
            Fading::Exponential { .. } => self,
        }
    }

    /// Turns the extent at this rate, rad/s: for a mode that turns.
    pub fn with_turn_rate(self, turn_rate: f64) -> Self {
        Evolution { turn_rate, ..self }
    }

    fn apply(&self, extent: &mut InverseWishart, dt: f64) {
        match self.fading {
            Fading::Exponential { time } => extent.forget((-dt.abs() / time).exp()),
            Fading::Wishart { delta, freedom, shrink } => {
                extent.diffuse(delta, freedom);
                if shrink != 1.0 {
                    extent.transform(&Matrix2::from_diagonal_element(shrink.max(0.0).sqrt()));
                }
            }
        }
        if self.turn_rate != 0.0 {
            extent.transform(&rotation(self.turn_rate * dt));
        }
    }
}

/// What a [`RandomMatrix`] filter knows of one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianInverseWishart<const N: usize> {
    /// The state of its centre.
    pub state: Gaussian<N>,
    /// Its extent; with [`Rule::Direct`] the covariance of its points.
    pub extent: InverseWishart,
    /// How many points it gives, if the filter estimates that.
    pub rate: Option<Rate>,
}

impl<T> RandomMatrix<T> {
    /// A filter of this motion, with the extent of a new object (with [`Rule::Direct`]: the covariance of its
    /// points).
    pub fn new(
        motion: T,
        scattering: Scattering,
        prior: InverseWishart,
        evolution: Evolution,
        rule: Rule,
    ) -> Self {
        RandomMatrix { motion, scattering, prior, evolution, rule, rate: None }
    }

    /// Estimates how many points an object gives, too, from this prior, which is forgotten over `time`
    /// seconds.
    ///
    /// # Errors
    /// When the time is not positive.
    pub fn with_rate(self, prior: Rate, time: f64) -> Result<Self, FilterError> {
        // The same range as that of the extent.
        Evolution::forget(time)?;
        Ok(RandomMatrix { rate: Some((prior, time)), ..self })
    }

    /// How points spread over the object.
    pub fn scattering(&self) -> Scattering {
        self.scattering
    }

    /// Covariance of a point around the centre, m².
    #[inline]
    fn spread(&self, extent: &Matrix2<f64>) -> Matrix2<f64> {
        match self.rule {
            Rule::Direct => *extent,
            Rule::Distorted | Rule::Variational { .. } => self.scattering.spread(extent),
        }
    }

    /// The expected extent matrix of a belief, m².
    pub fn extent_of<const N: usize>(&self, belief: &GaussianInverseWishart<N>) -> Matrix2<f64> {
        match self.rule {
            Rule::Direct => self.scattering.extent(&belief.extent.mean()),
            Rule::Distorted | Rule::Variational { .. } => belief.extent.mean(),
        }
    }
}

/// The step of a scan: what became of the belief, and how well it agreed.
struct Step<const N: usize> {
    state: Gaussian<N>,
    extent: InverseWishart,
    innovation: Innovation,
}

impl<T> RandomMatrix<T> {
    /// Conditions state and extent on at least one point.
    fn condition<const N: usize>(
        &self,
        belief: &GaussianInverseWishart<N>,
        points: &Points,
    ) -> Result<Step<N>, FilterError> {
        let count = points.count() as f64;
        let extent = belief.extent.mean();
        let spread = self.spread(&extent);
        let (sensor, mean) = centre(&spread, points)?;
        let comparison = Comparison::new(&sensor, &belief.state, &mean)?;
        let squares = self.squares(belief, points, &spread);
        let mut after = belief.extent;
        after.add(&squares, count);
        let ln_likelihood = likelihood::ln_points(&belief.extent, &spread, &squares, points, &belief.state);
        // Where a belief is as wide as numbers go, infinities cancel.
        if ln_likelihood.is_nan() {
            return Err(FilterError::NotFinite { what: "likelihood of the points" });
        }
        let residual = Vector2::from_column_slice(comparison.innovation.residual());
        let innovation = Innovation::new(&residual, comparison.innovation.nis, ln_likelihood);
        let mut state = belief.state;
        match self.rule {
            Rule::Direct | Rule::Distorted => comparison.condition(&sensor, &mut state)?,
            Rule::Variational { sweeps, tolerance } => {
                (state, after) = variational::fixed_point(self, belief, points, sweeps, tolerance)?;
            }
        }
        if !after.is_sound() {
            return Err(FilterError::NotFinite { what: "extent" });
        }
        Ok(Step { state, extent: after, innovation })
    }

    /// `N + T Z Tᵀ`: what the points add to the sum of squares of the extent.
    #[inline]
    fn squares<const N: usize>(
        &self,
        belief: &GaussianInverseWishart<N>,
        points: &Points,
        spread: &Matrix2<f64>,
    ) -> Matrix2<f64> {
        let state = &belief.state;
        let residual = points.mean() - Vector2::new(state.mean[0], state.mean[1]);
        let innovation = position_covariance(state) + spread / points.count() as f64;
        let half = root(&belief.extent.mean());
        let offset = half * inverse_root(&innovation) * residual;
        let scatter = match self.rule {
            Rule::Direct => points.scatter(),
            _ => congruent(&(half * inverse_root(spread)), &points.scatter()),
        };
        offset * offset.transpose() + scatter
    }

    fn follow_rate(&self, rate: Option<Rate>, count: usize) -> (Option<Rate>, f64) {
        let Some(mut rate) = rate else { return (None, 0.0) };
        let ln_likelihood = rate.ln_likelihood(count);
        rate.add(count);
        (Some(rate), ln_likelihood)
    }
}

/// The sensor and measurement of the mean of points, whose covariance around the centre is `spread`.
#[inline]
pub(super) fn centre(
    spread: &Matrix2<f64>,
    points: &Points,
) -> Result<(Position<2>, Measurement<2>), FilterError> {
    let sensor = Position::with_noise(spread / points.count() as f64)?;
    Ok((sensor, points.mean().into()))
}

/// Covariance of the position of a state, m².
#[inline]
pub(super) fn position_covariance<const N: usize>(state: &Gaussian<N>) -> Matrix2<f64> {
    const { assert!(N >= 2, "a state of an extended object begins with its position in the plane") };
    SMatrix::from_fn(|i, j| state.covariance[(i, j)])
}

impl<const N: usize, T: Motion<N>> Filter<N> for RandomMatrix<T> {
    type Belief = GaussianInverseWishart<N>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<GaussianInverseWishart<N>, FilterError> {
        points.check_birth()?;
        let (sensor, mean) = centre(&self.spread(&self.prior.mean()), points)?;
        let state = sensor.birth(&mean, &self.motion.prior())?;
        let (rate, _) = self.follow_rate(self.rate.map(|(prior, _)| prior), points.count());
        let mut extent = self.prior;
        let scatter = match self.rule {
            Rule::Direct => points.scatter(),
            _ => {
                let half = root(&extent.mean()) * inverse_root(&self.spread(&extent.mean()));
                congruent(&half, &points.scatter())
            }
        };
        // The mean is spent on the position; the rest tells the extent.
        extent.add(&scatter, points.count() as f64 - 1.0);
        Ok(GaussianInverseWishart { state, extent, rate })
    }

    #[inline]
    fn predict(&self, belief: &mut GaussianInverseWishart<N>, dt: f64) {
        belief.state = predicted(&self.motion, &belief.state, dt);
        if dt == 0.0 {
            return;
        }
        self.evolution.apply(&mut belief.extent, dt);
        if let (Some(rate), Some((_, time))) = (&mut belief.rate, self.rate) {
            rate.forget((-dt.abs() / time).exp());
        }
    }

    #[inline]
    fn update(
        &self,
        belief: &mut GaussianInverseWishart<N>,
        points: &Points,
    ) -> Result<Innovation, FilterError> {
        points.check()?;
        let (rate, ln_count) = self.follow_rate(belief.rate, points.count());
        if points.is_empty() {
            belief.rate = rate;
            return Ok(Innovation::new(&Vector2::zeros(), 0.0, ln_count));
        }
        let Step { state, extent, mut innovation } = self.condition(belief, points)?;
        innovation.log_likelihood += ln_count;
        *belief = GaussianInverseWishart { state, extent, rate };
        Ok(innovation)
    }

    fn merge(
        &self,
        belief: &mut GaussianInverseWishart<N>,
        weight: f64,
        other: &GaussianInverseWishart<N>,
        other_weight: f64,
    ) {
        belief.state.merge(weight, &other.state, other_weight);
        belief.extent.merge(weight, &other.extent, other_weight);
        if let (Some(rate), Some(other)) = (&mut belief.rate, &other.rate) {
            rate.merge(weight, other, other_weight);
        }
    }

    fn estimate(&self, belief: &GaussianInverseWishart<N>) -> Estimate<N> {
        Estimate { extent: Some(self.extent_of(belief)), ..belief.state.into() }
    }

    fn extent(&self, belief: &GaussianInverseWishart<N>) -> Option<InverseWishart> {
        Some(belief.extent)
    }

    fn set_extent(&self, belief: &mut GaussianInverseWishart<N>, extent: &InverseWishart) {
        belief.extent = *extent;
    }

    fn reach(&self, belief: &GaussianInverseWishart<N>, search: &Search) -> Option<Region> {
        let state = &belief.state;
        let spread = self.spread(&belief.extent.mean());
        let place = Vector2::new(state.mean[0], state.mean[1]);
        Some(search.around(place, &(position_covariance(state) + spread)))
    }

    scan_state!();
}

#[cfg(test)]
mod tests;
