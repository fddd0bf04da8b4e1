use std::sync::Arc;

use tercel_core::filter::Filter;
use tercel_core::sensor::{Measurement, RangeBearing};
use tercel_neural::Model;
use tercel_neural::filter::{BankNetwork, NeuralImm};
use tercel_sim::air_traffic::AirTraffic;

use super::*;
use crate::backend::{Tape, leaf};
use crate::task::repository;

const RECIPE: &str = "
version = 1
kind = \"neural-imm\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 40
unbroken = 0.3
bearings = [0.3, 0.8]
[model]
rates = [0.0, 0.1, -0.1]
accelerations = [8.0]
stay = 0.98
speed = 300.0
input = 6
hidden = 5
layers = 2
";

fn task() -> (NeuralImmTask, ParameterSet) {
    NeuralImmTask::new(&Recipe::parse(RECIPE).unwrap()).unwrap()
}

fn batch(task: &NeuralImmTask) -> NeuralImmBatch {
    task.batch(Draw { split: Split::Training, epoch: 0, seed: 3, samples: &[0, 1, 2, 3] }).unwrap()
}

#[test]
fn the_gradient_of_the_loss_is_its_slope() {
    let (task, _) = task();
    let NeuralImmBatch(followed) = batch(&task);
    let (rows, width) = (followed.updates * followed.members, task.hyper.outputs());
    // The error counts as given in the likelihood, so its slope is not that of the whole.
    for likelihood in [0.0, 0.05] {
        let mixture =
            Mixture { followed: followed.clone(), loss: NeuralImmLoss { likelihood, ..task.loss.clone() } };
        let start: Vec<f32> = (0..rows * width).map(|i| 0.2 * ((i as f32) * 0.7).sin()).collect();
        let total =
            |outputs: Vec<f32>| values(&apply(mixture.clone(), [constant(outputs, [rows, width])]))[0];
        let outputs = leaf(start.clone(), [rows, width]);
        let loss = apply(mixture.clone(), [outputs.clone()]).slice([0..1, 0..1]);
        let gradient = Tape::backward(&loss).unwrap().gradient(&outputs).unwrap();
        let columns: Vec<usize> =
            if likelihood == 0.0 { (0..width - 2).collect() } else { vec![width - 2, width - 1] };
        for column in columns {
            // All rows at once: a single one would drown in the rounding.
            let moved = |step: f32| {
                let mut outputs = start.clone();
                outputs.chunks_exact_mut(width).for_each(|row| row[column] += step);
                total(outputs)
            };
            let slope = (moved(0.02) - moved(-0.02)) / 0.04;
            let found: f32 = gradient.chunks_exact(width).map(|row| row[column]).sum();
            assert!((slope - found).abs() < 2e-3 + 0.02 * slope.abs(), "{column}: {slope} {found}");
        }
    }
}

#[test]
fn a_network_that_was_not_trained_is_the_bank() {
    let (task, set) = task();
    let batch = batch(&task);
    let loss = task.loss(&Weights::frozen(&set), &batch, 0, &mut None).unwrap();
    let NeuralImmBatch(followed) = &batch;
    let mut sums = vec![[0.0_f64; 2]; followed.members];
    for instant in &followed.instants {
        let square: f32 = instant.target[..2].iter().map(|x| x * x).sum();
        sums[instant.member][0] += f64::from(square);
        sums[instant.member][1] += 2.0;
    }
    let mean = sums.iter().map(|[sum, count]| (sum / count).sqrt()).sum::<f64>() / sums.len() as f64;
    assert!((loss.parts[0].1 - mean).abs() < 1e-3 * mean, "{:?} {mean}", loss.parts);
}

/// The differentiable model and the filter give the same: the outputs at each update, and the errors that follow.
#[test]
fn the_filter_says_what_was_trained() {
    for cell in [
        "{ kind = \"gru\" }",
        "{ kind = \"cfc\", backbone = 7 }",
        "{ kind = \"ltc\", unfolds = 3, solver = \"fused\" }",
    ] {
        let text = format!("{RECIPE}cell = {cell}\n");
        let (task, mut set) = NeuralImmTask::new(&Recipe::parse(&text).unwrap()).unwrap();
        for (index, (_, values)) in set.values_mut().enumerate() {
            values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.1 * ((i + index) as f32).sin());
        }
        agree(&task, &set, 40);
    }
}

#[test]
fn the_shipped_model_says_what_was_trained() {
    for (model, text) in repository::models(NeuralImmKind::NAME) {
        let (task, mut set) = NeuralImmTask::new(&Recipe::parse(&text).unwrap()).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set, 201);
    }
}

/// Compares both on a flight of this many steps.
fn agree(task: &NeuralImmTask, set: &ParameterSet, steps: usize) {
    let network =
        Arc::new(BankNetwork::from_model(&Model::new(task.card(), set.tensors()).unwrap()).unwrap());
    let filter = NeuralImm::new(network, &[RangeBearing::new(50.0, 0.01).unwrap()]).unwrap();
    let flight = AirTraffic::training().with_steps(steps).unwrap().flight(5, 2);
    let plots = flight.observe(&flight.radar(), 5, 2);
    let mut belief = filter.birth(&Measurement::from(plots[0].unwrap())).unwrap();
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for plot in plots[1..].iter().flatten() {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &Measurement::from(*plot)).unwrap();
        inputs.extend_from_slice(belief.inputs());
        outputs.extend_from_slice(belief.outputs());
    }
    let weights = Weights::frozen(set);
    let mut x = task.input.forward(&weights, constant(inputs, [steps - 1, task.hyper.inputs()]));
    for layer in &task.recurrent {
        x = layer.sequence(&weights, x, Cell::zero(1, task.hyper.cell.shape(task.hyper.hidden)));
    }
    for (trained, ran) in values(&task.output.forward(&weights, x)).iter().zip(&outputs) {
        assert!((trained - ran).abs() < 1e-4 * ran.abs().max(0.1), "{trained} {ran}");
    }
}

#[test]
fn impossible_recipes_are_refused_by_key() {
    let changes = [
        ("hidden = 5", "hidden = 0", "hidden"),
        ("steps = 40", "steps = 5", "data.steps"),
        ("unbroken = 0.3", "unbroken = 1.3", "data.unbroken"),
        ("unbroken = 0.3", "detection = [0.9, 0.5]", "data.detection"),
        ("bearings = [0.3, 0.8]", "bearings = []", "data.bearings"),
        ("bearings = [0.3, 0.8]", "population = []", "data.population"),
        ("accelerations = [8.0]", "accelerations = [-1.0]", "acceleration"),
        ("rates = [0.0, 0.1, -0.1]", "rates = []", "turn rates"),
        ("steps = 40", "stops = 40", "stops"),
    ];
    repository::refuses(RECIPE, &changes, |text: &str| NeuralImmTask::new(&Recipe::parse(text)?).map(drop));
}
