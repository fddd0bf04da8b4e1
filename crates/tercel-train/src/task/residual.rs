//! From what a network says of states to the loss: shared by the tasks that learn from windows.

use std::sync::Arc;

use serde::Deserialize;

use crate::TrainError;
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply, values};
use crate::check::{at_least, positive};
use crate::trainer::Loss;

/// The section `[loss]`.
///
/// ## Definition
///
/// With the errors `e` of position and velocity in units of `position` and `velocity`:
///
/// ```text
/// ρ(e)  = √(1 + |e|²) - 1      or |e|² / 2 if `square`
/// L     = weighted mean over steps of  ρ(e_pos) + v ρ(e_vel)
///         + l · mean over last steps of (‖(D R)⁻¹ e‖² / 2 + ln |D|)
/// ```
///
/// The last step of a window has weight 1, the others `others`. `R` is the root of the covariance of the filter beside the network
/// and `D` what the network scales its deviations by; the error counts as given in that term.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ResidualLoss {
    /// Unit of errors of the position, m.
    pub position: f64,
    /// Unit of errors of the velocity, m/s.
    pub velocity: f64,
    /// Weight of the velocity.
    pub velocity_weight: f64,
    /// Whether errors count by their squares. By their lengths, flights with large errors do not rule.
    pub square: bool,
    /// Weight of the steps of a window before the last.
    pub others: f64,
    /// Weight of the likelihood.
    pub likelihood: f64,
}

impl Default for ResidualLoss {
    fn default() -> Self {
        Self {
            position: 100.0,
            velocity: 20.0,
            velocity_weight: 0.2,
            square: false,
            others: 0.2,
            likelihood: 0.1,
        }
    }
}

impl ResidualLoss {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    ///
    /// Names the key.
    pub fn check(&self) -> Result<(), TrainError> {
        positive("loss.position", self.position)?;
        positive("loss.velocity", self.velocity)?;
        at_least("loss.velocity_weight", self.velocity_weight, 0.0)?;
        at_least("loss.others", self.others, 0.0)?;
        at_least("loss.likelihood", self.likelihood, 0.0)
    }

    /// The length of an error of this square, in its unit, and the factor by which the error is its derivative.
    fn length(&self, square: f32) -> (f32, f32) {
        if self.square {
            return (0.5 * square, 1.0);
        }
        let root = (1.0 + square).sqrt();
        (root - 1.0, 1.0 / root)
    }
}

/// Lower-triangular, row by row.
pub type Root = [[f32; 4]; 4];

/// A step of a window: what a row of outputs means, and what it should be.
#[derive(Debug, Clone, Copy)]
pub struct Aim {
    /// Takes the first four outputs to what they stand for: m, m, m/s, m/s.
    pub unit: Root,
    /// What that should be.
    pub target: [f32; 4],
    /// The share of the step.
    pub weight: f32,
    /// Root of the covariance beside the network, of the last step of a window.
    pub root: Option<Root>,
}

/// The loss of outputs with a row for each aim: four numbers, and two logarithms of scales if there are six.
pub fn loss(outputs: Tensor, aims: &Arc<Vec<Aim>>, config: &ResidualLoss) -> Loss {
    let value = apply(Residuals { aims: Arc::clone(aims), loss: config.clone() }, [outputs]);
    let all = values(&value);
    let names = ["position", "velocity", "likelihood"];
    let parts = names.into_iter().zip(all[1..].iter().map(|value| f64::from(*value))).collect();
    let terms = aims.iter().filter(|aim| aim.root.is_some()).count();
    Loss { value: value.slice([0..1, 0..1]), terms: terms as f64, parts }
}

/// One row `total, position, velocity, likelihood`: mean squares of an element at last steps and the mean likelihood. Only the
/// first is differentiated.
#[derive(Debug, Clone)]
struct Residuals {
    aims: Arc<Vec<Aim>>,
    loss: ResidualLoss,
}

const COLUMNS: usize = 4;

impl Residuals {
    /// Sum of the weights, and number of last steps.
    fn totals(&self) -> (f32, f32) {
        let weight: f32 = self.aims.iter().map(|aim| aim.weight).sum();
        let last = self.aims.iter().filter(|aim| aim.root.is_some()).count();
        (weight.max(f32::MIN_POSITIVE), last.max(1) as f32)
    }

    /// The error of a row, and the squares of its halves in their units.
    fn error(&self, aim: &Aim, row: &[f32]) -> ([f32; 4], [f32; 2]) {
        let mut error = aim.target;
        for (i, error) in error.iter_mut().enumerate() {
            *error -= (0..=i).map(|j| aim.unit[i][j] * row[j]).sum::<f32>();
        }
        let [p, v] = [self.loss.position, self.loss.velocity].map(|unit| (1.0 / (unit * unit)) as f32);
        let squares = [
            (error[0] * error[0] + error[1] * error[1]) * p,
            (error[2] * error[2] + error[3] * error[3]) * v,
        ];
        (error, squares)
    }
}

impl Operation<1> for Residuals {
    type Saved = ();

