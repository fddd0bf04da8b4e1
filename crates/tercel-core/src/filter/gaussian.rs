//! What every filter with a Gaussian belief answers alike.

use std::borrow::Borrow;
use std::ops::AddAssign;

use nalgebra::{SMatrix, SVector, Vector2};

use crate::association::{Region, Search};
use crate::belief::{Gaussian, positive};
use crate::error::FilterError;
use crate::sensor::{Aged, Measurement, Sensor};

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

        fn place(&self, measurement: &Measurement<$m>) -> Option<nalgebra::Vector2<f64>> {
            self.sensor.place(measurement)
        }

        fn widen(&self, search: &mut crate::association::Search, measurement: &Measurement<$m>) {
            search.widen(measurement);
        }

        fn area(&self, measurement: &Measurement<$m>) -> f64 {
            self.sensor.area(measurement)
        }
    };
}
pub(super) use gaussian_belief;

/// The region in which a gate may take measurements: `innovation` gives the expected reading of a belief, and the variances of a
/// measurement's difference from it. Every component of a reading inside the gate differs by at most the root of the gate's
/// limit times its variance. `mean` says how the object moves past the sensor while measurements of different ages are taken.
#[inline]
pub(super) fn searched<const N: usize, const M: usize, S: Sensor<N, M>>(
    sensor: &S,
    search: &Search,
    mean: &SVector<f64, N>,
    innovation: impl Fn(&Aged<'_, S>, &Measurement<M>) -> Result<(SVector<f64, M>, SVector<f64, M>), FilterError>,
) -> Option<Region> {
    // More than rounding of the gate's own comparison, where the innovation covariance is ill-conditioned.
    let limit = 1.001 * search.limit(M);
    let mut found: Option<(Region, Region)> = None;
    for age in search.ages() {
        let sensor = Aged::new(sensor, age);
        let mut here: Option<Region> = None;
        for probe in search.noises() {
            let Ok((expected, variances)) = innovation(&sensor, &probe) else { continue };
            let half = variances.map(|variance| (limit * variance).sqrt());
            let region = sensor.region(&expected, &half)?;
            here = Some(here.map_or(region, |here| here.and(&region)));
        }
        let Some(here) = here else { continue };
        // Between two ages the region may bulge on its way from one to the other.
        let all = found.map_or(here, |(all, last)| all.and(&here.stretched_from(&last)));
        found = Some((all, here));
    }
    let (all, _) = found?;
    Some(if passes_by(sensor, search, mean) { all.boundless() } else { all })
}

/// Whether an object moves so near past the sensor within the ages of a search that it is seen from other sides between
/// them: then the ages that are looked at say little of the others.
fn passes_by<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    search: &Search,
    mean: &SVector<f64, N>,
) -> bool {
    let Some(site) = sensor.site().filter(|_| N >= 2 && search.oldest() > search.youngest()) else {
        return false;
    };
    let from_site = |age: f64| {
        let seen = Aged::new(sensor, age).seen(mean);
        Vector2::new(seen[0] - site.x, seen[1] - site.y)
    };
    let (start, way) =
        (from_site(search.youngest()), from_site(search.oldest()) - from_site(search.youngest()));
    let square = way.norm_squared();
    let nearest = if square > 0.0 { (-start.dot(&way) / square).clamp(0.0, 1.0) } else { 0.0 };
    (start + way * nearest).norm() < 2.0 * way.norm()
}

/// The reach of a Gaussian belief whose readings are compared to first order.
#[inline]
pub(super) fn linear_reach<const N: usize, const M: usize>(
    sensor: &impl Sensor<N, M>,
    belief: &Gaussian<N>,
    search: &Search,
) -> Option<Region> {
    searched(sensor, search, &belief.mean, |sensor, probe| {
        let expected = sensor.expected(&belief.mean);
        let jacobian = sensor.jacobian(&belief.mean);
        let spread = jacobian * sensor.project(&belief.covariance, &jacobian);
        Ok((expected, (spread + sensor.read(probe, Some(&expected))?.noise).diagonal()))
    })
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
