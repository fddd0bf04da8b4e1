//! Sums that do not depend on the order of their terms.

use serde::{Deserialize, Serialize};

/// Fractional bits of a term.
const BITS: i32 = 24;

/// Terms are smaller than this, so that 2³² of them fit.
const LARGEST: f64 = (1_u128 << 70) as f64;

/// A sum of numbers as a multiple of 2⁻²⁴, with the number of terms.
///
/// ## Definition
/// ```text
/// sum = 2⁻²⁴ Σ_i round(2²⁴ x_i),    |x_i| < 2⁷⁰
/// ```
/// Each term is rounded once, to 6e-8; the sum of integers is exact. So any order and any grouping of the terms gives the
/// same sum, which floating point does not.
///
/// ## Use it when
/// a mean over many runs is to be the same however the runs are spread over threads and machines, and the terms are not
/// tiny: squared errors in m², scores, probabilities.
///
/// ## Reference
/// The idea is that of Kulisch's long accumulator ("Computer arithmetic and validity", 2008), cut to the range that is
/// needed here.
///
/// ```
/// use tercel_study::monte_carlo::ExactSum;
///
/// let (mut one, mut two) = (ExactSum::default(), ExactSum::default());
/// for x in [1e15, 0.1, -1e15] {
///     assert!(one.add(x));
/// }
/// for x in [0.1, -1e15, 1e15] {
///     two.add(x);
/// }
/// assert_eq!(one, two);
/// assert!((one.mean().unwrap() - 0.1 / 3.0).abs() < 1e-7);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ExactSum(i128, u64);

impl ExactSum {
    /// Adds a term. False, and nothing changes, when it is infinite or 2⁷⁰ (1e21) or more; NaN is no term and changes
    /// nothing either.
    #[must_use = "a term that is too large is not added"]
    pub fn add(&mut self, term: f64) -> bool {
        if term.is_nan() {
            return true;
        }
        if !ExactSum::takes(term) {
            return false;
        }
        self.0 += (term * f64::from(1 << BITS)).round() as i128;
        self.1 += 1;
        true
    }

    /// Whether a number can be a term.
    pub fn takes(term: f64) -> bool {
        term.abs() < LARGEST
    }

    /// Adds all terms of another sum.
    pub fn merge(&mut self, other: &ExactSum) {
        self.0 += other.0;
        self.1 += other.1;
    }

    /// How many terms there are.
    pub fn count(&self) -> u64 {
        self.1
    }

    /// Mean of the terms; `None` without any.
    pub fn mean(&self) -> Option<f64> {
        (self.1 > 0).then(|| self.0 as f64 / f64::from(1 << BITS) / self.1 as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_term_is_not_a_term_and_a_huge_one_is_refused() {
        let mut sum = ExactSum::default();
        assert!(sum.add(f64::NAN) && sum.mean().is_none());
        assert!(!sum.add(f64::INFINITY) && !sum.add(-1.3e21));
        assert!(sum.add(1e21) && sum.add(2.0));
        assert_eq!((sum.count(), sum.mean()), (2, Some(5e20 + 1.0)));
    }

    #[test]
    fn a_sum_of_huge_terms_survives_json() {
        let mut sum = ExactSum::default();
        for _ in 0..1000 {
            assert!(sum.add(-1e21));
        }
        let text = serde_json::to_string(&sum).unwrap();
        assert_eq!(serde_json::from_str::<ExactSum>(&text).unwrap(), sum);
    }
}
