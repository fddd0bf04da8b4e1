//! What the network of a liquid Kalman filter sees of an object, and what its outputs mean.

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use serde::{Deserialize, Serialize};
use tercel_core::belief::Gaussian;

use crate::filter::checked_positive;

/// What the network sees and says.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Form {
    /// What a straight motion misses, wherever the object is.
    Residual(Residual),
    /// The next state of the present one, as published.
    Absolute(Absolute),
}

/// The network sees the velocity and what the last measurement changed, and says what a straight motion misses and how sure
/// that is.
///
/// ## Definition
/// With the velocity `v`, the last correction `c` of the state, the last [`surprise`] `s`, the [`widths`] `w` of the belief and the
/// frame `R` of the heading (or of the state):
/// ```text
/// sees    |v| / velocity  (or v / velocity),   asinh(Rᵀ c / correction),   asinh(Rᵀ s),   ln(w / correction),
///         1 if there was a measurement, or 0
/// says    o = Rᵀ (position, velocity), l = logarithms of variances, held within ±10 by 10 tanh(l / 10)
/// dp = dt² / (2 interval²) acceleration interval² R o_p      dv = dt / interval · acceleration interval R o_v
/// Q  = R [(dt²/4) q_v + q_p   (dt/2) q_v] Rᵀ                 q_v = noise² dt / interval · exp l_v
///        [(dt/2) q_v          q_v       ]                    q_p = dt²/12 noise² dt / interval · exp l_p
/// ```
/// An output of zero is straight motion with white acceleration of density `noise² / interval`, for any `dt`. Below 1 m/s there
/// is no heading, and the frame is that of the state.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Residual {
    /// Whether the frame is that of the heading, in which a turn looks the same in all directions.
    pub heading: bool,
    /// Whether the network says the process noise.
    pub learned_noise: bool,
    /// Unit of velocities, m/s.
    pub velocity: f64,
    /// Units of corrections and widths of position and velocity, m and m/s.
    pub correction: [f64; 2],
    /// Unit of what the network says, m/s².
    pub acceleration: f64,
    /// Standard deviation of the change of velocity in an interval where the network says nothing, m/s per axis.
    pub noise: f64,
}

/// The network sees the state and says the next one, both within limits.
///
/// ## Definition
/// ```text
/// sees (x - minimum) / (maximum - minimum)      x⁻ = minimum + (maximum - minimum) o       Q = diag(noise) dt / interval
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Absolute {
    /// Least state, m and m/s.
    pub minimum: [f64; 4],
    /// Greatest state, m and m/s.
    pub maximum: [f64; 4],
    /// Variances of the process noise over an interval, m² and m²/s².
    pub noise: [f64; 4],
}

impl Default for Residual {
    fn default() -> Self {
        Residual {
            heading: true,
            learned_noise: true,
            velocity: 30.0,
            correction: [5.0, 2.0],
            acceleration: 2.0,
            noise: 1.0,
        }
    }
}

/// What is known of an object when it is predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Mean of the state.
    pub mean: Vector4<f64>,
    /// What the measurements of the last step changed.
    pub correction: Vector4<f64>,
    /// Whether there was one.
    pub measured: bool,
    /// How much they surprised.
    pub surprise: Vector2<f64>,
    /// How wide the belief is, m and m/s.
    pub widths: [f64; 2],
}

/// How much measurements surprised, by the belief before and after them: the innovation in the plane, in its standard deviations.
///
/// ## Definition
/// With the positions' means and covariances before (`p`, `P`) and after (`p'`, `P'`) an update by a position with innovation `ν` of
/// covariance `S`, `p' - p = P S⁻¹ ν` and `P - P' = P S⁻¹ P`, so that whatever was measured
/// ```text
/// s = (P - P')^(-1/2) (p' - p)          |s|² = νᵀ S⁻¹ ν
/// ```
/// Zero where nothing was learned.
pub fn surprise(before: &Gaussian<4>, after: &Gaussian<4>) -> Vector2<f64> {
    let learned: Matrix2<f64> = (before.covariance - after.covariance).fixed_view::<2, 2>(0, 0).into_owned();
    let correction = pair(&after.mean, 0) - pair(&before.mean, 0);
    let (determinant, trace) = (learned.determinant(), learned.trace());
    if !(determinant > 0.0 && trace > 0.0) {
        return Vector2::zeros();
    }
    // The root of a positive matrix of two rows, and its inverse, in closed form.
    let (root, length) = (determinant.sqrt(), (trace + 2.0 * determinant.sqrt()).sqrt());
    let inverse =
        Matrix2::new(learned[(1, 1)] + root, -learned[(0, 1)], -learned[(1, 0)], learned[(0, 0)] + root);
    inverse * correction / (root * length)
}

