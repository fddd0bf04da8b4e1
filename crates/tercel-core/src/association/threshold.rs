//! The gate: how far a measurement may lie from what was expected.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::error::FilterError;
use crate::filter::Innovation;

/// A limit on the normalised innovation squared that a measurement of the object passes with a given probability.
///
/// ```
/// use tercel_core::association::Gate;
///
/// let gate = Gate::new(0.99)?;
/// assert!((gate.limit(2) - 9.21).abs() < 0.001);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gate {
    probability: f64,
    /// Chi-square quantiles for one to six components.
    limits: [f64; 6],
}

impl Gate {
    /// A gate that holds a measurement of the object with this probability.
    ///
    /// # Errors
    /// When it is not strictly between 0 and 1.
    pub fn new(probability: f64) -> Result<Self, FilterError> {
        if !(probability > 0.0 && probability < 1.0) {
            let expected = "must be above 0 and below 1";
            return Err(FilterError::Parameter {
                parameter: "gate probability",
                value: probability,
                expected,
            });
        }
        let mut limits = [0.0; 6];
        for (dof, limit) in (1..).zip(&mut limits) {
            // Positive degrees of freedom are always accepted.
            *limit =
                ChiSquared::new(f64::from(dof)).map_or(f64::INFINITY, |chi| chi.inverse_cdf(probability));
        }
        Ok(Gate { probability, limits })
    }

    /// The probability with which a measurement of the object falls inside.
    pub fn probability(&self) -> f64 {
        self.probability
    }

    /// Largest normalised innovation squared for measurements of `dof` components (1 to 6).
    pub fn limit(&self, dof: usize) -> f64 {
        self.limits[dof.clamp(1, 6) - 1]
    }

    /// Whether the measurement lies inside.
    pub fn contains(&self, innovation: &Innovation) -> bool {
        innovation.nis <= self.limit(innovation.dof())
    }
}

impl Default for Gate {
    /// A gate of 99.9 %.
    fn default() -> Self {
        Gate {
            probability: 0.999,
            limits: [10.827566, 13.815511, 16.266236, 18.466827, 20.515006, 22.457744],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_gate_of_its_probability() {
        let gate = Gate::new(0.999).unwrap();
        for dof in 1..=6 {
            assert!((gate.limit(dof) - Gate::default().limit(dof)).abs() < 1e-5, "{dof}");
        }
    }

    #[test]
    fn impossible_probabilities_are_refused() {
        for probability in [0.0, 1.0, -1.0, 2.0, f64::NAN] {
            assert!(Gate::new(probability).is_err());
        }
    }
}
