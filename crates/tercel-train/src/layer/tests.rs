//! Layers against compositions of plain operations, and against differences in double precision.

use super::*;
use crate::backend::{Tensor, constant, values};
use crate::{ParameterSet, Weights};

/// Numbers in [-1, 1] without a pattern.
fn numbers(count: usize, salt: u32) -> Vec<f32> {
    let mut state = salt.wrapping_mul(2_654_435_769).max(1);
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as f32 / u32::MAX as f32 * 2.0 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

fn tensor(rows: usize, columns: usize, salt: u32) -> Tensor {
    constant(numbers(rows * columns, salt), [rows, columns])
}

/// A loss that weighs each element of a value differently.
fn weighted(value: Tensor) -> Tensor {
    let [rows, columns] = value.dims();
    (value * tensor(rows, columns, 99)).sum().reshape([1, 1])
}

/// The tensors of a set by name, for compositions.
fn named(set: &ParameterSet, weights: &Weights, name: &str) -> Tensor {
    let place = set.iter().position(|entry| entry.name() == name).unwrap();
    weights.tensors()[place].clone()
}

fn lstm_step(parameters: &[Tensor; 3], size: usize, x: Tensor, state: LstmState) -> LstmState {
    use burn::tensor::activation::{sigmoid, tanh};
    let [input, hidden, bias] = parameters.clone();
    let gates = x.matmul(input) + state.hidden.matmul(hidden) + bias;
    let gate = |n: usize| gates.clone().narrow(1, n * size, size);
    let cell = sigmoid(gate(1)) * state.cell + sigmoid(gate(0)) * tanh(gate(2));
    LstmState { hidden: sigmoid(gate(3)) * tanh(cell.clone()), cell }
}

fn gru_step(parameters: &[Tensor; 4], size: usize, x: Tensor, memory: Tensor) -> Tensor {
    use burn::tensor::activation::{sigmoid, tanh};
    let [input, input_bias, hidden, hidden_bias] = parameters.clone();
    let of_x = x.matmul(input) + input_bias;
    let of_h = memory.clone().matmul(hidden) + hidden_bias;
    let part = |of: &Tensor, n: usize| of.clone().narrow(1, n * size, size);
    let r = sigmoid(part(&of_x, 0) + part(&of_h, 0));
    let z = sigmoid(part(&of_x, 1) + part(&of_h, 1));
    let n = tanh(part(&of_x, 2) + r * part(&of_h, 2));
    (z.clone().neg() + 1.0) * n + z * memory
}

fn close(found: &[f32], expected: &[f32], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1e-3_f32, |scale, value| scale.max(value.abs()));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 2e-5 * scale, "{what}: {found} for {expected}");
    }
}

fn same_gradients(
    set: &ParameterSet,
    fused: &dyn Fn(&Weights) -> Tensor,
    plain: &dyn Fn(&Weights) -> Tensor,
) {
    let (one, other) = (Weights::trainable(set), Weights::trainable(set));
    let (fused, plain) = (fused(&one), plain(&other));
    close(&values(&fused), &values(&plain), "value");
    let found = one.gradients(&weighted(fused));
    let expected = other.gradients(&weighted(plain));
    for ((entry, found), expected) in set.iter().zip(&found).zip(&expected) {
        close(found, expected, entry.name());
        assert!(expected.iter().any(|gradient| gradient.abs() > 1e-4), "{} has a gradient", entry.name());
    }
}

