//! What every filter with a Gaussian belief answers alike.

use std::borrow::Borrow;
use std::ops::AddAssign;

use nalgebra::{SMatrix, SVector, Vector2};

use crate::belief::{Gaussian, positive};
use crate::sensor::Sensor;

/// The methods of [`Filter`](super::Filter) that follow from a Gaussian belief and a field `sensor` of `$m` components.
macro_rules! gaussian_belief {
    ($m:ident) => {
        fn state(&self, belief: &Gaussian<N>) -> Gaussian<N> {
            *belief
        }

        fn set_state(&self, belief: &mut Gaussian<N>, state: &Gaussian<N>) {
            *belief = *state;
        }

        fn merge(&self, belief: &mut Gaussian<N>, weight: f64, other: &Gaussian<N>, other_weight: f64) {
            belief.merge(weight, other, other_weight);
        }

        fn distance(&self, belief: &Gaussian<N>, other: &Gaussian<N>, limit: f64) -> f64 {
            belief.mahalanobis_within(&other.mean, limit)
        }

        fn reach(
            &self,
            belief: &Gaussian<N>,
        ) -> Option<(nalgebra::Vector2<f64>, nalgebra::SMatrix<f64, 2, 2>)> {
            crate::filter::gaussian::reach(&self.sensor, belief)
        }

        fn place(&self, measurement: &Measurement<$m>) -> Option<nalgebra::Vector2<f64>> {
            self.sensor.place(measurement)
        }

        fn area(&self, measurement: &Measurement<$m>) -> f64 {
            self.sensor.area(measurement)
        }
    };
}
pub(super) use gaussian_belief;

/// Expected place of a measurement of a Gaussian belief, and the covariance of the difference.
pub(super) fn reach<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &Gaussian<N>,
) -> Option<(Vector2<f64>, SMatrix<f64, 2, 2>)> {
    if N < 2 {
        return None;
    }
    let (place, noise) = sensor.footprint(&belief.mean)?;
    let position: SMatrix<f64, 2, 2> = SMatrix::from_fn(|i, j| belief.covariance[(i, j)]);
    Some((place, position + noise))
}

/// The Gaussian with the moments of a mixture, relative to the sum of its weights. An empty one has no moments: zeros.
#[inline]
pub(super) fn moments<const N: usize, G: Borrow<Gaussian<N>>>(
    parts: impl Iterator<Item = (f64, G)> + Clone,
) -> Gaussian<N> {
    let mut merged = Gaussian { mean: SVector::zeros(), covariance: SMatrix::zeros() };
    // Relative to the first mean: positions may be large against what lies between them.
    let Some(start) = parts.clone().next().map(|(_, part)| part.borrow().mean) else { return merged };
    let mut total = 0.0;
    for (weight, part) in parts.clone() {
        merged.mean += (part.borrow().mean - start) * weight;
        total += weight;
    }
    merged.mean = start + merged.mean / total;
    for (weight, part) in parts {
        let Gaussian { mean, covariance } = part.borrow();
        let difference = mean - merged.mean;
        // Column by column, which needs no matrix in between; in this order of factors the result is symmetric to the last bit.
        for column in 0..N {
            let of = covariance.column(column) * weight + difference * difference[column] * weight;
            merged.covariance.column_mut(column).add_assign(&of);
        }
    }
    merged.covariance /= total;
    settle(&mut merged);
    merged
}

/// Makes the covariance of a mixture definite again, when its means lie so far apart that they hide everything else from a
/// double. What is not finite stays so, for the next update to report.
#[inline]
pub(super) fn settle<const N: usize>(merged: &mut Gaussian<N>) {
    if !positive::is_definite(&merged.covariance) {
        let _ = positive::settle(&mut merged.covariance, "covariance of a mixture");
    }
}
