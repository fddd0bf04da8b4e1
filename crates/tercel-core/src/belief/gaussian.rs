//! The Gaussian belief.

use nalgebra::{SMatrix, SVector};

use super::positive::{self, Cholesky};
use crate::error::FilterError;

/// A state of `N` components, known up to a Gaussian error.
///
/// The components are ordered by derivative: positions, then velocities, then the rest
/// (`x, y, vx, vy` in the plane; `x, y, vx, vy, ax, ay` with accelerations; `x, y, vx, vy, turn rate`), in SI
/// units and radians. So the state of a smaller model is the beginning of the state of a larger one.
///
/// ```
/// use tercel_core::belief::Gaussian;
/// use nalgebra::{matrix, vector};
///
/// let belief = Gaussian::new(vector![10.0, 0.5], matrix![4.0, 0.0; 0.0, 1.0])?;
/// assert_eq!(belief.mahalanobis(&vector![12.0, 0.5])?, 1.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// Expected state.
    pub mean: SVector<f64, N>,
    /// Covariance of the state: symmetric and positive definite.
    pub covariance: SMatrix<f64, N, N>,
}

impl<const N: usize> Gaussian<N> {
    /// A Gaussian with this mean and covariance.
    ///
    /// # Errors
    /// When a number is not finite or the covariance is not positive definite.
    pub fn new(mean: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Result<Self, FilterError> {
        let mut gaussian = Gaussian { mean, covariance };
        gaussian.settle()?;
        Ok(gaussian)
    }

    /// Makes the covariance exactly symmetric and repairs what rounding did to it.
    ///
    /// # Errors
    /// When the mean or the covariance is not finite, or the covariance is indefinite beyond rounding.
    #[inline]
    pub fn settle(&mut self) -> Result<(), FilterError> {
        if !self.mean.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NotFinite { what: "state mean" });
        }
        positive::settle(&mut self.covariance, "state covariance")
    }

    /// Squared Mahalanobis distance of `state` from the mean.
    ///
    /// # Errors
    /// When the covariance is not positive definite.
    pub fn mahalanobis(&self, state: &SVector<f64, N>) -> Result<f64, FilterError> {
        Ok(Cholesky::new(&self.covariance, "state covariance")?.mahalanobis(&(state - self.mean)))
    }

    /// Squared Mahalanobis distance of `state` from the mean, or infinity as soon as it is known to exceed `limit`.
    ///
    /// A single component already bounds the distance from below, which makes the common case cheap.
    #[inline]
    pub fn mahalanobis_within(&self, state: &SVector<f64, N>, limit: f64) -> f64 {
        let difference = state - self.mean;
        for i in 0..N {
            if difference[i] * difference[i] > limit * self.covariance[(i, i)] {
                return f64::INFINITY;
            }
        }
        match Cholesky::new(&self.covariance, "state covariance") {
            Ok(factor) => factor.mahalanobis(&difference),
            Err(_) => f64::INFINITY,
        }
    }

    /// `ln N(state; mean, covariance)`.
    ///
    /// # Errors
    /// When the covariance is not positive definite.
    pub fn ln_density(&self, state: &SVector<f64, N>) -> Result<f64, FilterError> {
        let factor = Cholesky::new(&self.covariance, "state covariance")?;
        Ok(factor.ln_density(factor.mahalanobis(&(state - self.mean))))
    }

    /// Replaces this Gaussian by the one with the moments of a mixture of itself and `other`.
    ///
    /// Weights need not be normalised, and folding a mixture in pair by pair gives the moments of the whole:
    /// ```text
    /// m = (w₁ m₁ + w₂ m₂) / (w₁ + w₂)
    /// P = (w₁ P₁ + w₂ P₂) / (w₁ + w₂) + w₁ w₂ / (w₁ + w₂)² (m₁ - m₂)(m₁ - m₂)ᵀ
    /// ```
    #[inline]
    pub fn merge(&mut self, weight: f64, other: &Gaussian<N>, other_weight: f64) {
        let total = weight + other_weight;
        // Two vanished weights carry no preference, so the first belief stays.
        let share = if total > 0.0 { other_weight / total } else { 0.0 };
        let difference = other.mean - self.mean;
        self.mean += difference * share;
        self.covariance = self.covariance * (1.0 - share)
            + other.covariance * share
            + difference * difference.transpose() * (share * (1.0 - share));
    }

    /// The same object `seconds` later, where its `axes` positions have moved on with the `axes` velocities that follow them, and
    /// nothing else has changed. A state without velocities stays where it is.
    pub fn moved_on(&self, axes: usize, seconds: f64) -> Gaussian<N> {
        if seconds == 0.0 || N < 2 * axes {
            return *self;
        }
        let mut shift = SMatrix::<f64, N, N>::identity();
        for i in 0..axes {
            shift[(i, i + axes)] = seconds;
        }
        Gaussian { mean: shift * self.mean, covariance: shift * self.covariance * shift.transpose() }
    }

    /// The first `K` components, as the belief of a smaller state.
    ///
    /// A `K` above `N` does not compile.
    pub fn leading<const K: usize>(&self) -> Gaussian<K> {
        const { assert!(K <= N, "a leading part cannot be longer than the state") };
        Gaussian {
            mean: SVector::from_fn(|i, _| self.mean[i]),
            covariance: SMatrix::from_fn(|i, j| self.covariance[(i, j)]),
        }
    }

    /// Standard deviation of each component.
    pub fn deviations(&self) -> SVector<f64, N> {
        self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn merging_pair_by_pair_gives_the_moments_of_the_mixture() {
        let parts = [
            (0.5, Gaussian::new(vector![0.0, 1.0], matrix![1.0, 0.2; 0.2, 2.0]).unwrap()),
            (0.3, Gaussian::new(vector![4.0, -1.0], matrix![3.0, 0.0; 0.0, 1.0]).unwrap()),
            (0.9, Gaussian::new(vector![-2.0, 5.0], matrix![0.5, -0.1; -0.1, 0.4]).unwrap()),
        ];
        let total: f64 = parts.iter().map(|p| p.0).sum();
        let mean = parts.iter().map(|(w, g)| g.mean * *w).sum::<SVector<f64, 2>>() / total;
        let covariance = parts
            .iter()
            .map(|(w, g)| (g.covariance + (g.mean - mean) * (g.mean - mean).transpose()) * *w)
            .sum::<SMatrix<f64, 2, 2>>()
            / total;
        let (mut weight, mut merged) = parts[0];
        for (w, g) in &parts[1..] {
            merged.merge(weight, g, *w);
            weight += w;
        }
        assert!((merged.mean - mean).norm() < 1e-14);
        assert!((merged.covariance - covariance).norm() < 1e-14);
    }

    #[test]
    fn the_bounded_distance_is_the_distance_or_infinity() {
        let belief = Gaussian::new(vector![0.0, 0.0], matrix![4.0, 1.0; 1.0, 1.0]).unwrap();
        let near = vector![1.0, 0.5];
        assert_eq!(belief.mahalanobis_within(&near, 9.0), belief.mahalanobis(&near).unwrap());
        assert_eq!(belief.mahalanobis_within(&vector![100.0, 0.0], 9.0), f64::INFINITY);
    }

    #[test]
    fn a_covariance_that_is_not_positive_definite_is_refused() {
        assert!(Gaussian::new(vector![0.0, 0.0], matrix![1.0, 2.0; 2.0, 1.0]).is_err());
        assert!(Gaussian::new(vector![f64::NAN, 0.0], matrix![1.0, 0.0; 0.0, 1.0]).is_err());
    }
}
