//! Dropout.

use rand::{Rng, RngExt};

use crate::backend::{Tensor, constant};

/// Sets each element to zero with a probability and scales the others so that the mean stays.
///
/// ```text
/// y = x m / (1 - p),   m ~ Bernoulli(1 - p)
/// ```
///
/// A probability of 0 or less gives the tensor as it is, and so should the validation.
///
/// ## Reference
///
/// N. Srivastava et al., "Dropout: a simple way to prevent neural networks from overfitting", JMLR 15 (2014),
/// in the inverted form that leaves the run time as it is.
pub fn dropout(x: Tensor, probability: f32, random: &mut impl Rng) -> Tensor {
    if probability <= 0.0 {
        return x;
    }
    let [rows, columns] = x.dims();
    let keep = (1.0 - probability).max(f32::MIN_POSITIVE);
    let mask =
        (0..rows * columns).map(|_| if random.random::<f32>() < keep { 1.0 / keep } else { 0.0 }).collect();
    x * constant(mask, [rows, columns])
}
