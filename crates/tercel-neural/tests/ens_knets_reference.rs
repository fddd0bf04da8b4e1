//! Ensembles of KalmanNets against a second implementation in double precision, written from the equations.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::sync::Arc;

use nalgebra::{Matrix2, Rotation2, Vector2, Vector4};
use tercel_core::belief::Gaussian;
use tercel_core::filter::Filter;
use tercel_core::motion::{AccelerationNoise, Motion, Turn};
use tercel_core::sensor::{ConvertedPolar, Measurement, Sensor};
use tercel_neural::Model;
use tercel_neural::filter::{
    Attention, BranchHyper, EnsKNets, EnsKNetsHyper, EnsembleNetwork, KalmanNet, KalmanNetBelief,
    Normalisation, Sign,
};
use untrained::{ensemble_model, plots, radar, tiny_attention, tiny_ensemble};

fn sigma(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// A branch in double precision: outputs and cells of its layers.
struct Branch {
    name: &'static str,
    memory: Vec<[Vec<f64>; 2]>,
}

impl Branch {
    fn new(name: &'static str, sizes: Option<BranchHyper>) -> Option<Self> {
        sizes.map(|s| Branch { name, memory: vec![[vec![0.0; s.hidden], vec![0.0; s.hidden]]; s.layers] })
    }

    fn step(&mut self, model: &Model, inputs: &[f64]) -> Vec<f64> {
        let product = |x: &[f64], name: &str, columns: usize| -> Vec<f64> {
            let weight = &model.tensors()[name].values;
            assert_eq!(weight.len(), x.len() * columns, "{name}");
            let output =
                |j: usize| (0..x.len()).map(|k| x[k] * f64::from(weight[k * columns + j])).sum::<f64>();
            (0..columns).map(output).collect()
        };
        let mut value = inputs.to_vec();
        for (layer, [output, cell]) in self.memory.iter_mut().enumerate() {
            let (name, n) = (format!("{}.lstm.{layer}", self.name), cell.len());
            let bias = &model.tensors()[&format!("{name}.bias")].values;
            let a = product(&value, &format!("{name}.input"), 4 * n);
            let b = product(output, &format!("{name}.hidden"), 4 * n);
            let gate = |i: usize| a[i] + b[i] + f64::from(bias[i]);
            for i in 0..n {
                cell[i] = sigma(gate(n + i)) * cell[i] + sigma(gate(i)) * gate(2 * n + i).tanh();
                output[i] = sigma(gate(3 * n + i)) * cell[i].tanh();
            }
            value = output.clone();
        }
        let bias = &model.tensors()[&format!("{}.head.bias", self.name)].values;
        let outputs = product(&value, &format!("{}.head.weight", self.name), bias.len());
        outputs.iter().zip(bias).map(|(y, b)| y + f64::from(*b)).collect()
    }
}

/// The ensemble in double precision, around the KalmanNets of the library.
struct Reference<'a> {
    model: &'a Model,
    hyper: &'a EnsKNetsHyper,
    nets: Vec<KalmanNet<Turn, ConvertedPolar>>,
    beliefs: Vec<KalmanNetBelief>,
    weights: Vec<f64>,
    smallest: f64,
    waited: f64,
    /// All that the branches were ever offered.
    offered: Vec<Vec<f64>>,
    correction: Option<Branch>,
    classification: Option<Branch>,
    corrections: Vec<Vector4<f64>>,
    probabilities: Vec<f64>,
}

impl<'a> Reference<'a> {
    fn new(
        model: &'a Model,
        network: &EnsembleNetwork,
        hyper: &'a EnsKNetsHyper,
        first: &Measurement<2>,
    ) -> Self {
        let noise = AccelerationNoise::Piecewise(hyper.acceleration);
        let nets: Vec<_> = hyper
            .rates
            .iter()
            .zip(network.nets())
            .map(|(rate, net)| {
                let motion = Turn::with_noise(*rate, noise).with_speed(hyper.speed);
                KalmanNet::new(net.clone(), motion, radar())
            })
            .collect();
        let even = 1.0 / hyper.modes() as f64;
        Reference {
            model,
            hyper,
            beliefs: nets.iter().map(|net| net.birth(first).unwrap()).collect(),
            nets,
            weights: vec![even; hyper.modes()],
            smallest: 2.0,
            waited: 0.0,
            offered: Vec::new(),
            correction: Branch::new("correction", hyper.correction),
            classification: Branch::new("classification", hyper.classification),
            corrections: vec![Vector4::zeros(); hyper.modes()],
            probabilities: vec![even; hyper.modes()],
        }
    }

