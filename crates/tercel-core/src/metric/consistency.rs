//! Whether errors are as large as the filter believes.

use nalgebra::SVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::belief::Gaussian;
use crate::error::FilterError;

/// The value that a chi-square variable of `degrees` degrees of freedom stays below with this probability.
///
/// ```
/// let gate = tercel_core::metric::chi_square_quantile(2.0, 0.99)?;
/// assert!((gate - 9.210_340_371_976_18).abs() < 1e-9);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
///
/// # Errors
/// When the degrees are not positive, or the probability is not between 0 and 1 (both excluded).
pub fn chi_square_quantile(degrees: f64, probability: f64) -> Result<f64, FilterError> {
    FilterError::positive("degrees of freedom", degrees)?;
    if !(probability > 0.0 && probability < 1.0) {
        let expected = "must lie between 0 and 1";
        return Err(FilterError::Parameter { parameter: "probability", value: probability, expected });
    }
    let distribution =
        ChiSquared::new(degrees).map_err(|_| FilterError::NotFinite { what: "chi-square distribution" })?;
    Ok(distribution.inverse_cdf(probability))
}

/// Normalised estimation error squared: the squared error in units of the covariance,
/// `(x - x̂)ᵀ P⁻¹ (x - x̂)`.
///
/// # Errors
/// When the covariance is not positive definite or a number is not finite.
pub fn nees<const N: usize>(belief: &Gaussian<N>, truth: &SVector<f64, N>) -> Result<f64, FilterError> {
    let nees = belief.mahalanobis(truth)?;
    if nees.is_finite() { Ok(nees) } else { Err(FilterError::NotFinite { what: "estimation error" }) }
}

/// Collects NEES or NIS values and says whether their mean is one that a consistent filter would show.
///
/// ## Definition
/// For a consistent filter each value is chi-square with `n` degrees of freedom, `n` the size of the state (NEES) or of the
/// measurement (NIS). The sum of `K` independent values is chi-square with `nK`, so the mean lies with probability `P` in
/// ```text
/// [ χ²(nK, (1-P)/2) / K,  χ²(nK, (1+P)/2) / K ]
/// ```
/// A mean above the bounds says that the filter trusts itself too much, one below that it could be bolder.
///
/// ## Use it when
/// a filter is tuned or tested. NEES needs the truth; its values at successive steps of one run are correlated, so take one
/// step of many runs, or one mean per run, where the bounds must be strict. NIS needs no truth, and is white for the right
/// filter, so that all steps count.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation" (2001), section 5.4.
///
/// ```
/// use tercel_core::metric::Consistency;
///
/// let mut nis = Consistency::new(2)?;
/// for value in [1.2, 3.1, 0.4, 2.9, 1.8, 2.2] {
///     nis.push(value);
/// }
/// let (low, high) = nis.bounds(0.95)?;
/// assert!(low < 2.0 && 2.0 < high);
/// assert!(nis.is_consistent(0.95)?);
/// assert_eq!(nis.coverage90(), Some(1.0)); // all below 4.605
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consistency {
    dimension: usize,
    limit90: f64,
    count: u64,
    sum: f64,
    within90: u64,
}

impl Consistency {
    /// No values yet, of errors with `dimension` components.
    ///
    /// # Errors
    /// When the dimension is 0.
    pub fn new(dimension: usize) -> Result<Self, FilterError> {
        let limit90 = chi_square_quantile(dimension as f64, 0.9)?;
        Ok(Consistency { dimension, limit90, count: 0, sum: 0.0, within90: 0 })
    }

