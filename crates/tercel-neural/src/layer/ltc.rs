//! The liquid time-constant cell.

use serde::{Deserialize, Serialize};

use super::dispatch::{Arithmetic, Kernel, LANES, dispatch};
use super::synapses::{SynapseWeights, Synapses};
use super::tangents::Tangents;

/// How the differential equation of an [`Ltc`] is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Implicit in the neuron itself and explicit in its synapses: stable for steps of any length.
    #[default]
    Fused,
    /// Euler's explicit method: unstable for steps that are long against the time constants.
    Euler,
    /// The classical method of Runge and Kutta, of fourth order, at four times the cost; unstable as Euler's is.
    RungeKutta,
}

/// One layer of neurons with liquid time constants: their synapses change how fast they forget.
///
/// ## Recursion
/// With the neurons `v`, the input `x`, and `u` running over both:
/// ```text
/// C_i dv_i/dt = g_i (r_i - v_i) + Σ_j w_ji σ(γ_ji (u_j - μ_ji)) (E_ji - v_i)
/// ```
/// over `elapsed`, with the input held, in `unfolds` steps of length `δ`. [`Solver::Fused`] takes each as
/// ```text
/// v_i ← [C_i/δ v_i + g_i r_i + N_i] / [C_i/δ + g_i + D_i + 1e-8],      N_i = Σ_j w σ E,  D_i = Σ_j w σ
/// ```
/// The parts `N` and `D` of the input do not change between the steps. [`step_along`](Ltc::step_along) carries derivatives
/// through all of them, which makes the Jacobian exact; the memory before the first counts as given.
///
/// A model file holds `NAME.leak`, `NAME.rest`, `NAME.capacitance`, each `[h]`, and for `FROM` = `input` (`n` is the width
/// of the input) and `hidden` (`n` is `h`) the numbers `NAME.FROM.strength`, `NAME.FROM.slope`, `NAME.FROM.centre` and
/// `NAME.FROM.reversal`, each `[n, h]`. Leak `g`, capacitance `C` and strength `w` go through `ln(1 + eˣ)`, which keeps
/// them positive.
///
/// ## Use it when
/// steps have different lengths, or to compare with a [`Gru`](super::Gru) of the same width, which is some fifteen times
/// cheaper. Inputs must be of order one: far from `μ` all synapses are shut or open and nothing has a derivative.
///
/// ## Reference
/// Hasani, Lechner, Amini, Rus and Grosu, "Liquid time-constant networks", AAAI (2021), eq. 1 and Algorithm 1, with the
/// synapses of Lechner and Hasani (2020). Deviations: inputs are not scaled before the synapses, whose `γ` and `μ` do it;
/// all neurons are connected. `elapsed` divides the capacitance, as in later code of the authors.
///
/// ```
/// use tercel_neural::layer::{Ltc, LtcWeights, Solver, SynapseWeights};
///
/// let synapses = |count| [vec![0.5; count], vec![3.0; count], vec![0.3; count], vec![1.0; count]];
/// let (input, hidden) = (synapses(2), synapses(4));
/// fn of(s: &[Vec<f32>; 4]) -> SynapseWeights<'_> {
///     SynapseWeights { strength: &s[0], slope: &s[1], centre: &s[2], reversal: &s[3] }
/// }
/// let weights = LtcWeights {
///     leak: &[0.5; 2],
///     rest: &[0.0; 2],
///     capacitance: &[0.5; 2],
///     input: of(&input),
///     hidden: of(&hidden),
/// };
/// let layer = Ltc::new(1, 2, Solver::Fused, 6, weights);
/// let (mut memory, mut scratch) = ([0.0; 2], vec![0.0; layer.scratch(0)]);
/// layer.step(1.0, &[1.0], &mut memory, &mut scratch);
/// assert!(memory[0] > 0.1 && memory[0] == memory[1]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Ltc {
    solver: Solver,
    unfolds: usize,
    size: usize,
    /// `g`, `g r` and `C`, padded as the receivers of synapses are.
    leak: Vec<f32>,
    rest: Vec<f32>,
    capacitance: Vec<f32>,
    input: Synapses,
    hidden: Synapses,
}

/// The numbers of an [`Ltc`], as in a model file.
#[derive(Debug, Clone, Copy)]
pub struct LtcWeights<'a> {
    /// Before softplus: `g`.
    pub leak: &'a [f32],
    /// `r`: the value to which a neuron returns.
    pub rest: &'a [f32],
    /// Before softplus: `C`.
    pub capacitance: &'a [f32],
    /// From the input.
    pub input: SynapseWeights<'a>,
    /// Among the neurons.
    pub hidden: SynapseWeights<'a>,
}

/// Keeps a neuron without leak and open synapses from dividing by zero.
const TINY: f32 = 1e-8;

/// `ln(1 + eˣ)`.
pub(super) fn softplus(x: f32) -> f32 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

