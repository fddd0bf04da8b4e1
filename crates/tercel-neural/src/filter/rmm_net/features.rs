//! What the network sees: numbers without a unit, alike wherever the object is and wherever it goes.

use super::hyper::Aligned;
use super::regression::Regression;
use super::track::Track;
use super::view::View;

/// What is known of an object before it is predicted, apart from the recursion.
#[derive(Debug, Clone, Copy)]
pub struct Before<'a> {
    /// The direction of the extent, rad.
    pub angle: f64,
    /// What the measurements of the last step changed of `x, y, vx, vy`.
    pub correction: [f64; 4],
    /// Whether there was one.
    pub measured: bool,
    /// Weights of past velocities.
    pub regression: &'a Regression,
}

/// Numbers that the memory sees, with this many past velocities.
pub(super) fn motion_seen(order: usize) -> usize {
    13 + if order > 0 { 5 + 2 * order } else { 0 }
}

/// Numbers that are seen of a scan besides its points.
pub(super) const SCAN_SEEN: usize = 27;

/// Numbers that are seen of an extent.
pub const EXTENT_SEEN: usize = 10;

/// Logarithm of a deviation in units, held within reason.
fn ln_deviation(variance: f64, unit: f64) -> f64 {
    (0.5 * (variance / (unit * unit)).max(1e-12).ln()).clamp(-8.0, 8.0)
}

/// Numbers put one after the other.
struct Row<'a> {
    numbers: &'a mut [f32],
    next: usize,
}

impl Row<'_> {
    fn put(&mut self, value: f64) {
        self.numbers[self.next] = value as f32;
        self.next += 1;
    }

    fn both(&mut self, values: [f64; 2]) {
        values.into_iter().for_each(|value| self.put(value));
    }

    /// A size that may be large: its logarithm, with the sign.
    fn bent(&mut self, values: [f64; 2], unit: f64) {
        self.both(values.map(|value| (value / unit).asinh()));
    }
}

/// The unit vector of the course of a velocity, or that of the angle of an object that stands.
pub fn heading(options: &Aligned, velocity: [f64; 2], angle: f64) -> [f64; 2] {
    let speed = velocity[0].hypot(velocity[1]);
    if speed >= options.standing && speed.is_finite() {
        velocity.map(|v| v / speed)
    } else {
        [angle.cos(), angle.sin()]
    }
}

/// A vector of the plane in the frame of an axis.
fn turned(axis: [f64; 2], v: [f64; 2]) -> [f64; 2] {
    [axis[0] * v[0] + axis[1] * v[1], axis[0] * v[1] - axis[1] * v[0]]
}

fn speed(velocity: [f64; 2]) -> f64 {
    velocity[0].hypot(velocity[1])
}

impl Aligned {
    /// Writes what the memory sees of an object after a step, of which `track` is the posterior.
    ///
    /// # Panics
    /// When the row has another length than that of the first layer.
    pub fn see_motion(&self, track: &Track<f64>, before: &Before<'_>, numbers: &mut [f32]) {
        let axis = heading(self, track.motion.velocity, before.angle);
        let mut row = Row { numbers, next: 0 };
        let [x, y, vx, vy] = before.correction;
        row.put((speed(track.motion.velocity) / self.velocity).asinh());
        row.bent(turned(axis, [vx, vy]), self.change);
        row.bent(turned(axis, [x, y]), self.change);
        row.put(f64::from(u8::from(before.measured)));
        let own = track.motion.velocity_covariance.turned([axis[0], -axis[1]]);
        row.both([own.xx, own.yy].map(|variance| ln_deviation(variance, self.change)));
        self.see_size(track, &mut row);
        let (sine, cosine) = (2.0 * (before.angle - axis[1].atan2(axis[0]))).sin_cos();
        row.both([cosine - 1.0, sine]);
        if self.identification.order > 0 {
            let expected = before.regression.expected();
            row.bent(turned(axis, [0, 1].map(|i| expected[i] - track.motion.velocity[i])), self.change);
            row.bent(turned(axis, before.regression.missed()), self.change);
            row.put(ln_deviation(before.regression.deviation().powi(2), self.change));
            for velocity in &before.regression.past()[1..] {
                row.bent(turned(axis, *velocity), self.velocity);
            }
        }
        debug_assert_eq!(row.next, row.numbers.len());
    }

