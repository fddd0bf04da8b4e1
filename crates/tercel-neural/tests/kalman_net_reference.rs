//! KalmanNet against a second implementation: in double precision, with states instead of differences, written from the
//! equations.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Matrix2, Matrix4, Matrix4x2, Rotation2, Vector2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tercel_core::filter::Filter;
use tercel_core::motion::{Motion, Turn};
use tercel_core::sensor::{Position, Sensor};
use tercel_neural::Model;
use tercel_neural::filter::{Architecture, Covariance, Feature, GainNetwork, KalmanNet, KalmanNetHyper};
use untrained::{TINY_ONE, TINY_TWO, kalman_net, tiny};

const ORIGIN: Vector2<f64> = Vector2::new(-300.0, 4500.0);

/// A network in double precision, with the memory of each recurrent layer by its name.
struct Network<'a> {
    model: &'a Model,
    memory: BTreeMap<String, Vec<f64>>,
}

fn sigma(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

impl Network<'_> {
    fn affine(&self, x: &[f64], weight: &str, bias: &str) -> Vec<f64> {
        let (weight, bias) = (&self.model.tensors()[weight].values, &self.model.tensors()[bias].values);
        let columns = bias.len();
        assert_eq!(weight.len(), x.len() * columns);
        let output = |j: usize| {
            let products = (0..x.len()).map(|k| x[k] * f64::from(weight[k * columns + j]));
            products.sum::<f64>() + f64::from(bias[j])
        };
        (0..columns).map(output).collect()
    }

    fn linear(&self, name: &str, x: &[f64]) -> Vec<f64> {
        self.affine(x, &format!("{name}.weight"), &format!("{name}.bias"))
    }

    fn relu(&self, name: &str, x: &[f64]) -> Vec<f64> {
        self.linear(name, x).into_iter().map(|y| y.max(0.0)).collect()
    }

    fn gru(&mut self, name: &str, x: &[f64]) -> Vec<f64> {
        let h = self.memory[name].clone();
        let n = h.len();
        let a = self.affine(x, &format!("{name}.input"), &format!("{name}.input_bias"));
        let b = self.affine(&h, &format!("{name}.hidden"), &format!("{name}.hidden_bias"));
        let next: Vec<f64> = (0..n)
            .map(|i| {
                let (reset, keep) = (sigma(a[i] + b[i]), sigma(a[n + i] + b[n + i]));
                let candidate = (a[2 * n + i] + reset * b[2 * n + i]).tanh();
                (1.0 - keep) * candidate + keep * h[i]
            })
            .collect();
        self.memory.insert(name.to_owned(), next.clone());
        next
    }

    fn stacked(&mut self, layers: usize, head: usize, x: &[f64]) -> Vec<f64> {
        let mut value = self.relu("input", x);
        for layer in 0..layers {
            value = self.gru(&format!("gru.{layer}"), &value);
        }
        if head > 0 {
            value = self.relu("head", &value);
        }
        self.linear("gain", &value)
    }

    /// `x` is F1, F2, F3, F4, and, if there are any, their magnitudes and that of the range.
    fn branched(&mut self, x: &[f64]) -> Vec<f64> {
        let pick =
            |places: &[usize]| -> Vec<f64> { places.iter().filter_map(|i| x.get(*i).copied()).collect() };
        let update = self.relu("fc5", &pick(&[8, 9, 10, 11, 15]));
        let q = self.gru("gru_q", &update);
        let evolution = self.relu("fc6", &pick(&[4, 5, 6, 7, 14]));
        let covariance = self.gru("gru_sigma", &[q, evolution].concat());
        let expected = self.relu("fc1", &covariance);
        let seen = self.relu("fc7", &pick(&[0, 1, 2, 3, 12, 13, 16]));
        let s = self.gru("gru_s", &[expected, seen].concat());
        let wide = self.relu("fc2.0", &[covariance.clone(), s.clone()].concat());
        let gain = self.linear("fc2.1", &wide);
        let back = self.relu("fc3", &[s, gain.clone()].concat());
        let replaced = self.relu("fc4", &[covariance, back].concat());
        self.memory.insert("gru_sigma".to_owned(), replaced);
        gain
    }
}

