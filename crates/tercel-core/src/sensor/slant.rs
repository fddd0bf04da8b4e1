//! From slant ranges to ranges over ground.

/// The range over ground of an object at a slant range and a height above the sensor, each with its standard deviation, m:
/// `√(r² - h²)` with what both errors make of it.
///
/// Sensors of this module measure in the plane. A radar measures the slant range, so a detection whose height is known is
/// turned into one over ground before it becomes a [`Measurement`](super::Measurement); the deviation belongs in its noise,
/// for it grows without much bound towards the zenith:
/// ```text
/// d(r² - h²) = 2 √(r² σr² + h² σh²)            σ = (√(g² + d) - √(max(g² - d, 0))) / 2
/// ```
/// which is `r σr / g` where the object is far, and finite above the sensor. A range rate along the line of sight is that over
/// ground times `g / r`, as long as the object keeps its height.
///
/// `None` where a number is not finite or a deviation negative, and where the height exceeds the range by more than three
/// deviations: range and height then cannot belong together.
///
/// ```
/// use tercel_core::sensor::ground_range;
///
/// let (range, deviation) = ground_range((15e3, 50.0), (9e3, 0.0)).unwrap();
/// assert!((range - 12e3).abs() < 1e-6 && (deviation - 50.0 * 15.0 / 12.0).abs() < 0.1);
/// assert_eq!(ground_range((8e3, 50.0), (9e3, 0.0)), None);
/// ```
pub fn ground_range(slant: (f64, f64), height: (f64, f64)) -> Option<(f64, f64)> {
    let square = slant.0 * slant.0 - height.0 * height.0;
    let spread = 2.0 * (slant.0 * slant.1).hypot(height.0 * height.1);
    let known = slant.1 >= 0.0 && height.1 >= 0.0 && spread.is_finite();
    if !(known && square >= -3.0 * spread) {
        return None;
    }
    let root = |square: f64| square.max(0.0).sqrt();
    let square = square.max(0.0);
    Some((root(square), 0.5 * (root(square + spread) - root(square - spread))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviation_over_ground_is_that_of_the_errors_near_and_far() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        // Towards the zenith the spread is not Gaussian any more, and the deviation right by a quarter.
        for (ground, tolerance) in [(40e3, 0.03), (9e3, 0.03), (2e3, 0.1), (0.0_f64, 0.45)] {
            let (height, slant) = (9e3, ground.hypot(9e3));
            let (_, deviation) = ground_range((slant, 30.0), (height, 40.0)).unwrap();
            let mut squares = 0.0;
            for _ in 0..20_000 {
                let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
                let (r, h) = (slant + 30.0 * normal(), height + 40.0 * normal());
                squares += ((r * r - h * h).max(0.0).sqrt() - ground).powi(2);
            }
            let seen = (squares / 20_000.0).sqrt();
            assert!((deviation / seen - 1.0).abs() < tolerance, "{ground}: {deviation} {seen}");
        }
    }

    #[test]
    fn heights_that_no_range_can_have_are_refused() {
        assert_eq!(ground_range((100.0, 1.0), (104.0, 0.0)), None);
        assert_eq!(ground_range((100.0, 1.0), (102.0, 0.0)).unwrap().0, 0.0);
        assert_eq!(ground_range((f64::NAN, 1.0), (102.0, 0.0)), None);
        assert_eq!(ground_range((100.0, f64::INFINITY), (10.0, 0.0)), None);
        assert_eq!(ground_range((100.0, -1.0), (10.0, 0.0)), None);
        assert_eq!(ground_range((100.0, 0.0), (0.0, 0.0)), Some((100.0, 0.0)));
    }
}