    fn see_size(&self, track: &Track<f64>, row: &mut Row<'_>) {
        row.both([0, 1].map(|i| track.axes[i] - self.axes[i].ln()));
        row.put((track.worth / self.worth).ln() / 3.0);
    }

    /// Writes what is seen of a scan besides its points.
    ///
    /// # Panics
    /// When the row is shorter than that.
    pub fn see_scan(&self, prior: &Track<f64>, view: &View, numbers: &mut [f32]) {
        let mut row = Row { numbers, next: 0 };
        let axis = view.axis;
        let back = [axis[0], -axis[1]];
        let (place, velocity) =
            (prior.motion.place_covariance.turned(back), prior.motion.velocity_covariance.turned(back));
        let offset = view.within([0, 1].map(|i| view.mean[i] - prior.motion.place[i]));
        let variances = [place.xx, place.yy];
        let square = |i: usize| view.deviations[i] * view.deviations[i];
        row.both([0, 1].map(|i| (offset[i] / (variances[i] + square(i)).sqrt()).asinh()));
        row.both([0, 1].map(|i| (offset[i] / view.deviations[i]).asinh()));
        row.put(view.count.ln());
        row.put(1.0 / view.count.sqrt());
        let axes = prior.axes.map(f64::exp);
        row.both([0, 1].map(|i| (view.noise[i].sqrt() / axes[i]).min(4.0)));
        let spread = [0, 1].map(|i| square(i) * view.count);
        let scatter = view.scatter.map(|scatter| scatter / view.count);
        row.both([0, 1].map(|i| (scatter[i] / spread[i] + 0.05).ln()));
        row.put((view.lean_scatter / (view.count * (spread[0] * spread[1]).sqrt())).asinh());
        for vector in [view.course, view.concentration] {
            self.see_direction(vector, axis, &mut row);
        }
        row.put((speed(prior.motion.velocity) / self.velocity).asinh());
        let along = turned(axis, prior.motion.velocity);
        row.bent(along, self.velocity);
        row.both([0, 1].map(|i| 0.5 * (variances[i] / square(i)).max(1e-12).ln()));
        row.both([velocity.xx, velocity.yy].map(|variance| ln_deviation(variance, self.change)));
        self.see_size(prior, &mut row);
        debug_assert_eq!(row.next, SCAN_SEEN);
    }

    /// A concentration of twice the angle: its direction in the frame, and its size.
    fn see_direction(&self, vector: [f64; 2], axis: [f64; 2], row: &mut Row<'_>) {
        let length = speed(vector);
        let double = [axis[0] * axis[0] - axis[1] * axis[1], 2.0 * axis[0] * axis[1]];
        let own = turned(double, vector);
        row.both(own.map(|x| if length > 0.0 { x / length } else { 0.0 }));
        row.put((1.0 + length).ln() / 3.0);
    }

    /// Writes what is seen of an extent after the state was updated.
    ///
    /// # Panics
    /// When the row is shorter than that.
    pub fn see_extent(&self, after: &Track<f64>, view: &View, numbers: &mut [f32]) {
        let mut row = Row { numbers, next: 0 };
        let v = after.motion.velocity;
        row.put((speed(v) / self.velocity).asinh());
        let square = v[0] * v[0] + v[1] * v[1];
        let across = after.motion.velocity_covariance.form([-v[1], v[0]], [-v[1], v[0]]);
        let weight = (0.25 * square / across.max(1e-12 * square).max(f64::MIN_POSITIVE)).min(1e8);
        self.see_direction(
            [weight * (v[0] * v[0] - v[1] * v[1]), weight * 2.0 * v[0] * v[1]],
            view.axis,
            &mut row,
        );
        self.see_direction(view.concentration, view.axis, &mut row);
        self.see_size(after, &mut row);
        debug_assert_eq!(row.next, EXTENT_SEEN);
    }
}
