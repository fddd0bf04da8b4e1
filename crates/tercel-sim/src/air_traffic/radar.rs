//! A radar of stated accuracy.

use crate::SimulationError;

/// What a radar's data sheet states: the accuracy of a plot, and how often there is one.
///
/// ```
/// use tercel_sim::air_traffic::Radar;
///
/// let radar = Radar::new(50.0, 0.5_f64.to_radians())?.with_detection(0.9)?;
/// assert_eq!(radar.detection(), 0.9);
/// # Ok::<(), tercel_sim::SimulationError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radar {
    range: f64,
    bearing: f64,
    detection: f64,
    realisation: u64,
}

impl Radar {
    /// Standard deviations of the range, m, and of the bearing, rad. Every target is detected.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn new(range: f64, bearing: f64) -> Result<Self, SimulationError> {
        for (what, value) in [("range deviation", range), ("bearing deviation", bearing)] {
            let expected = "it must be positive and finite";
            SimulationError::unless(value > 0.0 && value.is_finite(), what, value, expected)?;
        }
        Ok(Radar::stated(range, bearing))
    }

    /// For deviations that were checked.
    pub(super) fn stated(range: f64, bearing: f64) -> Self {
        Radar { range, bearing, detection: 1.0, realisation: 0 }
    }

    /// Sets the probability of a detection. The first step is always detected: there is no flight to follow before.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn with_detection(self, detection: f64) -> Result<Self, SimulationError> {
        let expected = "it must lie between 0 and 1";
        SimulationError::unless(
            (0.0..=1.0).contains(&detection),
            "detection probability",
            detection,
            expected,
        )?;
        Ok(Radar { detection, ..self })
    }

    /// Measures anew: another number gives other errors and misses of the same flight. The default is 0.
    pub fn with_realisation(self, realisation: u64) -> Self {
        Radar { realisation, ..self }
    }

    /// Standard deviation of the range, m.
    pub fn range(&self) -> f64 {
        self.range
    }

    /// Standard deviation of the bearing, rad.
    pub fn bearing(&self) -> f64 {
        self.bearing
    }

    /// Probability of a detection.
    pub fn detection(&self) -> f64 {
        self.detection
    }

    /// Number of the measurement campaign.
    pub fn realisation(&self) -> u64 {
        self.realisation
    }
}
