//! A filter whose measurements are numbers of those of a scan.

use nalgebra::Vector2;
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::InverseWishart;
use tercel_core::filter::{Estimate, Filter, Innovation};
use tercel_core::sensor::Measurement;

/// A filter for the measurements of one scan, which it knows by their numbers.
///
/// Trackers that are given this need not be compiled anew for each kind of measurement.
pub(crate) struct Numbered<'a, B, const N: usize, const M: usize> {
    pub filter: &'a dyn Filter<N, Belief = B, Measurement = Measurement<M>>,
    pub measurements: &'a [Measurement<M>],
}

impl<B: Clone, const N: usize, const M: usize> Filter<N> for Numbered<'_, B, N, M> {
    type Belief = B;
    /// Its number in the scan, below the number of measurements.
    type Measurement = usize;

    fn birth(&self, number: &usize) -> Result<B, FilterError> {
        self.filter.birth(&self.measurements[*number])
    }

    fn predict(&self, belief: &mut B, dt: f64) {
        self.filter.predict(belief, dt);
    }

    fn update(&self, belief: &mut B, number: &usize) -> Result<Innovation, FilterError> {
        self.filter.update(belief, &self.measurements[*number])
    }

    fn innovation(&self, belief: &B, number: &usize) -> Result<Innovation, FilterError> {
        self.filter.innovation(belief, &self.measurements[*number])
    }

    fn innovations(&self, belief: &B, numbers: &[&usize], found: &mut Vec<Result<Innovation, FilterError>>) {
        let measurements: Vec<&Measurement<M>> =
            numbers.iter().map(|number| &self.measurements[**number]).collect();
        self.filter.innovations(belief, &measurements, found);
    }

    fn associate(&self, belief: &mut B, parts: &[(f64, &usize)], none: f64) -> f64 {
        let parts: Vec<(f64, &Measurement<M>)> =
            parts.iter().map(|(weight, number)| (*weight, &self.measurements[**number])).collect();
        self.filter.associate(belief, &parts, none)
    }

    fn state(&self, belief: &B) -> Gaussian<N> {
        self.filter.state(belief)
    }

    fn set_state(&self, belief: &mut B, state: &Gaussian<N>) {
        self.filter.set_state(belief, state);
    }

    fn merge(&self, belief: &mut B, weight: f64, other: &B, other_weight: f64) {
        self.filter.merge(belief, weight, other, other_weight);
    }

    fn distance(&self, belief: &B, other: &B, limit: f64) -> f64 {
        self.filter.distance(belief, other, limit)
    }

    fn extent(&self, belief: &B) -> Option<InverseWishart> {
        self.filter.extent(belief)
    }

    fn set_extent(&self, belief: &mut B, extent: &InverseWishart) {
        self.filter.set_extent(belief, extent);
    }

    fn estimate(&self, belief: &B) -> Estimate<N> {
        self.filter.estimate(belief)
    }

    fn reach(&self, belief: &B, search: &Search) -> Option<Region> {
        self.filter.reach(belief, search)
    }

    fn widen(&self, search: &mut Search, number: &usize) {
        self.filter.widen(search, &self.measurements[*number]);
    }

    fn place(&self, number: &usize) -> Option<Vector2<f64>> {
        self.filter.place(&self.measurements[*number])
    }

    fn area(&self, number: &usize) -> f64 {
        self.filter.area(&self.measurements[*number])
    }

    fn ln_clutter(&self, number: &usize, intensity: f64) -> f64 {
        self.filter.ln_clutter(&self.measurements[*number], intensity)
    }

    fn predict_all(&self, beliefs: &mut [&mut B], dt: f64) {
        self.filter.predict_all(beliefs, dt);
    }
}
