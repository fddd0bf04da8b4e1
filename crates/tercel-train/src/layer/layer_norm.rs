//! Layer normalisation.

use super::positive;
use crate::backend::vector::{sum_rows, vectorised};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// Added to the variance.
const EPSILON: f32 = 1e-5;

/// Normalises each row by its own mean and variance, then scales and moves each channel.
///
/// ## Definition
///
/// ```text
/// y = w (x - mean x) / √(var x + 1e-5) + b          over the numbers of a row
/// ```
///
/// Parameters: `NAME.weight`, which starts as one, and `NAME.bias`, which starts as zero.
///
/// ## Reference
///
/// J. Ba, J. Kiros, G. Hinton, "Layer normalization", arXiv 1607.06450 (2016).
#[derive(Debug, Clone)]
pub struct LayerNorm {
    weight: ParameterId,
    bias: ParameterId,
}

impl LayerNorm {
    /// Adds the parameters of a layer for rows of `size` numbers to a set.
    ///
    /// # Errors
    ///
    /// If the size is zero or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, size: usize) -> Result<Self, TrainError> {
        positive(name, &[("the size", size)])?;
        Ok(Self {
            weight: set.add(&format!("{name}.weight"), &[size], Initial::Constant(1.0))?,
            bias: set.add(&format!("{name}.bias"), &[size], Initial::Constant(0.0))?,
        })
    }

    /// Applies the layer to each row.
    pub fn forward(&self, weights: &Weights, x: Tensor) -> Tensor {
        apply(Normalise, [x, weights.get(self.weight), weights.get(self.bias)])
    }
}

/// Of inputs `x`, `w`, `b`.
#[derive(Debug, Clone)]
struct Normalise;

/// What the backward pass needs.
#[derive(Debug, Clone)]
struct Saved {
    /// The rows before weight and bias.
    normal: Vec<f32>,
    /// For each row, `1 / √(var x + 1e-5)`.
    scales: Vec<f32>,
}

impl Operation<3> for Normalise {
    type Saved = Saved;

    fn forward(&self, [x, weight, bias]: &[Matrix; 3]) -> Forward<Saved> {
        let size = x.columns();
        let mut normal = x.values().to_vec();
        let mut values = vec![0.0; normal.len()];
        let mut scales = vec![0.0; x.rows()];
        normalise(&mut normal, &mut values, &mut scales, weight.values(), bias.values());
        Forward { values, shape: [x.rows(), size], saved: Saved { normal, scales } }
    }

    fn backward(&self, past: Past<'_, Saved, 3>, gradient: &[f32]) -> [Option<Vec<f32>>; 3] {
        let [x, weight, _] = past.inputs;
        let (size, weight) = (x.columns(), weight.values());
        let Saved { normal, scales } = past.saved;
        let of_x = past.wanted[0].then(|| {
            let mut out = vec![0.0; gradient.len()];
            let rows = gradient.chunks_exact(size).zip(normal.chunks_exact(size)).zip(&scales);
            for (((gradient, normal), scale), out) in rows.zip(out.chunks_exact_mut(size)) {
                out.iter_mut().zip(gradient.iter().zip(weight)).for_each(|(out, (g, w))| *out = g * w);
                let mean = out.iter().sum::<f32>() / size as f32;
                let along = out.iter().zip(normal).map(|(g, n)| g * n).sum::<f32>() / size as f32;
                out.iter_mut().zip(normal).for_each(|(g, n)| *g = scale * (*g - mean - n * along));
            }
            out
        });
        let products: Vec<f32> = gradient.iter().zip(&normal).map(|(g, n)| g * n).collect();
        [
            of_x,
            past.wanted[1].then(|| sum_rows(&products, size)),
            past.wanted[2].then(|| sum_rows(gradient, size)),
        ]
    }
}

vectorised! {
    /// Normalises rows in place, and fills their scales and the values after weight and bias.
    fn normalise<'a>(
        normal: &'a mut [f32],
        values: &'a mut [f32],
        scales: &'a mut [f32],
        weight: &'a [f32],
        bias: &'a [f32],
    ) {
        let size = weight.len();
        let rows = normal.chunks_exact_mut(size).zip(values.chunks_exact_mut(size)).zip(scales);
        for ((row, value), scale) in rows {
            let mean = row.iter().sum::<f32>() / size as f32;
            row.iter_mut().for_each(|x| *x -= mean);
            let variance = row.iter().map(|x| x * x).sum::<f32>() / size as f32;
            *scale = 1.0 / (variance + EPSILON).sqrt();
            row.iter_mut().for_each(|x| *x *= *scale);
            for ((value, x), (weight, bias)) in value.iter_mut().zip(&*row).zip(weight.iter().zip(bias)) {
                *value = weight * x + bias;
            }
        }
    }
}