#[test]
fn an_lstm_sequence_equals_its_steps_and_so_do_the_gradients_of_everything_that_goes_in() {
    let (steps, batch, inputs, size) = (7, 5, 3, 6);
    let mut set = ParameterSet::new(2);
    let layer = Lstm::new(&mut set, "lstm", inputs, size).unwrap();
    for (name, shape, salt) in
        [("x", [steps * batch, inputs], 1), ("h", [batch, size], 2), ("c", [batch, size], 3)]
    {
        set.add(name, &shape, crate::Initial::Values(numbers(shape[0] * shape[1], salt))).unwrap();
    }
    let state =
        |weights: &Weights| LstmState { hidden: named(&set, weights, "h"), cell: named(&set, weights, "c") };
    let plain = |weights: &Weights| {
        let parameters = ["lstm.input", "lstm.hidden", "lstm.bias"].map(|name| named(&set, weights, name));
        let x = named(&set, weights, "x");
        let mut state = state(weights);
        let mut outputs = Vec::new();
        for step in 0..steps {
            state = lstm_step(&parameters, size, x.clone().narrow(0, step * batch, batch), state);
            outputs.push(state.hidden.clone());
        }
        outputs.push(state.cell);
        Tensor::cat(outputs, 0)
    };
    let fused = |weights: &Weights| {
        let (outputs, last) = layer.resume(weights, named(&set, weights, "x"), state(weights));
        Tensor::cat(vec![outputs, last.cell], 0)
    };
    let stepped = |weights: &Weights| {
        let x = named(&set, weights, "x");
        let mut state = state(weights);
        let mut outputs = Vec::new();
        for step in 0..steps {
            state = layer.step(weights, x.clone().narrow(0, step * batch, batch), state);
            outputs.push(state.hidden.clone());
        }
        outputs.push(state.cell);
        Tensor::cat(outputs, 0)
    };
    same_gradients(&set, &fused, &plain);
    same_gradients(&set, &stepped, &plain);
}

#[test]
fn a_reversed_lstm_is_the_layer_on_the_sequence_turned_round() {
    let (steps, batch, inputs, size) = (6, 2, 3, 4);
    let mut set = ParameterSet::new(5);
    let layer = Lstm::new(&mut set, "lstm", inputs, size).unwrap();
    set.add("x", &[steps * batch, inputs], crate::Initial::Values(numbers(steps * batch * inputs, 1)))
        .unwrap();
    let turned = |x: Tensor| {
        let rows = (0..steps).rev().map(|step| x.clone().narrow(0, step * batch, batch)).collect();
        Tensor::cat(rows, 0)
    };
    let reversed = |weights: &Weights| layer.reversed(weights, named(&set, weights, "x"), batch);
    let round = |weights: &Weights| turned(layer.sequence(weights, turned(named(&set, weights, "x")), batch));
    same_gradients(&set, &reversed, &round);
}

#[test]
fn a_gru_sequence_equals_its_steps_and_so_do_the_gradients_of_everything_that_goes_in() {
    let (steps, batch, inputs, size) = (7, 5, 3, 6);
    let mut set = ParameterSet::new(2);
    let layer = Gru::new(&mut set, "gru", inputs, size).unwrap();
    for (name, shape, salt) in [("x", [steps * batch, inputs], 1), ("h", [batch, size], 2)] {
        set.add(name, &shape, crate::Initial::Values(numbers(shape[0] * shape[1], salt))).unwrap();
    }
    let stepped = |weights: &Weights, step_of: &dyn Fn(Tensor, Tensor) -> Tensor| {
        let (x, mut memory) = (named(&set, weights, "x"), named(&set, weights, "h"));
        let mut outputs = Vec::new();
        for step in 0..steps {
            memory = step_of(x.clone().narrow(0, step * batch, batch), memory);
            outputs.push(memory.clone());
        }
        Tensor::cat(outputs, 0)
    };
    let plain = |weights: &Weights| {
        let parameters = ["gru.input", "gru.input_bias", "gru.hidden", "gru.hidden_bias"]
            .map(|name| named(&set, weights, name));
        stepped(weights, &|x, memory| gru_step(&parameters, size, x, memory))
    };
    let single = |weights: &Weights| stepped(weights, &|x, memory| layer.forward(weights, x, memory));
    let fused =
        |weights: &Weights| layer.forward(weights, named(&set, weights, "x"), named(&set, weights, "h"));
    same_gradients(&set, &fused, &plain);
    same_gradients(&set, &single, &plain);
}

