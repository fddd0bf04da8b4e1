//! Objects that no scan has shown yet.

use std::collections::VecDeque;

use nalgebra::Vector2;

use crate::error::FilterError;
use crate::multi::Detection;

/// Scans that are remembered. An object that so many scans could have seen is detected, or out of their view.
const MEMORY: usize = 32;

/// Objects per m² before the first scan, and new ones per m² and s, where nothing is known of their density.
const FEWEST: (f64, f64) = (1e-6, 1e-8);

/// The same for each false measurement. In dense clutter an object is no rarer than that: an unexplained measurement of the first
/// scan is as likely an object as not, and later ones are from time to time.
const PER_CLUTTER: (f64, f64) = (1.0, 1e-3);

/// The intensity of undetected objects: a Poisson process, uniform but for where the last scans looked.
///
/// The intensity at a place follows from the scans that could see it, so it is computed where it is asked for, and no map
/// of the plane is kept.
#[derive(Debug, Clone)]
pub(super) struct Undetected {
    initial: Option<f64>,
    birth: Option<f64>,
    survival: f64,
    /// The time before each scan, and how it saw.
    scans: VecDeque<(f64, Detection)>,
    /// The time since the last of them.
    since: f64,
}

impl Undetected {
    /// An intensity that starts with `initial` objects per m², of which each survives a second with the probability
    /// `survival`, and to which `birth` per m² and s are added. What is not given follows from the clutter.
    pub fn new(initial: Option<f64>, birth: Option<f64>, survival: f64) -> Result<Self, FilterError> {
        for (parameter, value) in [("density of undetected objects", initial), ("density of births", birth)] {
            if let Some(value) = value.filter(|value| !(*value >= 0.0 && value.is_finite())) {
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

    /// Undetected objects per m² at a place, now, for a sensor with so much clutter in the background, per m².
    pub fn intensity(&self, place: Option<&Vector2<f64>>, clutter: f64) -> f64 {
        let initial = self.initial.unwrap_or_else(|| FEWEST.0.max(PER_CLUTTER.0 * clutter));
        let birth = self.birth.unwrap_or_else(|| FEWEST.1.max(PER_CLUTTER.1 * clutter));
        let grown = |intensity: f64, dt: f64| intensity * self.survival.powf(dt) + birth * dt;
        let last = self.scans.iter().fold(initial, |intensity, (dt, detection)| {
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
        let mut undetected = Undetected::new(Some(1e-6), Some(1e-8), 1.0).unwrap();
        let near = Detection::by_range(vec![(100.0, 0.9), (101.0, 0.0)]).unwrap();
        assert_eq!(undetected.intensity(None, 1e-4), 1e-6);
        for _ in 0..5 {
            undetected.predict(1.0);
            undetected.seen(&near);
        }
        undetected.predict(1.0);
        // Births of the last second, and a tenth of those before.
        let here = undetected.intensity(Some(&vector![50.0, 0.0]), 1e-4);
        assert!((here - 1e-8 * (1.0 + 0.111_11)).abs() < 2e-11, "{here}");
        let there = undetected.intensity(Some(&vector![500.0, 0.0]), 1e-4);
        assert!((there - (1e-6 + 6e-8)).abs() < 1e-15, "{there}");
    }

    #[test]
    fn densities_that_are_not_given_follow_from_the_clutter() {
        let mut undetected = Undetected::new(None, None, 1.0).unwrap();
        assert_eq!(undetected.intensity(None, 1e-9), 1e-6);
        assert_eq!(undetected.intensity(None, 1e-4), 1e-4);
        undetected.predict(1.0);
        undetected.seen(&Detection::uniform(1.0).unwrap());
        undetected.predict(1.0);
        assert!((undetected.intensity(None, 1e-4) - 1e-7).abs() < 1e-12);
    }

    #[test]
    fn densities_below_zero_are_refused() {
        assert!(Undetected::new(Some(-1.0), None, 0.9).is_err());
        assert!(Undetected::new(None, Some(f64::NAN), 0.9).is_err());
    }
}