    fn forward(&self, [outputs]: &[Matrix; 1]) -> Forward<()> {
        let (weights, count) = self.totals();
        let mut value = [0.0; COLUMNS];
        for (aim, row) in self.aims.iter().zip(outputs.values().chunks_exact(outputs.columns())) {
            let (error, squares) = self.error(aim, row);
            let [position, velocity] = squares.map(|square| self.loss.length(square).0);
            value[0] += aim.weight / weights * (position + self.loss.velocity_weight as f32 * velocity);
            let Some(root) = &aim.root else { continue };
            value[1] += (error[0] * error[0] + error[1] * error[1]) / (2.0 * count);
            value[2] += (error[2] * error[2] + error[3] * error[3]) / (2.0 * count);
            value[3] += likelihood(&error, root, scales(row)).0 / count;
        }
        value[0] += self.loss.likelihood as f32 * value[3];
        Forward { values: value.to_vec(), shape: [1, COLUMNS], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [outputs] = past.inputs;
        let width = outputs.columns();
        let (weights, count) = self.totals();
        let [p, v] = [self.loss.position, self.loss.velocity].map(|unit| (1.0 / (unit * unit)) as f32);
        let mut found = vec![0.0; outputs.rows() * width];
        let rows = outputs.values().chunks_exact(width).zip(found.chunks_exact_mut(width));
        for (aim, (row, found)) in self.aims.iter().zip(rows) {
            let (error, squares) = self.error(aim, row);
            let share = gradient[0] * aim.weight / weights;
            let position = share * p * self.loss.length(squares[0]).1;
            let velocity = share * v * self.loss.velocity_weight as f32 * self.loss.length(squares[1]).1;
            let of = [-position * error[0], -position * error[1], -velocity * error[2], -velocity * error[3]];
            for (j, found) in found[..4].iter_mut().enumerate() {
                *found = (j..4).map(|i| of[i] * aim.unit[i][j]).sum();
            }
            if let (Some(root), [_, _, _, _, a, b]) = (&aim.root, found) {
                let slopes = likelihood(&error, root, scales(row)).1;
                let share = gradient[0] * self.loss.likelihood as f32 / count;
                (*a, *b) = (share * slopes[0], share * slopes[1]);
            }
        }
        [Some(found)]
    }
}

fn scales(row: &[f32]) -> [f32; 2] {
    match row {
        [_, _, _, _, position, velocity] => [*position, *velocity],
        _ => [0.0; 2],
    }
}

/// Half the squared Mahalanobis distance plus the logarithm of the determinant, for deviations that are scaled by `exp` of
/// `scales`, and its derivatives with respect to these.
pub fn likelihood(error: &[f32; 4], root: &Root, scales: [f32; 2]) -> (f32, [f32; 2]) {
    let [position, velocity] = scales.map(|scale| (-scale).exp());
    let y = [position * error[0], position * error[1], velocity * error[2], velocity * error[3]];
    let mut w = y;
    for i in 0..4 {
        for j in 0..i {
            w[i] -= root[i][j] * w[j];
        }
        w[i] /= root[i][i];
    }
    let mut g = w;
    for i in (0..4).rev() {
        for j in i + 1..4 {
            g[i] -= root[j][i] * g[j];
        }
        g[i] /= root[i][i];
    }
    let square: f32 = w.iter().map(|w| w * w).sum();
    let of = |i: usize| 2.0 - y[i] * g[i] - y[i + 1] * g[i + 1];
    (0.5 * square + 2.0 * (scales[0] + scales[1]), [of(0), of(2)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{Tape, constant, leaf};

    fn aims() -> Arc<Vec<Aim>> {
        let number = |i: usize| ((i * 7919 % 101) as f32 - 50.0) / 50.0;
        let root = |salt: usize, size: f32| -> Root {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| match i.cmp(&j) {
                    std::cmp::Ordering::Less => 0.0,
                    std::cmp::Ordering::Equal => size * (1.5 + number(salt + i)),
                    std::cmp::Ordering::Greater => size * number(salt + 4 * i + j),
                })
            })
        };
        let aim = |i: usize| Aim {
            unit: root(i, 60.0),
            target: std::array::from_fn(|j| 150.0 * number(40 * i + j)),
            weight: 0.5 + 0.25 * i as f32,
            root: (i % 2 == 1).then(|| root(i + 3, 70.0)),
        };
        Arc::new((0..6).map(aim).collect())
    }

    #[test]
    fn the_gradient_of_the_loss_is_its_slope() {
        // The error counts as given in the likelihood, so the slopes of the two parts are looked at apart.
        for (square, likelihood) in [(false, 0.0), (true, 0.0), (false, 0.3)] {
            let config = ResidualLoss { square, likelihood, ..ResidualLoss::default() };
            let start: Vec<f32> = (0..36).map(|i| ((i as f32) * 1.7).sin()).collect();
            let outputs = leaf(start.clone(), [6, 6]);
            let found = loss(outputs.clone(), &aims(), &config).value;
            let gradient = Tape::backward(&found).unwrap().gradient(&outputs).unwrap();
            for index in 0..36 {
                if (index % 6 < 4) != (likelihood == 0.0) {
                    continue;
                }
                let moved = |by: f32| {
                    let mut outputs = start.clone();
                    outputs[index] += by;
                    values(&loss(constant(outputs, [6, 6]), &aims(), &config).value)[0]
                };
                let slope = (moved(1e-2) - moved(-1e-2)) / 2e-2;
                let error = (slope - gradient[index]).abs();
                assert!(error < 2e-3 + 0.01 * slope.abs(), "{index}: {slope} {}", gradient[index]);
            }
        }
    }

    #[test]
    fn outputs_that_say_the_target_lose_nothing_but_the_determinant() {
        let unit: Root = std::array::from_fn(|i| std::array::from_fn(|j| f32::from(u8::from(i == j))));
        let aim = Aim { unit, target: [3.0, -1.0, 0.5, 2.0], weight: 1.0, root: Some(unit) };
        let row = constant(vec![3.0, -1.0, 0.5, 2.0, 0.1, 0.2], [1, 6]);
        let loss = loss(row, &Arc::new(vec![aim]), &ResidualLoss::default());
        assert!((values(&loss.value)[0] - 0.1 * 0.6).abs() < 1e-6);
        assert_eq!(loss.parts[0], ("position", 0.0));
    }
}
