//! What the network of a KalmanNet sees.

use nalgebra::{Matrix2, Matrix4x2, Vector2, Vector4};

use super::hyper::{Feature, READING, STATE};
use super::network::GainNetwork;
use crate::filter::memory::share;

/// The differences of earlier steps, and what has happened at the present one.
///
/// They are kept as differences, not as states, so that a state that is replaced from outside (by the mixing of an IMM) does
/// not look like a manoeuvre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct History {
    /// `y(t-1)`: the last reading, or the one that was expected when there was none.
    reading: Vector2<f64>,
    /// `x̂(t-1|t-1) - x̂(t-2|t-2)`.
    evolution: Vector4<f64>,
    /// `x̂(t-1|t-1) - x̂(t-1|t-2)`.
    update: Vector4<f64>,
    /// `x̂(t|t-1) - x̂(t-1|t-1)`.
    moved: Vector4<f64>,
    /// `x̂(t|t) - x̂(t|t-1)`: zero while there is no measurement.
    corrected: Vector4<f64>,
    /// `y(t)`, if there is one.
    seen: Option<Vector2<f64>>,
}

impl History {
    /// Of an object that was born from this reading.
    pub fn new(reading: Vector2<f64>) -> Self {
        let zero = Vector4::zeros();
        let seen = Some(reading);
        History { reading, evolution: zero, update: zero, moved: zero, corrected: zero, seen }
    }

    /// Makes the present step the last one, and begins another in which the prediction has `moved` the state. `expected` is
    /// what would have been read at the step that ends.
    pub fn predicted(&mut self, moved: Vector4<f64>, expected: Vector2<f64>) {
        self.reading = self.seen.take().unwrap_or(expected);
        self.evolution = self.moved + self.corrected;
        self.update = self.corrected;
        self.moved = moved;
        self.corrected = Vector4::zeros();
    }

    /// Notes a reading of the present step, and what it changed.
    pub fn updated(&mut self, reading: Vector2<f64>, correction: Vector4<f64>) {
        self.seen = Some(reading);
        self.corrected += correction;
    }

    /// The mean of two histories.
    pub fn merge(&mut self, weight: f64, other: &History, other_weight: f64) {
        let share = share(weight, other_weight);
        self.reading += (other.reading - self.reading) * share;
        self.evolution += (other.evolution - self.evolution) * share;
        self.update += (other.update - self.update) * share;
        self.moved += (other.moved - self.moved) * share;
        self.corrected += (other.corrected - self.corrected) * share;
        self.seen = match (self.seen, other.seen) {
            (Some(ours), Some(theirs)) => Some(ours + (theirs - ours) * share),
            (Some(ours), None) => Some(ours),
            (None, theirs) => theirs.filter(|_| share > 0.0),
        };
    }

    /// Writes the inputs of the network for a reading that differs by `innovation` from the expected one.
    pub fn inputs(
        &self,
        network: &GainNetwork,
        reading: &Vector2<f64>,
        innovation: &Vector2<f64>,
        view: &View,
        inputs: &mut [f32],
    ) {
        let (hyper, scales) = (network.hyper(), network.scales());
        let widths: usize = hyper.features.iter().map(|feature| feature.width()).sum();
        let (mut features, magnitudes) = inputs.split_at_mut(widths);
        for (index, feature) in hyper.features.iter().enumerate() {
            let mut value = [0.0; STATE];
            match feature {
                Feature::F1 => value[..READING].copy_from_slice((reading - self.reading).as_slice()),
                Feature::F2 => value[..READING].copy_from_slice(innovation.as_slice()),
                Feature::F3 => value.copy_from_slice(self.evolution.as_slice()),
                Feature::F4 => value.copy_from_slice(self.update.as_slice()),
            }
            let length = value.iter().map(|x| x * x).sum::<f64>().sqrt();
            let divisor = if hyper.normalise { length.max(1e-12) } else { 1.0 };
            let (to, rest) = features.split_at_mut(feature.width());
            let pairs = to.as_chunks_mut::<2>().0.iter_mut().zip(value.as_chunks::<2>().0);
            for (to, pair) in pairs {
                let turned = view.turned(Vector2::new(pair[0], pair[1])) / divisor;
                *to = [turned.x as f32, turned.y as f32];
            }
            features = rest;
            if hyper.magnitudes {
                magnitudes[index] = (length / scales.of_feature(*feature)).ln_1p() as f32;
            }
        }
        if let Some(to) = magnitudes.last_mut() {
            *to = (view.range.max(1.0) / scales.range).ln() as f32;
        }
    }
}

/// How the sensor sees the predicted position: the direction to which features are turned, and the range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    cosine: f64,
    sine: f64,
    pub range: f64,
}

impl View {
    /// Of a position relative to the sensor, with the directions of the state or of the line of sight.
    pub fn new(offset: Vector2<f64>, sensor_frame: bool) -> Self {
        let range = offset.norm();
        // On top of the sensor there is no line of sight.
        if sensor_frame && range > 0.0 && range.is_finite() {
            return View { cosine: offset.x / range, sine: offset.y / range, range };
        }
        View { cosine: 1.0, sine: 0.0, range }
    }

    /// A vector of the state's frame, in the frame of the line of sight.
    fn turned(&self, v: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.cosine * v.x + self.sine * v.y, self.cosine * v.y - self.sine * v.x)
    }

    /// A gain of the frame of the line of sight, in the state's frame.
    pub fn gain(&self, gain: Matrix4x2<f64>) -> Matrix4x2<f64> {
        let turn = Matrix2::new(self.cosine, -self.sine, self.sine, self.cosine);
        let mut turned = Matrix4x2::zeros();
        for block in [0, 2] {
            let part = turn * gain.fixed_rows::<2>(block) * turn.transpose();
            turned.fixed_rows_mut::<2>(block).copy_from(&part);
        }
        turned
    }
}
