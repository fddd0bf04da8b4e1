//! Sigma points, and moments of what becomes of them.

use nalgebra::{SMatrix, SVector};

use crate::belief::{Cholesky, Gaussian, positive};
use crate::error::FilterError;

/// Where an unscented filter samples a belief, and how it takes moments of the samples.
///
/// ## Definition
/// The scaled transformation: the mean, and a pair of points on either side of it along each column of the Cholesky
/// factor `L` of the covariance,
/// ```text
/// χ₀ = x        χᵢ± = x ± c Lᵢ        c² = α² (N + κ)
/// ```
/// For a function `y` of the points, with its odd part `bᵢ = (y(χᵢ+) - y(χᵢ-)) / 2c` and its even part
/// `eᵢ = (y(χᵢ+) + y(χᵢ-)) / 2 - y(χ₀)`:
/// ```text
/// mean        ȳ = y(χ₀) + m                m = Σ eᵢ / c²
/// covariance  Σ bᵢ bᵢᵀ + Σ (eᵢ - ē)(eᵢ - ē)ᵀ / c² + (β + α² κ / N) m mᵀ
/// ```
/// These are the weighted sums of the original, sorted: with `w₀ = 1 - N / c²` for the mean, and `w₀ + 1 - α² + β` for
/// the covariance, of the central point. Either may be negative, and then the original form subtracts and can lose
/// definiteness. Here every term is a square with a weight of at least zero whenever `β ≥ 0` and `κ ≥ 0`, so the
/// covariance cannot become indefinite and nothing cancels for small `α`.
///
/// The default is `α = 1, β = 2, κ = 0`: pairs at `√N` deviations, no weight on the centre for the mean and 2 for the
/// covariance, which makes the variance of a square exact.
///
/// ## Reference
/// Julier (2002); Wan and van der Merwe (2000), eq. 15. Deviation: `κ < 0`, such as the old advice `κ = 3 - N`, is refused.
///
/// ```
/// use tercel_core::filter::SigmaPoints;
///
/// let narrow = SigmaPoints::new(0.5, 2.0, 0.0)?;
/// assert!(SigmaPoints::new(1.0, 0.0, -1.0).is_err());
/// # assert_ne!(narrow, SigmaPoints::default());
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaPoints {
    alpha: f64,
    beta: f64,
    kappa: f64,
}

impl Default for SigmaPoints {
    fn default() -> Self {
        SigmaPoints { alpha: 1.0, beta: 2.0, kappa: 0.0 }
    }
}

impl SigmaPoints {
    /// Spread `alpha`, weight `beta` of the centre in the covariance, and secondary spread `kappa`.
    ///
    /// # Errors
    /// Unless `alpha > 0`, `beta >= 0` and `kappa >= 0`: only then is every covariance positive.
    pub fn new(alpha: f64, beta: f64, kappa: f64) -> Result<Self, FilterError> {
        let alpha = FilterError::positive("alpha", alpha)?;
        for (parameter, value) in [("beta", beta), ("kappa", kappa)] {
            if !(value >= 0.0 && value.is_finite()) {
                let expected = "must not be negative: the covariance of sigma points could become indefinite";
                return Err(FilterError::Parameter { parameter, value, expected });
            }
        }
        Ok(SigmaPoints { alpha, beta, kappa })
    }

    /// `c²`, the squared distance of the points in deviations.
    #[inline]
    fn reach<const N: usize>(&self) -> f64 {
        self.alpha * self.alpha * (N as f64 + self.kappa)
    }

    /// The sigma points of a belief. A covariance that only rounding keeps from a factor is taken as singular.
    #[inline]
    pub(super) fn draw<const N: usize>(&self, belief: &Gaussian<N>) -> Points<N, N> {
        let lower = match Cholesky::new(&belief.covariance, "state covariance") {
            Ok(factor) => *factor.lower(),
            Err(_) => positive::root(&belief.covariance),
        };
        let steps = lower * self.reach::<N>().sqrt();
        let centre = belief.mean;
        let side = |sign: f64| {
            let mut side = steps * sign;
            for mut column in side.column_iter_mut() {
                column += centre;
            }
            side
        };
        Points { centre, plus: side(1.0), minus: side(-1.0) }
    }
}

/// A function with `K` components at the `2 N + 1` sigma points of a state of `N` components.
pub(super) struct Points<const K: usize, const N: usize> {
    centre: SVector<f64, K>,
    plus: SMatrix<f64, K, N>,
    minus: SMatrix<f64, K, N>,
}

impl<const K: usize, const N: usize> Points<K, N> {
    /// A further function of these values.
    #[inline]
    pub fn map<const J: usize>(&self, f: impl Fn(&SVector<f64, K>) -> SVector<f64, J>) -> Points<J, N> {
        let side = |side: &SMatrix<f64, K, N>| {
            let mut image = SMatrix::<f64, J, N>::zeros();
            for i in 0..N {
                image.set_column(i, &f(&side.column(i).into_owned()));
            }
            image
        };
        Points { centre: f(&self.centre), plus: side(&self.plus), minus: side(&self.minus) }
    }

    /// The moments of these values, with `difference` as their subtraction.
    #[inline]
    pub fn image(
        &self,
        rule: &SigmaPoints,
        difference: impl Fn(&SVector<f64, K>, &SVector<f64, K>) -> SVector<f64, K>,
    ) -> Image<K, N> {
        let square = rule.reach::<N>();
        let inverse = 1.0 / square.sqrt();
        let (mut odd, mut even) = (SMatrix::<f64, K, N>::zeros(), SMatrix::<f64, K, N>::zeros());
        let mut sum = SVector::<f64, K>::zeros();
        for i in 0..N {
            let up = difference(&self.plus.column(i).into_owned(), &self.centre);
            let down = difference(&self.minus.column(i).into_owned(), &self.centre);
            odd.set_column(i, &((up - down) * (0.5 * inverse)));
            let half = (up + down) * 0.5;
            sum += half;
            even.set_column(i, &half);
        }
        let average = sum / N as f64;
        for mut column in even.column_iter_mut() {
            column -= average;
        }
        let shift = sum / square;
        let bend = rule.beta + rule.alpha * rule.alpha * rule.kappa / N as f64;
        Image { mean: self.centre + shift, odd, even: even * inverse, bend: shift * bend.sqrt() }
    }
}

/// Mean of a function of the state, and the columns whose squares add up to its covariance.
pub(super) struct Image<const K: usize, const N: usize> {
    pub mean: SVector<f64, K>,
    odd: SMatrix<f64, K, N>,
    even: SMatrix<f64, K, N>,
    bend: SVector<f64, K>,
}

impl<const K: usize, const N: usize> Image<K, N> {
    /// The covariance.
    #[inline]
    pub fn covariance(&self) -> SMatrix<f64, K, K> {
        self.cross(self)
    }

    /// The covariance with another function of the same state.
    #[inline]
    pub fn cross<const J: usize>(&self, other: &Image<J, N>) -> SMatrix<f64, K, J> {
        self.odd * other.odd.transpose()
            + self.even * other.even.transpose()
            + self.bend * other.bend.transpose()
    }

    /// The columns of this function minus `gain` times another.
    #[inline]
    pub fn minus<const J: usize>(&self, gain: &SMatrix<f64, K, J>, other: &Image<J, N>) -> Self {
        Image {
            mean: self.mean,
            odd: self.odd - gain * other.odd,
            even: self.even - gain * other.even,
            bend: self.bend - gain * other.bend,
        }
    }
}
