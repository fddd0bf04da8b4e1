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
        }
    }

    pub fn senders(&self) -> usize {
        self.senders
    }

    /// Numbers of scratch space.
    pub fn scratch(&self) -> usize {
        LANES * self.senders
    }

    /// Adds pull and leak of the synapses to the first rows of `pull` and `leak`, and their tangents to the rows after them:
    /// one for each tangent of the senders, whose rows are `stride` apart. Rows of receivers are padded.
    #[inline(always)]
    pub fn add<A: Arithmetic>(
        &self,
        machine: A,
        (senders, slopes, stride): (&[f32], &[f32], usize),
        open: &mut [f32],
        [pull, leak]: [&mut [f32]; 2],
    ) {
        let width = self.slope.len() / self.senders;
        let open = &mut open.as_chunks_mut::<LANES>().0[..self.senders];
        let (pull, leak) = (pull.as_chunks_mut::<LANES>().0, leak.as_chunks_mut::<LANES>().0);
        for block in 0..width {
            let own = block * self.senders..(block + 1) * self.senders;
            let synapses = self.slope[own.clone()].iter().zip(&self.shift[own.clone()]);
            for ((open, sender), (slope, shift)) in open.iter_mut().zip(senders).zip(synapses) {
                let level = machine.gather(machine.splat(*sender), &slope.0, machine.load(&shift.0));
                *open = machine.numbers(level);
            }
            sigmoid_pass::<A>(open.as_flattened_mut());
            let conductances = (&self.pull[own.clone()], &self.strength[own.clone()]);
            accumulate(machine, open, conductances, (&mut pull[block], &mut leak[block]));
            if slopes.is_empty() {
                continue;
            }
            steepen(machine, &self.slope[own], open);
            let mut at = width + block;
            let mut pairs = slopes.chunks_exact(2 * stride);
            for pair in pairs.by_ref() {
                let tangents = pair.split_at(stride);
                let (before, after) = pull.split_at_mut(at + width);
                let pulls = [&mut before[at], &mut after[0]];
                let (before, after) = leak.split_at_mut(at + width);
                let leaks = [&mut before[at], &mut after[0]];
                accumulate_pair(machine, open, [tangents.0, tangents.1], conductances, (pulls, leaks));
                at += 2 * width;
            }
            if let last @ [_, ..] = pairs.remainder() {
                let sums = (&mut pull[at], &mut leak[at]);
                accumulate_along(machine, open, last, conductances, sums);
            }
        }
    }
}

/// `w E` and `w` of the synapses to eight receivers.
type Conductances<'a> = (&'a [Eight], &'a [Eight]);

/// Adds what open synapses do to eight receivers.
#[inline(always)]
fn accumulate<A: Arithmetic>(
    machine: A,
    open: &[[f32; LANES]],
    (pull, strength): Conductances<'_>,
    (to_pull, to_leak): (&mut [f32; LANES], &mut [f32; LANES]),
) {
    // Two sums of each kind, so that one need not wait for the other.
    let mut n = [machine.load(to_pull), machine.splat(0.0)];
    let mut d = [machine.load(to_leak), machine.splat(0.0)];
    let ((open, last), (pull, last_pull)) = (open.as_chunks::<2>(), pull.as_chunks::<2>());
    let (strength, last_strength) = strength.as_chunks::<2>();
    for (open, (pull, strength)) in open.iter().zip(pull.iter().zip(strength)) {
        let open = [machine.load(&open[0]), machine.load(&open[1])];
        n = [machine.gather(open[0], &pull[0].0, n[0]), machine.gather(open[1], &pull[1].0, n[1])];
        d = [machine.gather(open[0], &strength[0].0, d[0]), machine.gather(open[1], &strength[1].0, d[1])];
    }
    for (open, (pull, strength)) in last.iter().zip(last_pull.iter().zip(last_strength)) {
        let open = machine.load(open);
        (n[0], d[0]) = (machine.gather(open, &pull.0, n[0]), machine.gather(open, &strength.0, d[0]));
    }
    *to_pull = machine.numbers(machine.gather(n[1], &[1.0; LANES], n[0]));
    *to_leak = machine.numbers(machine.gather(d[1], &[1.0; LANES], d[0]));
}

/// Turns how open synapses are into how fast they open with their senders: `γ s (1 - s)`.
#[inline(always)]
fn steepen<A: Arithmetic>(machine: A, slope: &[Eight], open: &mut [[f32; LANES]]) {
    let one = machine.splat(1.0);
    for (open, slope) in open.iter_mut().zip(slope) {
        let s = machine.load(open);
        let shut = machine.gather(s, &[-1.0; LANES], one);
        let steep = machine.times(machine.times(s, shut), machine.load(&slope.0));
        *open = machine.numbers(steep);
    }
}

/// Adds what the synapses to eight receivers do along a tangent of their senders.
#[inline(always)]
fn accumulate_along<A: Arithmetic>(
    machine: A,
    steep: &[[f32; LANES]],
    senders: &[f32],
    (pull, strength): Conductances<'_>,
    (to_pull, to_leak): (&mut [f32; LANES], &mut [f32; LANES]),
) {
    let (mut n, mut d) = (machine.load(to_pull), machine.load(to_leak));
    for ((steep, sender), (pull, strength)) in steep.iter().zip(senders).zip(pull.iter().zip(strength)) {
        let moved = machine.times(machine.load(steep), machine.splat(*sender));
        n = machine.gather(moved, &pull.0, n);
        d = machine.gather(moved, &strength.0, d);
    }
    (*to_pull, *to_leak) = (machine.numbers(n), machine.numbers(d));
}

/// The same along two tangents at once, which reads the synapses once.
#[inline(always)]
fn accumulate_pair<A: Arithmetic>(
    machine: A,
    steep: &[[f32; LANES]],
    [one, other]: [&[f32]; 2],
    (pull, strength): Conductances<'_>,
    (to_pull, to_leak): ([&mut [f32; LANES]; 2], [&mut [f32; LANES]; 2]),
) {
    let mut n = [machine.load(to_pull[0]), machine.load(to_pull[1])];
    let mut d = [machine.load(to_leak[0]), machine.load(to_leak[1])];
    let senders = one.iter().zip(other);
    for ((steep, (one, other)), (pull, strength)) in steep.iter().zip(senders).zip(pull.iter().zip(strength))
    {
        let steep = machine.load(steep);
        let one = machine.times(steep, machine.splat(*one));
        let other = machine.times(steep, machine.splat(*other));
        n = [machine.gather(one, &pull.0, n[0]), machine.gather(other, &pull.0, n[1])];
        d = [machine.gather(one, &strength.0, d[0]), machine.gather(other, &strength.0, d[1])];
    }
    let ([pull_one, pull_other], [leak_one, leak_other]) = (to_pull, to_leak);
    (*pull_one, *pull_other) = (machine.numbers(n[0]), machine.numbers(n[1]));
    (*leak_one, *leak_other) = (machine.numbers(d[0]), machine.numbers(d[1]));
}
