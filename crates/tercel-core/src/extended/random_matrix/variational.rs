//! The variational measurement update.

use nalgebra::{Matrix2, Vector2};

use super::{GaussianInverseWishart, RandomMatrix, centre, position_covariance};
use crate::belief::Gaussian;
use crate::error::FilterError;
use crate::extended::symmetric::{congruent, inverse, symmetric};
use crate::extended::{InverseWishart, Points};
use crate::filter::Comparison;

/// Estimates state, extent and the true position `y_j` of every point in turns, each given the newest of the
/// others.
///
/// ## Recursion
/// With `C = s V/(v-3)`, so that `C⁻¹ = E[(sX)⁻¹]`, and the gain `G = C (C + R)⁻¹` from a point to its true
/// position:
/// ```text
/// ŷ_j = G z_j + (I - G) H m             Σ = G R               in the first turn ŷ_j = z_j, Σ = s V⁻/(v⁻-6)
/// m, P: the prediction updated by mean ŷ with noise C/n
/// V = V⁻ + 1/s (Σ_j (ŷ_j - Hm)(..)ᵀ + n H P Hᵀ + n Σ)
/// ```
/// Only sums over the points enter, so a turn costs the same for any number of them.
///
/// ## Reference
/// Orguner (2012), "A variational measurement update for extended target tracking with random matrices",
/// algorithm 1, with every turn using the newest values. `G` in place of inverses of `R` allows a sensor
/// without noise.
pub(super) fn fixed_point<const N: usize, T>(
    filter: &RandomMatrix<T>,
    belief: &GaussianInverseWishart<N>,
    points: &Points,
    sweeps: u32,
    tolerance: f64,
) -> Result<(Gaussian<N>, InverseWishart), FilterError> {
    let (n, scale, noise) = (points.count() as f64, filter.scattering.scale(), filter.scattering.noise());
    let prior = &belief.state;
    let (place, covariance) = (Vector2::new(prior.mean[0], prior.mean[1]), position_covariance(prior));
    let mut extent = belief.extent;
    let mut inner = inner_spread(&extent, scale);
    let (mut mean, mut scatter, mut sigma) = (points.mean(), points.scatter(), extent.mean() * scale);
    for _ in 0..sweeps.max(1) {
        let gain = covariance * inverse(&(covariance + inner / n));
        let position = place + gain * (mean - place);
        let offset = mean - position;
        // P - K P without the difference, which would cancel where the prediction is vague.
        let uncertain = gain * inner / n + sigma;
        let squares = scatter + (offset * offset.transpose() + uncertain) * n;
        let before = extent.mean();
        extent = belief.extent;
        extent.add(&symmetric(&(squares / scale)), n);
        inner = inner_spread(&extent, scale);
        let shrink = inner * inverse(&(inner + noise));
        sigma = symmetric(&(shrink * noise));
        mean = position + shrink * (points.mean() - position);
        scatter = congruent(&shrink, &points.scatter());
        if (extent.mean() - before).norm() <= tolerance * before.norm() {
            break;
        }
    }
    let (sensor, _) = centre(&inner, points)?;
    let mut state = *prior;
    Comparison::new(&sensor, &state, &mean.into())?.condition(&sensor, &mut state)?;
    Ok((state, extent))
}

/// `E[(sX)⁻¹]⁻¹`, the covariance with which true positions count.
fn inner_spread(extent: &InverseWishart, scale: f64) -> Matrix2<f64> {
    extent.mean() * (scale * extent.weight() / (extent.weight() + 3.0))
}
