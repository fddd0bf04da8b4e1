//! Normalisation by the root mean square.

use super::positive;
use crate::backend::vector::sum_rows;
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// Added to the mean square.
const EPSILON: f32 = 1e-5;

/// Divides each row by its own root mean square, then scales each channel.
///
/// ## Definition
///
/// ```text
/// y = w x / √(mean x² + 1e-5)          over the numbers of a row
/// ```
///
/// Parameter: `NAME.weight`, which starts as one.
///
/// ## Reference
///
/// B. Zhang, R. Sennrich, "Root mean square layer normalization", NeurIPS 2019.
#[derive(Debug, Clone)]
pub struct RmsNorm {
    weight: ParameterId,
}

impl RmsNorm {
    /// Adds the parameter of a layer for rows of `size` numbers to a set.
    ///
    /// # Errors
    ///
    /// If the size is zero or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, size: usize) -> Result<Self, TrainError> {
        positive(name, &[("the size", size)])?;
        Ok(Self { weight: set.add(&format!("{name}.weight"), &[size], Initial::Constant(1.0))? })
    }

    /// Applies the layer to each row.
    pub fn forward(&self, weights: &Weights, x: Tensor) -> Tensor {
        apply(Normalise, [x, weights.get(self.weight)])
    }
}

/// Of inputs `x`, `w`.
#[derive(Debug, Clone)]
struct Normalise;

impl Operation<2> for Normalise {
    /// For each row, `1 / √(mean x² + 1e-5)`.
    type Saved = Vec<f32>;

    fn forward(&self, [x, weight]: &[Matrix; 2]) -> Forward<Vec<f32>> {
        let size = x.columns();
        let scale = |row: &[f32]| {
            let square = row.iter().map(|x| x * x).sum::<f32>() / size as f32;
            1.0 / (square + EPSILON).sqrt()
        };
        let saved: Vec<f32> = x.values().chunks_exact(size).map(scale).collect();
        let rows = x.values().chunks_exact(size).zip(&saved);
        let values = rows
            .flat_map(|(row, scale)| row.iter().zip(weight.values()).map(move |(x, w)| w * x * scale))
            .collect();
        Forward { values, shape: [x.rows(), size], saved }
    }

    fn backward(&self, past: Past<'_, Vec<f32>, 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let [x, weight] = past.inputs;
        let (size, weight) = (x.columns(), weight.values());
        let mut of_x = gradient.to_vec();
        let mut of_weight = gradient.to_vec();
        let rows = x.values().chunks_exact(size).zip(&past.saved);
        let found = of_x.chunks_exact_mut(size).zip(of_weight.chunks_exact_mut(size));
        for ((x, scale), (of_x, of_weight)) in rows.zip(found) {
            of_weight.iter_mut().zip(x).for_each(|(g, x)| *g *= x * scale);
            of_x.iter_mut().zip(weight).for_each(|(g, w)| *g *= w);
            let along = of_x.iter().zip(x).map(|(g, x)| g * x).sum::<f32>() / size as f32;
            let pull = along * scale * scale;
            of_x.iter_mut().zip(x).for_each(|(g, x)| *g = scale * (*g - x * pull));
        }
        [Some(of_x), Some(sum_rows(&of_weight, size))]
    }
}
