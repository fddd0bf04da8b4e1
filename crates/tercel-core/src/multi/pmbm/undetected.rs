//! Objects that no scan has shown yet.

use std::collections::VecDeque;

use nalgebra::Vector2;

use crate::error::FilterError;
use crate::multi::Detection;

/// Scans that are remembered. An object that so many scans could have seen is detected, or out of their view.
const MEMORY: usize = 32;

/// The intensity of undetected objects: a Poisson process, uniform but for where the last scans looked.
///
/// The intensity at a place follows from the scans that could see it, so it is computed where it is asked for, and no map
/// of the plane is kept.
#[derive(Debug, Clone)]
pub(super) struct Undetected {
    initial: f64,
    birth: f64,
    survival: f64,
    /// The time before each scan, and how it saw.
    scans: VecDeque<(f64, Detection)>,
    /// The time since the last of them.
    since: f64,
}

impl Undetected {
    /// An intensity that starts with `initial` objects per m², of which each survives a second with the probability
    /// `survival`, and to which `birth` per m² and s are added.
    pub fn new(initial: f64, birth: f64, survival: f64) -> Result<Self, FilterError> {
        for (parameter, value) in [("density of undetected objects", initial), ("density of births", birth)] {
            if !(value >= 0.0 && value.is_finite()) {
                let expected = "must be finite and not negative";
                return Err(FilterError::Parameter { parameter, value, expected });
            }
        }
        Ok(Undetected { initial, birth, survival, scans: VecDeque::new(), since: 0.0 })
    }

    /// Lets `dt` seconds pass.
    pub fn predict(&mut self, dt: f64) {
        self.since += dt;
    }

    /// Takes in how the sensor of a scan sees.
    pub fn seen(&mut self, detection: &Detection) {
        if self.scans.len() == MEMORY {
            self.scans.pop_front();
        }
        self.scans.push_back((std::mem::take(&mut self.since), detection.clone()));
    }

    /// Undetected objects per m² at a place, now.
    pub fn intensity(&self, place: Option<&Vector2<f64>>) -> f64 {
        let grown = |intensity: f64, dt: f64| intensity * self.survival.powf(dt) + self.birth * dt;
        let last = self.scans.iter().fold(self.initial, |intensity, (dt, detection)| {
            grown(intensity, *dt) * (1.0 - detection.probability(place))
        });
        grown(last, self.since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn what_was_looked_at_is_empty_and_what_was_not_fills_up() {
        let mut undetected = Undetected::new(1e-6, 1e-8, 1.0).unwrap();
        let near = Detection::by_range(vec![(100.0, 0.9), (101.0, 0.0)]).unwrap();
        assert_eq!(undetected.intensity(None), 1e-6);
        for _ in 0..5 {
            undetected.predict(1.0);
            undetected.seen(&near);
        }
        undetected.predict(1.0);
        // Births of the last second, and a tenth of those before.
        let here = undetected.intensity(Some(&vector![50.0, 0.0]));
        assert!((here - 1e-8 * (1.0 + 0.111_11)).abs() < 2e-11, "{here}");
        let there = undetected.intensity(Some(&vector![500.0, 0.0]));
        assert!((there - (1e-6 + 6e-8)).abs() < 1e-15, "{there}");
    }

    #[test]
    fn densities_below_zero_are_refused() {
        assert!(Undetected::new(-1.0, 0.0, 0.9).is_err());
        assert!(Undetected::new(0.0, f64::NAN, 0.9).is_err());
    }
}
