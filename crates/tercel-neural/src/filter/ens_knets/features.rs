//! What the branches of an ensemble see.

use nalgebra::{Matrix2, Vector2, Vector4};

use super::Mode;
use super::hyper::{EnsKNetsHyper, Normalisation};

/// The direction in which the sensor sees a place, and how far away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sight {
    cosine: f64,
    sine: f64,
    range: f64,
}

impl Sight {
    pub fn new(offset: Vector2<f64>) -> Self {
        let range = offset.norm();
        // On top of the sensor there is no line of sight.
        let (cosine, sine) = match range > 0.0 && range.is_finite() {
            true => (offset.x / range, offset.y / range),
            false => (1.0, 0.0),
        };
        Sight { cosine, sine, range }
    }

    /// A vector of the state's frame, along and across the line of sight.
    fn turned(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cosine * v.x + self.sine * v.y, self.cosine * v.y - self.sine * v.x)
    }

    /// Standard deviations along and across the line of sight.
    fn deviations(&self, covariance: &Matrix2<f64>) -> Vector2<f64> {
        let turn = Matrix2::new(self.cosine, self.sine, -self.sine, self.cosine);
        (turn * covariance * turn.transpose()).diagonal().map(|variance| variance.max(1e-6).sqrt())
    }

    /// A state along and across the line of sight.
    fn turned_state(&self, state: &Vector4<f64>) -> [Vector2<f64>; 2] {
        let [position, velocity] = halves(state);
        [self.turned(position), self.turned(velocity)]
    }

    /// The reverse for a difference of states.
    pub fn turned_back(&self, state: &Vector4<f64>) -> Vector4<f64> {
        let back = Sight { sine: -self.sine, ..*self };
        let [position, velocity] = back.turned_state(state);
        Vector4::new(position.x, position.y, velocity.x, velocity.y)
    }
}

fn halves(state: &Vector4<f64>) -> [Vector2<f64>; 2] {
    [Vector2::new(state[0], state[1]), Vector2::new(state[2], state[3])]
}

/// What a step offers to the branches.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scene<'a> {
    pub modes: &'a [Mode],
    /// States of the KalmanNets after the measurement, weighed equally and by attention.
    pub mean: Vector4<f64>,
    pub attended: Vector4<f64>,
    /// Where the measurement puts the object, and the covariance of its error.
    pub reading: Vector2<f64>,
    pub noise: Matrix2<f64>,
    /// Where the sensor stands, and where the object was born.
    pub origin: Vector2<f64>,
    pub anchor: Vector2<f64>,
    /// Time since the last measurement, s.
    pub waited: f64,
    /// Units of position and velocity.
    pub scales: [f64; 2],
}

impl Scene<'_> {
    /// Where the sensor sees the mean.
    pub fn sight(&self) -> Sight {
        Sight::new(self.mean.xy() - self.origin)
    }

    /// Writes the features for these options, before they are normalised.
    pub fn features(&self, hyper: &EnsKNetsHyper, to: &mut [f32]) {
        let mut to = Row(to.iter_mut());
        if hyper.normalisation == Normalisation::Relative {
            return self.relative(hyper.attention.is_some(), &mut to);
        }
        if hyper.attention.is_some() {
            return to.push(self.placed(&self.attended).as_slice());
        }
        if hyper.correction.is_some() {
            self.modes.iter().for_each(|mode| to.push(self.placed(&mode.evidence.state).as_slice()));
        }
        to.push((self.reading - self.anchor).as_slice());
    }

    /// A state as seen from the birth of the object, which normalisation does not notice: single precision
    /// does not reach from a radar to the metres of a track.
    fn placed(&self, state: &Vector4<f64>) -> Vector4<f64> {
        Vector4::new(state[0] - self.anchor.x, state[1] - self.anchor.y, state[2], state[3])
    }

    fn relative(&self, attention: bool, to: &mut Row<'_>) {
        let sight = self.sight();
        let ln = |value: f64, unit: f64| (value / unit).max(1e-6).ln();
        let difference = |state: &Vector4<f64>| {
            let [position, velocity] = sight.turned_state(&(state - self.mean));
            let [position, velocity] = [position / self.scales[0], velocity / self.scales[1]];
            [position.x, position.y, velocity.x, velocity.y].map(f64::asinh)
        };
        let mut expected = Vector2::zeros();
        for mode in self.modes {
            let evidence = &mode.evidence;
            let deviations = sight.deviations(&evidence.spread);
            expected += deviations / self.modes.len() as f64;
            let innovation = sight.turned(evidence.residual).component_div(&deviations);
            to.push(&difference(&evidence.state));
            to.push(&[innovation.x.asinh(), innovation.y.asinh(), evidence.nis.max(0.0).ln_1p()]);
            if attention {
                to.push(&[(mode.weight.ln().max(-12.0) + 4.0) / 4.0]);
            }
        }
        let [_, velocity] = sight.turned_state(&self.mean);
        let noise = sight.deviations(&self.noise);
        to.push(&[
            velocity.x / 300.0,
            velocity.y / 300.0,
            ln(sight.range, 100e3),
            ln(self.waited, 1.0),
            ln(expected.x, 100.0),
            ln(expected.y, 1000.0),
            ln(noise.x, 50.0),
            ln(noise.y, 1000.0),
        ]);
        if attention {
            to.push(&difference(&self.attended));
        }
    }
}

/// Numbers that are written one after the other.
struct Row<'a>(std::slice::IterMut<'a, f32>);

impl Row<'_> {
    fn push(&mut self, values: &[f64]) {
        // In this order, since a zip takes from its first part before it finds that the second has ended.
        for (value, to) in values.iter().zip(self.0.by_ref()) {
            *to = *value as f32;
        }
    }
}
