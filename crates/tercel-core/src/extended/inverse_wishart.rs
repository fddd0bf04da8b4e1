//! The belief about an extent.

use nalgebra::Matrix2;

use super::symmetric::{congruent, inverse, symmetric};
use crate::error::FilterError;

/// An extent matrix, known up to an inverse Wishart error in the plane.
///
/// ## Definition
/// In the form of Gupta and Nagar, with `v > 6`:
/// ```text
/// p(X) ∝ |X|^(-v/2) exp(-tr(V X⁻¹)/2),      X̂ = E[X] = V / λ,    λ = v - 6
/// ```
/// Inside are the mean `X̂` and the weight `λ`: about the number of points that the belief is worth. Both
/// stay meaningful when nearly everything is forgotten, where `V` vanishes.
///
/// | parametrisation | constructor |
/// |---|---|
/// | mean and weight (`λ`) | [`new`](InverseWishart::new) |
/// | `v`, `V` of Gupta and Nagar: Koch, Orguner, Lan and Li | [`gupta_nagar`](InverseWishart::gupta_nagar) |
/// | `ν`, `Ψ` of Wikipedia and SciPy, `v = ν + 3` | [`classical`](InverseWishart::classical) |
/// | mean and `α` of Feldmann, Fränken and Koch, `λ = α - 2` | [`feldmann`](InverseWishart::feldmann) |
///
/// ## Reference
/// Gupta and Nagar (2000), definition 3.4.1 and theorem 3.4.3 (moments).
///
/// ```
/// use nalgebra::matrix;
/// use tercel_core::extended::InverseWishart;
///
/// let belief = InverseWishart::gupta_nagar(10.0, matrix![400.0, 0.0; 0.0, 100.0])?;
/// assert_eq!((belief.weight(), belief.mean()), (4.0, matrix![100.0, 0.0; 0.0, 25.0]));
/// assert_eq!(InverseWishart::classical(7.0, belief.scale())?, belief);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseWishart {
    mean: Matrix2<f64>,
    weight: f64,
}

/// How degrees of freedom shrink in the prediction of Lan and Li.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// Matches mean and variance of the elements on the diagonal: `λ⁻ = 2 + δ (λ - 2) / (λ + δ)`.
    Exact,
    /// As printed: `v⁻ = 2 δ (λ+1)(λ-1)(λ-2) / (λ² (λ+δ)) + 8`, about twice as confident.
    Printed,
}

/// Weight of the least certain belief whose matrix still has a second moment.
const LEAST_WITH_VARIANCE: f64 = 2.05;

/// Smallest weight, of a belief that is as good as forgotten: less, and its densities leave the range of a
/// double.
const LEAST: f64 = 1e-6;

/// Largest weight that a moment match gives: beyond it, the difference of moments is rounding.
const LARGEST: f64 = 1e12;

impl InverseWishart {
    /// A belief with this mean (m²) that is worth `weight` points.
    ///
    /// # Errors
    /// When the mean is not positive definite or the weight is not positive and finite.
    pub fn new(mean: Matrix2<f64>, weight: f64) -> Result<Self, FilterError> {
        FilterError::positive("weight of an extent", weight)?;
        crate::belief::Cholesky::new(&mean, "mean of an extent")?;
        Ok(InverseWishart { mean: symmetric(&mean), weight })
    }

    /// The belief with the parameters `v` and `V` of Gupta and Nagar.
    ///
    /// # Errors
    /// Unless `v > 6`, where the mean begins to exist, and `V` is positive definite.
    pub fn gupta_nagar(freedom: f64, scale: Matrix2<f64>) -> Result<Self, FilterError> {
        let weight = freedom - 6.0;
        if !(weight > 0.0 && weight.is_finite()) {
            let (parameter, expected) = ("degrees of freedom of an extent", "must be above 6 and finite");
            return Err(FilterError::Parameter { parameter, value: freedom, expected });
        }
        InverseWishart::new(scale / weight, weight)
    }

    /// The belief with the parameters `ν` and `Ψ` of the classical form, whose mean is `Ψ / (ν - 3)`.
    ///
    /// # Errors
    /// Unless `ν > 3` and `Ψ` is positive definite.
    pub fn classical(freedom: f64, scale: Matrix2<f64>) -> Result<Self, FilterError> {
        InverseWishart::gupta_nagar(freedom + 3.0, scale)
    }

    /// The belief with the mean and the parameter `α` of Feldmann, Fränken and Koch.
    ///
    /// # Errors
    /// Unless `α > 2` and the mean is positive definite.
    pub fn feldmann(mean: Matrix2<f64>, alpha: f64) -> Result<Self, FilterError> {
        InverseWishart::gupta_nagar(alpha + 4.0, mean * (alpha - 2.0))
    }

