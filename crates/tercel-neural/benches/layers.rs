//! Time of a step of the layers, one row: `cargo bench -p tercel-neural --bench layers`.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use tercel_neural::layer::{
    Cell, Cfc, Gru, Linear, Lstm, Ltc, LtcWeights, Mlp, Solver, SynapseWeights, Tangents, activation,
};

fn main() {
    divan::main();
}

/// Steps timed together, so that the clock does not count.
const STEPS: usize = 100;

fn values(count: usize, seed: usize) -> Vec<f32> {
    (0..count).map(|i| ((i + 31 * seed) * 7919 % 2003) as f32 / 10_000.0 - 0.1).collect()
}

fn lstm(inputs: usize, size: usize) -> Lstm {
    let (input, hidden) = (values(inputs * 4 * size, 1), values(size * 4 * size, 2));
    Lstm::new(inputs, size, &input, &hidden, &values(4 * size, 3))
}

/// Two layers of 64 over 12 inputs, and a linear layer to four outputs.
#[divan::bench(args = [1, 16])]
fn lstm_2x64(bencher: Bencher, batch: usize) {
    let (first, second) = (lstm(12, 64), lstm(64, 64));
    let last = Linear::new(64, 4, &values(256, 4), &values(4, 5));
    let [mut h1, mut c1, mut h2, mut c2] = [0; 4].map(|_| vec![0.0; 64 * batch]);
    let mut scratch = vec![0.0; first.scratch(batch)];
    let (x, mut y) = (values(12 * batch, 6), vec![0.0; 4 * batch]);
    bencher.counter(ItemsCount::new(STEPS * batch)).bench_local(|| {
        for _ in 0..STEPS {
            first.step(black_box(&x), &mut h1, &mut c1, &mut scratch);
            second.step(&h1, &mut h2, &mut c2, &mut scratch);
            last.forward(&h2, &mut y);
            black_box(&y);
        }
    });
}

#[divan::bench(args = [16, 64, 200])]
fn gru(bencher: Bencher, size: usize) {
    let layer = Gru::new(
        20,
        size,
        &values(20 * 3 * size, 1),
        &values(3 * size, 2),
        &values(size * 3 * size, 3),
        &values(3 * size, 4),
    );
    let (mut memory, mut scratch) = (vec![0.0; size], vec![0.0; layer.scratch(1)]);
    let x = values(20, 5);
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        for _ in 0..STEPS {
            layer.step(black_box(&x), &mut memory, &mut scratch);
        }
    });
}

#[divan::bench(args = ["exp", "sigmoid", "tanh", "softplus"])]
fn pass_over_256(bencher: Bencher, name: &str) {
    let pass = match name {
        "exp" => activation::exp,
        "sigmoid" => activation::sigmoid,
        "tanh" => activation::tanh,
        _ => activation::softplus,
    };
    let mut x = values(256, 1);
    bencher.counter(ItemsCount::new(256_usize)).bench_local(|| pass(black_box(&mut x)));
}

/// Components of a picture with many objects.
const COMPONENTS: usize = 500;

/// A cell of 32 units over six inputs.
fn cell(name: &str) -> Cell {
    let (inputs, size) = (6, 32);
    let synapses = |count: usize| [values(count, 1), vec![4.0; count], values(count, 3), values(count, 4)];
    let (input, hidden) = (synapses(inputs * size), synapses(size * size));
    fn of(numbers: &[Vec<f32>; 4]) -> SynapseWeights<'_> {
        let [strength, slope, centre, reversal] = numbers;
        SynapseWeights { strength, slope, centre, reversal }
    }
    let (leak, rest, capacitance) = (&values(size, 5), &values(size, 6), &vec![0.5; size]);
    let linear =
        |inputs, outputs| Linear::new(inputs, outputs, &values(inputs * outputs, 7), &values(outputs, 8));
    match name {
        "ltc" => {
            let (input, hidden) = (of(&input), of(&hidden));
            let weights = LtcWeights { leak, rest, capacitance, input, hidden };
            Cell::Ltc(Ltc::new(inputs, size, Solver::Fused, 6, weights))
        }
        "cfc" => {
            let (wx, wh, heads) = (values(inputs * 64, 1), values(size * 64, 2), values(64 * 4 * size, 3));
            Cell::Cfc(Cfc::new(inputs, size, 64, &wx, &wh, &[0.0; 64], &heads, &vec![0.0; 4 * size]))
        }
        "gru" => {
            let (wx, wh) = (values(inputs * 3 * size, 1), values(size * 3 * size, 2));
            Cell::Gru(Gru::new(inputs, size, &wx, &vec![0.0; 3 * size], &wh, &vec![0.0; 3 * size]))
        }
        _ => Cell::Mlp(Mlp::new(linear(inputs, 64), linear(64, size))),
    }
}

/// A step of 500 components, with derivatives along two directions (the velocity), along four (the whole state), or none.
#[divan::bench(args = [("ltc", 0), ("ltc", 2), ("ltc", 4), ("cfc", 2), ("gru", 2), ("mlp", 2)])]
fn components(bencher: Bencher, (name, directions): (&str, usize)) {
    let cell = cell(name);
    let (inputs, size) = (cell.inputs(), cell.size());
    let x = values(COMPONENTS * inputs, 1);
    let slopes = values(COMPONENTS * directions * inputs, 2);
    let (mut memory, mut found) = (vec![0.0; COMPONENTS * size], vec![0.0; COMPONENTS * directions * size]);
    let mut scratch = vec![0.0; cell.scratch(COMPONENTS, directions)];
    bencher.bench_local(|| {
        let tangents = Tangents { directions, input: &slopes, output: &mut found };
        cell.step_along(1.0, black_box(&x), &mut memory, tangents, &mut scratch);
    });
}
