//! The form of the publication: a random matrix in the frame of the plane, with learned compensations.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};
use tercel_core::extended::Points;

use super::kinematics::Kinematics;
use super::number::{Number, Symmetric, within};
use crate::filter::checked_positive;
use crate::layer::LayerShape;

/// The form of the publication: Lan and Li's random matrix with a memory and learned terms in prediction and update, in the frame
/// of the plane.
///
/// ## Recursion
/// With the memory `c` of the last estimates, `λ = v - 6` and the extent `X̂ = V/λ`:
/// ```text
/// x⁻ = F x + Δ_f(c)           P⁻ = F P Fᵀ + Q + P_f(c)              (eqs. 25, 26)
/// X̂⁻ = δ A X̂ Aᵀ + P_φ(c)      v⁻ by eq. 32                          (eq. 33)
/// S = H P⁻ Hᵀ + B X̂⁻ Bᵀ/n + P_h(c, scan),     ε = z̄ - H x⁻ - Δ_h    (eqs. 29, 31)
/// V = V⁻ + N + B⁻¹ Z B⁻ᵀ,     N = X̂^½ S^-½ ε εᵀ S^-½ X̂^½,   v = v⁻ + n     (eqs. 34, 35)
/// ```
///
/// ## Reference
/// RMMNet paper, theorem 2 and section III-C. Deviations: eqs. 31 and 35 with the factors that their dimensions need; the position
/// is not among the inputs, since it has no bounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Published {
    /// Deviation of the white acceleration, m/s² per axis.
    pub acceleration: f64,
    /// Unit of velocities, m/s.
    pub velocity: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// Degrees of freedom of the extent of a new object, above 6.
    pub freedom: f64,
    /// Roots of the diagonal of its scale matrix, m.
    pub axes: [f64; 2],
    /// Degrees of freedom of the next extent.
    pub delta: f64,
    /// How the extent goes on.
    pub transition: Transition,
    /// Whether the degrees of freedom shrink as printed, rather than by the exact variance.
    pub printed: bool,
    /// Whether scale and sensor noise are inside the matrix `B`, which is one otherwise.
    pub distorted: bool,
    /// Which blocks there are.
    pub blocks: Blocks,
}

/// How the extent of the form of the publication goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Transition {
    /// `A = I/δ`, as printed: it shrinks by the factor `δ`, and the learned term makes up for it.
    Shrinking,
    /// `A = I/√δ`: its mean stays.
    Keeping,
    /// The same with a learned rotation and scaling.
    Turning,
}

/// The blocks of the form of the publication, of which each can be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Blocks {
    /// The memory (MUB). Without it the last estimate takes its place.
    pub memory: bool,
    /// The compensation of the prediction (JPB).
    pub prediction: bool,
    /// The compensation of the update (JUB).
    pub update: bool,
}

impl Default for Blocks {
    fn default() -> Self {
        Blocks { memory: true, prediction: true, update: true }
    }
}

impl Default for Published {
    fn default() -> Self {
        Published {
            acceleration: 1.0,
            velocity: 3.0,
            speed: 5.0,
            freedom: 7.0,
            axes: [10.0, 3.0],
            delta: 5.0,
            transition: Transition::Shrinking,
            printed: true,
            distorted: false,
            blocks: Blocks::default(),
        }
    }
}

/// Numbers that are seen of an estimate.
pub const ESTIMATE_SEEN: usize = 5;

/// Numbers that are seen of a scan besides the memory.
pub const SCAN_SEEN: usize = 11;

/// Numbers that are said about the mean and the covariance of the motion, the extent and a scan.
pub const SAID: [usize; 4] = [4, 16, 7, 6];

/// Numbers that are said about a prediction.
pub const PREDICTED: usize = SAID[0] + SAID[1] + SAID[2];

/// Names of the networks of the prediction.
pub const PREDICTIONS: [&str; 3] = ["mean", "covariance", "extent"];

/// Largest degrees of freedom of an extent.
const FREEST: f64 = 200.0;

/// Factor of the step of the learned scaling of the axes.
const SCALING: f64 = 0.5;

/// What the recursion of the form of the publication carries: the state, the mean extent and its weight `λ`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extended<T> {
    /// The state.
    pub motion: Kinematics<T>,
    /// The mean extent, m².
    pub extent: Symmetric<T>,
    /// Its weight.
    pub weight: T,
}

/// What a scan of at least one point says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Number of points.
    pub count: f64,
    /// Their mean, m.
    pub mean: [f64; 2],
    /// Their scatter, m².
    pub scatter: Symmetric<f64>,
    /// Covariance of the sensor noise, m².
    pub noise: Symmetric<f64>,
    /// Share of the extent in the covariance of points.
    pub scale: f64,
}

impl Moments {
    /// Those of points, for a sensor with this scale and noise (m²).
    pub fn new(points: &Points, scale: f64, noise: &Matrix2<f64>) -> Self {
        let symmetric = |m: &Matrix2<f64>| Symmetric { xx: m.m11, xy: m.m12, yy: m.m22 };
        Moments {
            count: points.count() as f64,
            mean: [points.mean().x, points.mean().y],
            scatter: symmetric(&points.scatter()),
            noise: symmetric(noise),
            scale,
        }
    }
}

