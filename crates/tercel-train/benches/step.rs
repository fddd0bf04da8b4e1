//! Time of a training step: `cargo bench -p tercel-train --bench step`.
//!
//! All on one core, except where threads are named. For comparison, on the machine where the figures in the
//! documentation were taken: the LSTM step takes PyTorch 0.31 to 0.42 s, and that of KalmanNet #2 1.01 s.

#![allow(clippy::unwrap_used)]

use divan::Bencher;
use tercel_train::backend::Tensor;
use tercel_train::backend::constant;
use tercel_train::kalman;
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

/// One update of KalmanNet on 128 flights of 200 steps: data, forward, backward, AdamW.
mod kalman_net {
    use super::*;
    use tercel_train::recipe::Recipe;
    use tercel_train::task::kalman_net::{KalmanNetKind, KalmanNetTask};
    use tercel_train::trainer::{Draw, Loss, Split, Task};

    const HEAD: &str = "version = 1\nkind = \"kalman-net\"\nname = \"net\"\nseed = 4\n[data]\n[model]\nzero_gain = true\n\
                        [model.network]\ncovariance = \"joseph\"\ngain_offset = [[0.4, 0.0], [0.0, 0.4], [0.1, 0.0], [0.0, \
                        0.1]]\n";
    const PAPER: &str = "normalise = true\nmagnitudes = false\nsensor_frame = false\n";
    const OURS: &str = "normalise = true\nmagnitudes = true\nsensor_frame = true\n";
    const ONE: &str = "features = [\"f2\", \"f4\"]\n[model.network.architecture]\nkind = \"architecture-1\"\ninput = 480\n\
                       hidden = 200\nlayers = 1\nhead = 32\n";
    const TWO: &str = "features = [\"f1\", \"f2\", \"f3\", \"f4\"]\n[model.network.architecture]\nkind = \
                       \"architecture-2\"\nin_mult = 5\nout_mult = 40\n";

    fn update(bencher: Bencher, options: &str, architecture: &str) {
        let recipe = Recipe::<KalmanNetKind>::parse(&format!("{HEAD}{options}{architecture}")).unwrap();
        let (task, mut set) = KalmanNetTask::new(&recipe).unwrap();
        let mut optimiser = AdamW::new(OptimiserConfig::default(), &set);
        let samples: Vec<u64> = (0..128).collect();
        bencher.bench_local(|| {
            let draw = Draw { split: Split::Training, epoch: 0, seed: 4, samples: &samples };
            let rollout = task.batch(draw).unwrap();
            let weights = Weights::trainable(&set);
            let Loss { value, .. } = task.loss(&weights, &rollout, 0, &mut None).unwrap();
            let gradients = weights.gradients(&value);
            optimiser.step(&mut set, &gradients, 1e-4)
        });
    }

    #[divan::bench(sample_count = 10, sample_size = 1)]
    fn architecture_1(bencher: Bencher) {
        update(bencher, PAPER, ONE);
    }

    #[divan::bench(sample_count = 10, sample_size = 1)]
    fn architecture_2(bencher: Bencher) {
        update(bencher, PAPER, TWO);
    }

    #[divan::bench(sample_count = 10, sample_size = 1)]
    fn architecture_2_ours(bencher: Bencher) {
        update(bencher, OURS, TWO);
    }

    /// An epoch of 4 batches in two shards, on one and two threads.
    #[divan::bench(sample_count = 5, sample_size = 1, args = [1, 2])]
    fn epoch(bencher: Bencher, threads: usize) {
        use std::ops::ControlFlow;
        use tercel_train::trainer::Run;
        let text = format!("{HEAD}{PAPER}{TWO}[schedule]\nepochs = 1\nbatch = 128\n")
            .replace("[data]", "[data]\ntraining = 512\nvalidation = 1");
        let folder = std::env::temp_dir();
        let run = Run { threads, ..Run::new(folder.join(format!("tercel-bench-{threads}.safetensors"))) };
        bencher.bench_local(|| {
            tercel_train::task::train(&text, &run, &mut |_| ControlFlow::Continue(())).unwrap()
        });
    }
}

