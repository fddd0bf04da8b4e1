//! Models with random weights, for tests and benchmarks that need none in particular.

#![allow(dead_code, clippy::unwrap_used)]

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tercel_neural::filter::{Architecture, Covariance, Feature, GainNetwork, KalmanNetHyper};
use tercel_neural::{Card, Model, Tensor};

/// The state of all filters here.
pub const STATE: [&str; 4] = ["x", "y", "vx", "vy"];

/// Gains of an alpha-beta filter for the objects of the conformance suite.
pub const ALPHA_BETA: [[f32; 2]; 4] = [[0.4, 0.0], [0.0, 0.4], [0.1, 0.0], [0.0, 0.1]];

/// A KalmanNet whose weights are uniform within `size`, times the inverse root of what each output sums.
pub fn kalman_net(hyper: &KalmanNetHyper, size: f32, seed: u64) -> Model {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let tensors = hyper.tensors().into_iter().map(|(name, shape)| {
        let count: usize = shape.iter().product();
        let bound = size / (shape[0] as f32).sqrt();
        let values = (0..count).map(|_| random.random_range(-bound..bound)).collect();
        (name, Tensor { shape, values })
    });
    let mut card = Card::new("untrained", "kalman-net", &STATE);
    card.hyper = hyper.to_table().unwrap();
    card.scales = KalmanNetHyper::default_scales();
    Model::new(card, tensors.collect()).unwrap()
}

pub fn network(hyper: &KalmanNetHyper, size: f32) -> Arc<GainNetwork> {
    Arc::new(GainNetwork::from_model(&kalman_net(hyper, size, 1)).unwrap())
}

/// Small networks with everything that differs from the publication, beside an alpha-beta filter.
pub fn tiny(architecture: Architecture, covariance: Covariance) -> KalmanNetHyper {
    KalmanNetHyper {
        features: Feature::ALL.to_vec(),
        magnitudes: true,
        sensor_frame: true,
        covariance,
        gain_offset: Some(ALPHA_BETA),
        ..KalmanNetHyper::paper(architecture)
    }
}

pub const TINY_ONE: Architecture = Architecture::Stacked { input: 12, hidden: 9, layers: 2, head: 5 };
pub const TINY_TWO: Architecture = Architecture::Branched { in_mult: 2, out_mult: 3 };