impl Ltc {
    /// A layer with these weights.
    ///
    /// # Panics
    /// When a slice has another length than the sizes say, or there are no unfolds.
    pub fn new(inputs: usize, size: usize, solver: Solver, unfolds: usize, weights: LtcWeights<'_>) -> Self {
        let LtcWeights { leak, rest, capacitance, input, hidden } = weights;
        assert_eq!([leak.len(), rest.len(), capacitance.len()], [size; 3], "neurons of an LTC");
        assert!(unfolds > 0, "an LTC takes at least one step");
        let padded = |number: &dyn Fn(usize) -> f32, rest: f32| {
            (0..size.next_multiple_of(LANES)).map(|i| if i < size { number(i) } else { rest }).collect()
        };
        Ltc {
            solver,
            unfolds,
            size,
            leak: padded(&|i| softplus(leak[i]), 0.0),
            rest: padded(&|i| softplus(leak[i]) * rest[i], 0.0),
            capacitance: padded(&|i| softplus(capacitance[i]), 1.0),
            input: Synapses::new(inputs, size, input),
            hidden: Synapses::new(size, size, hidden),
        }
    }

    /// Width of an input row.
    pub fn inputs(&self) -> usize {
        self.input.senders()
    }

    /// Width of the memory, which is also the output.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Numbers of scratch space that a step along this many directions needs, for any number of rows.
    pub fn scratch(&self, directions: usize) -> usize {
        self.input.scratch().max(self.hidden.scratch()) + Jets::COUNT * (1 + directions) * self.leak.len()
    }

    /// Moves the memory `[batch, size]` on by the time `elapsed` with the input `[batch, inputs]`. The new memory is the
    /// output. Without time, nothing changes.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step(&self, elapsed: f32, input: &[f32], memory: &mut [f32], scratch: &mut [f32]) {
        self.step_along(elapsed, input, memory, Tangents::none(), scratch);
    }

    /// As [`step`](Ltc::step), with derivatives.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows, or the scratch space is too small.
    pub fn step_along(
        &self,
        elapsed: f32,
        input: &[f32],
        memory: &mut [f32],
        tangents: Tangents<'_>,
        scratch: &mut [f32],
    ) {
        let batch = super::same_batch(&[(input.len(), self.inputs()), (memory.len(), self.size)]);
        tangents.check(batch, self.inputs(), self.size);
        if elapsed > 0.0 {
            dispatch(Step { layer: self, elapsed, input, memory, tangents, scratch });
        } else {
            tangents.output.fill(0.0);
        }
    }
}

struct Step<'a> {
    layer: &'a Ltc,
    elapsed: f32,
    input: &'a [f32],
    memory: &'a mut [f32],
    tangents: Tangents<'a>,
    scratch: &'a mut [f32],
}

/// Scratch space of one object. Values and their tangents are rows below each other, all of padded width.
struct Jets<'a> {
    open: &'a mut [f32],
    /// Pull and leak of the input.
    constant: [&'a mut [f32]; 2],
    /// Pull and leak of all synapses.
    sums: [&'a mut [f32]; 2],
    /// The neurons; within a step of Runge and Kutta those at its start, at a stage, and at its end.
    neurons: [&'a mut [f32]; 3],
}

impl<'a> Jets<'a> {
    const COUNT: usize = 7;

    #[inline(always)]
    fn new(layer: &Ltc, rows: usize, scratch: &'a mut [f32]) -> Self {
        let (open, mut rest) = scratch.split_at_mut(layer.input.scratch().max(layer.hidden.scratch()));
        let mut take = || {
            let (piece, after) = std::mem::take(&mut rest).split_at_mut(rows * layer.leak.len());
            rest = after;
            piece
        };
        let (constant, sums) = ([take(), take()], [take(), take()]);
        Jets { open, constant, sums, neurons: [take(), take(), take()] }
    }
}

impl Kernel for Step<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, machine: A) {
        let Step { layer, elapsed, input, memory, tangents, scratch } = self;
        let (inputs, size, directions) = (layer.inputs(), layer.size, tangents.directions);
        let mut jets = Jets::new(layer, 1 + directions, scratch);
        let delta = elapsed / layer.unfolds as f32;
        let rows = input.chunks_exact(inputs).zip(memory.chunks_exact_mut(size)).enumerate();
        for (row, (input, memory)) in rows {
            let slopes = &tangents.input[row * directions * inputs..][..directions * inputs];
            layer.listen(machine, input, slopes, &mut jets);
            let neurons = &mut *jets.neurons[0];
            neurons.fill(0.0);
            neurons[..size].copy_from_slice(memory);
            for _ in 0..layer.unfolds {
                match layer.solver {
                    Solver::Fused => layer.fused(machine, delta, &mut jets),
                    Solver::Euler => layer.euler(machine, delta, &mut jets),
                    Solver::RungeKutta => layer.runge_kutta(machine, delta, &mut jets),
                }
            }
            let mut found = jets.neurons[0].chunks_exact(layer.leak.len());
            if let Some(found) = found.next() {
                memory.copy_from_slice(&found[..size]);
            }
            let output = &mut tangents.output[row * directions * size..][..directions * size];
            for (to, found) in output.chunks_exact_mut(size).zip(found) {
                to.copy_from_slice(&found[..size]);
            }
        }
    }
}

