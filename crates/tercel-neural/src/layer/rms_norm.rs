//! Normalisation by the root mean square.

/// Added to the mean square, so that a row of zeros stays one.
const EPSILON: f32 = 1e-5;

/// Divides each row by its own root mean square, then scales each channel.
///
/// ## Definition
/// ```text
/// y = w x / √(mean x² + 1e-5)          over the numbers of a row
/// ```
/// A model file holds `NAME.weight [size]`.
///
/// ## Use it when
/// layers are stacked with shortcuts around them. Beside [`LayerNorm`](super::LayerNorm) it leaves the mean, which seldom matters.
///
/// ## Reference
/// Zhang and Sennrich (2019).
///
/// ```
/// use tercel_neural::layer::RmsNorm;
///
/// let norm = RmsNorm::new(&[1.0, 2.0]);
/// let mut y = [0.0; 2];
/// norm.forward(&[3.0, -3.0], &mut y);
/// assert!((y[0] - 1.0).abs() < 1e-5 && (y[1] + 2.0).abs() < 1e-5);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RmsNorm {
    weight: Vec<f32>,
}

impl RmsNorm {
    /// A layer with this weight, as in a model file.
    pub fn new(weight: &[f32]) -> Self {
        RmsNorm { weight: weight.to_vec() }
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
            let square = x.iter().map(|x| x * x).sum::<f32>() / size as f32;
            let scale = 1.0 / (square + EPSILON).sqrt();
            for ((y, x), weight) in y.iter_mut().zip(x).zip(&self.weight) {
                *y = weight * x * scale;
            }
        }
    }
}
