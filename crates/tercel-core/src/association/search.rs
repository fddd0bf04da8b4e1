//! Where in the plane the measurements of an object are searched.

use nalgebra::{SMatrix, Vector2};

use super::Gate;
use crate::belief::Cholesky;
use crate::sensor::Measurement;

/// An upright rectangle of the plane, and where in it a measurement is expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// The expected place of a measurement, m.
    pub centre: Vector2<f64>,
    /// The corner with the smallest coordinates, m.
    pub low: Vector2<f64>,
    /// The corner with the largest coordinates, m.
    pub high: Vector2<f64>,
}

impl Region {
    /// Whether a place lies inside or on the edge.
    pub fn contains(&self, place: &Vector2<f64>) -> bool {
        (0..2).all(|i| self.low[i] <= place[i] && place[i] <= self.high[i])
    }

    /// The smallest region that holds both, with the centre of this one.
    pub fn and(&self, other: &Region) -> Region {
        Region { centre: self.centre, low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// The whole plane, with the same centre.
    pub(crate) fn boundless(&self) -> Region {
        let far = Vector2::repeat(f64::INFINITY);
        Region { centre: self.centre, low: -far, high: far }
    }

    /// The region that holds those of all parts of a mixture, with the weighted mean of their centres. None where one has none,
    /// or where there is no part.
    pub(crate) fn mixture(mut parts: impl Iterator<Item = Option<(f64, Region)>>) -> Option<Region> {
        let (mut total, mut all) = parts.next()??;
        for part in parts {
            let (weight, region) = part?;
            total += weight;
            let share = if total > 0.0 { weight / total } else { 0.0 };
            all.centre += (region.centre - all.centre) * share;
            all = all.and(&region);
        }
        Some(all)
    }

    /// This region, wider on every side by half of what that side moved since an earlier one.
    pub(crate) fn stretched_from(&self, earlier: &Region) -> Region {
        let half = |now: &Vector2<f64>, before: &Vector2<f64>| (now - before).abs() * 0.5;
        Region {
            centre: self.centre,
            low: self.low - half(&self.low, &earlier.low),
            high: self.high + half(&self.high, &earlier.high),
        }
    }

    /// The region around an ellipse: all places whose squared Mahalanobis distance from `centre` is at most `limit`.
    pub fn ellipse(centre: Vector2<f64>, covariance: &SMatrix<f64, 2, 2>, limit: f64) -> Region {
        let half = covariance.diagonal().map(|variance| (limit * variance).sqrt());
        Region { centre, low: centre - half, high: centre + half }
    }
}

/// What a search for the measurements of a scan must allow for: the gate, the ages of the measurements and the noises that
/// they bring. A [`reach`](crate::filter::Filter::reach) under it leaves out no measurement that the gate would take.
///
/// ```
/// use tercel_core::association::{Gate, Search};
/// use tercel_core::{belief::Gaussian, filter::{Filter, Kalman}, motion::ConstantVelocity, sensor::{Measurement, Position}};
///
/// let filter = Kalman::new(ConstantVelocity::new(0.1), Position::new(5.0)?);
/// let mut belief: Gaussian<4> = filter.birth(&[0.0, 0.0].into())?;
/// belief.mean[2] = 100.0;
/// let old = Measurement::from([-200.0, 0.0]).with_age(2.0);
/// let mut search = Search::new(Gate::default());
/// let place = Filter::<4>::place(&filter, &old).unwrap();
/// assert!(!filter.reach(&belief, &search).unwrap().contains(&place));
/// Filter::<4>::widen(&filter, &mut search, &old);
/// assert!(filter.reach(&belief, &search).unwrap().contains(&place));
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    gate: Gate,
    youngest: f64,
    oldest: f64,
    /// Largest variances that measurements bring, by component.
    own: Option<[f64; 6]>,
}

impl Default for Search {
    fn default() -> Self {
        Search::new(Gate::default())
    }
}

/// Times within a range of ages at which an object is looked for.
const MOMENTS: usize = 5;

impl Search {
    /// For measurements at the time of the scan, with the noise of the sensor.
    pub fn new(gate: Gate) -> Self {
        Search { gate, youngest: 0.0, oldest: 0.0, own: None }
    }

    /// Allows for this measurement. One that no filter can read, because its age or noise is not finite or its noise not
    /// positive definite, is nothing to search for.
    pub fn widen<const M: usize>(&mut self, measurement: &Measurement<M>) {
        if !measurement.age.is_finite() {
            return;
        }
        self.youngest = self.youngest.min(measurement.age);
        self.oldest = self.oldest.max(measurement.age);
        let Some(noise) = &measurement.noise else { return };
        if Cholesky::new(noise, "noise of the measurement").is_err() {
            return;
        }
        // A covariance is at most its diagonal times the number of components.
        let mixed = (0..M).any(|i| (0..i).any(|j| noise[(i, j)] != 0.0));
        let factor = if mixed { M as f64 } else { 1.0 };
        let own = self.own.get_or_insert([0.0; 6]);
        for (largest, variance) in own.iter_mut().zip(noise.diagonal().iter()) {
            *largest = largest.max(factor * variance);
        }
    }

    /// Largest normalised innovation squared of readings of `dof` components.
    pub fn limit(&self, dof: usize) -> f64 {
        self.gate.limit(dof)
    }

    /// The least age of a measurement, s.
    pub(crate) fn youngest(&self) -> f64 {
        self.youngest
    }

    /// The largest age of a measurement, s.
    pub(crate) fn oldest(&self) -> f64 {
        self.oldest
    }

    /// Ages at which an object is to be looked for, s.
    pub(crate) fn ages(&self) -> impl Iterator<Item = f64> + use<> {
        let Search { youngest, oldest, .. } = *self;
        let count = if youngest == oldest { 1 } else { MOMENTS };
        (0..count).map(move |i| youngest + (oldest - youngest) * i as f64 / (MOMENTS - 1) as f64)
    }

    /// Measurements without a value that stand for the noises of all.
    pub(crate) fn noises<const M: usize>(&self) -> impl Iterator<Item = Measurement<M>> + use<M> {
        let bare = Measurement::from([0.0; M]);
        let own =
            self.own.map(|own| bare.with_noise(SMatrix::from_fn(|i, j| if i == j { own[i] } else { 0.0 })));
        std::iter::once(bare).chain(own)
    }

    /// The region of an object whose measurements lie around `centre` with this covariance to first order. Generous, because
    /// it is not the gate's own distance.
    pub fn around(&self, centre: Vector2<f64>, covariance: &SMatrix<f64, 2, 2>) -> Region {
        Region::ellipse(centre, covariance, 2.0 * self.gate.limit(3))
    }
}