impl Ltc {
    /// Pull and leak of the input, with tangents.
    #[inline(always)]
    fn listen<A: Arithmetic>(&self, machine: A, input: &[f32], slopes: &[f32], jets: &mut Jets<'_>) {
        let Jets { open, constant: [pull, leak], .. } = jets;
        pull.fill(0.0);
        leak.fill(0.0);
        self.input.add(machine, (input, slopes, self.inputs()), open, [pull, leak]);
    }

    /// Pull and leak of all synapses at some neurons, with tangents.
    #[inline(always)]
    fn sums<A: Arithmetic>(&self, machine: A, jets: &mut Jets<'_>, stage: usize) {
        let Jets { open, constant, sums: [pull, leak], neurons } = jets;
        pull.copy_from_slice(constant[0]);
        leak.copy_from_slice(constant[1]);
        let width = self.leak.len();
        let (values, slopes) = neurons[stage].split_at(width);
        self.hidden.add(machine, (values, slopes, width), open, [pull, leak]);
    }

    /// A step that is implicit in the neuron itself.
    #[inline(always)]
    fn fused<A: Arithmetic>(&self, machine: A, delta: f32, jets: &mut Jets<'_>) {
        self.sums(machine, jets, 0);
        let width = self.leak.len();
        let Jets { sums: [pull, leak], neurons: [neurons, stage, _], .. } = jets;
        let (values, slopes) = neurons.split_at_mut(width);
        let of_capacitance = &mut stage[..width];
        let per_step = 1.0 / delta;
        for (to, capacitance) in of_capacitance.iter_mut().zip(&self.capacitance) {
            *to = capacitance * per_step;
        }
        // The sums of the values become their inverse, which the tangents share.
        let (leak, leaks) = leak.split_at_mut(width);
        let (pull, pulls) = pull.split_at(width);
        for i in 0..width {
            leak[i] = 1.0 / (of_capacitance[i] + self.leak[i] + leak[i] + TINY);
        }
        for i in 0..width {
            values[i] = A::fused(of_capacitance[i], values[i], self.rest[i] + pull[i]) * leak[i];
        }
        let tangents = pulls.chunks_exact(width).zip(leaks.chunks_exact(width));
        for (slope, (pull, less)) in slopes.chunks_exact_mut(width).zip(tangents) {
            for i in 0..width {
                let moved = A::fused(of_capacitance[i], slope[i], pull[i]);
                slope[i] = A::fused(-values[i], less[i], moved) * leak[i];
            }
        }
    }

    /// The change of neurons and tangents in a time, at a stage, instead of their sums of pulls.
    #[inline(always)]
    fn change<A: Arithmetic>(&self, machine: A, delta: f32, jets: &mut Jets<'_>, stage: usize) {
        self.sums(machine, jets, stage);
        let width = self.leak.len();
        let Jets { sums: [pull, leak], neurons, .. } = jets;
        let (values, slopes) = neurons[stage].split_at(width);
        let (pull, pulls) = pull.split_at_mut(width);
        let (leak, leaks) = leak.split_at_mut(width);
        for i in 0..width {
            leak[i] += self.leak[i];
            pull[i] = A::fused(-leak[i], values[i], self.rest[i] + pull[i]) * delta / self.capacitance[i];
        }
        let tangents = pulls.chunks_exact_mut(width).zip(leaks.chunks_exact(width));
        for (slope, (pull, less)) in slopes.chunks_exact(width).zip(tangents) {
            for i in 0..width {
                let moved = A::fused(-leak[i], slope[i], pull[i]);
                pull[i] = A::fused(-less[i], values[i], moved) * delta / self.capacitance[i];
            }
        }
    }

    #[inline(always)]
    fn euler<A: Arithmetic>(&self, machine: A, delta: f32, jets: &mut Jets<'_>) {
        self.change(machine, delta, jets, 0);
        add_scaled::<A>(1.0, jets.sums[0], jets.neurons[0]);
    }

    #[inline(always)]
    fn runge_kutta<A: Arithmetic>(&self, machine: A, delta: f32, jets: &mut Jets<'_>) {
        let [start, stage, end] = &mut jets.neurons;
        stage.copy_from_slice(start);
        end.copy_from_slice(start);
        for (weight, next) in [(1.0 / 6.0, 0.5), (1.0 / 3.0, 0.5), (1.0 / 3.0, 1.0), (1.0 / 6.0, 0.0)] {
            self.change(machine, delta, jets, 1);
            let Jets { sums: [change, _], neurons: [start, stage, end], .. } = jets;
            add_scaled::<A>(weight, change, end);
            stage.copy_from_slice(start);
            add_scaled::<A>(next, change, stage);
        }
        let [start, _, end] = &mut jets.neurons;
        start.copy_from_slice(end);
    }
}

#[inline(always)]
fn add_scaled<A: Arithmetic>(factor: f32, terms: &[f32], to: &mut [f32]) {
    for (to, term) in to.iter_mut().zip(terms) {
        *to = A::fused(factor, *term, *to);
    }
}