    fn predict(&mut self) {
        for (index, rate) in self.hyper.rates.iter().enumerate() {
            self.nets[index].predict(&mut self.beliefs[index], 1.0);
            let f = Turn::new(*rate, 0.0).jacobian(&Vector4::zeros(), 1.0);
            self.corrections[index] = f * self.corrections[index];
        }
        if let Some(stay) = self.hyper.attention.and_then(|attention| attention.stay) {
            let change = (1.0 - stay) / (self.weights.len() - 1) as f64;
            let before = self.weights.clone();
            for (j, weight) in self.weights.iter_mut().enumerate() {
                let flow = |i: usize| before[i] * if i == j { stay } else { change };
                *weight = (0..before.len()).map(flow).sum();
            }
        }
        self.waited += 1.0;
    }

    fn update(&mut self, measurement: &Measurement<2>) {
        let read = |place: &Vector2<f64>| Sensor::<4, 2>::read(&radar(), measurement, Some(place)).unwrap();
        let (mut states, mut innovations, mut spreads) = (Vec::new(), Vec::new(), Vec::new());
        for (net, belief) in self.nets.iter().zip(&mut self.beliefs) {
            let Gaussian { mean, covariance } = net.state(belief);
            let reading = read(&mean.xy());
            innovations.push(reading.value - mean.xy());
            spreads.push(covariance.fixed_view::<2, 2>(0, 0) + reading.noise);
            net.update(belief, measurement).unwrap();
            states.push(net.state(belief).mean);
        }
        let nis: Vec<f64> = innovations
            .iter()
            .zip(&spreads)
            .map(|(v, s)| (v.transpose() * s.try_inverse().unwrap() * v)[0])
            .collect();
        if let Some(attention) = self.hyper.attention {
            self.weigh(&attention, &nis, &spreads);
        }
        let mean: Vector4<f64> = states.iter().map(|state| state / states.len() as f64).sum();
        let reading = read(&mean.xy());
        let inputs = self.inputs(&states, &innovations, &spreads, &nis, reading.value, reading.noise);
        self.think(&inputs, &states);
        self.waited = 0.0;
    }

    fn weigh(&mut self, attention: &Attention, nis: &[f64], spreads: &[Matrix2<f64>]) {
        let mut heat = 1.0;
        if let Some(share) = attention.temperature {
            let smallest = nis.iter().copied().fold(f64::INFINITY, f64::min);
            self.smallest = share * self.smallest + (1.0 - share) * smallest;
            heat = f64::max(1.0, self.smallest / 2.0);
        }
        let logits: Vec<f64> = (0..nis.len())
            .map(|m| {
                let own = match attention.sign {
                    Sign::Minus => -0.5 * nis[m] / heat - 0.5 * spreads[m].determinant().ln(),
                    Sign::Plus => nis[m] / heat,
                };
                own + attention.stay.map_or(0.0, |_| self.weights[m].ln())
            })
            .collect();
        self.weights = softmax(&logits);
    }

