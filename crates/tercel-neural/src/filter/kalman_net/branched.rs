//! Architecture #2: three recurrent layers in the places of three covariances.

use super::hyper::{KalmanNetHyper, READING, STATE};
use crate::error::ModelError;
use crate::filter::memory::{Room, side_by_side};
use crate::layer::{Gru, LayerShape, Linear};
use crate::model::Weights;

/// Sizes of the memories in the places of covariances of the state (also of the process noise) and of the innovation.
const SIGMA: usize = STATE * STATE;
const S: usize = READING * READING;

/// Components of the features F1 and F2 together, and of F3 and F4 each.
const OBSERVED: usize = 2 * READING;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Branched {
    magnitudes: bool,
    fc1: Linear,
    fc2: [Linear; 2],
    fc3: Linear,
    fc4: Linear,
    fc5: Linear,
    fc6: Linear,
    fc7: Linear,
    gru_q: Gru,
    gru_sigma: Gru,
    gru_s: Gru,
}

/// Names and widths (inputs, outputs) of the linear layers.
fn linears(hyper: &KalmanNetHyper, in_mult: usize, out_mult: usize) -> [(&'static str, [usize; 2]); 8] {
    // One number for the magnitude of each feature, and one for that of the range.
    let magnitude = usize::from(hyper.magnitudes);
    let wide = (SIGMA + S) * out_mult;
    [
        ("fc1", [SIGMA, S]),
        ("fc2.0", [SIGMA + S, wide]),
        ("fc2.1", [wide, STATE * READING]),
        ("fc3", [S + STATE * READING, SIGMA]),
        ("fc4", [2 * SIGMA, SIGMA]),
        ("fc5", [STATE + magnitude, STATE * in_mult]),
        ("fc6", [STATE + magnitude, STATE * in_mult]),
        ("fc7", [OBSERVED + 3 * magnitude, OBSERVED * in_mult]),
    ]
}

/// Names and widths (inputs, memory) of the recurrent layers.
fn recurrents(in_mult: usize) -> [(&'static str, [usize; 2]); 3] {
    [
        ("gru_q", [STATE * in_mult, SIGMA]),
        ("gru_sigma", [SIGMA + STATE * in_mult, SIGMA]),
        ("gru_s", [S + OBSERVED * in_mult, S]),
    ]
}

pub(super) fn layers(hyper: &KalmanNetHyper, in_mult: usize, out_mult: usize) -> Vec<(String, LayerShape)> {
    let linears = linears(hyper, in_mult, out_mult)
        .map(|(name, [inputs, outputs])| (name.to_owned(), LayerShape::Linear { inputs, outputs }));
    let recurrents =
        recurrents(in_mult).map(|(name, [inputs, size])| (name.to_owned(), LayerShape::Gru { inputs, size }));
    linears.into_iter().chain(recurrents).collect()
}

impl Branched {
    pub fn new(
        weights: &mut Weights<'_>,
        hyper: &KalmanNetHyper,
        in_mult: usize,
        out_mult: usize,
    ) -> Result<Self, ModelError> {
        let [fc1, fc2_wide, fc2_gain, fc3, fc4, fc5, fc6, fc7] = linears(hyper, in_mult, out_mult)
            .map(|(name, [inputs, outputs])| weights.linear(name, inputs, outputs));
        let [gru_q, gru_sigma, gru_s] =
            recurrents(in_mult).map(|(name, [inputs, size])| weights.gru(name, inputs, size));
        Ok(Branched {
            magnitudes: hyper.magnitudes,
            fc1: fc1?,
            fc2: [fc2_wide?, fc2_gain?],
            fc3: fc3?,
            fc4: fc4?,
            fc5: fc5?,
            fc6: fc6?,
            fc7: fc7?,
            gru_q: gru_q?,
            gru_sigma: gru_sigma?,
            gru_s: gru_s?,
        })
    }

    pub fn initial(&self) -> Vec<f32> {
        let identity = |n: usize| (0..n * n).map(move |i| if i % (n + 1) == 0 { 1.0 } else { 0.0 });
        identity(STATE).chain([0.0; SIGMA]).chain(identity(READING)).collect()
    }

    pub fn scratch(&self, batch: usize) -> usize {
        let Branched { fc1, fc2, fc3, fc4, fc5, fc6, fc7, gru_q, gru_sigma, gru_s, .. } = self;
        let linears = [fc1, &fc2[0], fc3, fc4, fc5, fc6, fc7];
        let row: usize = linears.iter().map(|layer| layer.inputs() + layer.outputs()).sum();
        let recurrent = [gru_q, gru_sigma, gru_s];
        let inputs = gru_sigma.inputs() + gru_s.inputs();
        let steps = recurrent.iter().map(|layer| layer.scratch(batch)).max().unwrap_or(0);
        batch * (row + inputs) + steps
    }

    pub fn step(&self, inputs: &[f32], memory: &mut [f32], scratch: &mut [f32], gain: &mut [f32]) {
        let batch = gain.len() / (STATE * READING);
        let mut room = Room(scratch);
        let (q, rest) = memory.split_at_mut(batch * SIGMA);
        let (sigma, s) = rest.split_at_mut(batch * SIGMA);
        let [seen, evolution, update] = self.branches(batch, inputs, &mut room);

        let update = activated(&self.fc5, batch, update, &mut room);
        self.gru_q.step(update, q, room.0);

        let evolution = activated(&self.fc6, batch, evolution, &mut room);
        let joined = room.take(batch * self.gru_sigma.inputs());
        side_by_side(&[(q, SIGMA), (evolution, self.fc6.outputs())], joined);
        self.gru_sigma.step(joined, sigma, room.0);

        let expected = activated(&self.fc1, batch, sigma, &mut room);
        let seen = activated(&self.fc7, batch, seen, &mut room);
        let joined = room.take(batch * self.gru_s.inputs());
        side_by_side(&[(expected, S), (seen, self.fc7.outputs())], joined);
        self.gru_s.step(joined, s, room.0);

        let joined = room.take(batch * (SIGMA + S));
        side_by_side(&[(sigma, SIGMA), (s, S)], joined);
        let wide = activated(&self.fc2[0], batch, joined, &mut room);
        self.fc2[1].forward(wide, gain);

        let joined = room.take(batch * self.fc3.inputs());
        side_by_side(&[(s, S), (gain, STATE * READING)], joined);
        let fed_back = activated(&self.fc3, batch, joined, &mut room);
        let joined = room.take(batch * self.fc4.inputs());
        side_by_side(&[(sigma, SIGMA), (fed_back, SIGMA)], joined);
        self.fc4.forward_relu(joined, sigma);
    }

    /// The inputs of `fc7`, `fc6` and `fc5`, each with its magnitudes behind its features.
    fn branches<'a>(&self, batch: usize, inputs: &[f32], room: &mut Room<'a>) -> [&'a [f32]; 3] {
        let seen = room.take(batch * self.fc7.inputs());
        let evolution = room.take(batch * self.fc6.inputs());
        let update = room.take(batch * self.fc5.inputs());
        let features = OBSERVED + 2 * STATE;
        for (index, row) in inputs.chunks_exact(inputs.len() / batch).enumerate() {
            let (row, magnitudes) = row.split_at(features);
            // m1 m2 m3 m4 and that of the range, or none.
            let magnitude =
                |part: std::ops::Range<usize>| if self.magnitudes { &magnitudes[part] } else { &[] };
            let fill = |to: &mut [f32], width: usize, parts: [&[f32]; 3]| {
                let values = parts.into_iter().flatten();
                to[index * width..][..width].iter_mut().zip(values).for_each(|(to, value)| *to = *value);
            };
            fill(seen, self.fc7.inputs(), [&row[..OBSERVED], magnitude(0..2), magnitude(4..5)]);
            fill(evolution, self.fc6.inputs(), [&row[OBSERVED..OBSERVED + STATE], magnitude(2..3), &[]]);
            fill(update, self.fc5.inputs(), [&row[OBSERVED + STATE..], magnitude(3..4), &[]]);
        }
        [seen, evolution, update]
    }
}

/// The output of a layer behind a ReLU, in a new piece of the room.
fn activated<'a>(layer: &Linear, batch: usize, input: &[f32], room: &mut Room<'a>) -> &'a [f32] {
    let output = room.take(batch * layer.outputs());
    layer.forward_relu(input, output);
    output
}
