//! Synapses with conductances that the sender opens, packed for eight receivers at a time.

use super::activation::sigmoid_pass;
use super::dispatch::{Arithmetic, LANES};

/// Numbers of eight receivers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
struct Eight([f32; LANES]);

/// All synapses from some senders to some receivers.
///
/// ## Definition
/// ```text
/// open   s_ji = σ(γ_ji (u_j - μ_ji))
/// pull   N_i  = Σ_j w_ji E_ji s_ji            leak   D_i = Σ_j w_ji s_ji
/// ```
/// Receivers are padded to a multiple of eight with synapses of no strength.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Synapses {
    senders: usize,
    /// `γ`; eight receivers of one sender, then of the next sender, then the next eight receivers.
    slope: Vec<Eight>,
    /// `-γ μ`.
    shift: Vec<Eight>,
    /// `w`.
    strength: Vec<Eight>,
    /// `w E`.
    pull: Vec<Eight>,
    /// `γ w`.
    steep_strength: Vec<Eight>,
    /// `γ w E`.
    steep_pull: Vec<Eight>,
}

/// The numbers of synapses, each `[senders, receivers]` row by row.
#[derive(Debug, Clone, Copy)]
pub struct SynapseWeights<'a> {
    /// Before softplus: the conductance `w` of an open synapse.
    pub strength: &'a [f32],
    /// `γ`: how sharply a synapse opens.
    pub slope: &'a [f32],
    /// `μ`: the sender at which it is half open.
    pub centre: &'a [f32],
    /// `E`: the value to which it pulls its receiver.
    pub reversal: &'a [f32],
}

impl Synapses {
    /// Packs the numbers of a model file.
    pub fn new(senders: usize, receivers: usize, weights: SynapseWeights<'_>) -> Self {
        let SynapseWeights { strength, slope, centre, reversal } = weights;
        let lengths = [strength.len(), slope.len(), centre.len(), reversal.len()];
        assert_eq!(lengths, [senders * receivers; 4], "synapses from {senders} to {receivers}");
        let packed = |number: &dyn Fn(usize) -> f32| {
            let blocks = (0..receivers).step_by(LANES);
            blocks
                .flat_map(|first| (0..senders).map(move |sender| (first, sender)))
                .map(|(first, sender)| {
                    let of = |lane| (first + lane < receivers).then_some(sender * receivers + first + lane);
                    Eight(std::array::from_fn(|lane| of(lane).map_or(0.0, number)))
                })
                .collect()
        };
        let conductance = |i: usize| super::ltc::softplus(strength[i]);
        Synapses {
            senders,
            slope: packed(&|i| slope[i]),
            shift: packed(&|i| -slope[i] * centre[i]),
            strength: packed(&|i| conductance(i)),
            pull: packed(&|i| conductance(i) * reversal[i]),
            steep_strength: packed(&|i| slope[i] * conductance(i)),
            steep_pull: packed(&|i| slope[i] * conductance(i) * reversal[i]),
        }
    }

    pub fn senders(&self) -> usize {
        self.senders
    }

    /// Numbers that say how open the synapses are.
    pub fn count(&self) -> usize {
        self.slope.len() * LANES
    }

    /// Writes how open the synapses are, and adds their pull and leak. All rows of receivers are padded.
    #[inline(always)]
    pub fn add<A: Arithmetic>(
        &self,
        machine: A,
        senders: &[f32],
        open: &mut [f32],
        [pull, leak]: [&mut [f32]; 2],
    ) {
        let lanes = open.as_chunks_mut::<LANES>().0;
        for (block, open) in lanes.chunks_exact_mut(self.senders).enumerate() {
            let own = block * self.senders..(block + 1) * self.senders;
            let synapses = self.slope[own.clone()].iter().zip(&self.shift[own]);
            for ((open, sender), (slope, shift)) in open.iter_mut().zip(senders).zip(synapses) {
                let level = machine.gather(machine.splat(*sender), &slope.0, machine.load(&shift.0));
                *open = machine.numbers(level);
            }
        }
        sigmoid_pass::<A>(lanes.as_flattened_mut());
        let receivers = pull.as_chunks_mut::<LANES>().0.iter_mut().zip(leak.as_chunks_mut::<LANES>().0);
        for (block, (pull, leak)) in receivers.enumerate() {
            let own = block * self.senders..(block + 1) * self.senders;
            let (mut n, mut d) = (machine.load(pull), machine.load(leak));
            let synapses = self.pull[own.clone()].iter().zip(&self.strength[own.clone()]);
            for (open, (pull, strength)) in lanes[own].iter().zip(synapses) {
                let open = machine.load(open);
                n = machine.gather(open, &pull.0, n);
                d = machine.gather(open, &strength.0, d);
            }
            (*pull, *leak) = (machine.numbers(n), machine.numbers(d));
        }
    }

    /// Adds the tangents of pull and leak along a tangent of the senders. `steep` is `s (1 - s)` of the synapses.
    #[inline(always)]
    pub fn add_tangents<A: Arithmetic>(
        &self,
        machine: A,
        senders: &[f32],
        steep: &[f32],
        [pull, leak]: [&mut [f32]; 2],
    ) {
        let steep = steep.as_chunks::<LANES>().0;
        let receivers = pull.as_chunks_mut::<LANES>().0.iter_mut().zip(leak.as_chunks_mut::<LANES>().0);
        for (block, (pull, leak)) in receivers.enumerate() {
            let own = block * self.senders..(block + 1) * self.senders;
            let (mut n, mut d) = (machine.load(pull), machine.load(leak));
            let synapses = self.steep_pull[own.clone()].iter().zip(&self.steep_strength[own.clone()]);
            for ((steep, sender), (pull, strength)) in steep[own].iter().zip(senders).zip(synapses) {
                let moved = machine.times(machine.load(steep), machine.splat(*sender));
                n = machine.gather(moved, &pull.0, n);
                d = machine.gather(moved, &strength.0, d);
            }
            (*pull, *leak) = (machine.numbers(n), machine.numbers(d));
        }
    }
}

/// Turns how open synapses are into `s (1 - s)`.
#[inline(always)]
pub(super) fn steepness(open: &[f32], steep: &mut [f32]) {
    for (steep, open) in steep.iter_mut().zip(open) {
        *steep = *open - *open * *open;
    }
}
