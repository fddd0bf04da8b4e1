//! The liquid time-constant layer.

use tercel_neural::layer::Solver;

use super::positive;
use super::synapses::{Slopes, SynapseIds, Synapses};
use crate::backend::vector::sum_rows;
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{Initial, ParameterId, ParameterSet, TrainError, Weights};

/// A layer of neurons with liquid time constants.
///
/// ## Recursion
///
/// That of [`tercel_neural::layer::Ltc`], with the same solvers and parameters. A step with all its unfolds is one operation
/// with a backward pass of its own, through every evaluation of the differential equation.
///
/// Parameters start as in the code of the authors (leak within 0.001 to 1, rest within ±0.2, slopes within 3 to 8, reversals
/// ±1), but for three: capacitances within 0.4 to 6 instead of 0.4 to 0.6, so that some neurons remember for longer than a
/// step; centres within ±0.8 instead of 0.3 to 0.8, since inputs have both signs; and strengths up to `min(1, 8 / senders)`
/// instead of 1, so that the forgetting does not grow with the layer.
///
/// ## Reference
///
/// R. Hasani, M. Lechner, A. Amini, D. Rus, R. Grosu, "Liquid time-constant networks", AAAI 2021.
#[derive(Debug, Clone)]
pub struct Ltc {
    leak: ParameterId,
    rest: ParameterId,
    capacitance: ParameterId,
    input: SynapseIds,
    hidden: SynapseIds,
    solver: Solver,
    unfolds: usize,
}

impl Ltc {
    /// Adds the parameters of a layer with `size` neurons to a set.
    ///
    /// # Errors
    ///
    /// If a size or the number of unfolds is zero, or the name is taken.
    pub fn new(
        set: &mut ParameterSet,
        name: &str,
        [inputs, size]: [usize; 2],
        solver: Solver,
        unfolds: usize,
    ) -> Result<Self, TrainError> {
        let counts =
            [("the number of inputs", inputs), ("the number of neurons", size), ("unfolds", unfolds)];
        positive(name, &counts)?;
        let mut add = |part: &str, initial| set.add(&format!("{name}.{part}"), &[size], initial);
        Ok(Self {
            leak: add("leak", Initial::Positive { low: 0.001, high: 1.0 })?,
            rest: add("rest", Initial::Uniform { bound: 0.2 })?,
            capacitance: add("capacitance", Initial::Positive { low: 0.4, high: 6.0 })?,
            input: SynapseIds::new(set, &format!("{name}.input"), [inputs, size])?,
            hidden: SynapseIds::new(set, &format!("{name}.hidden"), [size, size])?,
            solver,
            unfolds,
        })
    }

    /// The memory `[batch, size]` after a time, measured in the unit of the cell, with the input held.
    pub fn step(&self, weights: &Weights, elapsed: f32, x: Tensor, memory: Tensor) -> Tensor {
        let [a, b, c, d] = self.input.tensors(weights);
        let [e, f, g, h] = self.hidden.tensors(weights);
        let [leak, rest, capacitance] = [self.leak, self.rest, self.capacitance].map(|id| weights.get(id));
        let step = Step { solver: self.solver, unfolds: self.unfolds, delta: elapsed / self.unfolds as f32 };
        apply(step, [x, memory, leak, rest, capacitance, a, b, c, d, e, f, g, h])
    }
}

/// Parameters of an operation after the input and the memory.
const INPUTS: usize = 13;

/// A step as one operation on the input, the memory and all parameters.
#[derive(Debug, Clone)]
struct Step {
    solver: Solver,
    unfolds: usize,
    delta: f32,
}

/// One evaluation of the right-hand side, for all members: rows of neurons.
#[derive(Debug, Clone)]
struct Evaluation {
    /// The neurons.
    v: Vec<f32>,
    /// `g r + N`.
    pull: Vec<f32>,
    /// `g + D`.
    leak: Vec<f32>,
}

/// The parameters as the recursion uses them.
struct Neurons {
    leak: Vec<f32>,
    rest: Vec<f32>,
    capacitance: Vec<f32>,
    input: Synapses,
    hidden: Synapses,
}

/// Keeps a neuron without leak and open synapses from dividing by zero.
const TINY: f32 = 1e-8;

/// `ln(1 + eˣ)`.
pub(super) fn softplus(x: f32) -> f32 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

