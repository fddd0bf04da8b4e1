use tercel_core::filter::Filter;
use tercel_core::sensor::{Measurement, Position, Sensor};
use tercel_neural::filter::{MnemonicKalman, MnemonicNetwork};

use super::*;
use crate::backend::values;
use crate::task::gaussians::{Surprise, gaussian};
use crate::task::repository;

const RECIPE: &str = "
version = 1
kind = \"mnemonic\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 201
unbroken = 0.3
[model]
interval = 1.0
hidden = 7
layers = 2
sensor_frame = true
corrections = true
acceleration = 10.0
speed = 300.0
[loss]
window = 5
";

fn task(text: &str) -> (MnemonicTask, ParameterSet) {
    let (task, mut set) = MnemonicTask::new(&Recipe::parse(text).unwrap()).unwrap();
    for (index, (_, values)) in set.values_mut().enumerate() {
        values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.1 * ((i + index) as f32).sin());
    }
    (task, set)
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

#[test]
fn the_filter_does_what_was_trained() {
    let paper = RECIPE
        .replace("sensor_frame = true", "sensor_frame = false")
        .replace("corrections = true", "corrections = false");
    for text in [RECIPE, &paper] {
        let (task, set) = task(text);
        agree(&task, &set);
    }
}

#[test]
fn the_shipped_model_does_what_was_trained() {
    for (model, text) in repository::models(MnemonicKind::NAME) {
        let mut recipe = Recipe::<MnemonicKind>::parse(&text).unwrap();
        recipe.data.steps = 201;
        let (task, mut set) = MnemonicTask::new(&recipe).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set);
    }
}

/// Compares the differentiable model and the filter over two flights.
fn agree(task: &MnemonicTask, set: &ParameterSet) {
    let flown = task.batch(draw(&[1, 2])).unwrap();
    let model = Model::new(task.card(), set.tensors()).unwrap();
    let network = Arc::new(MnemonicNetwork::from_model(&model).unwrap());
    // The trainer reads each plot by itself; a filter of converted plots would take their noise at its prediction.
    let read = |plot: &Measurement<2>| {
        let reading = Sensor::<4, 2>::read(&task.sensor, plot, None).unwrap();
        Measurement::from(reading.value).with_noise(reading.noise)
    };
    let filter = MnemonicKalman::new(network, Position::<2>::new(1.0).unwrap());
    let sightings: Vec<_> = [1, 2].map(|sample| task.plots.sighting(draw(&[1, 2]), sample).unwrap()).into();
    let mut beliefs: Vec<_> =
        sightings.iter().map(|sighting| filter.birth(&read(sighting.first().unwrap())).unwrap()).collect();
    let weights = Weights::frozen(set);
    let mut state = task.first(&flown);
    for step in 1..=200 {
        state = task.step(&weights, &flown, state, step);
        let found = values(&state.both.posterior());
        for (member, (belief, sighting)) in beliefs.iter_mut().zip(&sightings).enumerate() {
            filter.predict(belief, 1.0);
            if let Some(plot) = &sighting.plots[step] {
                filter.update(belief, &read(plot)).unwrap();
            }
            let ran = filter.state(belief);
            let trained = gaussian(&found[member * GAUSSIAN..][..GAUSSIAN]);
            let origin = Vector2::new(flown.origins[2 * member], flown.origins[2 * member + 1]);
            let deviations = ran.deviations();
            for i in 0..4 {
                let origin = if i < 2 { origin[i] } else { 0.0 };
                let error = (trained.mean[i] + origin - ran.mean[i]).abs();
                let scale = (ran.mean[i] - origin).abs().max(100.0) + deviations[i];
                assert!(error < 1e-4 * scale, "step {step}, {i}: {error}");
            }
            let off = (trained.covariance - ran.covariance).norm() / ran.covariance.norm();
            assert!(off < 1e-3, "step {step}: {off}");
        }
    }
}

