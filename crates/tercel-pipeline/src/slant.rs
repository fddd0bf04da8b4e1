//! Slant ranges of objects whose height is known.

use tercel_core::sensor::ground_range;
use tercel_data::table::Noise;

use crate::config::Measures;

/// What turns the slant ranges of a sensor into ranges over ground.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Slant {
    /// Height of the objects above the sensor where none comes with a detection, m.
    height: Option<f64>,
    /// Deviation of a height that does not bring its own, m.
    deviation: f64,
    /// Height of the sensor in the local frame, m.
    pub sensor: f64,
    /// Deviations of range, bearing and range rate that come with no detection.
    noise: Noise,
}

impl Slant {
    pub fn new(measures: &Measures) -> Self {
        let Measures::Polar(polar) = measures else { return Slant::default() };
        Slant {
            height: polar.height.map(|height| height.get()),
            deviation: polar.height_deviation.get(),
            sensor: 0.0,
            noise: Noise {
                range: Some(polar.range_deviation.get()),
                bearing: Some(polar.bearing_deviation.get()),
                range_rate: polar.range_rate_deviation.map(|rate| rate.get()),
                ..Noise::default()
            },
        }
    }

    /// The range over ground of an object at a slant range and perhaps a height in the local frame, the deviations that go with it,
    /// and by how much a range rate grows. Without a height the range is one over ground, and nothing changes.
    pub fn over_ground(&self, range: f64, z: Option<f64>, own: &Noise) -> (f64, Noise, f64) {
        let Some(height) = z.map(|z| z - self.sensor).or(self.height) else { return (range, *own, 1.0) };
        let deviation = own.range.or(self.noise.range).unwrap_or(0.0);
        let climb = own.z.filter(|_| z.is_some()).unwrap_or(self.deviation);
        // Above all that the range allows, the object is overhead: its range over ground may be anything up to what both errors make.
        let overhead = (0.0, (2.0 * (range * deviation + height.abs() * climb)).sqrt());
        let (ground, deviation) = ground_range((range, deviation), (height, climb)).unwrap_or(overhead);
        let stretch = if ground > 0.0 { (range / ground).min(STEEPEST) } else { STEEPEST };
        let noise = Noise {
            range: Some(deviation),
            bearing: own.bearing.or(self.noise.bearing),
            range_rate: own.range_rate.or(self.noise.range_rate).map(|rate| rate * stretch),
            ..*own
        };
        (ground, noise, stretch)
    }
}

/// Steeper than that, a range rate says nothing of the motion over ground.
const STEEPEST: f64 = 100.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;

    fn slant(keys: &str) -> Slant {
        let text = format!(
            "[motion]\nconstant_velocity = {{ acceleration_density = 1.0, speed = 100.0 }}\n[sensors.radar]\n\
             measures = {{ polar = {{ range_deviation = 50.0, bearing_deviation = 0.01{keys} }} }}\n\
             clutter = {{ uniform = {{ density = 1e-9 }} }}\n"
        );
        Slant::new(&Config::parse(&text).unwrap().sensors["radar"].measures)
    }

    #[test]
    fn a_height_makes_a_slant_range_one_over_ground() {
        let (ground, noise, stretch) = slant(", height = 9000.0").over_ground(15e3, None, &Noise::default());
        assert!((ground - 12e3).abs() < 1e-6 && (stretch - 1.25).abs() < 1e-9);
        assert!((noise.range.unwrap() - 66.0).abs() < 5.0, "{noise:?}");
        assert_eq!(noise.bearing, Some(0.01));
        // That of a detection counts before the assumed one.
        let (ground, ..) = slant(", height = 100.0").over_ground(15e3, Some(9000.0), &Noise::default());
        assert!((ground - 12e3).abs() < 1e-6);
    }

    #[test]
    fn without_a_height_a_range_stays_what_it_is() {
        let own = Noise { range: Some(7.0), ..Noise::default() };
        assert_eq!(slant("").over_ground(15e3, None, &own), (15e3, own, 1.0));
    }

    #[test]
    fn overhead_the_range_over_ground_is_not_known() {
        let (ground, noise, _) = slant("").over_ground(8000.0, Some(9000.0), &Noise::default());
        assert_eq!(ground, 0.0);
        assert!(noise.range.unwrap() > 500.0, "{noise:?}");
    }
}
