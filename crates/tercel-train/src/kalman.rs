//! The algebra of the Kalman filter on batches, differentiable.
//!
//! States have four components `x, y, vx, vy`, of which the first two are measured. A batch of matrices is a
//! tensor with a matrix in each row, row by row: `[batch, 16]` for covariances, `[batch, 8]` for gains,
//! `[batch, 4]` for covariances of readings. Each function is one operation with a backward pass of its own;
//! as compositions of operations on components, a step of the filter would be hundreds of them.

use nalgebra::{Matrix2, Matrix4, Matrix4x2, SMatrix, Vector2};

use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};

/// The covariance of a prediction: `F P Fᵀ + Q`, the same `F` and `Q` for all.
pub fn predicted(covariance: Tensor, transition: &Matrix4<f32>, noise: &Matrix4<f32>) -> Tensor {
    apply(Predicted { transition: *transition, noise: *noise }, [covariance])
}

/// The covariance of the innovation: `S = H P Hᵀ + R`, given `P` and `R`.
pub fn innovation_covariance(covariance: Tensor, noise: Tensor) -> Tensor {
    apply(InnovationCovariance, [covariance, noise])
}

/// The Kalman gain `P Hᵀ S⁻¹`, given `P` and `S`.
pub fn gain(covariance: Tensor, innovation: Tensor) -> Tensor {
    apply(Gain, [covariance, innovation])
}

/// The covariance after an update with any gain, in Joseph's form: `(I - K H) P (I - K H)ᵀ + K R Kᵀ`.
pub fn joseph(covariance: Tensor, gain: Tensor, noise: Tensor) -> Tensor {
    apply(Joseph, [covariance, gain, noise])
}

/// The logarithm of the Gaussian density of an innovation `[batch, 2]` with covariance `S`: `[batch, 1]`.
///
/// ```text
/// -(νᵀ S⁻¹ ν + ln |S|) / 2 - ln 2π
/// ```
pub fn log_likelihood(innovation: Tensor, covariance: Tensor) -> Tensor {
    apply(LogLikelihood, [innovation, covariance])
}

/// The matrices of a batch.
fn rows<const R: usize, const C: usize>(matrix: &Matrix) -> impl Iterator<Item = SMatrix<f32, R, C>> {
    rows_of(matrix.values())
}

fn rows_of<const R: usize, const C: usize>(values: &[f32]) -> impl Iterator<Item = SMatrix<f32, R, C>> {
    values.chunks_exact(R * C).map(SMatrix::from_row_slice)
}

/// Matrices as rows.
fn packed<const R: usize, const C: usize>(matrices: impl Iterator<Item = SMatrix<f32, R, C>>) -> Vec<f32> {
    let mut values = Vec::new();
    for matrix in matrices {
        for row in 0..R {
            values.extend((0..C).map(|column| matrix[(row, column)]));
        }
    }
    values
}

/// The inverse by the adjugate. A matrix that is singular gives what is not finite, and the batch is skipped.
fn inverse(s: &Matrix2<f32>) -> Matrix2<f32> {
    let determinant = s[(0, 0)] * s[(1, 1)] - s[(0, 1)] * s[(1, 0)];
    Matrix2::new(s[(1, 1)], -s[(0, 1)], -s[(1, 0)], s[(0, 0)]) / determinant
}

fn forward<const R: usize, const C: usize>(values: impl Iterator<Item = SMatrix<f32, R, C>>) -> Forward<()> {
    let values = packed(values);
    let shape = [values.len() / (R * C), R * C];
    Forward { values, shape, saved: () }
}

#[derive(Debug, Clone)]
struct Predicted {
    transition: Matrix4<f32>,
    noise: Matrix4<f32>,
}

impl Operation<1> for Predicted {
    type Saved = ();

    fn forward(&self, [p]: &[Matrix; 1]) -> Forward<()> {
        forward(rows::<4, 4>(p).map(|p| self.transition * p * self.transition.transpose() + self.noise))
    }

    fn backward(&self, _: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let f = self.transition;
        [Some(packed(rows_of::<4, 4>(gradient).map(|g| f.transpose() * g * f)))]
    }
}

#[derive(Debug, Clone)]
struct InnovationCovariance;

impl Operation<2> for InnovationCovariance {
    type Saved = ();

    fn forward(&self, [p, r]: &[Matrix; 2]) -> Forward<()> {
        forward(rows::<4, 4>(p).zip(rows::<2, 2>(r)).map(|(p, r)| p.fixed_view::<2, 2>(0, 0) + r))
    }

