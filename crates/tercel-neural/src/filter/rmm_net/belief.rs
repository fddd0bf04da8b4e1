//! What an RMMNet knows of one object.

use nalgebra::{Matrix2, Vector4};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::extended::{InverseWishart, Rate, eigen};

use super::features::Before;
use super::kinematics::Kinematics;
use super::number::Symmetric;
use super::regression::Regression;
use super::track::{Report, Track};
use crate::filter::memory::{Memory, share};

/// What an [`RmmNet`](super::RmmNet) knows of one object.
#[derive(Debug, Clone, PartialEq)]
pub struct RmmNetBelief {
    pub(super) state: Gaussian<4>,
    /// Logarithms of the semi-axes, and how many points they are worth.
    pub(super) axes: [f64; 2],
    pub(super) worth: f64,
    /// Direction of the first axis, rad, and the logarithm of the weight of the extent.
    pub(super) angle: f64,
    pub(super) ln_weight: f64,
    /// The direction before the last prediction, which an object that stands keeps, rad.
    pub(super) held: f64,
    /// How many points it gives, if the filter estimates that.
    pub(super) rate: Option<Rate>,
    /// What the measurements of the present step changed, and whether there was one.
    pub(super) correction: [f64; 4],
    pub(super) measured: bool,
    pub(super) regression: Regression,
    pub(super) memory: Memory,
    pub(super) room: Room,
}

/// Room for the points of a scan. It is not part of what is known.
#[derive(Debug, Clone, Default)]
pub(super) struct Room(pub Vec<f32>);

impl PartialEq for Room {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The Gaussian as a vector and a matrix.
pub(super) fn gaussian(motion: &Kinematics<f64>) -> Gaussian<4> {
    let Kinematics { place, velocity, place_covariance: pp, cross: c, velocity_covariance: vv } = motion;
    Gaussian {
        mean: Vector4::new(place[0], place[1], velocity[0], velocity[1]),
        covariance: nalgebra::Matrix4::new(
            pp.xx, pp.xy, c[0][0], c[0][1], //
            pp.xy, pp.yy, c[1][0], c[1][1], //
            c[0][0], c[1][0], vv.xx, vv.xy, //
            c[0][1], c[1][1], vv.xy, vv.yy,
        ),
    }
}

/// The blocks of a Gaussian.
pub(super) fn kinematics(state: &Gaussian<4>) -> Kinematics<f64> {
    let (mean, p) = (&state.mean, &state.covariance);
    let block = |i: usize| Symmetric {
        xx: p[(i, i)],
        xy: 0.5 * (p[(i, i + 1)] + p[(i + 1, i)]),
        yy: p[(i + 1, i + 1)],
    };
    Kinematics {
        place: [mean.x, mean.y],
        velocity: [mean.z, mean.w],
        place_covariance: block(0),
        cross: [[p[(0, 2)], p[(0, 3)]], [p[(1, 2)], p[(1, 3)]]],
        velocity_covariance: block(2),
    }
}

impl RmmNetBelief {
    /// What the network remembers of the object.
    pub fn memory(&self) -> &[f32] {
        self.memory.held()
    }

    /// Semi-axes, along and across, m.
    pub fn axes(&self) -> [f64; 2] {
        self.axes.map(f64::exp)
    }

    /// Direction of the first semi-axis, rad.
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// The recursion's part of it.
    pub(super) fn track(&self) -> Track<f64> {
        Track { motion: kinematics(&self.state), axes: self.axes, worth: self.worth }
    }

    pub(super) fn before(&self) -> Before<'_> {
        Before {
            angle: self.angle,
            correction: self.correction,
            measured: self.measured,
            regression: &self.regression,
        }
    }

    pub(super) fn report(&mut self, track: &Track<f64>, report: &Report<f64>) {
        (self.axes, self.worth) = (track.axes, track.worth);
        (self.angle, self.ln_weight) = (report.angle, report.ln_weight);
    }

    /// The belief about the extent.
    pub(super) fn extent(&self) -> Result<InverseWishart, FilterError> {
        let squares = self.axes.map(|axis| (2.0 * axis).exp());
        let extent = Symmetric { xx: squares[0], xy: 0.0, yy: squares[1] };
        let own = extent.turned([self.angle.cos(), self.angle.sin()]);
        InverseWishart::new(Matrix2::new(own.xx, own.xy, own.xy, own.yy), self.ln_weight.exp())
    }

    /// Takes over an extent. Its axes are those nearest in direction to the old ones.
    pub(super) fn set_extent(&mut self, extent: &InverseWishart) {
        let (values, angle) = eigen(&extent.mean());
        if !(values.y > 0.0 && values.x.is_finite() && extent.weight() > 0.0) {
            return;
        }
        let swapped = (angle - self.angle).cos().abs() < std::f64::consts::FRAC_1_SQRT_2;
        let (first, second, turn) = if swapped {
            (values.y, values.x, std::f64::consts::FRAC_PI_2)
        } else {
            (values.x, values.y, 0.0)
        };
        self.axes = [0.5 * first.ln(), 0.5 * second.ln()];
        self.angle = angle + turn;
        self.ln_weight = extent.weight().ln();
    }

    /// The moments of this and another with these weights.
    pub(super) fn merge(&mut self, weight: f64, other: &Self, other_weight: f64) {
        self.state.merge(weight, &other.state, other_weight);
        let share = share(weight, other_weight);
        let mix = |ours: &mut f64, theirs: f64| *ours += share * (theirs - *ours);
        for i in 0..2 {
            mix(&mut self.axes[i], other.axes[i]);
        }
        if let (Some(rate), Some(other)) = (&mut self.rate, &other.rate) {
            rate.merge(weight, other, other_weight);
        }
        mix(&mut self.worth, other.worth);
        mix(&mut self.ln_weight, other.ln_weight);
        let double = |angle: f64| (2.0 * angle).sin_cos();
        let ((sine, cosine), (other_sine, other_cosine)) = (double(self.angle), double(other.angle));
        let (sine, cosine) = (sine + share * (other_sine - sine), cosine + share * (other_cosine - cosine));
        if share > 0.0 && sine.hypot(cosine) > 1e-12 {
            self.angle = 0.5 * sine.atan2(cosine);
            self.held = self.angle;
        }
        for (ours, theirs) in self.correction.iter_mut().zip(other.correction) {
            mix(ours, theirs);
        }
        self.measured |= share > 0.0 && other.measured;
        self.regression.merge(&other.regression, share);
        self.memory.merge(weight, &other.memory, other_weight);
    }
}