/// How wide a belief is: the standard deviation of its position (m) and of its velocity (m/s), as the geometric mean over all
/// directions.
pub fn widths(belief: &Gaussian<4>) -> [f64; 2] {
    let width = |first: usize| -> f64 {
        let covariance: Matrix2<f64> = belief.covariance.fixed_view::<2, 2>(first, first).into_owned();
        covariance.determinant().max(0.0).sqrt().sqrt()
    };
    [width(0), width(2)]
}

/// A prediction to first order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moved {
    /// Mean of the next state.
    pub mean: Vector4<f64>,
    /// Its derivative with respect to the state.
    pub jacobian: Matrix4<f64>,
    /// Process noise.
    pub noise: Matrix4<f64>,
}

impl Moved {
    /// The belief after the prediction.
    pub fn of(&self, before: &Gaussian<4>) -> Gaussian<4> {
        let covariance = self.jacobian * before.covariance * self.jacobian.transpose() + self.noise;
        Gaussian { mean: self.mean, covariance: 0.5 * (covariance + covariance.transpose()) }
    }
}

/// Lengths of a prediction: its time, and that in intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Time, s.
    pub dt: f64,
    /// The interval that the network was trained for, s.
    pub interval: f64,
}

impl Span {
    fn share(self) -> f64 {
        self.dt / self.interval
    }
}

/// A time as a network takes it that has learned one interval: in steps of about that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    pub steps: u32,
    /// Time of a step, s.
    pub each: f64,
    /// What is left after the most steps that are taken, s.
    pub rest: f64,
}

/// Most steps of a prediction: nobody knows where a manoeuvring object is after as many, and time must end.
const MOST: f64 = 300.0;

impl Cut {
    pub fn new(dt: f64, interval: f64) -> Self {
        match (dt / interval).round() {
            _ if dt == 0.0 => Cut { steps: 0, each: 0.0, rest: 0.0 },
            count if count > MOST => Cut { steps: MOST as u32, each: interval, rest: dt - MOST * interval },
            count if count > 1.0 => Cut { steps: count as u32, each: dt / count, rest: 0.0 },
            _ => Cut { steps: 1, each: dt, rest: 0.0 },
        }
    }
}

/// Speed below which there is no heading, m/s.
const STANDING: f64 = 1.0;

/// Largest logarithm of a variance.
const LIMIT: f64 = 10.0;

/// The axes of the heading, and how fast they turn with the velocity: `1/|v|`, or 0 where they do not.
#[derive(Debug, Clone, Copy)]
struct Axes {
    along: Vector2<f64>,
    across: Vector2<f64>,
    rate: f64,
}

impl Axes {
    fn new(velocity: Vector2<f64>, heading: bool) -> Self {
        let speed = velocity.norm();
        let turned = heading && speed >= STANDING && speed.is_finite();
        let (along, rate) = if turned { (velocity / speed, 1.0 / speed) } else { (Vector2::x(), 0.0) };
        Axes { along, across: Vector2::new(-along.y, along.x), rate }
    }

    /// A vector of the frame in that of the state.
    fn back(&self, v: [f64; 2]) -> Vector2<f64> {
        self.along * v[0] + self.across * v[1]
    }

    /// A covariance of independent components along the axes.
    fn spread(&self, variances: [f64; 2]) -> Matrix2<f64> {
        self.along * self.along.transpose() * variances[0]
            + self.across * self.across.transpose() * variances[1]
    }
}

fn pair(state: &Vector4<f64>, first: usize) -> Vector2<f64> {
    Vector2::new(state[first], state[first + 1])
}

impl Residual {
    fn inputs(&self) -> usize {
        if self.heading { 10 } else { 11 }
    }

    /// Units of position and velocity residuals.
    pub fn units(&self, span: Span) -> [f64; 2] {
        let (share, velocity) = (span.share(), self.acceleration * span.interval);
        [0.5 * velocity * span.interval * share * share, velocity * share]
    }

