//! The operations of a KalmanNet step, each with a backward pass of its own.
//!
//! A step of 128 filters is many operations on few numbers, and each costs more for being recorded than for
//! its arithmetic. So what a step needs beside its network is four operations.

use std::sync::Arc;

use tercel_neural::filter::Feature;

use crate::backend::{Forward, Matrix, Operation, Past};

/// A pair of components.
type Pair = [f32; 2];

/// The direction of the line of sight to the predicted position, and its length.
#[derive(Debug, Clone, Copy)]
struct View {
    cosine: f32,
    sine: f32,
    range: f32,
}

impl View {
    fn new(predicted: &[f32], origin: &[f32], sensor_frame: bool) -> Self {
        let [x, y] = [predicted[0] + origin[0], predicted[1] + origin[1]];
        let range = x.hypot(y);
        if sensor_frame && range > 0.0 && range.is_finite() {
            Self { cosine: x / range, sine: y / range, range }
        } else {
            Self { cosine: 1.0, sine: 0.0, range }
        }
    }

    /// A vector of the state's frame, in that of the line of sight.
    fn turned(&self, [x, y]: Pair) -> Pair {
        [self.cosine * x + self.sine * y, self.cosine * y - self.sine * x]
    }

    /// A vector of the frame of the line of sight, in that of the state.
    fn turned_back(&self, [x, y]: Pair) -> Pair {
        [self.cosine * x - self.sine * y, self.cosine * y + self.sine * x]
    }
}

/// The inputs of the network, of `y`, the last reading, the predicted state, and the last motion and
/// correction: `[batch, 2]`, `[batch, 2]`, and `[batch, 4]` thrice.
///
/// The definition is that of [`KalmanNetHyper`](tercel_neural::filter::KalmanNetHyper). What depends on the
/// direction or length of the line of sight is not differentiated: a metre more or less is nothing at a range
/// of kilometres.
#[derive(Debug, Clone)]
pub(super) struct Features {
    pub(super) features: Vec<Feature>,
    pub(super) normalise: bool,
    pub(super) sensor_frame: bool,
    /// The scales of the features and of the range, if there are magnitudes.
    pub(super) scales: Option<([f32; 4], f32)>,
    pub(super) origins: Arc<Vec<f32>>,
}

/// The smallest length that a feature is divided by.
const SHORTEST: f32 = 1e-12;

impl Features {
    fn width(&self) -> usize {
        let features: usize = self.features.iter().map(|feature| feature.width()).sum();
        features + self.scales.map_or(0, |_| self.features.len() + 1)
    }

    /// A feature before it is turned and divided; unused components are zero.
    fn difference(feature: Feature, row: &Row<'_>) -> [f32; 4] {
        let pair = |a: &[f32], b: &[f32]| [a[0] - b[0], a[1] - b[1], 0.0, 0.0];
        match feature {
            Feature::F1 => pair(row.reading, row.last),
            Feature::F2 => pair(row.reading, row.predicted),
            Feature::F3 => std::array::from_fn(|i| row.moved[i] + row.corrected[i]),
            Feature::F4 => std::array::from_fn(|i| row.corrected[i]),
        }
    }
}

/// What one filter of the batch has.
struct Row<'a> {
    reading: &'a [f32],
    last: &'a [f32],
    predicted: &'a [f32],
    moved: &'a [f32],
    corrected: &'a [f32],
    origin: &'a [f32],
}

fn rows<'a>(inputs: &'a [Matrix; 5], origins: &'a [f32]) -> impl Iterator<Item = Row<'a>> {
    let [reading, last, predicted, moved, corrected] = inputs;
    (0..reading.rows()).map(move |row| Row {
        reading: &reading.values()[2 * row..][..2],
        last: &last.values()[2 * row..][..2],
        predicted: &predicted.values()[4 * row..][..4],
        moved: &moved.values()[4 * row..][..4],
        corrected: &corrected.values()[4 * row..][..4],
        origin: &origins[2 * row..][..2],
    })
}

fn length(value: &[f32; 4]) -> f32 {
    value.iter().map(|x| x * x).sum::<f32>().sqrt()
}

