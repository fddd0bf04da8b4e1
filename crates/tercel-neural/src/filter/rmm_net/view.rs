//! A scan as the update sees it: its moments in a frame that the prediction and the scatter agree on.

use nalgebra::{Matrix2, Vector2};
use tercel_core::extended::Points;

use super::features::heading;
use super::hyper::Aligned;
use super::number::Symmetric;
use super::track::Track;

/// Moments of a scan of at least one point, relative to what was predicted. All of it counts as given in a training.
///
/// ## Definition
/// For points spread as `s X + R` around the centre, the likelihood of the angle of `X` given the scatter is von Mises in twice
/// the angle, but for what of `R` is not round. That of the course is nearly so. Their concentrations add up to that of the
/// frame:
/// ```text
/// κ_Z = s (a² - b²) / (4 |Y|) (Z_xx - Z_yy, 2 Z_xy)       κ_v = |v|² / (4 σ²) (cos 2χ, sin 2χ)
/// ```
/// with the predicted semi-axes `a, b`, the course `χ`, and the variance `σ²` of the velocity across it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Number of points.
    pub count: f64,
    /// Their mean, m.
    pub mean: [f64; 2],
    /// The unit vector of the frame.
    pub axis: [f64; 2],
    /// Deviations of the mean in the frame, m.
    pub deviations: [f64; 2],
    /// Scatter in the frame, its diagonal, m².
    pub scatter: [f64; 2],
    /// The element of the scatter beside it, m².
    pub lean_scatter: f64,
    /// Covariance of the sensor noise in the frame, its diagonal, m².
    pub noise: [f64; 2],
    /// Share of the extent in the covariance of points.
    pub scale: f64,
    /// What the scatter says of twice the angle.
    pub concentration: [f64; 2],
    /// What the course says of it.
    pub course: [f64; 2],
    /// The angle of the scatter, rad.
    pub lean: f64,
    /// Its deviation, rad; at most a right angle.
    pub lean_deviation: f64,
    /// Speed to which slower ones are lifted in errors of the direction, m/s.
    pub least_speed: f64,
}

/// Largest concentration: beyond it, an angle is known to better than anything needs.
const LARGEST: f64 = 1e8;

/// Largest deviation of an angle, rad.
const BLIND: f64 = std::f64::consts::FRAC_PI_2;

fn symmetric(matrix: &Matrix2<f64>) -> Symmetric<f64> {
    Symmetric { xx: matrix.m11, xy: 0.5 * (matrix.m12 + matrix.m21), yy: matrix.m22 }
}

/// A vector that is not longer than the largest concentration, and finite.
fn bounded(vector: [f64; 2]) -> [f64; 2] {
    let length = vector[0].hypot(vector[1]);
    if !length.is_finite() {
        return [0.0; 2];
    }
    let scale = (LARGEST / length.max(f64::MIN_POSITIVE)).min(1.0);
    vector.map(|x| x * scale)
}

impl View {
    /// A scan of at least one point, seen from a prediction; `noise` is that of the sensor, m², and `scale` the share of the
    /// extent in the covariance of points.
    pub fn new(
        options: &Aligned,
        prior: &Track<f64>,
        held: f64,
        points: &Points,
        (scale, noise): (f64, &Matrix2<f64>),
    ) -> Self {
        let count = points.count() as f64;
        let squares = prior.axes.map(|axis| (2.0 * axis).exp());
        let (scatter, noise) = (symmetric(&points.scatter()), symmetric(noise));
        let concentration = seen(&squares, &scatter, &noise, count, scale);
        let course = expected(options, prior, held);
        let double = [0, 1].map(|i| concentration[i] + course[i]);
        let angle = 0.5 * double[1].atan2(double[0]);
        // An ellipse has no front; the frame has that of the course.
        let front = heading(options, prior.motion.velocity, held);
        let sign = if front[0] * angle.cos() + front[1] * angle.sin() < 0.0 { -1.0 } else { 1.0 };
        let axis = [sign * angle.cos(), sign * angle.sin()];
        // The frame of the object: turned back by the angle.
        let within = |matrix: &Symmetric<f64>| matrix.turned([axis[0], -axis[1]]);
        let (own, around) = (within(&noise), within(&scatter));
        let own = [own.xx, own.yy];
        let deviations = [0, 1].map(|i| ((squares[i] * scale + own[i]) / count).sqrt());
        let length = concentration[0].hypot(concentration[1]);
        let lean_deviation = (0.5 / length.max(1e-6).sqrt()).min(BLIND);
        View {
            count,
            mean: [points.mean().x, points.mean().y],
            axis,
            deviations,
            scatter: [around.xx, around.yy],
            lean_scatter: around.xy,
            noise: own,
            scale,
            concentration,
            course,
            lean: 0.5 * concentration[1].atan2(concentration[0]),
            lean_deviation,
            least_speed: 0.1 * options.change,
        }
    }

    /// A vector of the plane in the frame.
    pub fn within(&self, v: [f64; 2]) -> [f64; 2] {
        [self.axis[0] * v[0] + self.axis[1] * v[1], self.axis[0] * v[1] - self.axis[1] * v[0]]
    }

    /// Writes what the encoder sees of each point: its place in the frame and the noise, in semi-axes.
    pub fn see_points(&self, prior: &Track<f64>, points: &Points, rows: &mut [f32]) {
        let axes = prior.axes.map(f64::exp);
        let noise = [0, 1].map(|i| (self.noise[i].sqrt() / axes[i]).min(FAR) as f32);
        for (row, point) in rows.as_chunks_mut::<POINT>().0.iter_mut().zip(points.points()) {
            let offset: Vector2<f64> = point - points.mean();
            let place = self.within([offset.x, offset.y]);
            let place = [0, 1].map(|i| (place[i] / axes[i]).clamp(-FAR, FAR) as f32);
            *row = [place[0], place[1], noise[0], noise[1]];
        }
    }
}

/// Numbers that the encoder sees of a point.
pub(super) const POINT: usize = 4;

/// Distance in semi-axes beyond which points look alike to the encoder.
const FAR: f64 = 8.0;

fn seen(
    squares: &[f64; 2],
    scatter: &Symmetric<f64>,
    noise: &Symmetric<f64>,
    count: f64,
    scale: f64,
) -> [f64; 2] {
    let round = 0.5 * (noise.xx + noise.yy);
    let spread = squares.map(|square| scale * square + round);
    let amplitude = 0.25 * scale * (squares[0] - squares[1]) / (spread[0] * spread[1]);
    // What of the noise is not round is taken out of the scatter.
    let free = count - 1.0;
    let difference = scatter.xx - scatter.yy - free * (noise.xx - noise.yy);
    bounded([amplitude * difference, amplitude * 2.0 * (scatter.xy - free * noise.xy)])
}

fn expected(options: &Aligned, prior: &Track<f64>, held: f64) -> [f64; 2] {
    let [x, y] = prior.motion.velocity;
    let square = x * x + y * y;
    if square < options.standing * options.standing {
        return [(2.0 * held).cos(), (2.0 * held).sin()];
    }
    let across = prior.motion.velocity_covariance.form([-y, x], [-y, x]);
    let weight = 0.25 * square / across.max(f64::MIN_POSITIVE);
    bounded([weight * (x * x - y * y), weight * 2.0 * x * y])
}
