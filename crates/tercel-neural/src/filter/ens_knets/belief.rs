//! What an ensemble of KalmanNets knows of one object.

use nalgebra::{Matrix2, Vector2, Vector4};

use super::network::EnsembleNetwork;
use crate::filter::kalman_net::KalmanNetBelief;
use crate::filter::memory::{Memory, share};

/// What a KalmanNet made of the last measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Its state after the measurement: `x, y, vx, vy`.
    pub state: Vector4<f64>,
    /// Innovation: measured minus expected position, m.
    pub residual: Vector2<f64>,
    /// Covariance of the innovation, m².
    pub spread: Matrix2<f64>,
    /// Normalised innovation squared.
    pub nis: f64,
    /// Logarithm of the measurement's density.
    pub log_likelihood: f64,
}

/// One KalmanNet of an ensemble, and what the ensemble thinks of it.
#[derive(Debug, Clone)]
pub(super) struct Mode {
    pub net: KalmanNetBelief,
    pub evidence: Evidence,
    /// By attention.
    pub weight: f64,
    /// By the classification branch.
    pub probability: f64,
    /// What the correction branch adds to the state: m, m/s.
    pub correction: Vector4<f64>,
}

impl Mode {
    pub fn new(net: KalmanNetBelief, state: Vector4<f64>, count: usize) -> Self {
        let evidence = Evidence {
            state,
            residual: Vector2::zeros(),
            spread: Matrix2::identity(),
            nis: 0.0,
            log_likelihood: 0.0,
        };
        let even = 1.0 / count as f64;
        Mode { net, evidence, weight: even, probability: even, correction: Vector4::zeros() }
    }

    /// Copies another mode without allocating.
    pub fn copy(&mut self, other: &Mode) {
        self.net.clone_from(&other.net);
        self.evidence = other.evidence;
        (self.weight, self.probability) = (other.weight, other.probability);
        self.correction = other.correction;
    }
}

/// What an [`EnsKNets`](super::EnsKNets) knows of one object.
#[derive(Debug)]
pub struct EnsKNetsBelief {
    pub(super) modes: Vec<Mode>,
    /// Room for a step, which takes the place of the modes when all of it has succeeded.
    pub(super) next: Vec<Mode>,
    /// Exponential mean of the smallest normalised innovation squared.
    pub(super) level: f64,
    /// Time since the last measurement, s.
    pub(super) waited: f64,
    /// Where the object was born.
    pub(super) anchor: Vector2<f64>,
    pub(super) memory: Memory,
    pub(super) features: Vec<f32>,
    pub(super) inputs: Vec<f32>,
    pub(super) outputs: Vec<f32>,
}

impl EnsKNetsBelief {
    pub(super) fn new(network: &EnsembleNetwork, modes: Vec<Mode>, anchor: Vector2<f64>) -> Self {
        let hyper = network.hyper();
        EnsKNetsBelief {
            next: modes.clone(),
            modes,
            level: super::attention::USUAL,
            waited: 0.0,
            anchor,
            memory: Memory::new(&vec![0.0; network.memory()], network.scratch()),
            features: vec![0.0; hyper.inputs()],
            inputs: vec![0.0; hyper.inputs()],
            outputs: vec![0.0; hyper.outputs()],
        }
    }

    /// How much attention each KalmanNet gets for its innovations; all alike without attention.
    pub fn weights(&self) -> impl ExactSizeIterator<Item = f64> {
        self.modes.iter().map(|mode| mode.weight)
    }

    /// The probability of each KalmanNet, as the classification branch sees it; all alike without one.
    pub fn probabilities(&self) -> impl ExactSizeIterator<Item = f64> {
        self.modes.iter().map(|mode| mode.probability)
    }

    /// What the correction branch adds to the state of each KalmanNet: `x, y, vx, vy` in m and m/s.
    pub fn corrections(&self) -> impl ExactSizeIterator<Item = Vector4<f64>> {
        self.modes.iter().map(|mode| mode.correction)
    }

    /// What each KalmanNet made of the last measurement.
    pub fn evidence(&self) -> impl ExactSizeIterator<Item = &Evidence> {
        self.modes.iter().map(|mode| &mode.evidence)
    }

    /// What the branches were offered at the last measurement, before it was normalised.
    pub fn features(&self) -> &[f32] {
        &self.features
    }

    /// What the branches saw at the last measurement.
    pub fn inputs(&self) -> &[f32] {
        &self.inputs
    }

    /// What the branches answered: a correction for each KalmanNet in units of the card, then a logit for
    /// each.
    pub fn outputs(&self) -> &[f32] {
        &self.outputs
    }

    /// Takes the means of what is no state: of weights, probabilities, corrections and memories.
    pub(super) fn merge_thoughts(
        &mut self,
        network: &EnsembleNetwork,
        weight: f64,
        other: &Self,
        other_weight: f64,
    ) {
        // Remembered positions must count from one place.
        network.shift(self.memory.stage().0, self.anchor - other.anchor);
        self.memory.commit();
        self.anchor = other.anchor;
        let common = share(weight, other_weight);
        for (ours, theirs) in self.modes.iter_mut().zip(&other.modes) {
            // As the states: each with its share of the probabilities.
            let own = share(weight * ours.probability, other_weight * theirs.probability);
            ours.correction += (theirs.correction - ours.correction) * own;
            ours.weight += (theirs.weight - ours.weight) * common;
            ours.probability += (theirs.probability - ours.probability) * common;
        }
        self.level += (other.level - self.level) * common;
        self.waited += (other.waited - self.waited) * common;
        self.memory.merge(weight, &other.memory, other_weight);
    }
}

impl Clone for EnsKNetsBelief {
    fn clone(&self) -> Self {
        EnsKNetsBelief {
            modes: self.modes.clone(),
            next: self.next.clone(),
            level: self.level,
            waited: self.waited,
            anchor: self.anchor,
            memory: self.memory.clone(),
            features: self.features.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
        }
    }

    fn clone_from(&mut self, source: &Self) {
        if self.modes.len() != source.modes.len() {
            *self = source.clone();
            return;
        }
        for (mode, other) in self.modes.iter_mut().zip(&source.modes) {
            mode.copy(other);
        }
        (self.level, self.waited, self.anchor) = (source.level, source.waited, source.anchor);
        self.memory.clone_from(&source.memory);
        self.features.clone_from(&source.features);
        self.inputs.clone_from(&source.inputs);
        self.outputs.clone_from(&source.outputs);
    }
}