/// One update of the published branches of an ensemble on 128 flights of 200 steps.
mod ens_knets {
    use super::*;
    use tercel_neural::filter::{Architecture, KalmanNetHyper};
    use tercel_neural::{Card, Model, Scale, Tensor as Stored};
    use tercel_train::recipe::Recipe;
    use tercel_train::task::ens_knets::{EnsKNetsKind, EnsKNetsTask};
    use tercel_train::trainer::{Draw, Loss, Split, Task};

    fn net(architecture: Architecture, rate: f64) -> Model {
        let gain_offset = Some([[0.5, 0.0], [0.0, 0.5], [0.1, 0.0], [0.0, 0.1]]);
        let hyper = KalmanNetHyper { gain_offset, ..KalmanNetHyper::paper(architecture) };
        let mut card = Card::new("net", "kalman-net", &["x", "y", "vx", "vy"]);
        card.hyper = hyper.to_table().unwrap();
        card.scales.insert("turn_rate".into(), Scale { value: rate, unit: "rad/s".into() });
        let zeros = |shape: Vec<usize>| Stored { values: vec![0.0; shape.iter().product()], shape };
        let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape)));
        Model::new(card, tensors.collect()).unwrap()
    }

    fn task(architecture: Architecture, fresh: &str) -> (EnsKNetsTask, ParameterSet) {
        let text = format!(
            "version = 1\nkind = \"ens-knets\"\nname = \"ensemble\"\n[data.flights]\nfresh = \"{fresh}\"\n[model]\n\
             nets = []\nacceleration = 10.0\nspeed = 300.0\nnormalisation = \"relative\"\ndropout = 0.2\n\
             attention = {{ sign = \"minus\" }}\ncorrection = {{ hidden = 64, layers = 2 }}\n\
             classification = {{ hidden = 64, layers = 2 }}\n[loss]\nusual = 1\n"
        );
        let nets = [0.0, 0.17, -0.17].map(|rate| net(architecture, rate));
        EnsKNetsTask::of_nets(&Recipe::<EnsKNetsKind>::parse(&text).unwrap(), &nets).unwrap()
    }

    const SAMPLES: [u64; 128] = {
        let mut samples = [0; 128];
        let mut i = 0;
        while i < 128 {
            samples[i] = i as u64;
            i += 1;
        }
        samples
    };

    const DRAW: Draw<'_> = Draw { split: Split::Training, epoch: 0, seed: 4, samples: &SAMPLES };

    /// Flights that are followed already: forward, backward, AdamW.
    #[divan::bench(sample_count = 5, sample_size = 1)]
    fn update(bencher: Bencher) {
        let (task, mut set) = task(Architecture::two(), "nothing");
        let mut optimiser = AdamW::new(OptimiserConfig::default(), &set);
        task.batch(DRAW).unwrap();
        bencher.bench_local(|| {
            let batch = task.batch(DRAW).unwrap();
            let weights = Weights::trainable(&set);
            let Loss { value, .. } = task.loss(&weights, &batch, 0, &mut None).unwrap();
            let gradients = weights.gradients(&value);
            optimiser.step(&mut set, &gradients, 1e-4)
        });
    }

    /// New flights, each followed by three KalmanNets.
    #[divan::bench(sample_count = 3, sample_size = 1)]
    fn flights_followed_by_architecture_2(bencher: Bencher) {
        let (task, _) = task(Architecture::two(), "flights");
        bencher.bench_local(|| task.batch(DRAW).unwrap());
    }

    #[divan::bench(sample_count = 2, sample_size = 1)]
    fn flights_followed_by_architecture_1(bencher: Bencher) {
        let (task, _) = task(Architecture::one(), "flights");
        bencher.bench_local(|| task.batch(DRAW).unwrap());
    }
}