    fn see(&self, seen: &Seen, inputs: &mut [f32], tangents: &mut [f32]) {
        let velocity = pair(&seen.mean, 2);
        let axes = Axes::new(velocity, self.heading);
        let mut next = 0;
        let mut put = |value: f64, slopes: Vector2<f64>| {
            inputs[next] = value as f32;
            for (k, row) in tangents.chunks_exact_mut(self.inputs()).enumerate() {
                row[next] = slopes[k] as f32;
            }
            next += 1;
        };
        if self.heading {
            // Where nothing has a heading, the speed has no derivative either.
            let slope = if axes.rate > 0.0 { axes.along } else { Vector2::zeros() };
            put(velocity.norm() / self.velocity, slope / self.velocity);
        } else {
            put(velocity.x / self.velocity, Vector2::x() / self.velocity);
            put(velocity.y / self.velocity, Vector2::y() / self.velocity);
        }
        let [place, velocity] = [0, 1].map(|i| pair(&seen.correction, 2 * i) / self.correction[i]);
        for seen in [place, velocity, seen.surprise] {
            let (a, b) = (axes.along.dot(&seen), axes.across.dot(&seen));
            let turn = axes.across * axes.rate;
            put(a.asinh(), turn * b / a.hypot(1.0));
            put(b.asinh(), -turn * a / b.hypot(1.0));
        }
        for (width, unit) in seen.widths.into_iter().zip(self.correction) {
            put((width / unit).ln().clamp(-LIMIT, LIMIT), Vector2::zeros());
        }
        put(f64::from(u8::from(seen.measured)), Vector2::zeros());
    }

    fn moved(&self, seen: &Seen, outputs: &[f32], tangents: &[f32], span: Span) -> Moved {
        let axes = Axes::new(pair(&seen.mean, 2), self.heading);
        let said = |i: usize| f64::from(outputs[i]);
        let mut moved = straight(&seen.mean, span);
        for (first, unit) in [0, 2].into_iter().zip(self.units(span)) {
            let (a, b) = (said(first), said(first + 1));
            let mut mean = moved.mean.fixed_rows_mut::<2>(first);
            mean += axes.back([a, b]) * unit;
            // The axes turn with the velocity: along into across, across into the reverse of along.
            let turned = axes.back([-b, a]) * axes.rate;
            for (k, slopes) in tangents.chunks_exact(outputs.len()).enumerate() {
                let own = axes.back([f64::from(slopes[first]), f64::from(slopes[first + 1])]);
                let mut column = moved.jacobian.fixed_view_mut::<2, 1>(first, 2 + k);
                column += (own + turned * axes.across[k]) * unit;
            }
        }
        moved.noise = self.noise(&axes, outputs, span);
        moved
    }

    fn noise(&self, axes: &Axes, outputs: &[f32], span: Span) -> Matrix4<f64> {
        let said = |i: usize| outputs.get(4 + i).map_or(0.0, |said| f64::from(*said));
        self.spread(axes, [0, 1, 2, 3].map(|i| (LIMIT * (said(i) / LIMIT).tanh()).exp()), span)
    }

    /// The process noise with these factors of the variances, of position and velocity along and across.
    fn spread(&self, axes: &Axes, factors: [f64; 4], span: Span) -> Matrix4<f64> {
        let unit = self.noise * self.noise * span.share();
        let own = unit * span.dt * span.dt / 12.0;
        let position = axes.spread([own * factors[0], own * factors[1]]);
        let velocity = axes.spread([unit * factors[2], unit * factors[3]]);
        let mut noise = Matrix4::zeros();
        noise.fixed_view_mut::<2, 2>(0, 0).copy_from(&(position + velocity * (0.25 * span.dt * span.dt)));
        noise.fixed_view_mut::<2, 2>(0, 2).copy_from(&(velocity * (0.5 * span.dt)));
        noise.fixed_view_mut::<2, 2>(2, 0).copy_from(&(velocity * (0.5 * span.dt)));
        noise.fixed_view_mut::<2, 2>(2, 2).copy_from(&velocity);
        noise
    }

    fn noise_slope(&self, axes: &Axes, said: f64, number: usize, span: Span) -> Matrix4<f64> {
        let bent = (said / LIMIT).tanh();
        let mut factors = [0.0; 4];
        factors[number] = (LIMIT * bent).exp() * (1.0 - bent * bent);
        self.spread(axes, factors, span)
    }
}

impl Absolute {
    fn range(&self, i: usize) -> f64 {
        self.maximum[i] - self.minimum[i]
    }

    /// The state within the limits, from 0 to 1.
    pub fn normalised(&self, state: &Vector4<f64>) -> [f32; 4] {
        std::array::from_fn(|i| ((state[i] - self.minimum[i]) / self.range(i)) as f32)
    }

    fn see(&self, seen: &Seen, inputs: &mut [f32], tangents: &mut [f32]) {
        inputs.copy_from_slice(&self.normalised(&seen.mean));
        for (k, row) in tangents.chunks_exact_mut(4).enumerate() {
            row.fill(0.0);
            row[k] = (1.0 / self.range(k)) as f32;
        }
    }