    fn inputs(
        &self,
        states: &[Vector4<f64>],
        innovations: &[Vector2<f64>],
        spreads: &[Matrix2<f64>],
        nis: &[f64],
        reading: Vector2<f64>,
        noise: Matrix2<f64>,
    ) -> [Vec<f64>; 2] {
        let attended: Vector4<f64> = states.iter().zip(&self.weights).map(|(x, w)| x * *w).sum();
        let attention = self.hyper.attention.is_some();
        if self.hyper.normalisation != Normalisation::Relative {
            if attention {
                return [attended.as_slice().to_vec(), attended.as_slice().to_vec()];
            }
            let all = states.iter().flat_map(|x| x.as_slice().to_vec()).collect();
            return [all, reading.as_slice().to_vec()];
        }
        let mean = states.iter().sum::<Vector4<f64>>() / states.len() as f64;
        let turn = Rotation2::new(-mean[1].atan2(mean[0]));
        let both = |x: Vector4<f64>| {
            let (p, v) = (turn * Vector2::new(x[0], x[1]), turn * Vector2::new(x[2], x[3]));
            [p.x, p.y, v.x, v.y]
        };
        let apart = |x: &Vector4<f64>| {
            let d = both(x - mean);
            [d[0] / 100.0, d[1] / 100.0, d[2] / 10.0, d[3] / 10.0].map(f64::asinh)
        };
        let deviations = |p: &Matrix2<f64>| {
            let turned = turn.matrix() * p * turn.matrix().transpose();
            Vector2::new(turned[(0, 0)].sqrt(), turned[(1, 1)].sqrt())
        };
        let mut row = Vec::new();
        for m in 0..states.len() {
            row.extend(apart(&states[m]));
            let (v, s) = (turn * innovations[m], deviations(&spreads[m]));
            row.extend([(v.x / s.x).asinh(), (v.y / s.y).asinh(), (1.0 + nis[m]).ln()]);
            if attention {
                row.push((self.weights[m].ln().max(-12.0) + 4.0) / 4.0);
            }
        }
        let spread = spreads.iter().map(deviations).sum::<Vector2<f64>>() / states.len() as f64;
        let (velocity, noise) = (both(mean), deviations(&noise));
        row.extend([
            velocity[2] / 300.0,
            velocity[3] / 300.0,
            (mean.xy().norm() / 1e5).ln(),
            self.waited.ln(),
        ]);
        row.extend([
            (spread.x / 100.0).ln(),
            (spread.y / 1e3).ln(),
            (noise.x / 50.0).ln(),
            (noise.y / 1e3).ln(),
        ]);
        if attention {
            row.extend(apart(&attended));
        }
        [row.clone(), row]
    }

    /// The last offer, each component by the mean and variance of all offers.
    fn normalised(&mut self, inputs: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
        if self.hyper.normalisation == Normalisation::Relative {
            return inputs.clone();
        }
        self.offered.push(inputs.concat());
        let count = self.offered.len() as f64;
        let all: Vec<f64> = (0..inputs[0].len() + inputs[1].len())
            .map(|i| {
                let mean = self.offered.iter().map(|row| row[i]).sum::<f64>() / count;
                let variance = self.offered.iter().map(|row| (row[i] - mean).powi(2)).sum::<f64>() / count;
                (self.offered.last().unwrap()[i] - mean) / (variance + 1e-5).sqrt()
            })
            .collect();
        let (first, second) = all.split_at(inputs[0].len());
        [first.to_vec(), second.to_vec()]
    }

    fn think(&mut self, inputs: &[Vec<f64>; 2], states: &[Vector4<f64>]) {
        let [first, second] = self.normalised(inputs);
        if let Some(branch) = &mut self.correction {
            let outputs = branch.step(self.model, &first);
            let mean = states.iter().sum::<Vector4<f64>>() / states.len() as f64;
            let relative = self.hyper.normalisation == Normalisation::Relative;
            let back = Rotation2::new(if relative { mean[1].atan2(mean[0]) } else { 0.0 });
            for (correction, d) in self.corrections.iter_mut().zip(outputs.chunks(4)) {
                let (p, v) =
                    (back * Vector2::new(d[0], d[1]) * 100.0, back * Vector2::new(d[2], d[3]) * 10.0);
                *correction = Vector4::new(p.x, p.y, v.x, v.y);
            }
        }
        if let Some(branch) = &mut self.classification {
            self.probabilities = softmax(&branch.step(self.model, &second));
        }
    }

