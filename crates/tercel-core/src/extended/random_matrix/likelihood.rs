//! The density of a set of points under a belief.

use nalgebra::Matrix2;

use super::position_covariance;
use crate::belief::Gaussian;
use crate::extended::symmetric::inverse;
use crate::extended::{InverseWishart, Points, rate::ln_rising};

/// Logarithm of the density of at least one point, integrated over the state and the extent.
///
/// With `Y` the covariance of a point, `S = H P Hᵀ + Y/n`, and `ΔV` the sum of squares that the points add:
/// ```text
/// ln L = -n ln π - ln n - (n-1)/2 ln(|Y|/|X̂|) + ½ ln(|X̂|/|S|)
///        - (λ+3)/2 ln(|V+ΔV|/|V|) - n/2 ln|V+ΔV| - n ln 2 + ln((λ+2)(λ+3)..(λ+n+1))
/// ```
/// The gamma functions of the inverse Wishart reduce to the product by Legendre's duplication formula. The
/// quotient of determinants is taken as one number, so that a belief of great weight does not cancel its own
/// digits.
pub(super) fn ln_points<const N: usize>(
    belief: &InverseWishart,
    spread: &Matrix2<f64>,
    squares: &Matrix2<f64>,
    points: &Points,
    state: &Gaussian<N>,
) -> f64 {
    let (count, weight) = (points.count(), belief.weight());
    let n = count as f64;
    let scale = belief.scale();
    let innovation = position_covariance(state) + spread / n;
    let extent = belief.mean().determinant();
    let added = inverse(&scale) * squares;
    let growth = (added.trace() + added.determinant()).ln_1p();
    -n * std::f64::consts::TAU.ln() - n.ln() - 0.5 * (n - 1.0) * (spread.determinant() / extent).ln()
        + 0.5 * (extent / innovation.determinant()).ln()
        - 0.5 * (weight + 3.0 + n) * growth
        - 0.5 * n * scale.determinant().ln()
        + ln_rising(weight + 2.0, count)
}
