//! Many objects in clutter: trackers that decide which measurements belong to which object, which objects are new and
//! which are gone. Every tracker takes every [`Filter`].
//!
//! | tracker | associates | for |
//! |---|---|---|
//! | [`NearestNeighbour`] | each measurement to at most one track, jointly at the least cost | clear pictures, thousands of objects |
//! | [`Jpda`] | each track with all measurements near it, by their joint probabilities | dense clutter, objects that pass close |
//! | [`Phd`] | nothing: it estimates the intensity of objects | dense clutter, objects that come and go |
//! | [`MultiBernoulli`] | nothing: it estimates a set of objects that may exist | the same, seen nearly always |
//! | [`Pmbm`] | by hypotheses, the most probable of which are kept | the least errors, at some cost |
//!
//! With a [`Particle`](crate::filter::Particle) filter, [`Phd`] and [`MultiBernoulli`] are their sequential Monte Carlo forms
//! (SMC-PHD, SMC-CB-MeMBer): each term of the mixture is a cloud of particles, which prediction, update and merging treat as
//! such. With an [`Imm`](crate::filter::Imm), any tracker follows motion that changes between models.

mod clutter;
mod detection;
mod directory;
mod error;
mod individuals;
mod jpda;
mod labels;
mod management;
mod mixture;
mod multi_bernoulli;
mod nearest_neighbour;
mod phd;
mod pmbm;
mod track;
mod vicinity;

use nalgebra::{SMatrix, Vector2};

use crate::belief::Gaussian;
use crate::filter::Filter;

pub use clutter::{Clutter, ClutterMap};
pub use detection::Detection;
pub use error::TrackerError;
pub use jpda::{Jpda, JpdaConfig};
pub use management::{Confirmation, Management};
pub use multi_bernoulli::{MultiBernoulli, MultiBernoulliConfig};
pub use nearest_neighbour::{NearestNeighbour, NearestNeighbourConfig};
pub use phd::{Phd, PhdConfig};
pub use pmbm::{Pmbm, PmbmConfig};
pub use track::{Status, Track, TrackId, Use};

/// What one sensor saw at one time, and how it sees.
#[derive(Debug, Clone, Copy)]
pub struct Scan<'a, Z> {
    /// Seconds, never less than in the scan before.
    pub time: f64,
    /// The measurements; none is a scan too.
    pub measurements: &'a [Z],
    /// How likely the sensor sees an object.
    pub detection: &'a Detection,
    /// How many measurements come from no object.
    pub clutter: &'a Clutter,
}

/// A tracker of many objects: measurements in, tracks out, scan by scan.
///
/// The filter is passed with each scan, so that scans of different sensors are processed by their own filters, as long as
/// these share the type of belief.
pub trait Tracker {
    /// What is known of one object.
    type Belief: Clone;

    /// Takes in one scan.
    ///
    /// # Errors
    /// When the scan is older than the one before, or holds a number that is not finite. The tracker is then unchanged.
    fn step<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
    ) -> Result<(), TrackerError>
    where
        F: Filter<N, Belief = Self::Belief> + ?Sized;

    /// The tracks after the last scan, tentative ones and those deleted in that scan included, by rising number.
    fn tracks(&self) -> &[Track<Self::Belief>];

    /// Which of the [`tracks`](Tracker::tracks) the last scan concerned, by their places there; nothing when it concerned all.
    /// A report concerns the few tracks that may have made it; the beliefs of the others stay at the times of their own.
    fn active(&self) -> Option<&[usize]> {
        None
    }

    /// What became of each measurement of the last scan.
    fn uses(&self) -> &[Use];

    /// Time of the last scan, s.
    fn time(&self) -> Option<f64>;
}

/// Where each measurement of a scan lies, after checking that it lies somewhere.
fn places<const N: usize, F: Filter<N> + ?Sized>(
    filter: &F,
    scan: &Scan<'_, F::Measurement>,
) -> Result<Vec<Option<Vector2<f64>>>, TrackerError> {
    let mut places = Vec::with_capacity(scan.measurements.len());
    for (number, measurement) in scan.measurements.iter().enumerate() {
        let place = filter.place(measurement);
        if place.is_some_and(|place| !(place.x.is_finite() && place.y.is_finite())) {
            return Err(TrackerError::Measurement { time: scan.time, measurement: number });
        }
        places.push(place);
    }
    Ok(places)
}

/// Logarithm of the clutter intensity at a measurement, in the units of the filter's likelihoods.
fn ln_clutter_at<const N: usize, F: Filter<N> + ?Sized>(
    filter: &F,
    scan: &Scan<'_, F::Measurement>,
    measurement: &F::Measurement,
) -> f64 {
    filter.ln_clutter(measurement, scan.clutter.intensity(filter.place(measurement).as_ref()))
}

/// A ratio of densities from its logarithm. One beyond the range of a double leaves no doubt, and can still be added up.
fn ratio(ln_ratio: f64) -> f64 {
    if ln_ratio > LARGEST_RATIO { LARGEST_RATIO.exp() } else { ln_ratio.exp() }
}

/// Logarithm of the largest ratio.
const LARGEST_RATIO: f64 = 600.0;

/// Expected number of new objects behind an unexplained measurement, given the number where clutter has its background
/// intensity: where the clutter map is dense an unexplained measurement is more clutter and as little new object as anywhere.
fn birth_weight<const N: usize, F: Filter<N> + ?Sized>(
    background_weight: f64,
    filter: &F,
    scan: &Scan<'_, F::Measurement>,
    measurement: &F::Measurement,
) -> f64 {
    let background = scan.clutter.background();
    let intensity = scan.clutter.intensity(filter.place(measurement).as_ref());
    let births = background_weight * background;
    births / (births + (1.0 - background_weight) * intensity)
}

/// Position part of a state in the plane, if it has two positions.
fn plane<const N: usize>(state: &Gaussian<N>) -> Option<(Vector2<f64>, SMatrix<f64, 2, 2>)> {
    (N >= 2).then(|| {
        (Vector2::new(state.mean[0], state.mean[1]), SMatrix::from_fn(|i, j| state.covariance[(i, j)]))
    })
}

#[cfg(test)]
mod tests;