/// `D L Lᵀ D` with a square factor of any numbers and units on the diagonal of `D`.
fn square<T: Number, const N: usize>(factor: &[T], units: [f64; N]) -> [[T; N]; N] {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let mut sum = T::of(0.0);
            for k in 0..N {
                sum = sum + factor[N * i + k] * factor[N * j + k];
            }
            sum * (units[i] * units[j])
        })
    })
}

fn planar<T: Number>(matrix: [[T; 2]; 2]) -> Symmetric<T> {
    Symmetric { xx: matrix[0][0], xy: matrix[0][1], yy: matrix[1][1] }
}

impl Published {
    /// The layers of the network with so many units.
    pub(super) fn layers(&self, units: usize) -> Vec<(String, LayerShape)> {
        let linear = |name: &str, inputs, outputs| (name.to_owned(), LayerShape::Linear { inputs, outputs });
        let Blocks { memory, prediction, update } = self.blocks;
        let (seen, context) = (self.seen(units), self.context(units));
        let mut layers = Vec::new();
        if memory {
            layers.push(("memory".to_owned(), LayerShape::Lstm { inputs: ESTIMATE_SEEN, size: units }));
        }
        if prediction {
            for (name, said) in PREDICTIONS.into_iter().zip(SAID) {
                layers.push(linear(&format!("{name}.hidden"), seen, units));
                layers.push(linear(&format!("{name}.output"), units, said));
            }
        }
        if update {
            layers.push(linear("update.hidden", SCAN_SEEN + context, units));
            layers.push(linear("update.output", units, SAID[3]));
        }
        layers
    }

    /// Width of what stands for the past in an update: the memory, or the last estimate.
    pub fn context(&self, units: usize) -> usize {
        if self.blocks.memory { units } else { ESTIMATE_SEEN }
    }

    /// Width of what a prediction sees.
    pub fn seen(&self, units: usize) -> usize {
        if self.blocks.memory { units + ESTIMATE_SEEN } else { ESTIMATE_SEEN }
    }

    /// Unit of extents, m².
    fn size(&self) -> f64 {
        self.axes[0] * self.axes[1]
    }

    /// The extent of a new object, and its weight.
    pub fn first_extent(&self) -> (Symmetric<f64>, f64) {
        let weight = self.freedom - 6.0;
        let squares = self.axes.map(|axis| axis * axis / weight);
        (Symmetric { xx: squares[0], xy: 0.0, yy: squares[1] }, weight)
    }

    /// The covariance of a point around the centre.
    fn spread<T: Number>(&self, extent: &Symmetric<T>, seen: &Moments) -> Symmetric<T> {
        if !self.distorted {
            return *extent;
        }
        extent.scaled(T::of(seen.scale)).plus(&Symmetric::constant(&seen.noise))
    }

    /// Writes what is seen of an estimate.
    ///
    /// # Panics
    /// When the row is shorter than that.
    pub fn see_estimate(&self, estimate: &Extended<f64>, row: &mut [f32]) {
        let ([vx, vy], x, unit) = (estimate.motion.velocity, &estimate.extent, self.size());
        let seen = [vx / self.velocity, vy / self.velocity, x.xx / unit, x.xy / unit, x.yy / unit];
        row.iter_mut().zip(seen).for_each(|(row, seen)| *row = bent(seen));
    }

    /// Writes what is seen of a scan, given the prediction.
    ///
    /// # Panics
    /// When the row is shorter than that.
    pub fn see_scan(&self, prior: &Extended<f64>, seen: &Moments, row: &mut [f32]) {
        self.see_estimate(prior, &mut row[..ESTIMATE_SEEN]);
        let (unit, scatter) = (self.size(), seen.scatter.scaled(1.0 / seen.count));
        let residual = [0, 1].map(|i| (seen.mean[i] - prior.motion.place[i]) / unit.sqrt());
        let rest = [
            residual[0],
            residual[1],
            scatter.xx / unit,
            scatter.xy / unit,
            scatter.yy / unit,
            seen.count.ln(),
        ];
        row[ESTIMATE_SEEN..].iter_mut().zip(rest).for_each(|(row, seen)| *row = bent(seen));
    }

    pub(super) fn check(&self) -> Result<(), String> {
        checked_positive(&[
            ("form.acceleration", self.acceleration),
            ("form.velocity", self.velocity),
            ("form.speed", self.speed),
            ("form.freedom", self.freedom),
            ("form.axes[0]", self.axes[0]),
            ("form.axes[1]", self.axes[1]),
            ("form.delta", self.delta),
        ])?;
        for (name, value, least) in [("freedom", self.freedom, 6.0), ("delta", self.delta, 1.0)] {
            if value <= least {
                return Err(format!("`form.{name}` is {value}; expected more than {least}"));
            }
        }
        Ok(())
    }
}