    fn moved(&self, outputs: &[f32], tangents: &[f32], span: Span) -> Moved {
        let of = |i: usize, said: f32| self.range(i) * f64::from(said);
        let mut jacobian = Matrix4::zeros();
        for (k, slopes) in tangents.chunks_exact(4).enumerate() {
            jacobian.set_column(k, &Vector4::from_fn(|i, _| of(i, slopes[i])));
        }
        let mean = Vector4::from_fn(|i, _| self.minimum[i] + of(i, outputs[i]));
        Moved { mean, jacobian, noise: Matrix4::from_diagonal(&(Vector4::from(self.noise) * span.share())) }
    }
}

impl Form {
    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        match self {
            Form::Residual(form) => form.inputs(),
            Form::Absolute(_) => 4,
        }
    }

    /// Width of an output row.
    pub fn outputs(&self) -> usize {
        match self {
            Form::Residual(form) if form.learned_noise => 8,
            _ => 4,
        }
    }

    /// The components of the state on which the inputs depend.
    pub fn directions(&self) -> std::ops::Range<usize> {
        match self {
            Form::Residual(_) => 2..4,
            Form::Absolute(_) => 0..4,
        }
    }

    /// Writes what the network sees of an object, and the derivatives with respect to [`directions`](Form::directions), one row
    /// each, if there is room for them.
    ///
    /// # Panics
    /// When a row is shorter than [`inputs`](Form::inputs).
    pub fn see(&self, seen: &Seen, inputs: &mut [f32], tangents: &mut [f32]) {
        match self {
            Form::Residual(form) => form.see(seen, inputs, tangents),
            Form::Absolute(form) => form.see(seen, inputs, tangents),
        }
    }

    /// The prediction that outputs mean. Without `tangents` its Jacobian is that of an output that stays.
    ///
    /// # Panics
    /// When a row is shorter than [`outputs`](Form::outputs).
    pub fn moved(&self, seen: &Seen, outputs: &[f32], tangents: &[f32], span: Span) -> Moved {
        match self {
            Form::Residual(form) => form.moved(seen, outputs, tangents, span),
            Form::Absolute(form) => form.moved(outputs, tangents, span),
        }
    }

    /// The derivative of the process noise with respect to the logarithm of a variance, of which `number` counts the outputs
    /// after the fourth: what a training needs. Zero where the network does not say the noise.
    ///
    /// # Panics
    /// When the row is shorter than [`outputs`](Form::outputs).
    pub fn noise_slope(
        &self,
        mean: &Vector4<f64>,
        outputs: &[f32],
        number: usize,
        span: Span,
    ) -> Matrix4<f64> {
        match self {
            Form::Residual(form) if form.learned_noise => {
                let axes = Axes::new(pair(mean, 2), form.heading);
                form.noise_slope(&axes, f64::from(outputs[4 + number]), number, span)
            }
            _ => Matrix4::zeros(),
        }
    }

    /// The prediction without the network: straight motion.
    pub fn straight(&self, mean: &Vector4<f64>, span: Span) -> Moved {
        let noise = match self {
            Form::Residual(form) => form.noise(&Axes::new(pair(mean, 2), false), &[], span),
            Form::Absolute(form) => Matrix4::from_diagonal(&(Vector4::from(form.noise) * span.share())),
        };
        Moved { noise, ..straight(mean, span) }
    }

    pub(super) fn check(&self) -> Result<(), String> {
        match self {
            Form::Residual(form) => checked_positive(&[
                ("form.velocity", form.velocity),
                ("form.correction[0]", form.correction[0]),
                ("form.correction[1]", form.correction[1]),
                ("form.acceleration", form.acceleration),
                ("form.noise", form.noise),
            ]),
            Form::Absolute(form) => {
                for i in 0..4 {
                    let (low, high) = (form.minimum[i], form.maximum[i]);
                    if !(low.is_finite() && high.is_finite() && low < high) {
                        let place = format!("`form.minimum[{i}]` is {low} and `form.maximum[{i}]` {high}");
                        return Err(format!("{place}; expected finite numbers, the second above the first"));
                    }
                    checked_positive(&[(&format!("form.noise[{i}]"), form.noise[i])])?;
                }
                Ok(())
            }
        }
    }
}

/// Straight motion without noise.
fn straight(mean: &Vector4<f64>, span: Span) -> Moved {
    let mut jacobian = Matrix4::identity();
    (jacobian[(0, 2)], jacobian[(1, 3)]) = (span.dt, span.dt);
    Moved { mean: jacobian * mean, jacobian, noise: Matrix4::zeros() }
}