    fn backward(&self, _: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let widened = rows_of::<2, 2>(gradient).map(|g| {
            let mut wide = Matrix4::zeros();
            wide.fixed_view_mut::<2, 2>(0, 0).copy_from(&g);
            wide
        });
        [Some(packed(widened)), Some(gradient.to_vec())]
    }
}

#[derive(Debug, Clone)]
struct Gain;

impl Operation<2> for Gain {
    type Saved = ();

    fn forward(&self, [p, s]: &[Matrix; 2]) -> Forward<()> {
        forward(rows::<4, 4>(p).zip(rows::<2, 2>(s)).map(|(p, s)| p.fixed_columns::<2>(0) * inverse(&s)))
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let [_, s] = past.inputs;
        let parts = || rows_of::<4, 2>(gradient).zip(rows::<2, 2>(s));
        let of_p = parts().map(|(g, s)| {
            let mut wide = Matrix4::zeros();
            wide.fixed_columns_mut::<2>(0).copy_from(&(g * inverse(&s).transpose()));
            wide
        });
        let gains = rows::<4, 2>(past.value);
        let of_s = parts().zip(gains).map(|((g, s), k)| -(k.transpose() * g * inverse(&s).transpose()));
        [Some(packed(of_p)), Some(packed(of_s))]
    }
}

#[derive(Debug, Clone)]
struct Joseph;

/// `I - K H`.
fn rest(gain: &Matrix4x2<f32>) -> Matrix4<f32> {
    let mut rest = Matrix4::identity();
    let mut measured = rest.fixed_columns_mut::<2>(0);
    measured -= gain;
    rest
}

impl Operation<3> for Joseph {
    type Saved = ();

    fn forward(&self, [p, k, r]: &[Matrix; 3]) -> Forward<()> {
        let all = rows::<4, 4>(p).zip(rows::<4, 2>(k)).zip(rows::<2, 2>(r));
        forward(all.map(|((p, k), r)| {
            let rest = rest(&k);
            rest * p * rest.transpose() + k * r * k.transpose()
        }))
    }

    fn backward(&self, past: Past<'_, (), 3>, gradient: &[f32]) -> [Option<Vec<f32>>; 3] {
        let [p, k, r] = past.inputs;
        let given = || rows_of::<4, 4>(gradient).zip(rows::<4, 2>(k));
        let of_p = past.wanted[0].then(|| {
            packed(given().map(|(g, k)| {
                let rest = rest(&k);
                rest.transpose() * g * rest
            }))
        });
        let of_k = past.wanted[1].then(|| {
            packed(given().zip(rows::<4, 4>(p).zip(rows::<2, 2>(r))).map(|((g, k), (p, r))| {
                let rest = rest(&k);
                let of_rest = g * rest * p.transpose() + g.transpose() * rest * p;
                g * k * r.transpose() + g.transpose() * k * r - of_rest.fixed_columns::<2>(0)
            }))
        });
        let of_r = past.wanted[2].then(|| packed(given().map(|(g, k)| k.transpose() * g * k)));
        [of_p, of_k, of_r]
    }
}

#[derive(Debug, Clone)]
struct LogLikelihood;

impl Operation<2> for LogLikelihood {
    type Saved = ();