impl Operation<5> for Features {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 5]) -> Forward<()> {
        let shape = [inputs[0].rows(), self.width()];
        let mut values = Vec::with_capacity(shape[0] * shape[1]);
        for row in rows(inputs, &self.origins) {
            let view = View::new(row.predicted, row.origin, self.sensor_frame);
            let mut magnitudes = [0.0; 4];
            for (feature, magnitude) in self.features.iter().zip(&mut magnitudes) {
                let value = Self::difference(*feature, &row);
                let length = length(&value);
                let divisor = if self.normalise { length.max(SHORTEST) } else { 1.0 };
                for pair in &value.as_chunks::<2>().0[..feature.width() / 2] {
                    values.extend(view.turned(*pair).map(|x| x / divisor));
                }
                if let Some((scales, _)) = self.scales {
                    *magnitude = (length / scales[*feature as usize]).ln_1p();
                }
            }
            if let Some((_, scale)) = self.scales {
                values.extend(&magnitudes[..self.features.len()]);
                values.push((view.range.max(1.0) / scale).ln());
            }
        }
        Forward { values, shape, saved: () }
    }

    fn backward(&self, past: Past<'_, (), 5>, gradient: &[f32]) -> [Option<Vec<f32>>; 5] {
        let batch = past.inputs[0].rows();
        let [mut last, mut predicted] = [vec![0.0; 2 * batch], vec![0.0; 4 * batch]];
        let [mut moved, mut corrected] = [vec![0.0; 4 * batch], vec![0.0; 4 * batch]];
        let given = gradient.chunks_exact(self.width());
        for ((index, row), gradient) in rows(past.inputs, &self.origins).enumerate().zip(given) {
            let view = View::new(row.predicted, row.origin, self.sensor_frame);
            let widths: usize = self.features.iter().map(|feature| feature.width()).sum();
            let (mut turned, magnitudes) = gradient.split_at(widths);
            for (place, feature) in self.features.iter().enumerate() {
                let (own, rest) = turned.split_at(feature.width());
                turned = rest;
                let magnitude = self.scales.map(|(scales, _)| (magnitudes[place], scales[*feature as usize]));
                let slope = self.slope(&Self::difference(*feature, &row), &view, own, magnitude);
                let pair = 2 * index..2 * index + 2;
                let four = 4 * index..4 * index + 4;
                let add = |to: &mut [f32], sign: f32| {
                    to.iter_mut().zip(slope).for_each(|(to, slope)| *to += sign * slope);
                };
                match feature {
                    Feature::F1 => add(&mut last[pair], -1.0),
                    Feature::F2 => add(&mut predicted[four.start..four.start + 2], -1.0),
                    Feature::F3 => {
                        add(&mut moved[four.clone()], 1.0);
                        add(&mut corrected[four], 1.0);
                    }
                    Feature::F4 => add(&mut corrected[four], 1.0),
                }
            }
        }
        // Readings are given.
        [None, Some(last), Some(predicted), Some(moved), Some(corrected)]
    }
}

impl Features {
    /// The gradient with respect to a difference, given that of its turned form and of its magnitude (with
    /// the scale).
    fn slope(
        &self,
        value: &[f32; 4],
        view: &View,
        turned: &[f32],
        magnitude: Option<(f32, f32)>,
    ) -> [f32; 4] {
        let mut slope = [0.0; 4];
        for (slope, pair) in slope.as_chunks_mut::<2>().0.iter_mut().zip(turned.as_chunks::<2>().0) {
            *slope = view.turned_back(*pair);
        }
        let length = length(value);
        if length <= SHORTEST {
            // No direction to follow: the slope of a division by so little would be noise.
            return if self.normalise { [0.0; 4] } else { slope };
        }
        let unit = value.map(|x| x / length);
        if self.normalise {
            let along: f32 = unit.iter().zip(slope).map(|(u, s)| u * s).sum();
            for (slope, unit) in slope.iter_mut().zip(unit) {
                *slope = (*slope - along * unit) / length;
            }
        }
        if let Some((gradient, scale)) = magnitude {
            for (slope, unit) in slope.iter_mut().zip(unit) {
                *slope += gradient * unit / (scale + length);
            }
        }
        slope
    }
}

/// `K (y - H x⁻)`, of the gain of the network and the predicted state; zero where nothing was seen.
#[derive(Debug, Clone)]
pub(super) struct Correction {
    pub(super) sensor_frame: bool,
    /// Added to the gain of the network.
    pub(super) offset: [f32; 8],
    pub(super) origins: Arc<Vec<f32>>,
    pub(super) readings: Arc<Vec<f32>>,
    pub(super) seen: Arc<Vec<f32>>,
}

