//! The step of the filter: prediction, update and extent, given what the network says.

use super::hyper::Aligned;
use super::kinematics::Kinematics;
use super::number::{Number, Symmetric, clamped, within};
use super::view::View;

/// What the recursion carries from step to step: the state, and the size of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track<T> {
    /// The state.
    pub motion: Kinematics<T>,
    /// Logarithms of the semi-axes in metres, along and across.
    pub axes: [T; 2],
    /// How many points the axes are worth.
    pub worth: T,
}

/// The direction of an extent, and how sure it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report<T> {
    /// Direction of the first axis, rad.
    pub angle: T,
    /// Logarithm of the weight of the inverse Wishart belief.
    pub ln_weight: T,
}

/// What is known of the motion when it is predicted, apart from the state.
#[derive(Debug, Clone, Copy)]
pub struct Past<'a> {
    /// The unit vector of the heading.
    pub heading: [f64; 2],
    /// The last velocities, m/s, the present one first.
    pub velocities: &'a [[f64; 2]],
    /// The velocity that the identified weights expect, m/s.
    pub expected: [f64; 2],
}

/// Lengths of a step: its time, and that in intervals.
#[derive(Debug, Clone, Copy)]
pub struct Length {
    /// Time, s.
    pub dt: f64,
    /// Time over the interval for which the network was trained.
    pub share: f64,
}

/// Number of outputs about the motion, without the weights of past velocities.
pub(super) const MOTION: usize = 16;

/// Number of outputs about a scan.
pub(super) const SCAN: usize = 8;

/// Number of outputs about the extent.
pub(super) const EXTENT: usize = 6;

/// Logarithms of deviations stay within this.
const LOGARITHM: f64 = 5.0;

/// Deviation of the position that motion alone does not explain, as a share of the jump of the velocity over the interval.
const SLIP: f64 = 0.05;

/// Share of the weight of the axes that lasts where the network says nothing, as the argument of a logistic function.
const LASTING: f64 = 4.0;

/// Weight of the reported extent where the network says nothing.
const WEIGHT: f64 = 30.0;

/// The same of an extent that is predicted.
const FORESEEN: f64 = 5.0;

/// Largest factor between semi-axes and those of a new object.
const STRETCH: f64 = 50.0;

/// Least and greatest worth of the axes, in points.
const WORTH: [f64; 2] = [0.01, 1e6];

/// Deviation of the velocity beyond which it is not made to grow, in units of a new object's.
const LOST: f64 = 100.0;

fn logistic<T: Number>(x: T) -> T {
    T::of(1.0) / ((-x).exp() + 1.0)
}

/// A vector of the frame of `axis` in that of the plane.
fn back<T: Number>(axis: [f64; 2], v: [T; 2]) -> [T; 2] {
    [v[0] * axis[0] - v[1] * axis[1], v[0] * axis[1] + v[1] * axis[0]]
}

