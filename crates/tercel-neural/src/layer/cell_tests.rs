//! Cells against the same recursions written in double precision, and derivatives against differences of those.

use super::{Cell, Cfc, Gru, Linear, Ltc, LtcWeights, Mlp, Solver, SynapseWeights, Tangents};

fn values(count: usize, seed: usize, centre: f32, size: f32) -> Vec<f32> {
    (0..count).map(|i| centre + (((i + 31 * seed) * 7919 % 2003) as f32 / 1001.5 - 1.0) * size).collect()
}

/// A cell and its recursion in double precision: `(elapsed, input, memory)` to the next memory.
type Reference = Box<dyn Fn(f64, &[f64], &[f64]) -> Vec<f64>>;

fn sigma(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

fn product(x: &[f64], weights: &[f32], columns: usize) -> Vec<f64> {
    let term = |j: usize| x.iter().enumerate().map(|(k, x)| x * f64::from(weights[k * columns + j])).sum();
    (0..columns).map(term).collect()
}

fn affine(x: &[f64], weights: &[f32], bias: &[f32]) -> Vec<f64> {
    product(x, weights, bias.len()).iter().zip(bias).map(|(x, b)| x + f64::from(*b)).collect()
}

#[derive(Clone)]
struct SynapseNumbers {
    strength: Vec<f32>,
    slope: Vec<f32>,
    centre: Vec<f32>,
    reversal: Vec<f32>,
}

impl SynapseNumbers {
    fn new(count: usize, seed: usize) -> Self {
        SynapseNumbers {
            strength: values(count, seed, -0.5, 1.5),
            slope: values(count, seed + 1, 3.0, 2.0),
            centre: values(count, seed + 2, 0.2, 0.5),
            reversal: values(count, seed + 3, 0.0, 1.0),
        }
    }

    fn weights(&self) -> SynapseWeights<'_> {
        let SynapseNumbers { strength, slope, centre, reversal } = self;
        SynapseWeights { strength, slope, centre, reversal }
    }

    /// Current into a neuron of value `v`, and conductance that stays.
    fn onto(&self, senders: &[f64], i: usize, size: usize) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (j, sender) in senders.iter().enumerate() {
            let of = |numbers: &[f32]| f64::from(numbers[j * size + i]);
            let conductance =
                of(&self.strength).exp().ln_1p() * sigma(of(&self.slope) * (sender - of(&self.centre)));
            sums[0] += conductance * of(&self.reversal);
            sums[1] += conductance;
        }
        sums
    }
}

fn ltc(inputs: usize, size: usize, solver: Solver, unfolds: usize) -> (Cell, Reference) {
    let (input, hidden) = (SynapseNumbers::new(inputs * size, 1), SynapseNumbers::new(size * size, 11));
    let (leak, rest) = (values(size, 21, 0.0, 1.0), values(size, 22, 0.0, 0.2));
    let capacitance = values(size, 23, 0.5, 0.3);
    let weights = LtcWeights {
        leak: &leak,
        rest: &rest,
        capacitance: &capacitance,
        input: input.weights(),
        hidden: hidden.weights(),
    };
    let cell = Cell::Ltc(Ltc::new(inputs, size, solver, unfolds, weights));
    let reference = move |elapsed: f64, x: &[f64], memory: &[f64]| {
        let positive = |numbers: &[f32], i: usize| f64::from(numbers[i]).exp().ln_1p();
        let sums = |v: &[f64], i: usize| {
            let (a, b) = (input.onto(x, i, size), hidden.onto(v, i, size));
            [a[0] + b[0] + positive(&leak, i) * f64::from(rest[i]), a[1] + b[1] + positive(&leak, i)]
        };
        let rate = |v: &[f64]| -> Vec<f64> {
            let of = |i: usize| (sums(v, i)[0] - sums(v, i)[1] * v[i]) / positive(&capacitance, i);
            (0..size).map(of).collect()
        };
        let delta = elapsed / unfolds as f64;
        let moved = |v: &[f64], by: f64, rate: &[f64]| -> Vec<f64> {
            v.iter().zip(rate).map(|(v, rate)| v + by * rate).collect()
        };
        let mut v = memory.to_vec();
        for _ in 0..unfolds {
            v = match solver {
                Solver::Euler => moved(&v, delta, &rate(&v)),
                Solver::RungeKutta => {
                    let one = rate(&v);
                    let two = rate(&moved(&v, delta / 2.0, &one));
                    let three = rate(&moved(&v, delta / 2.0, &two));
                    let four = rate(&moved(&v, delta, &three));
                    let mean: Vec<f64> =
                        (0..size).map(|i| (one[i] + 2.0 * two[i] + 2.0 * three[i] + four[i]) / 6.0).collect();
                    moved(&v, delta, &mean)
                }
                Solver::Fused => {
                    let next = |i: usize| {
                        let (c, [pull, leak]) = (positive(&capacitance, i) / delta, sums(&v, i));
                        (c * v[i] + pull) / (c + leak + 1e-8)
                    };
                    (0..size).map(next).collect()
                }
            };
        }
        v
    };
    (cell, Box::new(reference))
}

