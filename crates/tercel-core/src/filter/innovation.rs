//! How well a measurement agreed with what was expected.

use nalgebra::SVector;

/// Components that an innovation can hold.
const CAPACITY: usize = 6;

/// The outcome of comparing a measurement with a belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// `ln p(z)`: logarithm of the density of the measurement under the belief, in the space of the measurement.
    pub log_likelihood: f64,
    /// Normalised innovation squared: `νᵀ S⁻¹ ν`, chi-square distributed with [`dof`](Innovation::dof) degrees of freedom
    /// when the filter is consistent.
    pub nis: f64,
    residual: [f64; CAPACITY],
    dof: u8,
}

impl Innovation {
    /// An innovation with this residual `ν`, its normalised square and its log-likelihood.
    ///
    /// At most six components; a longer residual does not compile.
    pub fn new<const M: usize>(residual: &SVector<f64, M>, nis: f64, log_likelihood: f64) -> Self {
        const { assert!(M <= CAPACITY, "an innovation holds at most six components") };
        let mut components = [0.0; CAPACITY];
        components[..M].copy_from_slice(residual.as_slice());
        Innovation { log_likelihood, nis, residual: components, dof: M as u8 }
    }

    /// The innovation `ν`: measured minus expected, in the components of the sensor's reading.
    pub fn residual(&self) -> &[f64] {
        &self.residual[..usize::from(self.dof)]
    }

    /// Number of components of the measurement.
    pub fn dof(&self) -> usize {
        usize::from(self.dof)
    }
}

/// Gathers the innovations of several modes into the one of their mixture.
#[derive(Default)]
pub(super) struct Blend {
    /// Likelihoods are held relative to the largest so far, so that none of the relevant ones underflows.
    top: Option<f64>,
    likelihood: f64,
    nis: f64,
    probability: f64,
    residual: [f64; CAPACITY],
    dof: u8,
}

impl Blend {
    /// Adds a mode of this probability before the measurement. Returns the logarithm of its weight after it, `ln cΛ`.
    pub fn add(&mut self, probability: f64, innovation: &Innovation) -> f64 {
        self.add_weighted(probability, probability.ln(), innovation)
    }

    /// The same for a caller that holds the logarithm of the probability, which may be too small for a double.
    #[inline]
    pub fn add_weighted(&mut self, probability: f64, ln_probability: f64, innovation: &Innovation) -> f64 {
        let weight = ln_probability + innovation.log_likelihood;
        // A likelihood that overflowed or is not a number counts as zero.
        let weight = if weight < f64::INFINITY { weight } else { f64::NEG_INFINITY };
        let top = self.top.unwrap_or(weight);
        if weight > top {
            let shrink = (top - weight).exp();
            self.likelihood = self.likelihood * shrink + 1.0;
            self.nis = self.nis * shrink + innovation.nis;
        } else if top > f64::NEG_INFINITY {
            let share = (weight - top).exp();
            self.likelihood += share;
            // What has no share may be infinitely far away.
            if share > 0.0 {
                self.nis += share * innovation.nis;
            }
        }
        self.top = Some(top.max(weight));
        self.probability += probability;
        for (sum, component) in self.residual.iter_mut().zip(innovation.residual()) {
            *sum += probability * component;
        }
        self.dof = self.dof.max(innovation.dof);
        weight
    }

    /// The innovation of the mixture, unless no mode was added.
    pub fn finish(self) -> Option<Innovation> {
        let top = self.top?;
        if top == f64::NEG_INFINITY {
            let residual = self.residual.map(|sum| sum / self.probability);
            return Some(Innovation { log_likelihood: top, nis: f64::INFINITY, residual, dof: self.dof });
        }
        Some(Innovation {
            log_likelihood: top + self.likelihood.ln(),
            nis: self.nis / self.likelihood,
            residual: self.residual.map(|sum| sum / self.probability),
            dof: self.dof,
        })
    }
}
