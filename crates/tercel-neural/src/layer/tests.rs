//! Layers against the same recursions written in double precision, and alone against in a batch.

use super::{Gru, Linear, Lstm, RunningNorm};

fn values(count: usize, seed: usize, size: f32) -> Vec<f32> {
    (0..count).map(|i| (((i + 31 * seed) * 7919 % 2003) as f32 / 1001.5 - 1.0) * size).collect()
}

fn product(x: &[f64], weights: &[f32], bias: &[f32]) -> Vec<f64> {
    let columns = bias.len();
    let term =
        |j: usize| x.iter().enumerate().map(|(k, x)| x * f64::from(weights[k * columns + j])).sum::<f64>();
    (0..columns).map(|j| f64::from(bias[j]) + term(j)).collect()
}

fn sigma(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

fn doubled(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

fn close(ours: &[f32], exact: &[f64], tolerance: f64) {
    assert_eq!(ours.len(), exact.len());
    for (ours, exact) in ours.iter().zip(exact) {
        assert!((f64::from(*ours) - exact).abs() < tolerance, "{ours} is not {exact}");
    }
}

#[test]
fn a_gru_follows_its_recursion_for_200_steps() {
    for (inputs, size) in [(3, 1), (5, 4), (20, 16), (36, 17), (6, 200)] {
        let (wx, bx) = (values(inputs * 3 * size, 1, 0.4), values(3 * size, 2, 0.3));
        let (wh, bh) = (values(size * 3 * size, 3, 0.8 / size as f32), values(3 * size, 4, 0.3));
        let layer = Gru::new(inputs, size, &wx, &bx, &wh, &bh);
        assert_eq!((layer.inputs(), layer.size()), (inputs, size));
        let (mut memory, mut scratch) = (vec![0.0; size], vec![0.0; layer.scratch(1)]);
        let mut exact = vec![0.0; size];
        for step in 0..200 {
            let x = values(inputs, 100 + step, 1.0);
            layer.step(&x, &mut memory, &mut scratch);
            let (a, b) = (product(&doubled(&x), &wx, &bx), product(&exact, &wh, &bh));
            for j in 0..size {
                let (r, z) = (sigma(a[j] + b[j]), sigma(a[size + j] + b[size + j]));
                let n = (a[2 * size + j] + r * b[2 * size + j]).tanh();
                exact[j] = (1.0 - z) * n + z * exact[j];
            }
        }
        close(&memory, &exact, 3e-6);
    }
}

#[test]
fn an_lstm_follows_its_recursion_for_200_steps() {
    for (inputs, size) in [(3, 1), (5, 4), (12, 64), (7, 19)] {
        let (wx, wh) = (values(inputs * 4 * size, 1, 0.4), values(size * 4 * size, 3, 0.8 / size as f32));
        let bias = values(4 * size, 2, 0.3);
        let layer = Lstm::new(inputs, size, &wx, &wh, &bias);
        assert_eq!((layer.inputs(), layer.size()), (inputs, size));
        let (mut output, mut cell) = (vec![0.0; size], vec![0.0; size]);
        let mut scratch = vec![0.0; layer.scratch(1)];
        let (mut h, mut c) = (vec![0.0; size], vec![0.0; size]);
        for step in 0..200 {
            let x = values(inputs, 100 + step, 1.0);
            layer.step(&x, &mut output, &mut cell, &mut scratch);
            let (a, b) = (product(&doubled(&x), &wx, &bias), product(&h, &wh, &vec![0.0; 4 * size]));
            let gate = |k: usize, j: usize| a[k * size + j] + b[k * size + j];
            for j in 0..size {
                c[j] = sigma(gate(1, j)) * c[j] + sigma(gate(0, j)) * gate(2, j).tanh();
                h[j] = sigma(gate(3, j)) * c[j].tanh();
            }
        }
        close(&output, &h, 3e-6);
        close(&cell, &c, 6e-6);
    }
}

#[test]
fn a_running_norm_is_the_normalisation_of_the_steps_so_far() {
    let norm = RunningNorm::new(2);
    let (mut memory, mut y) = (vec![0.0; norm.memory()], [0.0; 2]);
    let mut seen: Vec<Vec<f64>> = Vec::new();
    for step in 0..100 {
        let x = values(2, step, 50.0);
        seen.push(doubled(&x));
        norm.step(&x, &mut memory, &mut y);
        let count = seen.len() as f64;
        let exact = [0, 1].map(|c| {
            let mean = seen.iter().map(|x| x[c]).sum::<f64>() / count;
            let variance = seen.iter().map(|x| (x[c] - mean).powi(2)).sum::<f64>() / count;
            (seen[step][c] - mean) / (variance + 1e-5).sqrt()
        });
        close(&y, &exact, 1e-4);
    }
}

#[test]
fn a_row_gives_the_same_bits_alone_and_in_a_batch() {
    let (batch, inputs, size) = (5, 9, 21);
    let gru = Gru::new(
        inputs,
        size,
        &values(inputs * 3 * size, 1, 0.4),
        &values(3 * size, 2, 0.3),
        &values(size * 3 * size, 3, 0.1),
        &values(3 * size, 4, 0.3),
    );
    let lstm = Lstm::new(
        inputs,
        size,
        &values(inputs * 4 * size, 5, 0.4),
        &values(size * 4 * size, 6, 0.1),
        &values(4 * size, 7, 0.3),
    );
    let linear = Linear::new(size, 13, &values(size * 13, 8, 0.5), &values(13, 9, 0.5));
    let run = |x: &[f32], rows: usize| {
        let mut scratch = vec![0.0; gru.scratch(rows).max(lstm.scratch(rows))];
        let [mut memory, mut output, mut cell] = [0; 3].map(|_| vec![0.25; rows * size]);
        for _ in 0..3 {
            gru.step(x, &mut memory, &mut scratch);
            lstm.step(x, &mut output, &mut cell, &mut scratch);
        }
        let mut y = vec![0.0; rows * 13];
        linear.forward_relu(&output, &mut y);
        [memory, output, cell, y]
    };
    let x = values(batch * inputs, 11, 1.0);
    let together = run(&x, batch);
    for row in 0..batch {
        let alone = run(&x[row * inputs..][..inputs], 1);
        for (alone, together) in alone.iter().zip(&together) {
            assert_eq!(alone, &together[row * alone.len()..][..alone.len()]);
        }
    }
}

#[test]
#[should_panic(expected = "rows of 3 numbers")]
fn slices_of_different_batches_are_refused() {
    let layer = Linear::new(2, 3, &[0.0; 6], &[0.0; 3]);
    layer.forward(&[0.0; 4], &mut [0.0; 3]);
}

#[test]
fn attention_is_the_definition_and_leaves_out_what_is_masked() {
    let (rows, keys, size, heads) = (3, 5, 12, 3);
    let weights: Vec<_> = (0..4).map(|i| values(size * size, 20 + i, 0.6)).collect();
    let biases: Vec<_> = (0..4).map(|i| values(size, 30 + i, 0.3)).collect();
    let linear = |i: usize| Linear::new(size, size, &weights[i], &biases[i]);
    let layer = super::Attention::new(heads, linear(0), linear(1), linear(2), linear(3));
    let (x, memory) = (values(rows * size, 1, 2.0), values(keys * size, 2, 2.0));
    let mask = [1.0, 0.0, 1.0, 1.0, 0.0];
    let (mut y, mut scratch) = (vec![0.0; rows * size], vec![f32::NAN; layer.scratch(rows, keys)]);
    layer.forward(&x, &memory, &mask, &mut y, &mut scratch);

    let project = |x: &[f32], i: usize| product(&doubled(x), &weights[i], &biases[i]);
    for (x, y) in x.chunks(size).zip(y.chunks(size)) {
        let query = project(x, 0);
        let mut mixed = vec![0.0_f32; size];
        for head in 0..heads {
            let own = head * 4..head * 4 + 4;
            let mut shares = vec![0.0; keys];
            for (key, memory) in memory.chunks(size).enumerate() {
                let keys = project(memory, 1);
                let dot: f64 = own.clone().map(|c| query[c] * keys[c]).sum();
                shares[key] = if mask[key] == 0.0 { 0.0 } else { (dot / 2.0).exp() };
            }
            let sum: f64 = shares.iter().sum();
            for c in own {
                let values = memory.chunks(size).map(|memory| project(memory, 2)[c]);
                mixed[c] = values.zip(&shares).map(|(v, s)| v * s / sum).sum::<f64>() as f32;
            }
        }
        close(y, &project(&mixed, 3), 1e-5);
    }
}

#[test]
fn a_bidirectional_layer_is_two_layers_from_both_ends() {
    let (inputs, size, steps) = (3, 4, 6);
    let lstm = |seed| {
        let (wx, wh) = (values(inputs * 4 * size, seed, 0.5), values(size * 4 * size, seed + 1, 0.3));
        Lstm::new(inputs, size, &wx, &wh, &values(4 * size, seed + 2, 0.3))
    };
    let layer = super::Bidirectional::new(lstm(1), lstm(5));
    let x = values(steps * inputs, 9, 1.0);
    let (mut y, mut scratch) = (vec![0.0; steps * 2 * size], vec![9.0; layer.scratch()]);
    layer.forward(&x, &mut y, &mut scratch);
    let run = |layer: &Lstm, x: Vec<&[f32]>| {
        let (mut h, mut c, mut scratch) = (vec![0.0; size], vec![0.0; size], vec![0.0; layer.scratch(1)]);
        let step = |x: &[f32]| {
            layer.step(x, &mut h, &mut c, &mut scratch);
            h.clone()
        };
        x.into_iter().map(step).collect::<Vec<_>>()
    };
    let forward = run(&lstm(1), x.chunks(inputs).collect());
    let backward = run(&lstm(5), x.chunks(inputs).rev().collect());
    for (step, y) in y.chunks(2 * size).enumerate() {
        assert_eq!(y[..size], forward[step]);
        assert_eq!(y[size..], backward[steps - 1 - step]);
    }
}

#[test]
fn a_layer_norm_gives_rows_of_mean_zero_and_variance_one() {
    let x = values(40, 3, 70.0);
    let mut y = vec![0.0; 40];
    super::LayerNorm::new(&[2.0; 20], &[1.0; 20]).forward(&x, &mut y);
    for y in y.chunks(20) {
        let y: Vec<f64> = y.iter().map(|y| (f64::from(*y) - 1.0) / 2.0).collect();
        let mean = y.iter().sum::<f64>() / 20.0;
        let variance = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 20.0;
        assert!(mean.abs() < 1e-6 && (variance - 1.0).abs() < 1e-5, "{mean} {variance}");
    }
}

#[test]
fn positions_tell_the_steps_of_a_window_apart() {
    let rows = super::positions(25, 16);
    for (a, b) in (0..25).flat_map(|a| (0..a).map(move |b| (a, b))) {
        let apart: f32 = (0..16).map(|c| (rows[a * 16 + c] - rows[b * 16 + c]).powi(2)).sum();
        assert!(apart > 0.1, "{a} {b}");
    }
}

#[test]
fn attention_with_a_cache_is_the_definition_over_the_last_steps_however_many_came_before() {
    let (steps, size, heads, window) = (23, 12, 3, 5);
    let weights: Vec<_> = (0..4).map(|i| values(size * size, 20 + i, 0.6)).collect();
    let biases: Vec<_> = (0..4).map(|i| values(size, 30 + i, 0.3)).collect();
    let linear = |i: usize| Linear::new(size, size, &weights[i], &biases[i]);
    let layer = super::RotaryAttention::new(heads, linear(0), linear(1), linear(2), linear(3));
    let x = values(steps * size, 1, 2.0);
    let mut past = super::KeyValues::new(size, window);
    let mut scratch = vec![f32::NAN; layer.scratch(window)];
    let project = |x: &[f32], i: usize| product(&doubled(x), &weights[i], &biases[i]);
    for step in 0..steps {
        let mut y = vec![0.0; size];
        layer.step(&x[step * size..][..size], &mut past, &mut y, &mut scratch);
        assert_eq!(past.len(), window.min(step + 1));
        let row = |step: usize| &x[step * size..][..size];
        let query = project(row(step), 0);
        let mut mixed = vec![0.0_f32; size];
        let seen: Vec<usize> = ((step + 1).saturating_sub(window)..=step).collect();
        for head in 0..heads {
            let share = |before: &usize| {
                let key = project(row(*before), 1);
                // Turning both by their steps is turning one by the steps between them.
                let pairs = (0..2).map(|pair| {
                    let angle = (step - before) as f64 / 10_000_f64.powf(pair as f64 / 2.0);
                    let c = 4 * head + 2 * pair;
                    let (q, k) = ([query[c], query[c + 1]], [key[c], key[c + 1]]);
                    angle.cos() * (q[0] * k[0] + q[1] * k[1]) - angle.sin() * (q[1] * k[0] - q[0] * k[1])
                });
                (pairs.sum::<f64>() / 2.0).exp()
            };
            let shares: Vec<f64> = seen.iter().map(share).collect();
            let sum: f64 = shares.iter().sum();
            for (c, mixed) in mixed.iter_mut().enumerate().skip(4 * head).take(4) {
                let values = seen.iter().map(|before| project(row(*before), 2)[c]);
                *mixed = values.zip(&shares).map(|(v, s)| v * s / sum).sum::<f64>() as f32;
            }
        }
        close(&y, &project(&mixed, 3), 1e-5);
    }
}

#[test]
fn caches_of_one_step_merge_to_their_mean_and_others_to_the_heavier() {
    let zero = || Linear::new(2, 2, &[0.0; 4], &[0.0; 2]);
    let same = || Linear::new(2, 2, &[1.0, 0.0, 0.0, 1.0], &[0.0; 2]);
    let layer = super::RotaryAttention::new(1, zero(), same(), same(), same());
    let mut scratch = vec![0.0; layer.scratch(3)];
    let mut cache = |rows: &[f32]| {
        let mut past = super::KeyValues::new(2, 3);
        rows.iter().for_each(|x| layer.step(&[*x, *x], &mut past, &mut [0.0; 2], &mut scratch));
        past
    };
    let (one, other, older) = (cache(&[1.0, 2.0]), cache(&[3.0, 6.0]), cache(&[1.0, 2.0, 5.0]));
    let mut merged = one.clone();
    merged.merge(0.75, &other, 0.25);
    let mean = cache(&[1.5, 3.0]);
    assert_eq!(merged.len(), 2);
    let [found, expected] = [merged, mean].map(|mut past| {
        let mut y = [0.0; 2];
        layer.step(&[0.0; 2], &mut past, &mut y, &mut vec![0.0; layer.scratch(3)]);
        y
    });
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {expected:?}");
    let mut merged = one.clone();
    merged.merge(0.4, &older, 0.6);
    assert_eq!(merged, older);
    merged.merge(0.6, &one, 0.4);
    assert_eq!(merged, older);
    merged.clear();
    assert!(merged.is_empty() && merged == super::KeyValues::new(2, 3));
}