fn cfc(inputs: usize, size: usize, backbone: usize) -> (Cell, Reference) {
    let (wx, wh) = (values(inputs * backbone, 1, 0.0, 0.7), values(size * backbone, 2, 0.0, 0.5));
    let (bias, heads) = (values(backbone, 3, 0.1, 0.3), values(backbone * 4 * size, 4, 0.0, 0.6));
    let heads_bias = values(4 * size, 5, 0.1, 0.3);
    let cell = Cell::Cfc(Cfc::new(inputs, size, backbone, &wx, &wh, &bias, &heads, &heads_bias));
    let reference = move |elapsed: f64, x: &[f64], memory: &[f64]| {
        let from_memory = product(memory, &wh, backbone);
        let z: Vec<f64> =
            affine(x, &wx, &bias).iter().zip(from_memory).map(|(a, b)| (a + b).tanh()).collect();
        let y = affine(&z, &heads, &heads_bias);
        let next = |i: usize| {
            let t = sigma(y[2 * size + i] * elapsed + y[3 * size + i]);
            (1.0 - t) * y[i].tanh() + t * y[size + i].tanh()
        };
        (0..size).map(next).collect()
    };
    (cell, Box::new(reference))
}

fn gru(inputs: usize, size: usize) -> (Cell, Reference) {
    let (wx, bx) = (values(inputs * 3 * size, 1, 0.0, 0.7), values(3 * size, 2, 0.0, 0.3));
    let (wh, bh) = (values(size * 3 * size, 3, 0.0, 0.4), values(3 * size, 4, 0.0, 0.3));
    let cell = Cell::Gru(Gru::new(inputs, size, &wx, &bx, &wh, &bh));
    let reference = move |_: f64, x: &[f64], memory: &[f64]| {
        let (a, b) = (affine(x, &wx, &bx), affine(memory, &wh, &bh));
        let next = |j: usize| {
            let (r, z) = (sigma(a[j] + b[j]), sigma(a[size + j] + b[size + j]));
            (1.0 - z) * (a[2 * size + j] + r * b[2 * size + j]).tanh() + z * memory[j]
        };
        (0..size).map(next).collect()
    };
    (cell, Box::new(reference))
}

fn mlp(inputs: usize, size: usize, hidden: usize) -> (Cell, Reference) {
    let (w, b) = (values(inputs * hidden, 1, 0.0, 0.8), values(hidden, 2, 0.0, 0.4));
    let (v, c) = (values(hidden * size, 3, 0.0, 0.5), values(size, 4, 0.0, 0.4));
    let cell = Mlp::new(Linear::new(inputs, hidden, &w, &b), Linear::new(hidden, size, &v, &c));
    let reference = move |_: f64, x: &[f64], _: &[f64]| {
        let z: Vec<f64> = affine(x, &w, &b).iter().map(|x| x.tanh()).collect();
        affine(&z, &v, &c).iter().map(|x| x.tanh()).collect()
    };
    (Cell::Mlp(cell), Box::new(reference))
}

