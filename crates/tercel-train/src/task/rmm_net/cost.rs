//! What an estimate costs, given the truth.

use serde::Deserialize;
use tercel_neural::filter::rmm_net::{Number, Symmetric};

use super::rows::{STEP, TRACK, track};
use crate::TrainError;
use crate::check::{at_least, positive};
use crate::tape::Variable;

/// The section `[loss]`.
///
/// ## Definition
/// ```text
/// L = s · (eᵀ P⁻¹ e + ln |P|) / 2 + m · (|e_p|² / p² + |e_v|² / v²)
///   + g · d²(X̂, X) / a² + w · -ln p(X; X̂, λ) + f · the last two of the extent that was expected
/// ```
/// with the squared Wasserstein distance `d²` of the shapes alone and the geometric mean `a` of the true semi-axes. The mean
/// extent counts as given in the logarithmic score, which therefore sets the weight alone.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Costs {
    /// Weight `s` of the surprise by the true state.
    pub surprise: f64,
    /// Weight `m` of squared errors.
    pub error: f64,
    /// What errors of the position are divided by, m.
    pub position: f64,
    /// What errors of the velocity are divided by, m/s.
    pub velocity: f64,
    /// Weight `g` of the error of the shape.
    pub shape: f64,
    /// Weight `w` of the logarithmic score of the extent.
    pub score: f64,
    /// Weight `f` of the extent that is expected before an update.
    pub foresight: f64,
    /// Steps between cuts of the back-propagation.
    pub window: usize,
}

impl Default for Costs {
    fn default() -> Self {
        Costs {
            surprise: 1.0,
            error: 0.5,
            position: 0.5,
            velocity: 0.6,
            shape: 2.0,
            score: 0.05,
            foresight: 0.05,
            window: 50,
        }
    }
}

/// The true state and extent.
#[derive(Debug, Clone, Copy)]
pub struct Truth {
    pub state: [f64; 4],
    pub extent: Symmetric<f64>,
}

impl Costs {
    /// Refuses weights and scales that make no sense.
    pub fn check(&self) -> Result<(), TrainError> {
        for (key, value) in [
            ("surprise", self.surprise),
            ("error", self.error),
            ("shape", self.shape),
            ("score", self.score),
            ("foresight", self.foresight),
        ] {
            at_least(&format!("loss.{key}"), value, 0.0)?;
        }
        positive("loss.position", self.position)?;
        positive("loss.velocity", self.velocity)
    }

    /// The cost of a row of a step.
    pub fn of<'t>(&self, row: &[Variable<'t>], truth: &Truth) -> Variable<'t> {
        debug_assert_eq!(row.len(), STEP);
        let track = track(row);
        let e: [Variable<'t>; 4] = std::array::from_fn(|i| row[i] + -truth.state[i]);
        let (pp, rest) = (track.motion.place_covariance, track.motion.velocity_given_place());
        let place = [e[0], e[1]];
        let shift = track.motion.velocity_shift(place);
        let left = [e[2] - shift[0], e[3] - shift[1]];
        let square = pp.inverse().form(place, place) + rest.inverse().form(left, left);
        let surprise = (square + pp.determinant().ln() + rest.determinant().ln()) * 0.5;
        let of_place = (e[0] * e[0] + e[1] * e[1]) * (1.0 / (self.position * self.position));
        let of_velocity = (e[2] * e[2] + e[3] * e[3]) * (1.0 / (self.velocity * self.velocity));
        let found = self.of_extent([row[TRACK], row[TRACK + 1], row[14], row[15]], &truth.extent);
        let expected =
            self.of_extent([row[TRACK + 2], row[TRACK + 3], row[TRACK + 4], row[TRACK + 5]], &truth.extent);
        surprise * self.surprise + (of_place + of_velocity) * self.error + found + expected * self.foresight
    }

    /// Costs of an extent, of its angle, the logarithm of its weight, and those of its axes.
    fn of_extent<'t>(
        &self,
        [angle, ln_weight, along, across]: [Variable<'t>; 4],
        truth: &Symmetric<f64>,
    ) -> Variable<'t> {
        let size = truth.determinant().sqrt();
        let axes = [along, across].map(|axis| (axis * 2.0).exp());
        let zero = Variable::of(0.0);
        let extent = Symmetric { xx: axes[0], xy: zero, yy: axes[1] }.turned([angle.cos(), angle.sin()]);
        self.distance(&extent, truth) * (self.shape / size) + score(&extent, ln_weight, truth) * self.score
    }

    /// The squared Wasserstein distance of the shapes.
    fn distance<'t>(&self, extent: &Symmetric<Variable<'t>>, truth: &Symmetric<f64>) -> Variable<'t> {
        let product = extent.xx * truth.xx + extent.xy * (2.0 * truth.xy) + extent.yy * truth.yy;
        let root = (extent.determinant() * truth.determinant()).sqrt();
        extent.xx + extent.yy + (truth.xx + truth.yy) - (product + root * 2.0).sqrt() * 2.0
    }
}

/// Minus the logarithm of the density of the truth under an inverse Wishart belief, with the mean as given.
fn score<'t>(
    mean: &Symmetric<Variable<'t>>,
    ln_weight: Variable<'t>,
    truth: &Symmetric<f64>,
) -> Variable<'t> {
    let mean = Symmetric { xx: mean.xx.value(), xy: mean.xy.value(), yy: mean.yy.value() };
    let weight = ln_weight.exp();
    let freedom = weight + 6.0;
    let shifted = (freedom + -3.0) * 0.5;
    let trace = {
        let inverse = truth.inverse();
        mean.xx * inverse.xx + 2.0 * mean.xy * inverse.xy + mean.yy * inverse.yy
    };
    let ln_scale = ln_weight * 2.0 + mean.determinant().ln();
    // p(X) = |V|^s exp(-tr(V X⁻¹)/2) / (2^(2 s) Γ₂(s) |X|^(v/2)), s = (v - 3) / 2.
    let ln_density = shifted * ln_scale + weight * (-0.5 * trace)
        - shifted * (4.0_f64.ln())
        - shifted.ln_gamma()
        - (shifted + -0.5).ln_gamma()
        - freedom * (0.5 * truth.determinant().ln());
    -(ln_density + -0.5 * std::f64::consts::PI.ln())
}