/// Its slope.
pub(super) fn softplus_slope(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

impl Neurons {
    fn new(inputs: &[Matrix; INPUTS]) -> Self {
        let positive = |at: usize| inputs[at].values().iter().map(|x| softplus(*x)).collect();
        let synapses = |at: usize| {
            let [a, b, c, d] = [0, 1, 2, 3].map(|part| &inputs[at + part]);
            Synapses::new([a, b, c, d])
        };
        Self {
            leak: positive(2),
            rest: inputs[3].values().to_vec(),
            capacitance: positive(4),
            input: synapses(5),
            hidden: synapses(9),
        }
    }

    /// `g r + N` and `g + D` of the input alone.
    fn constant(&self, x: &Matrix) -> [Vec<f32>; 2] {
        let own: Vec<f32> = self.leak.iter().zip(&self.rest).map(|(g, r)| g * r).collect();
        let mut sums = [own.repeat(x.rows()), self.leak.repeat(x.rows())];
        let [pull, leak] = &mut sums;
        self.input.add(x.values(), pull, leak);
        sums
    }

    fn evaluate(&self, [pull, leak]: &[Vec<f32>; 2], v: Vec<f32>) -> Evaluation {
        let (mut pull, mut leak) = (pull.clone(), leak.clone());
        self.hidden.add(&v, &mut pull, &mut leak);
        Evaluation { v, pull, leak }
    }

    fn capacitances(&self) -> impl Iterator<Item = f32> + '_ {
        self.capacitance.iter().copied().cycle()
    }

    /// `dv/dt` at an evaluation.
    fn rate(&self, at: &Evaluation) -> Vec<f32> {
        let terms = at.v.iter().zip(&at.pull).zip(&at.leak).zip(self.capacitances());
        terms.map(|(((v, pull), leak), c)| (pull - leak * v) / c).collect()
    }
}

fn moved(v: &[f32], by: f32, rate: &[f32]) -> Vec<f32> {
    v.iter().zip(rate).map(|(v, rate)| v + by * rate).collect()
}

impl Step {
    /// The neurons after an unfold, whose evaluations are noted.
    fn unfold(
        &self,
        neurons: &Neurons,
        constant: &[Vec<f32>; 2],
        v: Vec<f32>,
        trace: &mut Vec<Evaluation>,
    ) -> Vec<f32> {
        let delta = self.delta;
        let at = neurons.evaluate(constant, v);
        let next = match self.solver {
            Solver::Fused => {
                let terms = at.v.iter().zip(&at.pull).zip(&at.leak).zip(neurons.capacitances());
                let implicit = terms.map(|(((v, pull), leak), c)| {
                    let c = c / delta;
                    (c * v + pull) / (c + leak + TINY)
                });
                implicit.collect()
            }
            Solver::Euler => moved(&at.v, delta, &neurons.rate(&at)),
            Solver::RungeKutta => {
                let mut rate = neurons.rate(&at);
                let (mut end, start) = (moved(&at.v, delta / 6.0, &rate), at.v.clone());
                trace.push(at);
                for (weight, reach) in [(1.0 / 3.0, 0.5), (1.0 / 3.0, 0.5), (1.0 / 6.0, 1.0)] {
                    let stage = neurons.evaluate(constant, moved(&start, reach * delta, &rate));
                    rate = neurons.rate(&stage);
                    end = moved(&end, weight * delta, &rate);
                    trace.push(stage);
                }
                return end;
            }
        };
        trace.push(at);
        next
    }
}

/// Gradients of everything that the neurons are made of.
struct Found {
    /// Of `g` and `g r` together: rows of members, summed at the end.
    pull: Vec<f32>,
    leak: Vec<f32>,
    capacitance: Vec<f32>,
    hidden: Slopes,
}

impl Found {
    /// Takes in the gradients of pull and leak at an evaluation, and adds what they mean for its neurons.
    fn sums(&mut self, neurons: &Neurons, at: &Evaluation, [pull, leak]: [&[f32]; 2], of_v: &mut [f32]) {
        add(&mut self.pull, pull);
        add(&mut self.leak, leak);
        neurons.hidden.retreat(&at.v, [pull, leak], &mut self.hidden, Some(of_v));
    }