/// Sizes that may be large, by their logarithm.
fn bent(value: f64) -> f32 {
    value.asinh() as f32
}

impl<T: Number> Extended<T> {
    /// The prediction over `dt` seconds. Outputs of zero are the filter of Lan and Li in straight motion.
    pub fn predict(&self, options: &Published, said: &[T], dt: f64) -> Self {
        let before = &self.motion;
        let jump = options.acceleration * dt;
        let units = [0.5 * jump * dt, 0.5 * jump * dt, jump, jump];
        let place =
            std::array::from_fn(|i| before.place[i] + before.velocity[i] * dt + said[i] * (jump * dt));
        let velocity = std::array::from_fn(|i| before.velocity[i] + said[2 + i] * jump);
        let learned = square::<T, 4>(&said[4..20], units);
        let (pp, pv, vv) = (&before.place_covariance, &before.cross, &before.velocity_covariance);
        let of_velocity = [[vv.xx, vv.xy], [vv.xy, vv.yy]];
        // The published noise is that of a piecewise constant acceleration, alike and independent on both axes.
        let own = |i: usize, j: usize, a: usize, b: usize| if i == j { units[a] * units[b] } else { 0.0 };
        let of_place = |i: usize, j: usize| {
            let old = [[pp.xx, pp.xy], [pp.xy, pp.yy]][i][j];
            old + (pv[i][j] + pv[j][i]) * dt + of_velocity[i][j] * (dt * dt) + learned[i][j] + own(i, j, 0, 0)
        };
        let place_covariance = Symmetric { xx: of_place(0, 0), xy: of_place(0, 1), yy: of_place(1, 1) };
        let cross = std::array::from_fn(|i| {
            std::array::from_fn(|j| pv[i][j] + of_velocity[i][j] * dt + learned[i][2 + j] + own(i, j, 0, 2))
        });
        let after = |i: usize, j: usize| of_velocity[i][j] + learned[2 + i][2 + j] + own(i, j, 2, 2);
        let velocity_covariance = Symmetric { xx: after(0, 0), xy: after(0, 1), yy: after(1, 1) };
        let motion = Kinematics { place, velocity, place_covariance, cross, velocity_covariance };
        Extended { motion, extent: self.next_extent(options, &said[20..]), weight: self.next_weight(options) }
    }

    fn next_extent(&self, options: &Published, said: &[T]) -> Symmetric<T> {
        let unit = options.size().sqrt();
        let learned = planar(square::<T, 2>(&said[..4], [unit; 2]));
        let kept = match options.transition {
            Transition::Shrinking => self.extent.scaled(T::of(1.0 / options.delta)),
            Transition::Keeping => self.extent,
            Transition::Turning => {
                let [x, y] = [said[5], said[6]].map(|scale| (within(scale, 1.0) * SCALING).exp());
                let e = &self.extent;
                let scaled = Symmetric { xx: e.xx * x * x, xy: e.xy * x * y, yy: e.yy * y * y };
                let angle = within(said[4], 2.0);
                scaled.turned([angle.cos(), angle.sin()])
            }
        };
        kept.plus(&learned)
    }

    fn next_weight(&self, options: &Published) -> T {
        // Below a weight of one the printed formula turns round and grows without bound.
        let (w, delta) = (super::number::clamped(self.weight, 1.0, f64::INFINITY), options.delta);
        if options.printed {
            let product = (w + 1.0) * (w + -1.0) * (w + -2.0);
            product * (2.0 * delta) / (w * w * (w + delta)) + 2.0
        } else {
            (w + -2.0) * delta / (w + delta) + 2.0
        }
    }

    /// The update with a scan of at least one point. Outputs of zero are that of Lan and Li.
    pub fn update(&self, options: &Published, seen: &Moments, said: &[T]) -> Self {
        let unit = options.size().sqrt() / 10.0;
        let spread = options.spread(&self.extent, seen);
        let learned = planar(square::<T, 2>(&said[2..6], [unit; 2]));
        let noise = spread.scaled(T::of(1.0 / seen.count)).plus(&learned);
        let residual: [T; 2] =
            std::array::from_fn(|i| -(self.motion.place[i] + said[i] * unit) + seen.mean[i]);
        let innovation = self.motion.place_covariance.plus(&noise);
        let half = self.extent.root();
        let offset = half.times(innovation.root().inverse().times(residual));
        let scatter = Symmetric::constant(&seen.scatter);
        let scatter = if options.distorted {
            scatter.between(&half.product(&spread.root().inverse()))
        } else {
            scatter
        };
        let squares = Symmetric {
            xx: offset[0] * offset[0] + scatter.xx,
            xy: offset[0] * offset[1] + scatter.xy,
            yy: offset[1] * offset[1] + scatter.yy,
        };
        let total = self.weight + seen.count;
        let extent = self.extent.scaled(self.weight / total).plus(&squares.scaled(T::of(1.0) / total));
        let mut motion = self.motion;
        motion.see_place(residual, &noise);
        let weight = super::number::clamped(total, 0.0, FREEST - 6.0);
        Extended { motion, extent, weight }
    }
}