fn all() -> Vec<(&'static str, Cell, Reference)> {
    let named = |name, (cell, reference)| (name, cell, reference);
    vec![
        named("fused", ltc(3, 5, Solver::Fused, 6)),
        named("fused, wide", ltc(9, 33, Solver::Fused, 4)),
        named("fused, one", ltc(1, 1, Solver::Fused, 1)),
        named("euler", ltc(4, 8, Solver::Euler, 12)),
        named("runge-kutta", ltc(3, 11, Solver::RungeKutta, 6)),
        named("cfc", cfc(5, 9, 12)),
        named("cfc, wide", cfc(3, 40, 33)),
        named("gru", gru(6, 17)),
        named("mlp", mlp(4, 7, 19)),
    ]
}

fn doubled(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

/// An input that changes from step to step.
fn input(width: usize, step: usize) -> Vec<f32> {
    values(width, 100 + step, 0.0, 1.0)
}

/// Times between steps.
fn elapsed(step: usize) -> f32 {
    [1.0, 0.3, 0.7, 1.2][step % 4]
}

#[test]
fn cells_follow_their_recursions_for_200_steps() {
    for (name, cell, reference) in all() {
        let (mut memory, mut exact) = (vec![0.0; cell.size()], vec![0.0; cell.size()]);
        let mut scratch = vec![f32::NAN; cell.scratch(1, 0)];
        for step in 0..200 {
            let (x, elapsed) = (input(cell.inputs(), step), elapsed(step));
            cell.step_along(elapsed, &x, &mut memory, Tangents::none(), &mut scratch);
            exact = reference(f64::from(elapsed), &doubled(&x), &exact);
            for (ours, exact) in memory.iter().zip(&exact) {
                let error = (f64::from(*ours) - exact).abs();
                assert!(error < 3e-6 * exact.abs().max(1.0), "{name}, step {step}: {ours} for {exact}");
            }
        }
        assert!(exact.iter().any(|x| x.abs() > 0.05), "{name}: something is remembered");
    }
}

#[test]
fn derivatives_are_the_slopes_of_the_recursion_in_double_precision() {
    for (name, cell, reference) in all() {
        let (inputs, size) = (cell.inputs(), cell.size());
        let (batch, mut memory) = (3, values(3 * size, 9, 0.1, 0.5));
        let before = memory.clone();
        let x: Vec<f32> = (0..batch).flat_map(|row| input(inputs, row)).collect();
        // The unit vectors: the tangents are the columns of the Jacobian.
        let unit: Vec<f32> =
            (0..batch * inputs * inputs).map(|i| f32::from(i % inputs == i / inputs % inputs)).collect();
        let mut found = vec![f32::NAN; batch * inputs * size];
        let mut scratch = vec![f32::NAN; cell.scratch(batch, inputs)];
        let tangents = Tangents { directions: inputs, input: &unit, output: &mut found };
        cell.step_along(0.8, &x, &mut memory, tangents, &mut scratch);
        let mut largest: f64 = 0.0;
        for row in 0..batch {
            let (x, h) = (doubled(&x[row * inputs..][..inputs]), doubled(&before[row * size..][..size]));
            for direction in 0..inputs {
                let at = |by: f64| {
                    let mut x = x.clone();
                    x[direction] += by;
                    reference(f64::from(0.8_f32), &x, &h)
                };
                let (high, low) = (at(1e-5), at(-1e-5));
                for i in 0..size {
                    let slope = (high[i] - low[i]) / 2e-5;
                    let ours = f64::from(found[(row * inputs + direction) * size + i]);
                    largest = largest.max(slope.abs());
                    assert!((ours - slope).abs() < 2e-6 + 1e-5 * slope.abs(), "{name}: {ours} for {slope}");
                }
            }
        }
        assert!(largest > 0.005, "{name}: the output depends on the input");
    }
}

#[test]
fn values_are_the_same_with_and_without_derivatives_alone_and_in_a_batch() {
    for (name, cell, _) in all() {
        let (inputs, size, batch, directions) = (cell.inputs(), cell.size(), 5, 2);
        let x = values(batch * inputs, 3, 0.0, 1.0);
        let slopes = values(batch * directions * inputs, 4, 0.0, 1.0);
        let start = values(batch * size, 5, 0.0, 0.5);
        let run = |rows: std::ops::Range<usize>, directions: usize| {
            let mut memory = start[rows.start * size..rows.end * size].to_vec();
            let mut found = vec![f32::NAN; rows.len() * directions * size];
            let mut scratch = vec![f32::NAN; cell.scratch(rows.len(), directions)];
            let input = &slopes[rows.start * directions * inputs..rows.end * directions * inputs];
            let tangents = Tangents { directions, input, output: &mut found };
            let x = &x[rows.start * inputs..rows.end * inputs];
            cell.step_along(1.0, x, &mut memory, tangents, &mut scratch);
            (memory, found)
        };
        let (together, slopes_together) = run(0..batch, directions);
        assert_eq!(run(0..batch, 0).0, together, "{name}");
        for row in 0..batch {
            let (alone, slopes_alone) = run(row..row + 1, directions);
            assert_eq!(alone, together[row * size..][..size], "{name}");
            assert_eq!(
                slopes_alone,
                slopes_together[row * directions * size..][..directions * size],
                "{name}"
            );
        }
    }
}

#[test]
fn without_time_a_liquid_cell_stays_and_after_long_it_settles() {
    let (cell, _) = ltc(2, 6, Solver::Fused, 6);
    let run = |elapsed: f32, memory: &[f32]| {
        let (mut memory, mut found) = (memory.to_vec(), vec![9.0; 6]);
        let mut scratch = vec![0.0; cell.scratch(1, 1)];
        let tangents = Tangents { directions: 1, input: &[1.0, 0.0], output: &mut found };
        cell.step_along(elapsed, &[0.5, -0.5], &mut memory, tangents, &mut scratch);
        (memory, found)
    };
    let start = [0.5, -0.4, 0.3, 0.0, 0.1, 0.2];
    assert_eq!(run(0.0, &start), (start.to_vec(), vec![0.0; 6]));
    let (mut one, mut other) = (start.to_vec(), vec![-0.9; 6]);
    for _ in 0..200 {
        (one, other) = (run(1e6, &one).0, run(1e6, &other).0);
    }
    for (one, other) in one.iter().zip(&other) {
        assert!(one.is_finite() && (one - other).abs() < 1e-4, "{one} {other}");
    }
}

#[test]
fn solvers_agree_on_fine_steps() {
    let solved = |solver, unfolds| {
        let (cell, _) = ltc(3, 7, solver, unfolds);
        let (mut memory, mut scratch) = (vec![0.1; 7], vec![0.0; cell.scratch(1, 0)]);
        cell.step_along(1.0, &[0.4, -0.3, 0.9], &mut memory, Tangents::none(), &mut scratch);
        memory
    };
    let exact = solved(Solver::RungeKutta, 50);
    let error =
        |found: Vec<f32>| found.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0_f32, f32::max);
    assert!(error(solved(Solver::RungeKutta, 12)) < 1e-4);
    for solver in [Solver::Fused, Solver::Euler] {
        let (coarse, fine) = (error(solved(solver, 64)), error(solved(solver, 640)));
        assert!(fine < 2e-3 && fine < 0.2 * coarse, "{solver:?}: {coarse} {fine}");
    }
}