impl Correction {
    /// The gain with the offset, the innovation in the frame of the gain, and the view.
    fn parts(&self, [gain, predicted]: &[Matrix; 2], row: usize) -> ([f32; 8], Pair, View) {
        let predicted = &predicted.values()[4 * row..][..4];
        let view = View::new(predicted, &self.origins[2 * row..][..2], self.sensor_frame);
        let reading = &self.readings[2 * row..][..2];
        let innovation = view.turned([reading[0] - predicted[0], reading[1] - predicted[1]]);
        let gain = &gain.values()[8 * row..][..8];
        (std::array::from_fn(|i| gain[i] + self.offset[i]), innovation, view)
    }
}

impl Operation<2> for Correction {
    type Saved = ();

    fn forward(&self, inputs: &[Matrix; 2]) -> Forward<()> {
        let batch = inputs[0].rows();
        let mut values = vec![0.0; 4 * batch];
        for (row, (value, seen)) in values.as_chunks_mut::<4>().0.iter_mut().zip(&*self.seen).enumerate() {
            let (k, [a, b], view) = self.parts(inputs, row);
            for block in 0..2 {
                let k = &k[4 * block..][..4];
                let [x, y] = view.turned_back([k[0] * a + k[1] * b, k[2] * a + k[3] * b]);
                value[2 * block] = seen * x;
                value[2 * block + 1] = seen * y;
            }
        }
        Forward { values, shape: [batch, 4], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let batch = past.inputs[0].rows();
        let (mut of_gain, mut of_state) = (vec![0.0; 8 * batch], vec![0.0; 4 * batch]);
        for (row, gradient) in gradient.as_chunks::<4>().0.iter().enumerate() {
            let (k, [a, b], view) = self.parts(past.inputs, row);
            let seen = self.seen[row];
            let mut of_innovation = [0.0; 2];
            for block in 0..2 {
                let [x, y] = view.turned([seen * gradient[2 * block], seen * gradient[2 * block + 1]]);
                of_gain[8 * row + 4 * block..][..4].copy_from_slice(&[x * a, x * b, y * a, y * b]);
                let k = &k[4 * block..][..4];
                of_innovation[0] += k[0] * x + k[2] * y;
                of_innovation[1] += k[1] * x + k[3] * y;
            }
            let [x, y] = view.turned_back(of_innovation);
            of_state[4 * row..][..2].copy_from_slice(&[-x, -y]);
        }
        [Some(of_gain), Some(of_state)]
    }
}

/// The first of two matrices in the rows that were seen, the second in the others.
#[derive(Debug, Clone)]
pub(super) struct Hold {
    pub(super) seen: Arc<Vec<f32>>,
}

impl Operation<2> for Hold {
    type Saved = ();

    fn forward(&self, [new, old]: &[Matrix; 2]) -> Forward<()> {
        let width = new.columns();
        let rows = new.values().chunks_exact(width).zip(old.values().chunks_exact(width));
        let chosen =
            rows.zip(&*self.seen).flat_map(|((new, old), seen)| if *seen == 1.0 { new } else { old });
        Forward { values: chosen.copied().collect(), shape: [new.rows(), width], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 2>, gradient: &[f32]) -> [Option<Vec<f32>>; 2] {
        let width = past.value.columns();
        let part = |which: f32| {
            let rows = gradient.chunks_exact(width).zip(&*self.seen);
            rows.flat_map(|(row, seen)| row.iter().map(move |g| if *seen == which { *g } else { 0.0 }))
                .collect()
        };
        [Some(part(1.0)), Some(part(0.0))]
    }
}

/// Some columns of a matrix, side by side.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    pub(super) columns: Vec<usize>,
}

impl Operation<1> for Columns {
    type Saved = ();

    fn forward(&self, [x]: &[Matrix; 1]) -> Forward<()> {
        let rows = x.values().chunks_exact(x.columns());
        let values = rows.flat_map(|row| self.columns.iter().map(|column| row[*column])).collect();
        Forward { values, shape: [x.rows(), self.columns.len()], saved: () }
    }

    fn backward(&self, past: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        let [x] = past.inputs;
        let mut found = vec![0.0; x.rows() * x.columns()];
        let rows = found.chunks_exact_mut(x.columns()).zip(gradient.chunks_exact(self.columns.len()));
        for (found, gradient) in rows {
            self.columns.iter().zip(gradient).for_each(|(column, gradient)| found[*column] += gradient);
        }
        [Some(found)]
    }
}