/// One batch of a recipe of the repository on one core: data, forward and backward of all its windows.
mod recipes {
    use super::*;
    use tercel_train::TrainError;
    use tercel_train::recipe::{Kind, Recipe};
    use tercel_train::task::{deep_mtt, liquid, mnemonic, tr_mtt};
    use tercel_train::trainer::{Draw, Split, Task};

    type Made<T> = Result<(T, ParameterSet), TrainError>;

    fn batch<K: Kind, T: Task>(bencher: Bencher, text: &str, make: fn(&Recipe<K>) -> Made<T>) {
        let recipe = Recipe::<K>::parse(text).unwrap();
        let (task, set) = make(&recipe).unwrap();
        let samples: Vec<u64> = (0..recipe.schedule.batch as u64).collect();
        bencher.bench_local(|| {
            let draw = Draw { split: Split::Training, epoch: 0, seed: recipe.seed, samples: &samples };
            let batch = task.batch(draw).unwrap();
            let mut memory = None;
            for window in 0..task.windows(&batch) {
                let weights = Weights::trainable(&set);
                let loss = task.loss(&weights, &batch, window, &mut memory).unwrap();
                weights.gradients(&loss.value);
            }
        });
    }

    macro_rules! recipe {
        ($name:ident, $file:literal, $task:ty) => {
            #[divan::bench(sample_count = 3, sample_size = 1)]
            fn $name(bencher: Bencher) {
                batch(bencher, include_str!(concat!("../../../recipes/", $file, ".toml")), <$task>::new);
            }
        };
    }

    recipe!(liquid, "liquid", liquid::LiquidTask);
    recipe!(liquid_cfc, "liquid-cfc", liquid::LiquidTask);
    recipe!(liquid_gru, "liquid-gru", liquid::LiquidTask);
    recipe!(liquid_paper, "liquid-paper", liquid::LiquidTask);
    recipe!(mnemonic, "mnemonic", mnemonic::MnemonicTask);
    recipe!(mnemonic_full, "mnemonic-full", mnemonic::MnemonicTask);
    recipe!(deep_mtt, "deep-mtt", deep_mtt::DeepMttTask);
    recipe!(deep_mtt_full, "deep-mtt-full", deep_mtt::DeepMttTask);
    recipe!(tr_mtt, "tr-mtt", tr_mtt::TrMttTask);
    recipe!(tr_mtt_full, "tr-mtt-full", tr_mtt::TrMttTask);
}

/// 200 steps of a Kalman filter for 128 objects, forward and backward: prediction, gain, Joseph form,
/// log-likelihood.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn kalman_steps(bencher: Bencher) {
    use nalgebra::Matrix4;
    let batch = 128;
    let eye = |n: usize, scale: f32| -> Vec<f32> {
        (0..n * n).map(|i| if i % (n + 1) == 0 { scale } else { 0.0 }).collect::<Vec<_>>().repeat(batch)
    };
    let mut set = ParameterSet::new(1);
    set.add("noise", &[batch, 4], tercel_train::Initial::Values(eye(2, 2.0))).unwrap();
    let innovation = numbers(batch * 2);
    bencher.bench_local(|| {
        let weights = Weights::trainable(&set);
        let noise = weights.tensors()[0].clone();
        let mut covariance = constant(eye(4, 1.0), [batch, 16]);
        let mut losses: Vec<Tensor> = Vec::new();
        for _ in 0..200 {
            let predicted =
                kalman::predicted(covariance, &(Matrix4::identity() * 0.98), &Matrix4::identity());
            let s = kalman::innovation_covariance(predicted.clone(), noise.clone());
            let gain = kalman::gain(predicted.clone(), s.clone());
            losses.push(kalman::log_likelihood(constant(innovation.clone(), [batch, 2]), s));
            covariance = kalman::joseph(predicted, gain, noise.clone());
        }
        let loss = Tensor::cat(losses, 0).mean().reshape([1, 1]);
        weights.gradients(&loss)
    });
}