    /// The gradient of the neurons before an implicit step.
    fn fused(&mut self, neurons: &Neurons, at: &Evaluation, delta: f32, gradient: &[f32]) -> Vec<f32> {
        let count = gradient.len();
        let (mut of_v, mut of_pull, mut of_leak) = (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        for (k, c) in (0..count).zip(neurons.capacitances()) {
            let per_step = c / delta;
            let below = per_step + at.leak[k] + TINY;
            let next = (per_step * at.v[k] + at.pull[k]) / below;
            of_pull[k] = gradient[k] / below;
            of_leak[k] = -of_pull[k] * next;
            of_v[k] = per_step * of_pull[k];
            self.capacitance[k] += (at.v[k] * of_pull[k] + of_leak[k]) / delta;
        }
        self.sums(neurons, at, [&of_pull, &of_leak], &mut of_v);
        of_v
    }

    /// What a gradient of the rate means for the neurons of an evaluation.
    fn rate(&mut self, neurons: &Neurons, at: &Evaluation, gradient: &[f32]) -> Vec<f32> {
        let count = gradient.len();
        let (mut of_v, mut of_pull, mut of_leak) = (vec![0.0; count], vec![0.0; count], vec![0.0; count]);
        for (k, c) in (0..count).zip(neurons.capacitances()) {
            of_pull[k] = gradient[k] / c;
            of_leak[k] = -of_pull[k] * at.v[k];
            of_v[k] = -of_pull[k] * at.leak[k];
            self.capacitance[k] -= of_pull[k] * (at.pull[k] - at.leak[k] * at.v[k]) / c;
        }
        self.sums(neurons, at, [&of_pull, &of_leak], &mut of_v);
        of_v
    }

    fn euler(&mut self, neurons: &Neurons, at: &Evaluation, delta: f32, gradient: &[f32]) -> Vec<f32> {
        let mut of_v = self.rate(neurons, at, &scaled(gradient, delta));
        add(&mut of_v, gradient);
        of_v
    }

    fn runge_kutta(
        &mut self,
        neurons: &Neurons,
        stages: &[Evaluation],
        delta: f32,
        gradient: &[f32],
    ) -> Vec<f32> {
        let mut of_v = gradient.to_vec();
        let mut of_stage = vec![0.0; gradient.len()];
        // The last stage first; `reach` is how far its rate moves the next stage.
        let weights = [(1.0 / 6.0, 0.0), (1.0 / 3.0, 1.0), (1.0 / 3.0, 0.5), (1.0 / 6.0, 0.5)];
        for (at, (weight, reach)) in stages.iter().rev().zip(weights) {
            let of_rate = moved(&scaled(gradient, weight * delta), reach * delta, &of_stage);
            of_stage = self.rate(neurons, at, &of_rate);
            add(&mut of_v, &of_stage);
        }
        of_v
    }
}

fn add(to: &mut [f32], terms: &[f32]) {
    to.iter_mut().zip(terms).for_each(|(to, term)| *to += term);
}

fn scaled(values: &[f32], by: f32) -> Vec<f32> {
    values.iter().map(|value| by * value).collect()
}

impl Operation<INPUTS> for Step {
    type Saved = Vec<Evaluation>;

    fn forward(&self, inputs: &[Matrix; INPUTS]) -> Forward<Vec<Evaluation>> {
        let [x, memory, ..] = inputs;
        let neurons = Neurons::new(inputs);
        let constant = neurons.constant(x);
        let mut trace = Vec::new();
        let mut v = memory.values().to_vec();
        for _ in 0..self.unfolds {
            v = self.unfold(&neurons, &constant, v, &mut trace);
        }
        Forward { values: v, shape: [memory.rows(), memory.columns()], saved: trace }
    }

    fn backward(
        &self,
        past: Past<'_, Vec<Evaluation>, INPUTS>,
        gradient: &[f32],
    ) -> [Option<Vec<f32>>; INPUTS] {
        let inputs = past.inputs;
        let [x, memory, leaks, _, capacitances, ..] = inputs;
        let (neurons, size, count) = (Neurons::new(inputs), memory.columns(), gradient.len());
        let mut found = Found {
            pull: vec![0.0; count],
            leak: vec![0.0; count],
            capacitance: vec![0.0; count],
            hidden: Slopes::new(&neurons.hidden),
        };
        let mut of_v = gradient.to_vec();
        let stages = past.saved.len() / self.unfolds;
        for stages in past.saved.chunks_exact(stages).rev() {
            of_v = match self.solver {
                Solver::Fused => found.fused(&neurons, &stages[0], self.delta, &of_v),
                Solver::Euler => found.euler(&neurons, &stages[0], self.delta, &of_v),
                Solver::RungeKutta => found.runge_kutta(&neurons, stages, self.delta, &of_v),
            };
        }
        let mut of_input = Slopes::new(&neurons.input);
        let mut of_x = past.wanted[0].then(|| vec![0.0; x.values().len()]);
        neurons.input.retreat(x.values(), [&found.pull, &found.leak], &mut of_input, of_x.as_deref_mut());
        let [pull, leak, capacitance] =
            [&found.pull, &found.leak, &found.capacitance].map(|of| sum_rows(of, size));
        let positive = |of: Vec<f32>, raw: &Matrix| -> Vec<f32> {
            of.iter().zip(raw.values()).map(|(of, raw)| of * softplus_slope(*raw)).collect()
        };
        let of_leak =
            pull.iter().zip(&neurons.rest).zip(&leak).map(|((pull, r), leak)| pull * r + leak).collect();
        let of_rest = pull.iter().zip(&neurons.leak).map(|(pull, g)| pull * g).collect();
        let [a, b, c, d] =
            of_input.of_parameters(&neurons.input, [&inputs[5], &inputs[6], &inputs[7], &inputs[8]]);
        let [e, f, g, h] =
            found.hidden.of_parameters(&neurons.hidden, [&inputs[9], &inputs[10], &inputs[11], &inputs[12]]);
        let of_neurons =
            [Some(positive(of_leak, leaks)), Some(of_rest), Some(positive(capacitance, capacitances))];
        let [leak, rest, capacitance] = of_neurons;
        let [a, b, c, d, e, f, g, h] = [a, b, c, d, e, f, g, h].map(Some);
        [of_x, Some(of_v), leak, rest, capacitance, a, b, c, d, e, f, g, h]
    }
}