    /// Takes one more value.
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.within90 += u64::from(value <= self.limit90);
    }

    /// Takes all values of another accumulator.
    ///
    /// # Errors
    /// When the two have values of different dimensions.
    pub fn merge(&mut self, other: &Consistency) -> Result<(), FilterError> {
        if self.dimension != other.dimension {
            let (parameter, value) = ("dimension", other.dimension as f64);
            return Err(FilterError::Parameter {
                parameter,
                value,
                expected: "must be that of the other values",
            });
        }
        self.count += other.count;
        self.sum += other.sum;
        self.within90 += other.within90;
        Ok(())
    }

    /// How many values were taken.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean of the values, which should be near the dimension; `None` before the first.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }

    /// Share of the values inside the region that should hold 90 % of them; `None` before the first.
    pub fn coverage90(&self) -> Option<f64> {
        (self.count > 0).then(|| self.within90 as f64 / self.count as f64)
    }

    /// Where the mean of a consistent filter lies with this probability.
    ///
    /// # Errors
    /// When there are no values, or the probability is not between 0 and 1 (both excluded).
    pub fn bounds(&self, probability: f64) -> Result<(f64, f64), FilterError> {
        let count = self.count as f64;
        FilterError::positive("number of values", count)?;
        let degrees = self.dimension as f64 * count;
        let bound = |tail: f64| chi_square_quantile(degrees, tail).map(|value| value / count);
        Ok((bound(0.5 * (1.0 - probability))?, bound(0.5 * (1.0 + probability))?))
    }

    /// Whether the mean lies within [`bounds`](Consistency::bounds).
    ///
    /// # Errors
    /// As `bounds`.
    pub fn is_consistent(&self, probability: f64) -> Result<bool, FilterError> {
        let (low, high) = self.bounds(probability)?;
        Ok(self.mean().is_some_and(|mean| (low..=high).contains(&mean)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn quantiles_are_those_of_printed_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, section 1.3.6.7.4, three decimals.
        for (degrees, probability, value) in [
            (1.0, 0.9, 2.706),
            (2.0, 0.95, 5.991),
            (4.0, 0.99, 13.277),
            (10.0, 0.975, 20.483),
            (100.0, 0.999, 149.449),
            (1.0, 0.05, 0.004),
            (10.0, 0.01, 2.558),
            (100.0, 0.025, 74.222),
        ] {
            let quantile = chi_square_quantile(degrees, probability).unwrap();
            assert!((quantile - value).abs() < 5.1e-4, "{degrees}, {probability}: {quantile}");
        }
    }

    #[test]
    fn quantiles_of_two_degrees_have_their_closed_form() {
        for probability in [1e-9, 0.01, 0.3, 0.5, 0.9, 0.9999] {
            let exact = -2.0 * f64::ln_1p(-probability);
            let quantile = chi_square_quantile(2.0, probability).unwrap();
            assert!((quantile / exact - 1.0).abs() < 1e-7, "{probability}: {quantile} instead of {exact}");
        }
    }

    #[test]
    fn quantiles_of_many_degrees_are_near_normal() {
        // Wilson and Hilferty's cube root approximation is good to 1e-6 here.
        for degrees in [1e3, 1e5, 1e7] {
            let z = 1.959_963_984_540_054;
            let spread = 2.0 / (9.0 * degrees);
            let near = degrees * (1.0 - spread + z * f64::sqrt(spread)).powi(3);
            let quantile = chi_square_quantile(degrees, 0.975).unwrap();
            assert!((quantile / near - 1.0).abs() < 1e-5, "{degrees}: {quantile} instead of {near}");
        }
    }

    #[test]
    fn what_has_no_quantile_is_refused() {
        for (degrees, probability) in
            [(0.0, 0.5), (-1.0, 0.5), (f64::NAN, 0.5), (2.0, 0.0), (2.0, 1.0), (2.0, f64::NAN)]
        {
            assert!(chi_square_quantile(degrees, probability).is_err());
        }
    }

    #[test]
    fn errors_drawn_from_the_covariance_are_consistent_and_larger_ones_are_not() {
        let belief = Gaussian::new(vector![1.0, -2.0], matrix![4.0, 1.0; 1.0, 2.0]).unwrap();
        let lower = matrix![2.0, 0.0; 0.5, 1.75_f64.sqrt()];
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut collect = |scale: f64| {
            let mut collected = Consistency::new(2).unwrap();
            for _ in 0..2000 {
                let white = vector![StandardNormal.sample(&mut random), StandardNormal.sample(&mut random)];
                let truth = belief.mean + lower * white * scale;
                collected.push(nees(&belief, &truth).unwrap());
            }
            collected
        };
        let (right, wrong) = (collect(1.0), collect(1.1));
        assert!(right.is_consistent(0.99).unwrap());
        assert!((right.coverage90().unwrap() - 0.9).abs() < 0.03);
        assert!(!wrong.is_consistent(0.99).unwrap());
        assert!(wrong.mean() > right.mean());
    }

    #[test]
    fn merged_values_are_counted_once_and_dimensions_must_agree() {
        let (mut first, mut second) = (Consistency::new(2).unwrap(), Consistency::new(2).unwrap());
        assert!(first.mean().is_none() && first.bounds(0.9).is_err());
        first.push(1.0);
        second.push(5.0);
        first.merge(&second).unwrap();
        assert_eq!((first.count(), first.mean(), first.coverage90()), (2, Some(3.0), Some(0.5)));
        assert!(first.merge(&Consistency::new(4).unwrap()).is_err());
        assert!(Consistency::new(0).is_err());
    }
}