#[test]
fn the_gradients_of_a_step_and_of_the_surprise_are_their_slopes() {
    let (task, _) = task(RECIPE);
    let flown = task.batch(draw(&[1, 2, 5])).unwrap();
    let step = (1..200).find(|step| flown.readings[*step].seen.contains(&0.0)).unwrap();
    let outputs: Vec<f32> = (0..3 * 14).map(|i| 0.3 * (i as f32 * 1.3).sin()).collect();
    // Small covariances, so that differences in single precision see everything.
    let mut states = Vec::new();
    for member in 0..3 {
        let reading = &flown.readings[step].places[2 * member..][..2];
        let mean =
            nalgebra::Vector4::new(f64::from(reading[0]) - 9.0, f64::from(reading[1]) + 7.0, 5.0, -3.0);
        let root =
            nalgebra::Matrix4::from_fn(
                |i, j| {
                    if i == j { 15.0 } else { 4.0 * ((i * 4 + j + member) as f64).sin() }
                },
            );
        crate::task::gaussians::push(&mut states, &mean, &(root * root.transpose()));
    }
    let mut reading = (*flown.readings[step]).clone();
    reading.noises = [400.0, 30.0, 30.0, 200.0].repeat(3);
    let operation = Step {
        hyper: Arc::clone(&task.hyper),
        interval: 1.0,
        origins: Arc::clone(&flown.origins),
        reading: Arc::new(reading),
    };
    let mut set = ParameterSet::new(1);
    set.add("states", &[3, GAUSSIAN], Initial::Values(states)).unwrap();
    set.add("outputs", &[3, 14], Initial::Values(outputs)).unwrap();
    let truth: Vec<f32> = (0..6 * 4).map(|i| 10.0 * (i as f32).cos()).collect();
    let loss = |weights: &Weights| {
        let [states, outputs] = [0, 1].map(|place| weights.tensors()[place].clone());
        let both = apply(operation.clone(), [states, outputs]).reshape([6, GAUSSIAN]);
        // Relative to where the states are, so that the truth is near.
        let places = values(&both);
        let truth = truth.iter().enumerate().map(|(i, t)| (places[i / 4 * GAUSSIAN + i % 4] + t).round());
        (both, Arc::new(truth.collect::<Vec<f32>>()))
    };
    let truth = loss(&Weights::frozen(&set)).1;
    let value = |weights: &Weights| apply(Surprise { truth: Arc::clone(&truth) }, [loss(weights).0]);
    let trainable = Weights::trainable(&set);
    let found = trainable.gradients(&value(&trainable));
    for (place, by) in [(0, 0.5_f32), (1, 0.02)] {
        for index in 0..found[place].len() {
            let (row, column) = (index / GAUSSIAN, index % GAUSSIAN);
            // Covariances stay symmetric: both elements move together.
            let twin = (place == 0 && column >= 4).then(|| {
                let (i, j) = ((column - 4) / 4, (column - 4) % 4);
                row * GAUSSIAN + 4 + 4 * j + i
            });
            let moved = |by: f32| {
                let mut set = set.clone();
                let values_of = set.values_mut().nth(place).unwrap().1;
                values_of[index] += by;
                if let Some(twin) = twin.filter(|twin| *twin != index) {
                    values_of[twin] += by;
                }
                f64::from(values(&value(&Weights::frozen(&set)))[0])
            };
            let slope = (moved(by) - moved(-by)) / (2.0 * f64::from(by));
            let mut gradient = f64::from(found[place][index]);
            if let Some(twin) = twin.filter(|twin| *twin != index) {
                gradient += f64::from(found[place][twin]);
            }
            assert!(
                (slope - gradient).abs() < 1e-3 + 0.02 * slope.abs(),
                "{place} {index}: {slope} {gradient}"
            );
        }
    }
}

#[test]
fn a_training_surprises_less() {
    let text = RECIPE.replace("steps = 201", "steps = 40")
        + "[optimiser]\nrate = 1e-2\n[schedule]\nepochs = 3\nbatch = 8\nupdate = \"window\"\n";
    repository::learns(&text, |row| row.validation);
}

#[test]
fn impossible_recipes_are_refused_by_key() {
    let changes = [
        ("hidden = 7", "hidden = 0", "hidden"),
        ("interval = 1.0", "interval = 2.0", "model.interval"),
        ("acceleration = 10.0", "acceleration = -1.0", "acceleration"),
        ("steps = 201", "steps = 1", "data.steps"),
        ("unbroken = 0.3", "stated = 1.3", "data.stated"),
        ("unbroken = 0.3", "bearing = 0.0", "data.bearing"),
        ("window = 5", "surprise = -1.0", "loss.surprise"),
        ("window = 5", "windows = 5", "windows"),
    ];
    repository::refuses(RECIPE, &changes, |text: &str| MnemonicTask::new(&Recipe::parse(text)?).map(drop));
}

#[test]
fn the_recipes_of_the_repository_can_be_trained() {
    let recipes = repository::recipes(MnemonicKind::NAME);
    for text in &recipes {
        MnemonicTask::new(&Recipe::parse(text).unwrap()).unwrap();
    }
    assert!(recipes.len() >= 2, "{}", recipes.len());
}