    fn forward(&self, [innovation, s]: &[Matrix; 2]) -> Forward<()> {
        let all = rows::<2, 1>(innovation).zip(rows::<2, 2>(s));
        forward(all.map(|(v, s): (Vector2<f32>, _)| {
            let nis = v.dot(&(inverse(&s) * v));
            SMatrix::<f32, 1, 1>::new(-0.5 * (nis + s.determinant().ln()) - std::f32::consts::TAU.ln())
        }))
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let [innovation, s] = past.inputs;
        let all = || gradient.iter().zip(rows::<2, 1>(innovation).zip(rows::<2, 2>(s)));
        let of_v = all().map(|(g, (v, s)): (_, (Vector2<f32>, _))| {
            let inverse = inverse(&s);
            (inverse + inverse.transpose()) * v * (-0.5 * *g)
        });
        let of_s = all().map(|(g, (v, s)): (_, (Vector2<f32>, _))| {
            let inverse = inverse(&s).transpose();
            (inverse * v * v.transpose() * inverse - inverse) * (0.5 * *g)
        });
        [Some(packed(of_v)), Some(packed(of_s))]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{constant, values};
    use crate::{Initial, ParameterSet, Weights};

    fn numbers(count: usize, salt: usize) -> Vec<f32> {
        (0..count).map(|i| (((i * 7919 + salt * 104_729) % 1009) as f32 - 504.0) / 504.0).collect()
    }

    /// Positive definite matrices.
    fn covariances<const N: usize>(batch: usize, salt: usize) -> Vec<f32> {
        let factors = numbers(batch * N * N, salt);
        packed(rows_of::<N, N>(&factors).map(|f| f * f.transpose() + SMatrix::identity() * 0.5))
    }

    /// Four inputs as parameters: P, R, K and the innovation.
    fn inputs(batch: usize) -> ParameterSet {
        let mut set = ParameterSet::new(1);
        let mut add = |name, width, values| set.add(name, &[batch, width], Initial::Values(values)).unwrap();
        add("p", 16, covariances::<4>(batch, 1));
        add("r", 4, covariances::<2>(batch, 2));
        add("k", 8, numbers(batch * 8, 3));
        add("v", 2, numbers(batch * 2, 4));
        set
    }

    fn transition() -> Matrix4<f32> {
        Matrix4::new(1.0, 0.0, 0.7, 0.1, 0.0, 1.0, -0.1, 0.7, 0.0, 0.0, 0.9, -0.2, 0.0, 0.0, 0.2, 0.9)
    }

    type Case = (&'static str, fn(&[Tensor]) -> Tensor);

    fn cases() -> [Case; 5] {
        [
            ("predicted", |t| predicted(t[0].clone(), &transition(), &(Matrix4::identity() * 0.3))),
            ("innovation_covariance", |t| innovation_covariance(t[0].clone(), t[1].clone())),
            ("gain", |t| gain(t[0].clone(), innovation_covariance(t[0].clone(), t[1].clone()))),
            ("joseph", |t| joseph(t[0].clone(), t[2].clone(), t[1].clone())),
            ("log_likelihood", |t| log_likelihood(t[3].clone(), t[1].clone())),
        ]
    }

    #[test]
    fn gradients_equal_differences() {
        let set = inputs(3);
        for (name, case) in cases() {
            let sum = |set: &ParameterSet| -> f64 {
                let value = values(&case(Weights::frozen(set).tensors()));
                value.iter().zip(numbers(value.len(), 9)).map(|(v, w)| f64::from(*v) * f64::from(w)).sum()
            };
            let weights = Weights::trainable(&set);
            let value = case(weights.tensors());
            let [rows, columns] = value.dims();
            let loss = (value * constant(numbers(rows * columns, 9), [rows, columns])).sum().reshape([1, 1]);
            let gradients = weights.gradients(&loss);
            for (place, gradient) in gradients.iter().enumerate() {
                for (index, found) in gradient.iter().enumerate() {
                    let moved = |by: f32| {
                        let mut set = set.clone();
                        set.values_mut().nth(place).unwrap().1[index] += by;
                        sum(&set)
                    };
                    let slope = (moved(3e-3) - moved(-3e-3)) / 6e-3;
                    let error = (slope - f64::from(*found)).abs();
                    assert!(
                        error < 2e-3 * (1.0 + slope.abs()),
                        "{name} {place} {index}: {found} for {slope}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_joseph_form_with_the_kalman_gain_is_the_short_form() {
        let set = inputs(4);
        let weights = Weights::frozen(&set);
        let (p, r) = (weights.tensors()[0].clone(), weights.tensors()[1].clone());
        let k = gain(p.clone(), innovation_covariance(p.clone(), r.clone()));
        let long = values(&joseph(p.clone(), k.clone(), r));
        let (p, k) = (values(&p), values(&k));
        let short =
            packed(rows_of::<4, 4>(&p).zip(rows_of::<4, 2>(&k)).map(|(p, k)| p - k * p.fixed_rows::<2>(0)));
        for (long, short) in long.iter().zip(short) {
            assert!((long - short).abs() < 1e-5, "{long} {short}");
        }
    }

    #[test]
    fn the_log_likelihood_is_that_of_a_gaussian() {
        let value =
            log_likelihood(constant(vec![1.0, -2.0], [1, 2]), constant(vec![4.0, 1.0, 1.0, 2.0], [1, 4]));
        // S⁻¹ = [2 -1; -1 4] / 7, so the NIS is (2 + 4 + 16) / 7.
        let expected = -0.5 * (22.0 / 7.0 + 7.0_f32.ln()) - std::f32::consts::TAU.ln();
        assert!((values(&value)[0] - expected).abs() < 1e-6);
    }
}
