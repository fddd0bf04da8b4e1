//! An aligned object whose motion is identified while it is tracked.

use nalgebra::{SMatrix, SVector, Vector2};

use super::aligned::{begin, condition};
use super::known_size::{Body, Oriented, axial_mean, course};
use super::{Points, Scattering, scan_state};
use crate::association::{Region, Search};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::filter::{Estimate, Filter, Innovation};
use crate::motion::AutoRegression;

/// Estimates an object of known size that points where it goes, and the weights with which its velocity
/// depends on the last `B` velocities.
///
/// ## Recursion
/// State, angle and scan as in [`Aligned`](super::Aligned), with the motion of
/// [`AutoRegressive`](crate::motion::AutoRegressive) under the weights `a` that are believed so far. After
/// each step `k`, for each axis with `φ = (v(k-1), .., v(k-B))` and `v(k)` from the state:
/// ```text
/// g = A φ / (σ² + φᵀ A φ),    a ← a + g (v(k) - φᵀ a),    A ← (A - g φᵀ A) / f
/// ```
/// recursive least squares with the forgetting factor `f`. What the weights leave open adds `φᵀ A φ` to the
/// variance of the next velocity.
///
/// ## Use it when
/// an object repeats patterns that no model was written for, and stays in view for some ten times `B` scans.
/// `N` is `2 + 2 B`.
///
/// ## Reference
/// Ljung and Söderström (1983), algorithm of section 2.2.1, on estimated instead of measured velocities; own
/// combination with the aligned extent.
///
/// ```
/// use nalgebra::{Matrix2, vector};
/// use tercel_core::extended::{AlignedAutoRegressive, Points, Scattering};
/// use tercel_core::filter::Filter;
///
/// let lidar = Scattering::uniform(Matrix2::identity() * 0.01)?;
/// let filter = AlignedAutoRegressive::<3>::new(lidar, vector![2.3, 0.9], 0.1, 1.0)?;
/// let car = |x: f64| Points::from_iter([[x - 1.0, -0.5], [x + 1.0, 0.5], [x, 0.2], [x, -0.2]]);
/// let mut belief: tercel_core::extended::Identified<8, 3> = filter.birth(&car(0.0))?;
/// filter.predict(&mut belief, 0.1);
/// filter.update(&mut belief, &car(1.0))?;
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignedAutoRegressive<const B: usize> {
    body: Body,
    regression: AutoRegression,
    forgetting: f64,
    prior: Gaussian<B>,
}

/// What [`AlignedAutoRegressive`] holds of one object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identified<const N: usize, const B: usize> {
    /// Position, and the last `B` velocities.
    pub state: Gaussian<N>,
    /// Direction of the first semi-axis, rad.
    pub angle: f64,
    /// The weights of the last velocities, the newest first.
    pub coefficients: Gaussian<B>,
    /// The velocity that has just left the state: the last regressor of the step.
    oldest: Vector2<f64>,
    /// Whether a step was made that no identification has used yet.
    moved: bool,
}

impl<const B: usize> AlignedAutoRegressive<B> {
    /// A filter of objects with these semi-axes (m), for scans every `interval` seconds, with this standard
    /// deviation (m/s per axis) of what the weights do not explain of a velocity. At first the velocity is
    /// believed to stay as it is.
    ///
    /// # Errors
    /// When an axis, the interval or the deviation is not positive.
    pub fn new(
        scattering: Scattering,
        axes: Vector2<f64>,
        interval: f64,
        deviation: f64,
    ) -> Result<Self, FilterError> {
        const { assert!(B > 0, "a regression needs a velocity before") };
        FilterError::positive("interval of the regression", interval)?;
        FilterError::positive("deviation of a velocity", deviation)?;
        let mean = SVector::from_fn(|i, _| if i == 0 { 1.0 } else { 0.0 });
        Ok(AlignedAutoRegressive {
            body: Body::new(axes, scattering)?,
            regression: AutoRegression::new(interval, deviation),
            forgetting: 0.998,
            prior: Gaussian { mean, covariance: SMatrix::identity() * 0.25 },
        })
    }

    /// Sets what is believed of the weights of a new object.
    pub fn with_coefficients(self, prior: Gaussian<B>) -> Self {
        AlignedAutoRegressive { prior, ..self }
    }