impl<T: Number> Track<T> {
    /// The prediction. Outputs of zero are straight motion whose velocity jumps by `change` in an interval.
    pub fn predict(&self, options: &Aligned, past: &Past<'_>, said: &[T], length: Length) -> Track<T> {
        let Length { dt, share } = length;
        let turned = back(past.heading, [said[0], said[1]]);
        let slid = back(past.heading, [said[2], said[3]]);
        let gate = said[4];
        let mut change = [turned[0] * options.change, turned[1] * options.change];
        let before = &self.motion;
        let now = before.velocity.map(T::value);
        for i in 0..2 {
            change[i] = change[i] + gate * (past.expected[i] - now[i]);
            for (weight, pair) in said[MOTION..].iter().zip(past.velocities.windows(2)) {
                change[i] = change[i] + *weight * (pair[0][i] - pair[1][i]);
            }
        }
        let lost = before.velocity_covariance.xx.value() + before.velocity_covariance.yy.value()
            > (LOST * options.speed).powi(2);
        // Without measurements for long, the covariance must not grow by a factor in each step.
        let kept = if lost { T::of(1.0) } else { (within(said[5], 1.5) * share) + 1.0 };
        let velocity: [T; 2] = std::array::from_fn(|i| before.velocity[i] + change[i] * share);
        let place = std::array::from_fn(|i| {
            before.place[i] + velocity[i] * dt + slid[i] * (options.change * share * dt)
        });
        let noise = self.noise(options, past.heading, said, share);
        let (pp, pv, vv) = (&before.place_covariance, &before.cross, &before.velocity_covariance);
        let step = kept * dt;
        let slip = options.change * dt * SLIP;
        let [along, across] = [said[9], said[10]].map(|l| (within(l, LOGARITHM) * 2.0).exp());
        let own = Symmetric {
            xx: along * (slip * slip * share.abs()),
            xy: T::of(0.0),
            yy: across * (slip * slip * share.abs()),
        };
        let own = own.turned(past.heading.map(T::of));
        let moved = |sum: T, v: T, q: T, own: T| step * sum + step * step * v + q * (dt * dt) + own;
        let place_covariance = Symmetric {
            xx: pp.xx + moved(pv[0][0] * 2.0, vv.xx, noise.xx, own.xx),
            xy: pp.xy + moved(pv[0][1] + pv[1][0], vv.xy, noise.xy, own.xy),
            yy: pp.yy + moved(pv[1][1] * 2.0, vv.yy, noise.yy, own.yy),
        };
        let of_velocity = |i: usize, j: usize| match (i, j) {
            (0, 0) => (vv.xx, noise.xx),
            (1, 1) => (vv.yy, noise.yy),
            _ => (vv.xy, noise.xy),
        };
        let cross = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let (v, q) = of_velocity(i, j);
                kept * (pv[i][j] + step * v) + q * dt
            })
        });
        let velocity_covariance = vv.scaled(kept * kept).plus(&noise);
        let axes = options.bounded([0, 1].map(|i| self.axes[i] + within(said[11 + i], 1.0) * (0.1 * share)));
        let worth = clamped(self.worth * logistic(said[13] + LASTING), WORTH[0], WORTH[1]);
        let motion = Kinematics { place, velocity, place_covariance, cross, velocity_covariance };
        Track { motion, axes, worth }
    }

    /// The extent that is expected after a prediction: along the course, or in the direction `held` of an object that stands.
    pub fn foresee(&self, options: &Aligned, held: f64, said: &[T]) -> Report<T> {
        let [x, y] = self.motion.velocity;
        let moves = x.value().hypot(y.value()) >= options.standing;
        let angle = if moves { y.atan2(x) } else { T::of(held) };
        let ln_weight = within(said[15], LOGARITHM) + FORESEEN.ln();
        Report { angle: angle + within(said[14], 1.0) * 0.3, ln_weight }
    }

    /// Covariance of the jump of the velocity.
    fn noise(&self, options: &Aligned, heading: [f64; 2], said: &[T], share: f64) -> Symmetric<T> {
        let unit = options.change * share.abs().sqrt();
        let [a, c] = [said[6], said[8]].map(|l| within(l, LOGARITHM).exp() * unit);
        Symmetric::of_factor(a, within(said[7], LOGARITHM) * unit, c).turned(heading.map(T::of))
    }

    /// The update with a scan of at least one point. Outputs of zero are the centroid with its covariance, the direction of the
    /// scatter, and the rule of Feldmann for the axes.
    pub fn update(&self, options: &Aligned, view: &View, said: &[T]) -> Track<T> {
        let mut after = *self;
        let deviations = view.deviations;
        let shift = [0, 1].map(|i| within(said[i], 3.0) * deviations[i]);
        let shift = back(view.axis, shift);
        let factors = [said[2], said[4]].map(|l| within(l, 3.0).exp());
        let noise = Symmetric::of_factor(
            factors[0] * deviations[0],
            within(said[3], 3.0) * deviations[1],
            factors[1] * deviations[1],
        )
        .turned(view.axis.map(T::of));
        let residual = std::array::from_fn(|i| shift[i] - self.motion.place[i] + view.mean[i]);
        after.motion.see_place(residual, &noise);
        after.see_direction(view, [said[5], said[6]]);
        after.see_size(view, said[7]);
        after.axes = options.bounded(after.axes);
        after
    }

    /// The object moves along its first axis: across it the velocity is zero, up to the error of the direction.
    fn see_direction(&mut self, view: &View, said: [T; 2]) {
        let angle = within(said[0], 3.0) * view.lean_deviation.min(0.5) + view.lean;
        let normal = [-angle.sin(), angle.cos()];
        let v = self.motion.velocity;
        let (deviation, least) = (view.lean_deviation, view.least_speed);
        let speed = v[0] * v[0] + v[1] * v[1] + least * least;
        let noise = speed * (deviation * deviation) * (within(said[1], 3.0) * 2.0).exp();
        self.motion.see_across(normal, noise);
    }

    /// The recursion of a random matrix for the axes, in the frame of the object.
    fn see_size(&mut self, view: &View, said: T) {
        let count = view.count - 1.0;
        if count <= 0.0 {
            return;
        }
        let gained = (within(said, 3.0)).exp() * count;
        let total = self.worth + gained;
        for i in 0..2 {
            let spread = (self.axes[i] * 2.0).exp() * view.scale + view.noise[i];
            let ratio = T::of(view.scatter[i] / count) / spread;
            self.axes[i] = self.axes[i] + ((self.worth + gained * ratio) / total).ln() * 0.5;
        }
        self.worth = clamped(total, WORTH[0], WORTH[1]);
    }

    /// The extent after an update: its direction between the course and the scatter, its axes, and how sure both are.
    pub fn settle_extent(&mut self, options: &Aligned, view: &View, said: &[T]) -> Report<T> {
        let v = self.motion.velocity;
        let square = v[0] * v[0] + v[1] * v[1] + 1e-6 * view.least_speed * view.least_speed;
        let across = self.motion.velocity_covariance.form([-v[1], v[0]], [-v[1], v[0]]);
        // Weight of the course, as the concentration of twice the angle.
        let course = within(said[0], LOGARITHM).exp() * square / (across * 4.0 + 1e-9 * square.value());
        let scan = within(said[1], LOGARITHM).exp();
        let double = [
            course * (v[0] * v[0] - v[1] * v[1]) + scan * view.concentration[0],
            course * (v[0] * v[1] * 2.0) + scan * view.concentration[1],
        ];
        let angle = double[1].atan2(double[0]) * 0.5 + within(said[2], 1.0) * 0.3;
        self.axes = options.bounded([0, 1].map(|i| self.axes[i] + within(said[3 + i], 1.0) * 0.2));
        Report { angle, ln_weight: within(said[5], LOGARITHM) + WEIGHT.ln() }
    }
}

impl Aligned {
    /// Logarithms of semi-axes that are within reason.
    fn bounded<T: Number>(&self, axes: [T; 2]) -> [T; 2] {
        [0, 1].map(|i| {
            let own = self.axes[i].ln();
            clamped(axes[i], own - STRETCH.ln(), own + STRETCH.ln())
        })
    }
}
