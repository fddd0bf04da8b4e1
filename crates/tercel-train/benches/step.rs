//! Time of a training step: `cargo bench -p tercel-train --bench step`.
//!
//! All on one core. For comparison, on the machine where the figures in the documentation were taken: the LSTM step takes
//! PyTorch 0.31 to 0.42 s.

use divan::Bencher;
use tercel_train::backend::constant;
use tercel_train::layer::{Activation, Linear, Lstm};
use tercel_train::optimiser::{AdamW, OptimiserConfig};
use tercel_train::{ParameterSet, Weights};

fn main() {
    divan::main();
}

fn numbers(count: usize) -> Vec<f32> {
    (0..count).map(|i| ((i * 7919 % 1009) as f32 - 504.0) / 504.0).collect()
}

/// Forward, backward and AdamW of two layers of 64 units: 12 inputs, batches of 128, 200 steps.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn lstm_two_layers(bencher: Bencher) {
    let (steps, batch, inputs, size) = (200, 128, 12, 64);
    let mut set = ParameterSet::new(1);
    let first = Lstm::new(&mut set, "lstm.0", inputs, size).unwrap();
    let second = Lstm::new(&mut set, "lstm.1", size, size).unwrap();
    let head = Linear::new(&mut set, "head", size, 4, Activation::Identity).unwrap();
    let mut optimiser = AdamW::new(OptimiserConfig::default(), &set);
    let x = numbers(steps * batch * inputs);
    let target = numbers(steps * batch * 4);
    bencher.bench_local(|| {
        let weights = Weights::trainable(&set);
        let x = constant(x.clone(), [steps * batch, inputs]);
        let hidden = first.sequence(&weights, x, batch);
        let hidden = second.sequence(&weights, hidden, batch);
        let error = head.forward(&weights, hidden) - constant(target.clone(), [steps * batch, 4]);
        let loss = (error.clone() * error).mean().reshape([1, 1]);
        let gradients = weights.gradients(&loss);
        optimiser.step(&mut set, &gradients, 1e-3)
    });
}
