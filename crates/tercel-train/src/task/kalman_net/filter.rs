//! The recursion of the filter.

use std::sync::Arc;

use nalgebra::Matrix4;
use tercel_core::motion::{Motion, Turn};
use tercel_neural::filter::{Feature, KalmanNetHyper};

use super::network::Network;
use super::operations::{Correction, Features, Hold};
use crate::Weights;
use crate::backend::{Tensor, apply, constant, detached};
use crate::task::flights::Rollout;

/// A batch of filters between two steps.
#[derive(Debug, Clone)]
pub struct State {
    /// `x̂(t|t)`.
    estimate: Tensor,
    /// `x̂(t|t-1) - x̂(t-1|t-1)`.
    moved: Tensor,
    /// `x̂(t|t) - x̂(t|t-1)`.
    corrected: Tensor,
    /// `y(t)`, or what was expected where nothing was seen.
    reading: Tensor,
    memory: Vec<Tensor>,
}

impl State {
    /// After the first reading, which is the origin: at rest, as the run time starts.
    pub(super) fn first(network: &Network, batch: usize) -> Self {
        let zeros = |width: usize| constant(vec![0.0; batch * width], [batch, width]);
        Self {
            estimate: zeros(4),
            moved: zeros(4),
            corrected: zeros(4),
            reading: zeros(2),
            memory: network.initial(batch),
        }
    }

    /// `x̂(t|t)`: `[batch, 4]`.
    pub(super) fn estimate(&self) -> &Tensor {
        &self.estimate
    }

    /// The same values, from which no gradient flows back.
    pub(super) fn detached(self) -> Self {
        Self {
            estimate: detached(self.estimate),
            moved: detached(self.moved),
            corrected: detached(self.corrected),
            reading: detached(self.reading),
            memory: self.memory.into_iter().map(detached).collect(),
        }
    }
}

/// What is the same at all steps.
#[derive(Debug)]
pub(super) struct Options {
    features: Vec<Feature>,
    normalise: bool,
    sensor_frame: bool,
    scales: Option<([f32; 4], f32)>,
    offset: [f32; 8],
    /// The transition, transposed, row by row.
    transition: Vec<f32>,
}

impl Options {
    pub(super) fn new(hyper: &KalmanNetHyper, turn_rate: f64, interval: f64) -> Self {
        let scales = KalmanNetHyper::default_scales();
        let scale = |name: &str| scales.get(name).map_or(1.0, |scale| scale.value as f32);
        let transition = Turn::new(turn_rate, 0.0).jacobian(&nalgebra::Vector4::zeros(), interval);
        let mut offset = [0.0; 8];
        for (to, value) in offset.iter_mut().zip(hyper.gain_offset.iter().flatten().flatten()) {
            *to = *value;
        }
        Self {
            features: hyper.features.clone(),
            normalise: hyper.normalise,
            sensor_frame: hyper.sensor_frame,
            scales: hyper.magnitudes.then(|| (["f1", "f2", "f3", "f4"].map(scale), scale("range"))),
            offset,
            transition: row_major(&transition.transpose()),
        }
    }

    /// One step of the batch.
    pub(super) fn step(
        &self,
        network: &Network,
        weights: &Weights,
        state: State,
        rollout: &Rollout,
        step: usize,
    ) -> State {
        let State { estimate, moved, corrected, reading: last, memory } = state;
        let batch = rollout.members;
        let seen = rollout.seen[step].clone();
        let reading = constant(rollout.readings[step].to_vec(), [batch, 2]);

        let predicted = estimate.clone().matmul(constant(self.transition.clone(), [4, 4]));
        let inputs = self.features(rollout, [reading.clone(), last, predicted.clone(), moved, corrected]);
        let (gain, next) = network.step(weights, inputs, &memory);
        let corrected = self.correction(rollout, step, gain, predicted.clone());
        let updated = predicted.clone() + corrected.clone();
        let hold = |new: Tensor, old: Tensor| apply(Hold { seen: Arc::clone(&seen) }, [new, old]);
        let (memory, reading) = if rollout.all_seen(step) {
            (next, reading)
        } else {
            let memory = next.into_iter().zip(memory).map(|(new, old)| hold(new, old)).collect();
            (memory, hold(reading, updated.clone().narrow(1, 0, 2)))
        };
        State { estimate: updated, moved: predicted - estimate, corrected, reading, memory }
    }

    fn features(&self, rollout: &Rollout, inputs: [Tensor; 5]) -> Tensor {
        let operation = Features {
            features: self.features.clone(),
            normalise: self.normalise,
            sensor_frame: self.sensor_frame,
            scales: self.scales,
            origins: Arc::clone(&rollout.origins),
        };
        apply(operation, inputs)
    }

    fn correction(&self, rollout: &Rollout, step: usize, gain: Tensor, predicted: Tensor) -> Tensor {
        let operation = Correction {
            sensor_frame: self.sensor_frame,
            offset: self.offset,
            origins: Arc::clone(&rollout.origins),
            readings: Arc::clone(&rollout.readings[step]),
            seen: Arc::clone(&rollout.seen[step]),
        };
        apply(operation, [gain, predicted])
    }
}

fn row_major(matrix: &Matrix4<f64>) -> Vec<f32> {
    matrix.transpose().iter().map(|value| *value as f32).collect()
}
