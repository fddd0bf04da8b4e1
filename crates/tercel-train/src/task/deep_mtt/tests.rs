use super::*;
use crate::backend::values;
use crate::task::repository;

const RECIPE: &str = "
version = 1
kind = \"deep-mtt\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 60
unbroken = 0.3
windows = 6
[model]
window = 5
layers = [6, 4]
dense = 5
sensor_frame = true
context = true
whitened = true
scales = true
acceleration = 10.0
speed = 300.0
";

fn task(text: &str) -> (DeepMttTask, ParameterSet) {
    let (task, mut set) = DeepMttTask::new(&Recipe::parse(text).unwrap()).unwrap();
    for (index, (_, values)) in set.values_mut().enumerate() {
        values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.2 * ((i + index) as f32).sin());
    }
    (task, set)
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

#[test]
fn the_filter_says_what_was_trained() {
    let paper = RECIPE.replace("= true", "= false").replace("dense = 5", "dense = 0");
    for text in [RECIPE, &paper] {
        let (task, set) =
            task(&text.replace("windows = 6", "windows = 0").replace("steps = 60", "steps = 201"));
        agree(&task, &set);
    }
}

#[test]
fn the_shipped_model_says_what_was_trained() {
    for (model, text) in repository::models(DeepMttKind::NAME) {
        let mut recipe = Recipe::<DeepMttKind>::parse(&text).unwrap();
        (recipe.data.windows, recipe.data.steps) = (0, 201);
        let (task, mut set) = DeepMttTask::new(&recipe).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set);
    }
}

/// Compares the differentiable model and the filter at every window of a flight.
fn agree(task: &DeepMttTask, set: &ParameterSet) {
    let windows = task.batch(draw(&[1])).unwrap();
    let trained = values(&task.forward(&Weights::frozen(set), &windows));
    let model = Model::new(task.card(), set.tensors()).unwrap();
    let network = Arc::new(ResidualNetwork::from_model(&model).unwrap());
    let filter = DeepMtt::new(network, RangeBearing::new(50.0, 0.5_f64.to_radians()).unwrap());
    let sighting = task.plots.sighting(draw(&[1]), 1).unwrap();
    let mut belief = filter.birth(sighting.first().unwrap()).unwrap();
    let (mut window, width) = (0, task.hyper.outputs());
    for plot in &sighting.plots[1..] {
        filter.predict(&mut belief, 1.0);
        let Some(plot) = plot else { continue };
        filter.update(&mut belief, plot).unwrap();
        if belief.window().is_none() {
            continue;
        }
        for (step, ran) in belief.outputs().chunks(width).enumerate() {
            let trained = &trained[(step * windows.count + window) * width..][..width];
            for (trained, ran) in trained.iter().zip(ran) {
                assert!((trained - ran).abs() < 1e-4 * ran.abs().max(0.1), "{window}: {trained} {ran}");
            }
        }
        // The aim of the last step is what is missing to the truth: the correction of the filter reduces it likewise.
        window += 1;
    }
    assert_eq!(window, windows.count);
}

#[test]
fn an_untrained_network_leaves_the_errors_of_the_front_end() {
    let (task, set) = DeepMttTask::new(&Recipe::parse(RECIPE).unwrap()).unwrap();
    let windows = task.batch(draw(&[0, 1, 2])).unwrap();
    assert_eq!(windows.count, 18);
    let loss = task.loss(&Weights::frozen(&set), &windows, 0, &mut None).unwrap();
    let last = windows.aims.iter().filter(|aim| aim.root.is_some());
    let square: f32 = last.map(|aim| aim.target[..2].iter().map(|x| x * x).sum::<f32>()).sum();
    let mean = f64::from(square) / 36.0;
    assert!((loss.parts[0].1 - mean).abs() < 1e-3 * mean, "{:?} {mean}", loss.parts);
    assert!(mean.sqrt() > 10.0 && mean.sqrt() < 5e3, "{mean}");
}

#[test]
fn what_the_filter_adds_is_what_the_loss_takes_off() {
    let (task, set) = task(RECIPE);
    let window = &task.follow(draw(&[1]), 1).unwrap()[3];
    let aim = task.aims(window).last().unwrap();
    let row = [0.3, -0.2, 0.5, 0.1, 0.0, 0.0];
    let last = window.estimates.last().unwrap();
    let sight = task.hyper.sight(last, &Vector2::zeros());
    let added = sight.matrix() * task.hyper.said(last, &sight, &row).0;
    for i in 0..4 {
        let taken: f32 = (0..=i).map(|j| aim.unit[i][j] * row[j]).sum();
        assert!((f64::from(taken) - added[i]).abs() < 1e-3 * added.norm(), "{i}: {taken} {}", added[i]);
    }
    assert!(set.count() > 0);
}

#[test]
fn a_training_reduces_the_errors() {
    let text = RECIPE.to_owned() + "[optimiser]\nrate = 1e-2\n[schedule]\nepochs = 4\nbatch = 8\n";
    repository::learns(&text, |row| row.loss);
}

#[test]
fn impossible_recipes_are_refused_by_key() {
    let changes = [
        ("layers = [6, 4]", "layers = []", "layers"),
        ("layers = [6, 4]", "layers = [6, 0]", "layers"),
        ("window = 5", "window = 0", "window"),
        ("steps = 60", "steps = 4", "data.steps"),
        ("speed = 300.0", "speed = 0.0", "speed"),
        ("speed = 300.0", "speed = 300.0\n[loss]\nposition = -1.0", "loss.position"),
        ("speed = 300.0", "speed = 300.0\n[loss]\nothers = nan", "loss.others"),
    ];
    repository::refuses(RECIPE, &changes, |text: &str| DeepMttTask::new(&Recipe::parse(text)?).map(drop));
}

#[test]
fn the_recipes_of_the_repository_can_be_trained() {
    let recipes = repository::recipes(DeepMttKind::NAME);
    for text in &recipes {
        DeepMttTask::new(&Recipe::parse(text).unwrap()).unwrap();
    }
    assert!(recipes.len() >= 2, "{}", recipes.len());
}