    /// Sets the forgetting factor, 0 to 1. The default, 0.998, remembers some 500 steps.
    ///
    /// # Errors
    /// Unless it lies in `(0, 1]`.
    pub fn with_forgetting(self, forgetting: f64) -> Result<Self, FilterError> {
        FilterError::positive("forgetting factor", forgetting)?;
        Ok(AlignedAutoRegressive {
            forgetting: FilterError::probability("forgetting factor", forgetting)?,
            ..self
        })
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    pub fn with_speed(self, speed: f64) -> Self {
        AlignedAutoRegressive { regression: AutoRegression { speed, ..self.regression }, ..self }
    }

    /// The last `B` velocities of an axis.
    fn velocities<const N: usize>(state: &Gaussian<N>, axis: usize) -> SVector<f64, B> {
        SVector::from_fn(|lag, _| state.mean[2 + 2 * lag + axis])
    }

    /// Learns the weights from the step that the state has just made.
    fn identify<const N: usize>(&self, belief: &mut Identified<N, B>) {
        if !belief.moved {
            return;
        }
        belief.moved = false;
        let mut weights = belief.coefficients;
        for axis in 0..2 {
            let newer = Self::velocities(&belief.state, axis);
            let regressors =
                SVector::<f64, B>::from_fn(|i, _| if i + 1 < B { newer[i + 1] } else { belief.oldest[axis] });
            let spread = weights.covariance * regressors;
            let gain = spread / (self.regression.variance + regressors.dot(&spread));
            weights.mean += gain * (newer[0] - regressors.dot(&weights.mean));
            weights.covariance -= gain * spread.transpose();
        }
        // Directions that nothing excites would otherwise grow without bound.
        let bound = self.prior.covariance.trace();
        if weights.covariance.trace() / self.forgetting < bound {
            weights.covariance /= self.forgetting;
        }
        if weights.settle().is_ok() {
            belief.coefficients = weights;
        }
    }
}

impl<const N: usize, const B: usize> Filter<N> for AlignedAutoRegressive<B> {
    type Belief = Identified<N, B>;
    type Measurement = Points;

    fn birth(&self, points: &Points) -> Result<Identified<N, B>, FilterError> {
        let Oriented { state, angle } = begin(&self.body, &self.regression.prior(), points)?;
        Ok(Identified { state, angle, coefficients: self.prior, oldest: Vector2::zeros(), moved: false })
    }

    fn predict(&self, belief: &mut Identified<N, B>, dt: f64) {
        let (steps, rest) = self.regression.steps(dt);
        for _ in 0..steps {
            let extra = [0, 1].map(|axis| {
                let velocities = Self::velocities(&belief.state, axis);
                velocities.dot(&(belief.coefficients.covariance * velocities))
            });
            belief.oldest = [0, 1].map(|axis| Self::velocities(&belief.state, axis)[B - 1]).into();
            self.regression.step(&belief.coefficients.mean, &mut belief.state, extra);
        }
        // A gap of several steps says too little about each.
        belief.moved = steps == 1;
        self.regression.drift(&mut belief.state, rest);
        // What is not finite stays so, for the next update to report.
        let _ = belief.state.settle();
        belief.angle = course(&belief.state).unwrap_or(belief.angle);
    }

    fn update(&self, belief: &mut Identified<N, B>, points: &Points) -> Result<Innovation, FilterError> {
        let mut oriented = Oriented { state: belief.state, angle: belief.angle };
        let innovation = condition(&self.body, &mut oriented, points)?;
        (belief.state, belief.angle) = (oriented.state, oriented.angle);
        if !points.is_empty() {
            self.identify(belief);
        }
        Ok(innovation)
    }

    fn merge(&self, belief: &mut Identified<N, B>, weight: f64, other: &Identified<N, B>, other_weight: f64) {
        belief.state.merge(weight, &other.state, other_weight);
        belief.coefficients.merge(weight, &other.coefficients, other_weight);
        belief.angle = axial_mean(belief.angle, weight, other.angle, other_weight);
        let total = weight + other_weight;
        if total > 0.0 {
            belief.oldest = (belief.oldest * weight + other.oldest * other_weight) / total;
        }
    }

    fn estimate(&self, belief: &Identified<N, B>) -> Estimate<N> {
        Estimate { extent: Some(self.body.extent(belief.angle)), ..belief.state.into() }
    }

    fn reach(&self, belief: &Identified<N, B>, search: &Search) -> Option<Region> {
        self.body.reach(&belief.state, belief.angle, search)
    }

    scan_state!();
}
