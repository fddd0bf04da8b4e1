//! What an estimate costs, given the truth.

use serde::Deserialize;
use tercel_neural::filter::rmm_net::{Number, Symmetric};

use super::rows::Estimate;
use crate::TrainError;
use crate::check::{at_least, positive};
use crate::tape::Variable;

/// The section `[loss]`.
///
/// ## Definition
/// ```text
/// L = s · (eᵀ P⁻¹ e + ln |P|) / 2 + m · (|e_p|² / p² + |e_v|² / v²)
///   + g · d²(X̂, X) / a² + w · -ln p(X; X̂, λ) + f · the last two of the extent that was expected
///   + q · (|e|² + x |X̂ - X|²) / 2                       as published (eq. 37), with x = 1
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
    /// Weight `q` of the loss of the publication.
    pub squares: f64,
    /// Weight `x` of squared errors of the extent in it, 1/m².
    pub extent: f64,
    /// Steps between cuts of the back-propagation; 0 cuts nothing.
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
            squares: 0.0,
            extent: 1.0,
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

impl Truth {
    /// The same with the position relative to an origin.
    pub fn from(&self, origin: [f64; 2]) -> Self {
        let [x, y, vx, vy] = self.state;
        Truth { state: [x - origin[0], y - origin[1], vx, vy], ..*self }
    }
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
            ("squares", self.squares),
            ("extent", self.extent),
        ] {
            at_least(&format!("loss.{key}"), value, 0.0)?;
        }
        positive("loss.position", self.position)?;
        positive("loss.velocity", self.velocity)
    }

    /// The cost of an estimate.
    pub fn of<'t>(&self, found: &Estimate<Variable<'t>>, truth: &Truth) -> Variable<'t> {
        let motion = &found.motion;
        let off = |found: [Variable<'t>; 2], first: usize| {
            [found[0] + -truth.state[first], found[1] + -truth.state[first + 1]]
        };
        let (place, velocity) = (off(motion.place, 0), off(motion.velocity, 2));
        // The velocity is judged where the position is known.
        let (pp, rest) = (motion.place_covariance, motion.velocity_given_place());
        let shift = motion.velocity_shift(place);
        let left = [velocity[0] - shift[0], velocity[1] - shift[1]];
        let square = pp.inverse().form(place, place) + rest.inverse().form(left, left);
        let surprise = (square + pp.determinant().ln() + rest.determinant().ln()) * 0.5;
        let [place, velocity] = [place, velocity].map(|e| e[0] * e[0] + e[1] * e[1]);
        let [p, v] = [self.position, self.velocity].map(|unit| 1.0 / (unit * unit));
        let mut cost = surprise * self.surprise
            + (place * p + velocity * v) * self.error
            + self.of_extent(&found.extent, found.ln_weight, truth);
        if let Some((extent, ln_weight)) = &found.expected {
            cost = cost + self.of_extent(extent, *ln_weight, truth) * self.foresight;
        }
        if self.squares > 0.0 {
            let x = &found.extent;
            let off = [x.xx + -truth.extent.xx, x.xy + -truth.extent.xy, x.yy + -truth.extent.yy];
            let norm = off[0] * off[0] + off[1] * off[1] * 2.0 + off[2] * off[2];
            cost = cost + (place + velocity + norm * self.extent) * (0.5 * self.squares);
        }
        cost
    }

    fn of_extent<'t>(
        &self,
        extent: &Symmetric<Variable<'t>>,
        ln_weight: Variable<'t>,
        truth: &Truth,
    ) -> Variable<'t> {
        let size = truth.extent.determinant().sqrt();
        distance(extent, &truth.extent) * (self.shape / size)
            + score(extent, ln_weight, &truth.extent) * self.score
    }
}

/// The squared Wasserstein distance of the shapes.
pub fn distance<T: Number>(extent: &Symmetric<T>, truth: &Symmetric<f64>) -> T {
    let product = extent.xx * truth.xx + extent.xy * (2.0 * truth.xy) + extent.yy * truth.yy;
    let root = (extent.determinant() * truth.determinant()).sqrt();
    extent.xx + extent.yy + (truth.xx + truth.yy) + -((product + root * 2.0).sqrt() * 2.0)
}

/// Minus the logarithm of the density of the truth under an inverse Wishart belief, with the mean as given.
pub fn score<'t>(
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