/// The filter, with the states of the last steps.
struct Reference<'a> {
    hyper: &'a KalmanNetHyper,
    network: Network<'a>,
    motion: Turn,
    radar: Position<2>,
    /// `x(t-1|t-1)`, `x(t-2|t-2)` and `x(t-1|t-2)`.
    posterior: Vector4<f64>,
    before: Vector4<f64>,
    prior: Vector4<f64>,
    covariance: Matrix4<f64>,
    observed: Vector2<f64>,
}

impl<'a> Reference<'a> {
    fn new(
        model: &'a Model,
        hyper: &'a KalmanNetHyper,
        motion: Turn,
        radar: Position<2>,
        first: Vector2<f64>,
    ) -> Self {
        let mut memory = BTreeMap::new();
        match hyper.architecture {
            Architecture::Stacked { hidden, layers, .. } => {
                memory.extend((0..layers).map(|layer| (format!("gru.{layer}"), vec![0.0; hidden])));
            }
            Architecture::Branched { .. } => {
                memory.insert("gru_q".to_owned(), Matrix4::<f64>::identity().as_slice().to_vec());
                memory.insert("gru_sigma".to_owned(), vec![0.0; 16]);
                memory.insert("gru_s".to_owned(), vec![1.0, 0.0, 0.0, 1.0]);
            }
        }
        let born = radar.birth(&first.into(), &motion.prior()).unwrap();
        let network = Network { model, memory };
        let (x, covariance) = (born.mean, born.covariance);
        Reference {
            hyper,
            network,
            motion,
            radar,
            posterior: x,
            before: x,
            prior: x,
            covariance,
            observed: first,
        }
    }

    fn inputs(
        &self,
        y: Vector2<f64>,
        innovation: Vector2<f64>,
        prior: Vector4<f64>,
        turn: Rotation2<f64>,
    ) -> Vec<f64> {
        let long = |v: Vector4<f64>| {
            let (p, v) = (turn * v.fixed_rows::<2>(0), turn * v.fixed_rows::<2>(2));
            vec![p[0], p[1], v[0], v[1]]
        };
        let short = |v: Vector2<f64>| (turn * v).as_slice().to_vec();
        let (mut features, mut magnitudes) = (Vec::new(), Vec::new());
        for feature in &self.hyper.features {
            let value = match feature {
                Feature::F1 => short(y - self.observed),
                Feature::F2 => short(innovation),
                Feature::F3 => long(self.posterior - self.before),
                Feature::F4 => long(self.posterior - self.prior),
            };
            let length = value.iter().map(|x| x * x).sum::<f64>().sqrt();
            let divisor = if self.hyper.normalise { length.max(1e-12) } else { 1.0 };
            features.extend(value.iter().map(|x| x / divisor));
            magnitudes.push((1.0 + length / 100.0).ln());
        }
        if self.hyper.magnitudes {
            magnitudes.push(((prior.xy() - ORIGIN).norm() / 100e3).ln());
            features.extend(magnitudes);
        }
        features
    }

