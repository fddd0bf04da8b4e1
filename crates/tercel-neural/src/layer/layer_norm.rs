//! Layer normalisation.

/// Added to the variance, so that a row of equal numbers gives the offset.
const EPSILON: f32 = 1e-5;

/// Normalises each row by its own mean and variance, then scales and moves each channel.
///
/// ## Definition
/// ```text
/// y = w (x - mean x) / √(var x + 1e-5) + b          over the numbers of a row
/// ```
/// A model file holds `NAME.weight [size]` and `NAME.bias [size]`.
///
/// ## Use it when
/// layers are stacked with shortcuts around them, as in a transformer.
///
/// ## Reference
/// Ba, Kiros and Hinton (2016).
///
/// ```
/// use tercel_neural::layer::LayerNorm;
///
/// let norm = LayerNorm::new(&[1.0, 1.0], &[0.0, 3.0]);
/// let mut y = [0.0; 2];
/// norm.forward(&[5.0, 9.0], &mut y);
/// assert!((y[0] + 1.0).abs() < 1e-5 && (y[1] - 4.0).abs() < 1e-5);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LayerNorm {
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl LayerNorm {
    /// A layer with these weights, as in a model file.
    ///
    /// # Panics
    /// When the slices have different lengths.
    pub fn new(weight: &[f32], bias: &[f32]) -> Self {
        assert_eq!(weight.len(), bias.len(), "weight and bias of a layer normalisation");
        LayerNorm { weight: weight.to_vec(), bias: bias.to_vec() }
    }

    /// Width of a row.
    pub fn size(&self) -> usize {
        self.weight.len()
    }

    /// Writes the rows of `input` normalised.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows.
    pub fn forward(&self, input: &[f32], output: &mut [f32]) {
        let size = self.size();
        super::same_batch(&[(input.len(), size), (output.len(), size)]);
        for (x, y) in input.chunks_exact(size).zip(output.chunks_exact_mut(size)) {
            let count = size as f32;
            let mean = x.iter().sum::<f32>() / count;
            let variance = x.iter().map(|x| (x - mean) * (x - mean)).sum::<f32>() / count;
            let scale = 1.0 / (variance + EPSILON).sqrt();
            for ((y, x), (weight, bias)) in y.iter_mut().zip(x).zip(self.weight.iter().zip(&self.bias)) {
                *y = weight * (x - mean) * scale + bias;
            }
        }
    }
}
