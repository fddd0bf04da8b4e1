//! Synapses with conductances that the sender opens, and the way back through them.

use super::ltc::{softplus, softplus_slope};
use crate::backend::vector::{sigmoid, vectorised};
use crate::backend::{Matrix, Tensor};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// The parameters of synapses from some senders to some receivers.
#[derive(Debug, Clone)]
pub(super) struct SynapseIds([ParameterId; 4]);

impl SynapseIds {
    pub fn new(set: &mut ParameterSet, name: &str, shape: [usize; 2]) -> Result<Self, TrainError> {
        let high = (8.0 / shape[0] as f32).min(1.0);
        let mut add = |part: &str, initial| set.add(&format!("{name}.{part}"), &shape, initial);
        Ok(Self([
            add("strength", Initial::Positive { low: 0.001 * high, high })?,
            add("slope", Initial::Between { low: 3.0, high: 8.0 })?,
            add("centre", Initial::Uniform { bound: 0.8 })?,
            add("reversal", Initial::Signs)?,
        ]))
    }

    pub fn tensors(&self, weights: &Weights) -> [Tensor; 4] {
        self.0.map(|id| weights.get(id))
    }
}

/// Synapses as sums need them: `[senders, receivers]`, row by row.
///
/// ```text
/// s = σ(γ u - γ μ)       N = Σ w E s       D = Σ w s
/// ```
pub(super) struct Synapses {
    receivers: usize,
    slope: Vec<f32>,
    /// `-γ μ`.
    shift: Vec<f32>,
    /// `w`.
    strength: Vec<f32>,
    /// `w E`.
    pull: Vec<f32>,
}

impl Synapses {
    /// Of strength, slope, centre and reversal as they are trained.
    pub fn new([strength, slope, centre, reversal]: [&Matrix; 4]) -> Self {
        let strengths: Vec<f32> = strength.values().iter().map(|raw| softplus(*raw)).collect();
        Self {
            receivers: strength.columns(),
            slope: slope.values().to_vec(),
            shift: slope
                .values()
                .iter()
                .zip(centre.values())
                .map(|(slope, centre)| -slope * centre)
                .collect(),
            pull: strengths.iter().zip(reversal.values()).map(|(w, e)| w * e).collect(),
            strength: strengths,
        }
    }

    fn senders(&self) -> usize {
        self.slope.len() / self.receivers
    }

    /// Adds pull and leak of the synapses to rows of receivers.
    pub fn add(&self, senders: &[f32], pull: &mut [f32], leak: &mut [f32]) {
        let mut open = vec![0.0; self.receivers];
        receive(self, senders, &mut open, pull, leak);
    }

    /// From gradients of pull and leak to those of the synapses, and of the senders if they are wanted.
    pub fn retreat(
        &self,
        senders: &[f32],
        [pull, leak]: [&[f32]; 2],
        found: &mut Slopes,
        of_senders: Option<&mut [f32]>,
    ) {
        let mut room = vec![0.0; 2 * self.receivers];
        let mut unwanted = Vec::new();
        let of_senders = match of_senders {
            Some(of_senders) => of_senders,
            None => {
                unwanted.resize(senders.len(), 0.0);
                &mut unwanted
            }
        };
        send_back(self, senders, pull, leak, &mut room, found, of_senders);
    }
}

/// Sums over members and evaluations from which the gradients of synapses follow.
pub(super) struct Slopes {
    /// Of `γ u - γ μ`, times the sender.
    level_sender: Vec<f32>,
    /// Of `γ u - γ μ`.
    level: Vec<f32>,
    /// Of `w E`.
    pull: Vec<f32>,
    /// Of `w` alone.
    strength: Vec<f32>,
}

impl Slopes {
    pub fn new(synapses: &Synapses) -> Self {
        let zero = || vec![0.0; synapses.slope.len()];
        Self { level_sender: zero(), level: zero(), pull: zero(), strength: zero() }
    }