    fn step(&mut self, dt: f64, y: Option<Vector2<f64>>) -> Vector4<f64> {
        let f = self.motion.jacobian(&self.posterior, dt);
        let prior = f * self.posterior;
        self.covariance = f * self.covariance * f.transpose() + self.motion.noise(&prior, dt);
        let h = self.radar.jacobian(&prior);
        let expected = h * prior;
        let mut next = prior;
        if let Some(y) = y {
            let innovation = y - expected;
            let seen = prior.xy() - ORIGIN;
            let azimuth = if self.hyper.sensor_frame { seen.y.atan2(seen.x) } else { 0.0 };
            let turn = Rotation2::new(-azimuth);
            let inputs = self.inputs(y, innovation, prior, turn);
            let output = match self.hyper.architecture {
                Architecture::Stacked { layers, head, .. } => self.network.stacked(layers, head, &inputs),
                Architecture::Branched { .. } => self.network.branched(&inputs),
            };
            let offset = self.hyper.gain_offset.unwrap_or_default();
            let learned = Matrix4x2::from_fn(|i, j| output[2 * i + j] + f64::from(offset[i][j]));
            let mut back = Matrix4::zeros();
            for block in [0, 2] {
                back.fixed_view_mut::<2, 2>(block, block).copy_from(turn.inverse().matrix());
            }
            let gain = back * learned * turn.matrix();
            next = prior + gain * innovation;
            let r: Matrix2<f64> = Sensor::<4, 2>::noise(&self.radar, &y);
            let kalman = self.covariance
                * h.transpose()
                * (h * self.covariance * h.transpose() + r).try_inverse().unwrap();
            let used = if self.hyper.covariance == Covariance::Joseph { gain } else { kalman };
            let rest = Matrix4::identity() - used * h;
            self.covariance = rest * self.covariance * rest.transpose() + used * r * used.transpose();
        }
        self.before = self.posterior;
        (self.posterior, self.prior, self.observed) = (next, prior, y.unwrap_or(expected));
        next
    }
}

/// Runs both over 60 steps of an object that turns, of which a fifth is not measured, and compares states and covariances.
/// Weights are random within `size`, which must not be so large that the filter loses the object.
fn compare(hyper: &KalmanNetHyper, size: f32) {
    let model = kalman_net(hyper, size, 7);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (motion, radar) = (Turn::new(0.03, 2.0), Position::new(40.0).unwrap());
    let network = Arc::new(GainNetwork::from_model(&model).unwrap());
    let filter = KalmanNet::new(network, motion, radar).seen_from(ORIGIN);
    let mut truth = Vector4::new(8000.0, 3000.0, -150.0, 90.0);
    let mut look =
        |truth: &Vector4<f64>| truth.xy() + Vector2::from_fn(|_, _| random.random_range(-60.0..60.0));
    let first = look(&truth);
    let mut belief = filter.birth(&first.into()).unwrap();
    let mut reference = Reference::new(&model, hyper, motion, radar, first);
    for step in 1..=60 {
        let dt = [1.0, 0.5, 2.0][step % 3];
        truth = motion.transition(&truth, dt);
        let seen = (step % 5 != 3).then(|| look(&truth));
        filter.predict(&mut belief, dt);
        if let Some(seen) = seen {
            filter.update(&mut belief, &seen.into()).unwrap();
        }
        let exact = reference.step(dt, seen);
        let state = filter.state(&belief);
        let error = (state.mean - exact).norm() / exact.norm();
        assert!(error < 1e-5, "step {step} of {hyper:?}: {error:e}");
        let error = (state.covariance - reference.covariance).norm() / reference.covariance.norm();
        assert!(error < 1e-5, "covariance at step {step} of {hyper:?}: {error:e}");
    }
    assert!(filter.state(&belief).mean.norm() < 1e6, "the comparison says little: the filter diverged");
}

fn offset(hyper: KalmanNetHyper) -> KalmanNetHyper {
    KalmanNetHyper { gain_offset: Some(untrained::ALPHA_BETA), ..hyper }
}

#[test]
fn architecture_one_of_the_publication_equals_its_reference() {
    compare(&offset(KalmanNetHyper::paper(Architecture::one())), 0.6);
}

#[test]
fn architecture_one_for_bent_models_equals_its_reference() {
    let two_layers = Architecture::Stacked { input: 480, hidden: 200, layers: 2, head: 32 };
    let features = vec![Feature::F1, Feature::F3, Feature::F4];
    compare(&offset(KalmanNetHyper { features, ..KalmanNetHyper::paper(two_layers) }), 0.3);
}

