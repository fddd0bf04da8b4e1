//! What an estimate costs, given the truth.

use std::sync::Arc;

use serde::Deserialize;
use tercel_neural::filter::ExtentNetHyper;
use tercel_neural::filter::extent_net::{DOUBTED, Doubt, TOLD, Told};
use tercel_neural::filter::rmm_net::Number;

use crate::TrainError;
use crate::backend::{Forward, Matrix, Operation, Past};
use crate::check::{at_least, positive};
use crate::tape::{Tape, Variable};
use crate::task::rmm_net::{Truth, distance, score};

/// The section `[loss]`.
///
/// ## Definition
/// ```text
/// L = (|e_p|² / p² + |e_v|² / v² + x |X̂ - X|²) / 2 + g · d²(X̂, X) / a²
///   + d · (|e_p|² / 2σ_p² + 2 ln σ_p + |e_v|² / 2σ_v² + 2 ln σ_v - ln p(X; X̂, λ))
/// ```
/// with the squared Wasserstein distance `d²` of the shapes and the geometric mean `a` of the true semi-axes. As it stands without
/// further keys the first line is the loss of the publication (eq. 37). Errors and mean extent count as given in the second, which
/// sets the deviations and the weight alone.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ExtentCosts {
    /// What errors of the position are divided by, m.
    pub position: f64,
    /// What errors of the velocity are divided by, m/s.
    pub velocity: f64,
    /// Weight `x` of squared errors of the extent, 1/m².
    pub extent: f64,
    /// Weight `g` of the error of the shape.
    pub shape: f64,
    /// Weight `d` of deviations and weight.
    pub doubt: f64,
    /// Steps between cuts of the back-propagation; 0 cuts nothing.
    pub window: usize,
    /// Epochs in which the network is given the truth in the place of its last estimate. Validation never is.
    pub forced: usize,
}

impl Default for ExtentCosts {
    fn default() -> Self {
        ExtentCosts {
            position: 1.0,
            velocity: 1.0,
            extent: 1.0,
            shape: 0.0,
            doubt: 0.05,
            window: 50,
            forced: 0,
        }
    }
}

impl ExtentCosts {
    /// Refuses weights and scales that make no sense.
    pub fn check(&self) -> Result<(), TrainError> {
        at_least("loss.extent", self.extent, 0.0)?;
        at_least("loss.shape", self.shape, 0.0)?;
        at_least("loss.doubt", self.doubt, 0.0)?;
        positive("loss.position", self.position)?;
        positive("loss.velocity", self.velocity)
    }

    /// The cost of an estimate.
    pub fn of<'t>(
        &self,
        told: &Told<Variable<'t>>,
        doubt: &Doubt<Variable<'t>>,
        truth: &Truth,
    ) -> Variable<'t> {
        let square = |found: [Variable<'t>; 2], first: usize| {
            let [x, y] = [0, 1].map(|i| found[i] + -truth.state[first + i]);
            x * x + y * y
        };
        let (place, velocity) = (square(told.place, 0), square(told.velocity, 2));
        let (found, true_) = (told.extent(), &truth.extent);
        let off = [found.xx + -true_.xx, found.xy + -true_.xy, found.yy + -true_.yy];
        let norm = off[0] * off[0] + off[1] * off[1] * 2.0 + off[2] * off[2];
        let [p, v] = [self.position, self.velocity].map(|unit| 1.0 / (unit * unit));
        let surprise =
            |ln: Variable<'t>, square: Variable<'t>| (ln * -2.0).exp() * (0.5 * square.value()) + ln * 2.0;
        (place * p + velocity * v + norm * self.extent) * 0.5
            + distance(&found, true_) * (self.shape / true_.determinant().sqrt())
            + (surprise(doubt.ln_place, place)
                + surprise(doubt.ln_velocity, velocity)
                + score(&found, doubt.ln_weight, true_))
                * self.doubt
    }
}

/// The cost of each row of state, extent and doubt, given the truth.
#[derive(Debug, Clone)]
pub struct Judge {
    pub hyper: Arc<ExtentNetHyper>,
    pub costs: ExtentCosts,
    pub truth: Arc<Vec<Truth>>,
}

impl Judge {
    fn of<'t>(&self, member: usize, row: &[Variable<'t>]) -> Variable<'t> {
        let doubt = self.hyper.doubt(&row[TOLD..TOLD + DOUBTED]);
        self.costs.of(&Told::of(row), &doubt, &self.truth[member])
    }
}

fn row(matrix: &Matrix, member: usize) -> &[f32] {
    &matrix.values()[member * matrix.columns()..][..matrix.columns()]
}

impl Operation<1> for Judge {
    type Saved = ();

    fn forward(&self, [rows]: &[Matrix; 1]) -> Forward<()> {
        let cost = |member: usize| {
            let row: Vec<_> = row(rows, member).iter().map(|x| Variable::of(f64::from(*x))).collect();
            self.of(member, &row).value() as f32
        };
        Forward { values: (0..rows.rows()).map(cost).collect(), shape: [rows.rows(), 1], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [rows] = past.inputs;
        let mut found = Vec::with_capacity(rows.rows() * rows.columns());
        let (mut tape, mut slopes) = (Tape::default(), Vec::new());
        for (member, weight) in gradient.iter().enumerate() {
            tape.clear();
            let row: Vec<_> = row(rows, member).iter().map(|x| tape.variable(f64::from(*x))).collect();
            tape.slopes(&[(self.of(member, &row), f64::from(*weight))], &mut slopes);
            found.extend(row.iter().map(|input| slopes[input.place()] as f32));
        }
        [Some(found)]
    }
}