#[test]
fn a_linear_layer_equals_product_bias_and_activation() {
    use burn::tensor::activation;
    for (activation, inputs, outputs) in [
        (Activation::Identity, 7, 9),
        (Activation::Relu, 4, 12),
        (Activation::Tanh, 12, 3),
        (Activation::Sigmoid, 2, 2),
    ] {
        let mut set = ParameterSet::new(7);
        let layer = Linear::new(&mut set, "head", inputs, outputs, activation).unwrap();
        set.add("x", &[11, inputs], crate::Initial::Values(numbers(11 * inputs, 1))).unwrap();
        let fused = |weights: &Weights| layer.forward(weights, named(&set, weights, "x"));
        let plain = |weights: &Weights| {
            let y = named(&set, weights, "x").matmul(named(&set, weights, "head.weight"));
            let y = y + named(&set, weights, "head.bias");
            match activation {
                Activation::Identity => y,
                Activation::Relu => activation::relu(y),
                Activation::Tanh => activation::tanh(y),
                Activation::Sigmoid => activation::sigmoid(y),
            }
        };
        same_gradients(&set, &fused, &plain);
    }
}

/// The gradient along a direction against the difference of losses summed in double precision.
fn check_differences(set: &ParameterSet, value: &dyn Fn(&Weights) -> Tensor) {
    let sum = |set: &ParameterSet| -> f64 {
        let value = value(&Weights::frozen(set));
        let factors = numbers(value.dims().iter().product(), 99);
        values(&value).iter().zip(factors).map(|(v, f)| f64::from(*v) * f64::from(f)).sum()
    };
    let weights = Weights::trainable(set);
    let gradients = weights.gradients(&weighted(value(&weights)));
    for (place, gradient) in gradients.iter().enumerate() {
        let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        let length = 1e-2;
        let moved = |sign: f64| {
            let mut set = set.clone();
            let (_, values) = set.values_mut().nth(place).unwrap();
            for (value, g) in values.iter_mut().zip(gradient) {
                *value += (sign * length * f64::from(*g) / norm) as f32;
            }
            sum(&set)
        };
        let slope = (moved(1.0) - moved(-1.0)) / (2.0 * length);
        let name = set.iter().nth(place).unwrap().name();
        assert!((slope - norm).abs() <= 1e-3 * norm, "{name}: slope {slope}, norm of the gradient {norm}");
    }
}

#[test]
fn gradients_of_recurrent_layers_equal_differences() {
    let (steps, batch, inputs, size) = (9, 4, 3, 8);
    let mut set = ParameterSet::new(11);
    let lstm = Lstm::new(&mut set, "lstm.0", inputs, size).unwrap();
    let gru = Gru::new(&mut set, "gru.0", size, size).unwrap();
    let head = Linear::new(&mut set, "head", size, 2, Activation::Tanh).unwrap();
    let x = tensor(steps * batch, inputs, 4);
    check_differences(&set, &|weights| {
        let outputs = lstm.sequence(weights, x.clone(), batch);
        head.forward(weights, gru.forward(weights, outputs, gru.zero(batch)))
    });
}

#[test]
fn a_detached_state_stops_the_gradient() {
    let mut set = ParameterSet::new(1);
    let layer = Lstm::new(&mut set, "lstm", 2, 3).unwrap();
    let weights = Weights::trainable(&set);
    let (_, state) = layer.resume(&weights, tensor(8, 2, 1), LstmState::zero(4, 3));
    let loss = weighted(state.detached().cell);
    assert!(weights.gradients(&loss).iter().flatten().all(|gradient| *gradient == 0.0));
}

#[test]
fn layers_of_size_zero_are_refused() {
    let mut set = ParameterSet::new(1);
    assert!(Lstm::new(&mut set, "a", 0, 4).unwrap_err().to_string().contains("inputs"));
    assert!(Gru::new(&mut set, "b", 4, 0).unwrap_err().to_string().contains("units"));
    assert!(Linear::new(&mut set, "c", 4, 0, Activation::Relu).unwrap_err().to_string().contains("outputs"));
    assert!(set.is_empty());
}

