//! How many points an object gives.

use crate::error::FilterError;

/// The belief about the mean number of points that an object gives in a scan: a gamma distribution.
///
/// ## Recursion
/// For a Poisson number `n` of points with the rate `γ ~ Gamma(a, b)`, whose mean is `a/b`:
/// ```text
/// predict   a ← ρ a,  b ← ρ b                 ρ = exp(-dt/τ): the mean stays, the certainty fades
/// update    a ← a + n,  b ← b + 1
/// ln p(n) n! = Σ_(i<n) ln(a + i) + a ln(b/(b+1)) - n ln(b+1)
/// ```
/// The factor `n!` makes it the density of a set of points rather than of a list.
///
/// ## Use it when
/// the number of points tells something: an empty scan then speaks against an object that used to give
/// twenty, and an object with many points is not taken for one with few.
///
/// ## Reference
/// Granström and Orguner (2012), "Estimation and maintenance of measurement rates for multiple extended
/// target tracking", eqs. 10 to 13.
///
/// ```
/// use tercel_core::extended::Rate;
///
/// let mut rate = Rate::new(10.0, 2.0)?;
/// rate.add(25);
/// assert!(rate.mean() > 10.0 && rate.ln_likelihood(0) < rate.ln_likelihood(1));
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    shape: f64,
    inverse_scale: f64,
}

/// Parameters do not fall below this: their inverse is still finite.
const LEAST: f64 = 1e-300;

impl Rate {
    /// A rate of `mean` points a scan that is worth `scans` scans.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn new(mean: f64, scans: f64) -> Result<Self, FilterError> {
        FilterError::positive("mean number of points", mean)?;
        FilterError::positive("weight of a measurement rate, in scans", scans)?;
        Ok(Rate { shape: mean * scans, inverse_scale: scans })
    }

    /// Expected number of points a scan.
    pub fn mean(&self) -> f64 {
        self.shape / self.inverse_scale
    }

    /// How many scans the belief is worth.
    pub fn weight(&self) -> f64 {
        self.inverse_scale
    }

    /// The same mean, worth `share` of the scans.
    pub fn forget(&mut self, share: f64) {
        self.shape = (self.shape * share).max(LEAST);
        self.inverse_scale = (self.inverse_scale * share).max(LEAST);
    }

    /// Conditions the belief on a scan with `count` points.
    pub fn add(&mut self, count: usize) {
        self.shape += count as f64;
        self.inverse_scale += 1.0;
    }

    /// Logarithm of the probability of `count` points, times the number of their orders.
    pub fn ln_likelihood(&self, count: usize) -> f64 {
        let (a, b) = (self.shape, self.inverse_scale);
        ln_rising(a, count) - a * (1.0 / b).ln_1p() - count as f64 * (b + 1.0).ln()
    }

    /// Replaces this belief by the one with the moments of a mixture of itself and `other`.
    pub fn merge(&mut self, weight: f64, other: &Rate, other_weight: f64) {
        let total = weight + other_weight;
        let share = if total > 0.0 { other_weight / total } else { 0.0 };
        let difference = other.mean() - self.mean();
        let variance = |rate: &Rate| rate.mean() / rate.inverse_scale;
        let variance = (1.0 - share) * variance(self)
            + share * variance(other)
            + share * (1.0 - share) * difference * difference;
        let mean = self.mean() + share * difference;
        self.inverse_scale = mean / variance;
        self.shape = mean * self.inverse_scale;
    }
}

/// `ln Γ(a + n) - ln Γ(a)`: the logarithm of `a (a+1) .. (a+n-1)`, by few logarithms.
pub(crate) fn ln_rising(a: f64, count: usize) -> f64 {
    let (mut sum, mut product) = (0.0, 1.0_f64);
    for i in 0..count {
        product *= a + i as f64;
        if !(1e-280..1e280).contains(&product) {
            sum += product.ln();
            product = 1.0;
        }
    }
    sum + product.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probabilities_of_all_counts_add_up_to_one() {
        let rate = Rate::new(4.0, 3.0).unwrap();
        let mut orders = 0.0;
        let mut sum = 0.0;
        for count in 0..200 {
            orders += if count > 0 { f64::from(count).ln() } else { 0.0 };
            sum += (rate.ln_likelihood(count as usize) - orders).exp();
        }
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }

    #[test]
    fn a_rising_product_is_the_ratio_of_gamma_functions() {
        use statrs::function::gamma::ln_gamma;
        for (a, n) in [(0.3, 0), (0.3, 1), (7.5, 20), (1e9, 64), (2.0, 1000)] {
            let exact = ln_gamma(a + f64::from(n)) - ln_gamma(a);
            assert!(
                (ln_rising(a, n as usize) - exact).abs()
                    < 1e-9 * (1.0 + exact.abs()) + 1e-5 * f64::from(a > 1e6)
            );
        }
    }

    #[test]
    fn a_merged_rate_has_the_moments_of_the_mixture() {
        let (mut rate, other) = (Rate::new(4.0, 3.0).unwrap(), Rate::new(10.0, 1.0).unwrap());
        rate.merge(0.25, &other, 0.75);
        assert!((rate.mean() - 8.5).abs() < 1e-12);
        let variance = 0.25 * 4.0 / 3.0 + 0.75 * 10.0 + 0.25 * 0.75 * 36.0;
        assert!((rate.mean() / rate.weight() - variance).abs() < 1e-12);
    }
}