    fn estimate(&self) -> Gaussian<4> {
        let modes: Vec<Gaussian<4>> = (0..self.nets.len())
            .map(|m| {
                let Gaussian { mean, covariance } = self.nets[m].state(&self.beliefs[m]);
                Gaussian { mean: mean + self.corrections[m], covariance }
            })
            .collect();
        let mean: Vector4<f64> = modes.iter().zip(&self.probabilities).map(|(mode, p)| mode.mean * *p).sum();
        let spread = |mode: &Gaussian<4>| (mode.mean - mean) * (mode.mean - mean).transpose();
        let parts = modes.iter().zip(&self.probabilities);
        let covariance = parts.map(|(mode, p)| (mode.covariance + spread(mode)) * *p).sum();
        Gaussian { mean, covariance }
    }
}

fn softmax(logits: &[f64]) -> Vec<f64> {
    let sum: f64 = logits.iter().map(|x| (x - logits[0]).exp()).sum();
    logits.iter().map(|x| (x - logits[0]).exp() / sum).collect()
}

fn compare(hyper: &EnsKNetsHyper) {
    let model = ensemble_model(hyper, 0.7, 5);
    let network = Arc::new(EnsembleNetwork::from_model(&model).unwrap());
    let filter = EnsKNets::new(network.clone(), radar()).unwrap();
    let plots = plots(0.05);
    let first = plots[0].unwrap();
    let mut belief = filter.birth(&first).unwrap();
    let mut reference = Reference::new(&model, &network, hyper, &first);
    for (step, plot) in plots[1..].iter().enumerate() {
        filter.predict(&mut belief, 1.0);
        reference.predict();
        if let Some(plot) = plot {
            filter.update(&mut belief, plot).unwrap();
            reference.update(plot);
        }
        for (found, exact) in belief.weights().zip(&reference.weights) {
            assert!((found - exact).abs() < 1e-9, "weight at step {step} of {hyper:?}: {found} {exact}");
        }
        for (found, exact) in belief.corrections().zip(&reference.corrections) {
            assert!((found - exact).norm() < 0.05, "step {step} of {hyper:?}: {found} {exact}");
        }
        let (estimate, exact) = (filter.estimate(&belief), reference.estimate());
        for (found, exact) in estimate.modes.iter().zip(&reference.probabilities) {
            assert!((found - exact).abs() < 1e-4, "step {step} of {hyper:?}: {found} {exact}");
        }
        let error = (estimate.mean - exact.mean).norm() / exact.mean.norm();
        assert!(error < 1e-5, "step {step} of {hyper:?}: {error:e}");
        let error = (estimate.covariance - exact.covariance).norm() / exact.covariance.norm();
        assert!(error < 1e-3, "covariance at step {step} of {hyper:?}: {error:e}");
    }
}

#[test]
fn ensembles_without_attention_equal_their_reference() {
    let running = tiny_ensemble();
    compare(&running);
    compare(&EnsKNetsHyper { normalisation: Normalisation::Relative, ..running });
}

#[test]
fn ensembles_with_attention_equal_their_reference() {
    let attention = |sign, temperature, stay| Some(Attention { sign, temperature, stay });
    let running = tiny_ensemble();
    compare(&EnsKNetsHyper { attention: attention(Sign::Minus, None, None), ..running.clone() });
    compare(&EnsKNetsHyper { attention: attention(Sign::Minus, Some(0.5), None), ..running.clone() });
    compare(&EnsKNetsHyper { attention: attention(Sign::Minus, None, Some(0.9)), ..running.clone() });
    compare(&EnsKNetsHyper { attention: attention(Sign::Plus, None, None), ..running });
    compare(&tiny_attention());
}

#[test]
fn the_baselines_of_the_publication_equal_their_reference() {
    let all = EnsKNetsHyper { speed: 200.0, ..tiny_ensemble() };
    compare(&EnsKNetsHyper { correction: None, ..all.clone() });
    compare(&EnsKNetsHyper { classification: None, ..all.clone() });
    compare(&EnsKNetsHyper { correction: None, classification: None, ..all });
}