#[test]
fn dropout_keeps_the_mean_and_can_be_repeated() {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    let once = |seed| {
        let ones = constant(vec![1.0; 20_000], [200, 100]);
        values(&dropout(ones, 0.2, &mut ChaCha8Rng::seed_from_u64(seed)))
    };
    let mean = once(1).iter().sum::<f32>() / 20_000.0;
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
    assert_eq!(once(1), once(1));
    assert_ne!(once(1), once(2));
}

#[test]
fn a_layer_norm_equals_its_definition_and_so_do_its_gradients() {
    let (rows, size) = (5, 7);
    let mut set = ParameterSet::new(3);
    let layer = LayerNorm::new(&mut set, "norm", size).unwrap();
    for (_, values) in set.values_mut() {
        values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.3 * (i as f32).sin());
    }
    set.add("x", &[rows, size], crate::Initial::Values(numbers(rows * size, 1))).unwrap();
    let fused = |weights: &Weights| layer.forward(weights, named(&set, weights, "x"));
    let plain = |weights: &Weights| {
        let x = named(&set, weights, "x");
        let centred = x.clone() - x.mean_dim(1);
        let variance = (centred.clone() * centred.clone()).mean_dim(1);
        let normal = centred / (variance + 1e-5).sqrt();
        normal * named(&set, weights, "norm.weight") + named(&set, weights, "norm.bias")
    };
    same_gradients(&set, &fused, &plain);
}

#[test]
fn attention_equals_its_definition_and_so_do_its_gradients() {
    use burn::tensor::activation::softmax;
    let (steps, size, heads) = (4, 6, 2);
    let mut set = ParameterSet::new(4);
    let layer = Attention::new(&mut set, "attention", size, heads).unwrap();
    for (name, salt) in [("x", 1), ("m", 2)] {
        set.add(name, &[2 * steps, size], crate::Initial::Values(numbers(2 * steps * size, salt))).unwrap();
    }
    let seen = vec![1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    let mask = std::sync::Arc::new(Mask { steps, seen: seen.clone() });
    let fused = |weights: &Weights| {
        layer.forward(weights, named(&set, weights, "x"), named(&set, weights, "m"), &mask)
    };
    let plain = |weights: &Weights| {
        let part = |x: Tensor, name: &str| {
            let weight = named(&set, weights, &format!("attention.{name}.weight"));
            x.matmul(weight) + named(&set, weights, &format!("attention.{name}.bias"))
        };
        let memory = named(&set, weights, "m");
        let (q, k) = (part(named(&set, weights, "x"), "query"), part(memory.clone(), "key"));
        let v = part(memory, "value");
        let mut windows = Vec::new();
        for window in 0..2 {
            let closed = seen[window * steps..][..steps].iter().map(|seen| (seen - 1.0) * 1e9).collect();
            let closed = constant(closed, [1, steps]);
            let mut all = Vec::new();
            for head in 0..heads {
                let cut = |x: &Tensor| {
                    let width = size / heads;
                    x.clone().narrow(0, window * steps, steps).narrow(1, head * width, width)
                };
                let scores = cut(&q).matmul(cut(&k).transpose()) * (1.0 / 3.0_f32.sqrt());
                all.push(softmax(scores + closed.clone(), 1).matmul(cut(&v)));
            }
            windows.push(Tensor::cat(all, 1));
        }
        part(Tensor::cat(windows, 0), "output")
    };
    let (one, other) = (Weights::trainable(&set), Weights::trainable(&set));
    let (fused, plain) = (fused(&one), plain(&other));
    close(&values(&fused), &values(&plain), "value");
    let (found, expected) = (one.gradients(&weighted(fused)), other.gradients(&weighted(plain)));
    for ((entry, found), expected) in set.iter().zip(&found).zip(&expected) {
        // Keys that all move together change no share, so their bias has no gradient but rounding.
        if entry.name() == "attention.key.bias" {
            assert!(found.iter().chain(expected).all(|gradient| gradient.abs() < 1e-5));
        } else {
            close(found, expected, entry.name());
        }
    }
    assert!(Attention::new(&mut ParameterSet::new(1), "a", 6, 4).is_err());
}