    /// Gradients of strength, slope, centre and reversal as they are trained.
    pub fn of_parameters(
        &self,
        synapses: &Synapses,
        [strength, _, centre, reversal]: [&Matrix; 4],
    ) -> [Vec<f32>; 4] {
        let all = 0..self.level.len();
        let (raw, centre, reversal) = (strength.values(), centre.values(), reversal.values());
        let of_strength = |k: usize| (self.pull[k] * reversal[k] + self.strength[k]) * softplus_slope(raw[k]);
        [
            all.clone().map(of_strength).collect(),
            all.clone().map(|k| self.level_sender[k] - centre[k] * self.level[k]).collect(),
            all.clone().map(|k| -synapses.slope[k] * self.level[k]).collect(),
            all.map(|k| self.pull[k] * synapses.strength[k]).collect(),
        ]
    }
}

vectorised! {
    fn receive<'a>(
        synapses: &'a Synapses,
        senders: &'a [f32],
        open: &'a mut [f32],
        pull: &'a mut [f32],
        leak: &'a mut [f32],
    ) {
        let size = synapses.receivers;
        let sums = pull.chunks_exact_mut(size).zip(leak.chunks_exact_mut(size));
        for (senders, (pull, leak)) in senders.chunks_exact(synapses.senders()).zip(sums) {
            for (j, sender) in senders.iter().enumerate() {
                let own = j * size..(j + 1) * size;
                opened(open, *sender, &synapses.slope[own.clone()], &synapses.shift[own.clone()]);
                add_products(pull, open, &synapses.pull[own.clone()]);
                add_products(leak, open, &synapses.strength[own]);
            }
        }
    }
}

vectorised! {
    fn send_back<'a>(
        synapses: &'a Synapses,
        senders: &'a [f32],
        pull: &'a [f32],
        leak: &'a [f32],
        room: &'a mut [f32],
        found: &'a mut Slopes,
        of_senders: &'a mut [f32],
    ) {
        let (size, count) = (synapses.receivers, synapses.senders());
        let (open, level) = room.split_at_mut(size);
        let members = senders.chunks_exact(count).zip(of_senders.chunks_exact_mut(count));
        let sums = pull.chunks_exact(size).zip(leak.chunks_exact(size));
        for ((senders, of_senders), (pull, leak)) in members.zip(sums) {
            for (j, (sender, of_sender)) in senders.iter().zip(of_senders).enumerate() {
                let own = j * size..(j + 1) * size;
                let slope = &synapses.slope[own.clone()];
                opened(open, *sender, slope, &synapses.shift[own.clone()]);
                add_products(&mut found.pull[own.clone()], open, pull);
                add_products(&mut found.strength[own.clone()], open, leak);
                level.fill(0.0);
                add_products(level, pull, &synapses.pull[own.clone()]);
                add_products(level, leak, &synapses.strength[own.clone()]);
                for (level, open) in level.iter_mut().zip(open.iter()) {
                    *level *= open * (1.0 - open);
                }
                *of_sender += dot(level, slope);
                for (to, level) in found.level[own.clone()].iter_mut().zip(level.iter()) {
                    *to += level;
                }
                for (to, level) in found.level_sender[own].iter_mut().zip(level.iter()) {
                    *to += level * sender;
                }
            }
        }
    }
}

/// How open the synapses of a sender are.
#[inline(always)]
fn opened(open: &mut [f32], sender: f32, slope: &[f32], shift: &[f32]) {
    for ((open, slope), shift) in open.iter_mut().zip(slope).zip(shift) {
        *open = sender * slope + shift;
    }
    for open in open {
        *open = sigmoid(*open);
    }
}

#[inline(always)]
fn add_products(to: &mut [f32], a: &[f32], b: &[f32]) {
    for ((to, a), b) in to.iter_mut().zip(a).zip(b) {
        *to += a * b;
    }
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    // Eight sums side by side; one could not be vectorised without changing its rounding.
    let mut sums = [0.0_f32; 8];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a.iter().zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}