#[test]
fn architecture_one_without_a_head_equals_its_reference() {
    let headless = Architecture::Stacked { input: 200, hidden: 200, layers: 1, head: 0 };
    compare(&offset(KalmanNetHyper::paper(headless)), 0.3);
}

#[test]
fn architecture_two_of_the_publication_equals_its_reference() {
    compare(&offset(KalmanNetHyper::paper(Architecture::two())), 0.6);
}

#[test]
fn all_options_together_equal_their_reference() {
    for architecture in [TINY_ONE, TINY_TWO, Architecture::two()] {
        for covariance in [Covariance::Riccati, Covariance::Joseph] {
            compare(&tiny(architecture, covariance), 0.6);
        }
    }
}

#[test]
fn features_in_another_order_and_their_own_length_equal_their_reference() {
    let mut hyper = tiny(TINY_ONE, Covariance::Joseph);
    hyper.features = vec![Feature::F4, Feature::F2, Feature::F1];
    compare(&hyper, 0.3);
    // Features in metres are hundreds of times larger, which the weights must make up for.
    hyper.normalise = false;
    compare(&hyper, 0.05);
}

#[test]
fn a_gain_does_not_depend_on_the_azimuth_in_the_frame_of_the_sensor() {
    let hyper = tiny(TINY_TWO, Covariance::Joseph);
    let network = untrained::network(&hyper, 0.6);
    let (motion, radar) = (Turn::new(0.0, 2.0), Position::new(40.0).unwrap());
    let filter = KalmanNet::new(network, motion, radar);
    let run = |angle: f64| {
        let turn = Rotation2::new(angle);
        let seen = |x: f64, y: f64| (turn * Vector2::new(x, y)).into();
        let mut belief = filter.birth(&seen(5000.0, 100.0)).unwrap();
        for step in 1..20 {
            filter.predict(&mut belief, 1.0);
            filter
                .update(&mut belief, &seen(5000.0 - 90.0 * f64::from(step), 100.0 + f64::from(step * step)))
                .unwrap();
        }
        let mean = filter.state(&belief).mean;
        let (p, v) = (turn.inverse() * mean.xy(), turn.inverse() * mean.fixed_rows::<2>(2));
        Vector4::new(p[0], p[1], v[0], v[1])
    };
    for angle in [0.7, 2.5, -1.9] {
        assert!((run(angle) - run(0.0)).norm() < 1e-2, "{angle}: {} {}", run(angle), run(0.0));
    }
}

#[test]
fn rows_of_a_batch_give_the_gains_that_they_give_alone() {
    for architecture in [Architecture::one(), Architecture::two(), TINY_ONE, TINY_TWO] {
        let hyper = tiny(architecture, Covariance::Riccati);
        let network = untrained::network(&hyper, 0.6);
        let (batch, width) = (3, hyper.inputs());
        let inputs: Vec<f32> = (0..batch * width).map(|i| (i as f32 * 0.37).sin()).collect();
        let run = |inputs: &[f32], rows: usize| {
            let sizes: Vec<usize> = match architecture {
                Architecture::Stacked { hidden, layers, .. } => vec![hidden; layers],
                Architecture::Branched { .. } => vec![16, 16, 4],
            };
            let mut rest = &network.initial()[..];
            let mut memory = Vec::new();
            for size in sizes {
                (0..rows).for_each(|_| memory.extend_from_slice(&rest[..size]));
                rest = &rest[size..];
            }
            let mut scratch = vec![0.0; network.scratch(rows)];
            let mut gain = vec![0.0; rows * GainNetwork::GAIN];
            for _ in 0..5 {
                network.step(inputs, &mut memory, &mut scratch, &mut gain);
            }
            gain
        };
        let together = run(&inputs, batch);
        for row in 0..batch {
            let alone = run(&inputs[row * width..][..width], 1);
            assert_eq!(alone, together[row * 8..][..8], "{architecture:?}");
        }
    }
}