    /// The expected extent matrix, m².
    #[inline]
    pub fn mean(&self) -> Matrix2<f64> {
        self.mean
    }

    /// How many points the belief is worth, `λ`.
    #[inline]
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// The parameter `v` of Gupta and Nagar.
    pub fn freedom(&self) -> f64 {
        self.weight + 6.0
    }

    /// The parameter `V` of Gupta and Nagar, m².
    pub fn scale(&self) -> Matrix2<f64> {
        self.mean * self.weight
    }

    /// `E[X⁻¹]`, 1/m².
    pub fn mean_inverse(&self) -> Matrix2<f64> {
        inverse(&self.mean) * ((self.weight + 3.0) / self.weight)
    }

    /// `tr E[X²]`, m⁴. It exists for weights above 2; a smaller one counts as 2.05.
    pub fn mean_square(&self) -> f64 {
        let weight = self.weight.max(LEAST_WITH_VARIANCE);
        let (trace, square) = (self.mean.trace(), (self.mean * self.mean).trace());
        weight * (weight * square + trace * trace) / ((weight + 1.0) * (weight - 2.0))
    }

    /// The same mean, worth `share` of the points.
    #[inline]
    pub fn forget(&mut self, share: f64) {
        self.weight = (self.weight * share).max(LEAST);
    }

    /// The same weight, with the mean transformed: `X̂ ← A X̂ Aᵀ`.
    #[inline]
    pub fn transform(&mut self, a: &Matrix2<f64>) {
        self.mean = congruent(a, &self.mean);
    }

    /// The prediction of Lan and Li: the extent after a step is Wishart with `δ` degrees of freedom and the
    /// mean `X̂`.
    ///
    /// ## Reference
    /// Lan and Li (2012), eqs. 12 and 13 for [`Freedom::Printed`]; the exact variance match is derived from
    /// the second moments of both distributions.
    #[inline]
    pub fn diffuse(&mut self, delta: f64, freedom: Freedom) {
        // Below a weight of one the printed formula turns round and grows without bound.
        let w = self.weight.max(1.0);
        self.weight = match freedom {
            Freedom::Exact => 2.0 + delta * (w - 2.0) / (w + delta),
            Freedom::Printed => {
                let product = (w + 1.0) * (w - 1.0) * (w - 2.0);
                2.0 + 2.0 * delta * product / (w * w * (w + delta))
            }
        };
    }

    /// Conditions the belief on a sum of squares (m²) that is worth `count` points.
    #[inline]
    pub fn add(&mut self, squares: &Matrix2<f64>, count: f64) {
        let total = self.weight + count;
        self.mean = symmetric(&((self.mean * self.weight + squares) / total));
        self.weight = total;
    }

    /// Replaces this belief by the one with the mean and the mean trace of the square of a mixture of itself
    /// and `other`.
    ///
    /// ## Definition
    /// With the mixture's `X̂`, `M₂ = tr E[X²]`, `t₁ = tr X̂` and `t₂ = tr X̂²`:
    /// ```text
    /// λ = ((M₂ + t₁²) + √((M₂ + t₁²)² + 8 M₂ (M₂ - t₂))) / (2 (M₂ - t₂))
    /// ```
    /// the positive root of the equation that [`mean_square`](InverseWishart::mean_square) gives `M₂`.
    pub fn merge(&mut self, weight: f64, other: &InverseWishart, other_weight: f64) {
        let total = weight + other_weight;
        let share = if total > 0.0 { other_weight / total } else { 0.0 };
        if share == 0.0 || self == other {
            return;
        }
        let square = (1.0 - share) * self.mean_square() + share * other.mean_square();
        self.mean = self.mean * (1.0 - share) + other.mean * share;
        let (trace, own) = (self.mean.trace(), (self.mean * self.mean).trace());
        let excess = (square - own).max(own * f64::EPSILON);
        let sum = square + trace * trace;
        let root = (sum * sum + 8.0 * square * excess).sqrt();
        self.weight = ((sum + root) / (2.0 * excess)).min(LARGEST);
    }

    /// Whether mean and weight are those of a proper belief.
    #[inline]
    pub(crate) fn is_sound(&self) -> bool {
        let mean = &self.mean;
        mean.m11 > 0.0 && mean.determinant() > 0.0 && mean.trace().is_finite() && self.weight > 0.0
    }
}

#[cfg(test)]
mod tests;
