//! What the network sees and says, over numbers that are plain at run time and record themselves in a training.

use nalgebra::Matrix2;
use tercel_core::extended::Points;

use super::hyper::{ExtentNetHyper, Frame};
use crate::filter::rmm_net::{Number, Symmetric, within};

/// Numbers of a state and extent, in the order of [`Told::numbers`].
pub const TOLD: usize = 7;

/// Numbers that say how sure these are.
pub const DOUBTED: usize = 3;

/// Numbers that the network sees.
pub const SEEN: usize = 14;

/// Logarithms of deviations stay within this.
const LOGARITHM: f64 = 8.0;

/// The logarithm of the weight of the extent, in points, where the network says nothing, and how far it goes from there.
const WEIGHT: (f64, f64) = (3.4, 5.0);

/// Least element on the diagonal of the factor of the extent, in its unit.
const LEAST: f64 = 1e-3;

/// Share of an interval below which two scans say nothing of a velocity.
const MOMENT: f64 = 0.1;

/// State and extent of an object, relative to an origin: that of the absolute frame, or the last centroid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Told<T> {
    /// Position, m.
    pub place: [T; 2],
    /// Velocity, m/s.
    pub velocity: [T; 2],
    /// Lower triangular factor of the extent: first row, then second, m.
    pub factor: [T; 3],
}

/// How sure a state and extent are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doubt<T> {
    /// Logarithm of the standard deviation of the position in metres, per axis.
    pub ln_place: T,
    /// The same of the velocity in m/s.
    pub ln_velocity: T,
    /// Logarithm of the weight of the extent, in points.
    pub ln_weight: T,
}

/// What is seen of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scan {
    /// The centroid, relative to the origin of the state before, m.
    pub centre: [f64; 2],
    /// Mean square of the points around it, m².
    pub scatter: Symmetric<f64>,
    /// Number of points.
    pub count: f64,
    /// Time since the last scan with points, s.
    pub elapsed: f64,
    /// The centroid of that, relative to the same origin, m.
    pub before: [f64; 2],
}

impl Scan {
    /// What is seen of these points, `elapsed` seconds after the last ones, whose centroid was at `before`.
    pub fn new(points: &Points, origin: [f64; 2], before: [f64; 2], elapsed: f64) -> Self {
        let (mean, count) = (points.mean(), points.count().max(1) as f64);
        let scatter: Matrix2<f64> = points.scatter() / count;
        Scan {
            centre: [mean.x - origin[0], mean.y - origin[1]],
            scatter: Symmetric { xx: scatter.m11, xy: scatter.m12, yy: scatter.m22 },
            count,
            elapsed,
            before: [before[0] - origin[0], before[1] - origin[1]],
        }
    }
}

impl<T: Number> Told<T> {
    /// The numbers of a state and extent: position, velocity, factor.
    pub fn numbers(&self) -> [T; TOLD] {
        let ([x, y], [u, v], [a, b, c]) = (self.place, self.velocity, self.factor);
        [x, y, u, v, a, b, c]
    }

    /// The state and extent of such numbers.
    ///
    /// # Panics
    /// When there are fewer.
    pub fn of(row: &[T]) -> Self {
        Told { place: [row[0], row[1]], velocity: [row[2], row[3]], factor: [row[4], row[5], row[6]] }
    }

    /// The extent.
    pub fn extent(&self) -> Symmetric<T> {
        let [a, b, c] = self.factor;
        Symmetric::of_factor(a, b, c)
    }

    /// The same after this time, in s.
    pub fn moved(&self, dt: f64) -> Self {
        let place = [0, 1].map(|i| self.place[i] + self.velocity[i] * dt);
        Told { place, ..*self }
    }
}

/// `ln(1 + eˣ)`.
fn softplus<T: Number>(x: T) -> T {
    if x.value() > 30.0 { x } else { (x.exp() + 1.0).ln() }
}

impl ExtentNetHyper {
    /// Mean velocity of the centroid since the last scan, m/s; that of the object where this is too short ago.
    fn way<T: Number>(&self, prior: &Told<T>, scan: &Scan) -> [T; 2] {
        if scan.elapsed < MOMENT * self.interval {
            return prior.velocity;
        }
        [0, 1].map(|i| T::of((scan.centre[i] - scan.before[i]) / scan.elapsed))
    }

    /// What the network sees of a scan and of the state that was expected at its time.
    pub fn see<T: Number>(&self, prior: &Told<T>, scan: &Scan) -> [T; SEEN] {
        let (place, velocity) = (1.0 / self.position, 1.0 / self.velocity);
        let [own, other] = match self.frame {
            Frame::Absolute => [
                prior.place.map(|x| x * place), //
                scan.centre.map(|x| T::of(x * place)),
            ],
            Frame::Residual => {
                let way = self.way(prior, scan);
                [
                    [0, 1].map(|i| (prior.place[i] + -scan.centre[i]) * place),
                    [0, 1].map(|i| (prior.velocity[i] - way[i]) * (1.0 / self.change)),
                ]
            }
        };
        let [u, v] = prior.velocity.map(|v| v * velocity);
        let [a, b, c] = prior.factor.map(|x| x * (1.0 / self.extent));
        let square = 1.0 / (self.extent * self.extent);
        let scatter = [scan.scatter.xx, scan.scatter.xy, scan.scatter.yy].map(|x| T::of(x * square));
        let elapsed = (scan.elapsed / self.interval).max(MOMENT).ln();
        let [p, q, r] = scatter;
        let (count, elapsed) = (T::of(scan.count.ln()), T::of(elapsed));
        [own[0], own[1], u, v, a, b, c, other[0], other[1], p, q, r, count, elapsed]
    }

    /// The state and extent that the network says, relative to the origin of the scan.
    ///
    /// # Panics
    /// When there are fewer than [`TOLD`] numbers.
    pub fn told<T: Number>(&self, prior: &Told<T>, scan: &Scan, said: &[T]) -> Told<T> {
        let (place, velocity) = match self.frame {
            Frame::Absolute => {
                ([0, 1].map(|i| said[i] * self.position), [2, 3].map(|i| said[i] * self.velocity))
            }
            Frame::Residual => {
                let way = self.way(prior, scan);
                (
                    [0, 1].map(|i| said[i] * self.position + scan.centre[i]),
                    [0, 1].map(|i| said[2 + i] * self.change + way[i]),
                )
            }
        };
        let diagonal = |x: T| (softplus(x) + LEAST) * self.extent;
        Told { place, velocity, factor: [diagonal(said[4]), said[5] * self.extent, diagonal(said[6])] }
    }

    /// How sure the network says it is.
    ///
    /// # Panics
    /// When there are fewer than [`DOUBTED`] numbers.
    pub fn doubt<T: Number>(&self, said: &[T]) -> Doubt<T> {
        let velocity = match self.frame {
            Frame::Absolute => self.velocity,
            Frame::Residual => self.change,
        };
        Doubt {
            ln_place: within(said[0], LOGARITHM) + self.position.ln(),
            ln_velocity: within(said[1], LOGARITHM) + velocity.ln(),
            ln_weight: within(said[2], WEIGHT.1) + WEIGHT.0,
        }
    }
}
