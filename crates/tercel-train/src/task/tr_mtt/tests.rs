use super::*;
use crate::backend::values;
use crate::task::repository;

const RECIPE: &str = "
version = 1
kind = \"tr-mtt\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 60
unbroken = 0.3
windows = 6
[model]
window = 7
size = 8
heads = 2
encoder = 2
decoder = 2
feed = 12
sensor_frame = true
context = true
scales = true
acceleration = 10.0
speed = 300.0
";

fn task(text: &str) -> (TrMttTask, ParameterSet) {
    let (task, mut set) = TrMttTask::new(&Recipe::parse(text).unwrap()).unwrap();
    for (index, (_, values)) in set.values_mut().enumerate() {
        values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.1 * ((i + index) as f32).sin());
    }
    (task, set)
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

#[test]
fn the_filter_says_what_was_trained() {
    for text in [RECIPE.to_owned(), RECIPE.replace("= true", "= false")] {
        let text = text.replace("windows = 6", "windows = 0").replace("steps = 60", "steps = 201");
        let (task, set) = task(&text);
        agree(&task, &set);
    }
}

#[test]
fn the_shipped_model_says_what_was_trained() {
    for (model, text) in repository::models(TrMttKind::NAME) {
        let mut recipe = Recipe::<TrMttKind>::parse(&text).unwrap();
        (recipe.data.windows, recipe.data.steps) = (0, 201);
        let (task, mut set) = TrMttTask::new(&recipe).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set);
    }
}

/// Compares the differentiable model and the filter at every window of a flight.
fn agree(task: &TrMttTask, set: &ParameterSet) {
    let windows = task.batch(draw(&[1])).unwrap();
    let trained = values(&task.forward(&Weights::frozen(set), &windows));
    let model = Model::new(task.card(), set.tensors()).unwrap();
    let network = Arc::new(TransformerNetwork::from_model(&model).unwrap());
    let sensor = ConvertedPolar::new(50.0, 0.5_f64.to_radians()).unwrap();
    let filter = TrMtt::new(network, sensor);
    let sighting = task.plots.sighting(draw(&[1]), 1).unwrap();
    let mut belief = filter.birth(sighting.first().unwrap()).unwrap();
    let mut trained = trained.chunks(task.hyper.outputs() * task.hyper.window);
    for plot in &sighting.plots[1..] {
        filter.predict(&mut belief, 1.0);
        let Some(plot) = plot else { continue };
        filter.update(&mut belief, plot).unwrap();
        if belief.window().iter().flatten().count() < 2 {
            continue;
        }
        for (trained, ran) in trained.next().unwrap().iter().zip(belief.outputs()) {
            assert!((trained - ran).abs() < 1e-4 * ran.abs().max(0.1), "{trained} {ran}");
        }
    }
    assert!(trained.next().is_none());
}

#[test]
fn windows_at_the_start_of_a_flight_are_partly_empty_and_count_only_where_there_is_truth() {
    let (task, _) =
        task(&RECIPE.replace("windows = 6", "windows = 0").replace("unbroken = 0.3", "unbroken = 1.0"));
    let windows = task.batch(draw(&[1])).unwrap();
    let first = &windows.aims[..7];
    let counted: Vec<bool> = first.iter().map(|aim| aim.weight > 0.0).collect();
    assert_eq!(counted, [false, false, false, false, false, true, true]);
    assert_eq!(windows.mask.seen[..7], [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
    // What should be said is what the filter would take it for.
    let window = &task.follow(draw(&[1]), 1).unwrap()[20];
    let frame = task.hyper.frame(&window.readings, &Vector2::zeros()).unwrap();
    let truth = window.truth[6].unwrap();
    let mut row = frame.turned(&truth).to_vec();
    row.extend([0.0; 2]);
    assert!((task.hyper.said(&frame, &row).0 - truth).norm() < 1e-2);
}

#[test]
fn the_gradient_of_the_transformer_is_its_slope() {
    let (task, set) = task(RECIPE);
    let windows = task.batch(draw(&[0, 1])).unwrap();
    let smooth = ResidualLoss { likelihood: 0.0, position: 3000.0, velocity: 300.0, ..task.loss.clone() };
    let loss =
        |weights: &Weights| residual::loss(task.forward(weights, &windows), &windows.aims, &smooth).value;
    let trainable = Weights::trainable(&set);
    let found = trainable.gradients(&loss(&trainable));
    for (place, (entry, gradient)) in set.iter().zip(&found).enumerate() {
        // Along the gradient itself, all elements at once: single ones would drown in the rounding.
        let norm = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
        if norm < 1e-5 {
            // Keys that all move together change no share.
            assert!(entry.name().contains("key.bias"), "{} has no gradient", entry.name());
            continue;
        }
        let moved = |by: f32| {
            let mut set = set.clone();
            let values_of = set.values_mut().nth(place).unwrap().1;
            values_of.iter_mut().zip(gradient).for_each(|(value, g)| *value += by * g / norm);
            f64::from(values(&loss(&Weights::frozen(&set)))[0])
        };
        let slope = (moved(5e-3) - moved(-5e-3)) / 1e-2;
        let error = (slope - f64::from(norm)).abs();
        assert!(error < 2e-4 + 0.02 * slope.abs(), "{}: {slope} {norm}", entry.name());
    }
}

#[test]
fn a_training_reduces_the_errors() {
    let text = RECIPE.to_owned() + "[optimiser]\nrate = 1e-2\n[schedule]\nepochs = 4\nbatch = 8\n";
    repository::learns(&text, |row| row.loss);
}

#[test]
fn impossible_recipes_are_refused_by_key() {
    let changes = [
        ("heads = 2", "heads = 3", "heads"),
        ("heads = 2", "heads = 0", "heads"),
        ("window = 7", "window = 1", "window"),
        ("feed = 12", "feed = 0", "feed"),
        ("steps = 60", "steps = 2", "data.steps"),
        ("speed = 300.0", "speed = 300.0\n[loss]\nlikelihood = -1.0", "loss.likelihood"),
    ];
    repository::refuses(RECIPE, &changes, |text: &str| TrMttTask::new(&Recipe::parse(text)?).map(drop));
}

#[test]
fn the_recipes_of_the_repository_can_be_trained() {
    let recipes = repository::recipes(TrMttKind::NAME);
    for text in &recipes {
        TrMttTask::new(&Recipe::parse(text).unwrap()).unwrap();
    }
    assert!(recipes.len() >= 2, "{}", recipes.len());
}
