use nalgebra::Vector4;
use tercel_core::belief::Gaussian;
use tercel_core::filter::Filter;
use tercel_neural::filter::{ExtentNet, ExtentNetwork};

use super::*;
use crate::backend::values;
use crate::task::repository;

const RECIPE: &str = "
version = 1
kind = \"extent-net\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 201
interval = 1.0
points = 12.0
noise = [1.0, 0.64]
empty = 0.1
born = 0.5
[data.source]
kind = \"vehicles\"
generators = [\"smooth\", \"reject\"]
mixed = 0.5
[model]
interval = 1.0
frame = \"residual\"
position = 2.0
velocity = 3.0
change = 1.5
extent = 3.0
axes = [6.0, 1.25]
worth = 4.0
speed = 5.0
architecture = { kind = \"lstm\", units = 7 }
[loss]
window = 4
";

const TRANSFORMER: &str =
    "{ kind = \"transformer\", size = 12, heads = 3, layers = 2, feed = 9, window = 11 }";

fn transformer(text: &str) -> String {
    text.replace("{ kind = \"lstm\", units = 7 }", TRANSFORMER)
}

/// As published, or nearly.
fn absolute(text: &str) -> String {
    text.replace("\"residual\"\nposition = 2.0", "\"absolute\"\nposition = 100.0")
}

/// The task of a recipe, with parameters that have a say.
fn task(text: &str) -> (ExtentNetTask, ParameterSet) {
    let recipe = Recipe::<ExtentNetKind>::parse(text).unwrap();
    let (task, mut set) = ExtentNetTask::new(&recipe, None).unwrap();
    for (name, values) in set.values_mut() {
        if name.starts_with("output") || name.starts_with("doubt") {
            values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.2 * (i as f32 * 1.3).sin());
        }
    }
    (task, set)
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

#[test]
fn the_filter_does_what_was_trained_in_each_frame_with_each_memory() {
    for text in [RECIPE.to_owned(), transformer(RECIPE)] {
        for text in [text.clone(), absolute(&text)] {
            let (task, set) = task(&text);
            agree(&task, &set, 200);
        }
    }
}

#[test]
fn the_shipped_models_do_what_was_trained() {
    for (model, text) in repository::models(ExtentNetKind::NAME) {
        let mut recipe = Recipe::<ExtentNetKind>::parse(&text).unwrap();
        recipe.data.steps = 201;
        // The filter is never given the truth.
        recipe.loss.forced = 0;
        let (task, mut set) = ExtentNetTask::new(&recipe, Some(repository::turning_flights(201))).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set, 200);
    }
}

/// Compares the differentiable model and the filter over some steps of three objects.
fn agree(task: &ExtentNetTask, set: &ParameterSet, steps: usize) {
    let batch = task.batch(draw(&[1, 2, 3])).unwrap();
    let rides = &batch.rides;
    let model = Model::new(task.card(), set.tensors()).unwrap();
    let network = Arc::new(ExtentNetwork::from_model(&model).unwrap());
    let filter = ExtentNet::new(network, task.data.scattering().unwrap());
    let begin = |member: usize| {
        let mut belief = filter.birth(&rides.scans[0][member]).unwrap();
        let motion = &rides.births[member].0;
        let mean = Vector4::new(motion.place[0], motion.place[1], motion.velocity[0], motion.velocity[1]);
        filter.set_state(&mut belief, &Gaussian { mean, covariance: nalgebra::Matrix4::identity() });
        belief
    };
    let mut beliefs: Vec<_> = (0..3).map(begin).collect();
    let weights = Weights::frozen(set);
    let mut state = task.first(rides);
    for step in 1..=steps {
        let row;
        (state, row) = task.step(&weights, &batch, state, step);
        if step % 16 == 0 {
            let next: Vec<u64> = state.known.iter().map(|known| known.scans).collect();
            state = State { past: task.network.detached(state.past, &next), ..state };
        }
        let found = values(&row);
        for (member, belief) in beliefs.iter_mut().enumerate() {
            filter.predict(belief, task.data.interval);
            let points = &rides.scans[step][member];
            filter.update(belief, points).unwrap();
            let row: Vec<f64> = found[member * JUDGED..][..JUDGED].iter().map(|x| f64::from(*x)).collect();
            let mut ran = filter.state(belief);
            (0..2).for_each(|i| ran.mean[i] -= state.known[member].origin[i]);
            for (i, trained) in row.iter().enumerate().take(4) {
                let scale = ran.mean.fixed_rows::<2>(i / 2 * 2).norm().max(10.0);
                let error = (trained - ran.mean[i]).abs();
                assert!(error < 1e-4 * scale, "step {step}, member {member}, {i}: {error}");
            }
            let (told, extent) = (Told::of(&row).extent(), filter.extent(belief).unwrap());
            let told = nalgebra::Matrix2::new(told.xx, told.xy, told.xy, told.yy);
            let off = (told - extent.mean()).norm() / extent.mean().norm();
            assert!(off < 1e-4, "step {step}, member {member}: {off}");
            if points.is_empty() {
                continue;
            }
            let doubt = task.hyper.doubt(&row[TOLD..]);
            let deviations = ran.deviations().map(f64::ln);
            for (trained, ran) in [
                (doubt.ln_place, deviations[1]),
                (doubt.ln_velocity, deviations[2]),
                (doubt.ln_weight, extent.weight().ln()),
            ] {
                assert!((trained - ran).abs() < 1e-4, "step {step}, member {member}: {trained} {ran}");
            }
        }
    }
}

#[test]
fn the_gradients_of_the_loss_are_its_slopes() {
    for text in [RECIPE.to_owned(), transformer(RECIPE)] {
        for text in [text.clone(), absolute(&text)] {
            let (task, set) = task(&text.replace("[loss]", "[loss]\nshape = 2.0\nextent = 0.01"));
            let batch = task.batch(draw(&[1, 2, 3])).unwrap();
            let loss = |weights: &Weights| task.loss(weights, &batch, 0, &mut None).unwrap().value;
            let weights = Weights::trainable(&set);
            let found = weights.gradients(&loss(&weights));
            // Single precision does not tell smaller changes of a large loss.
            let blur = |set: &ParameterSet| 3e-5 * f64::from(values(&loss(&Weights::frozen(set)))[0]).abs();
            let blur = blur(&set);
            // What is said of the doubt does not reach the memory; the slopes of the whole loss would.
            for (place, entry) in
                set.iter().enumerate().filter(|(_, entry)| entry.name().starts_with("doubt"))
            {
                let slope = slope(&set, (place, 0), &loss);
                let error = (slope - f64::from(found[place][0])).abs();
                assert!(error < 1e-3 + blur + 0.02 * slope.abs(), "{}: {slope}", entry.name());
            }
            let mut without = task;
            without.costs.doubt = 0.0;
            let loss = |weights: &Weights| without.loss(weights, &batch, 0, &mut None).unwrap().value;
            for (place, entry) in set.iter().enumerate() {
                for index in (0..found[place].len()).step_by(1 + found[place].len() / 6) {
                    if entry.name().starts_with("doubt") {
                        continue;
                    }
                    let slope = slope(&set, (place, index), &loss);
                    let error = (slope - f64::from(found[place][index])).abs();
                    let name = entry.name();
                    assert!(
                        error < 5e-3 + blur + 0.03 * slope.abs(),
                        "{name} {index}: {} {slope}",
                        found[place][index]
                    );
                }
            }
            assert!(found.iter().all(|of| of.iter().any(|gradient| gradient.abs() > 1e-4)));
        }
    }
}

fn slope(
    set: &ParameterSet,
    (place, index): (usize, usize),
    loss: &impl Fn(&Weights) -> crate::backend::Tensor,
) -> f64 {
    let moved = |by: f32| {
        let mut set = set.clone();
        set.values_mut().nth(place).unwrap().1[index] += by;
        f64::from(values(&loss(&Weights::frozen(&set)))[0])
    };
    (moved(1e-2) - moved(-1e-2)) / 2e-2
}

#[test]
fn training_lowers_the_loss_whether_the_truth_is_given_or_not() {
    for (text, forced) in [(RECIPE.to_owned(), 0), (transformer(RECIPE), 2)] {
        let folder = tempfile::tempdir().unwrap();
        let text = text
            .replace("steps = 201", "steps = 41")
            .replace("empty = 0.1\nborn = 0.5", "")
            .replace("window = 4", &format!("window = 20\nforced = {forced}\nextent = 0.01"))
            .replace("training = 8", "training = 64")
            + "[optimiser]\nrate = 1e-2\n[schedule]\nepochs = 7\nbatch = 16\nupdate = \"window\"\n";
        let mut curve = Vec::new();
        let summary = train(&text, &Run::new(folder.path().join("net.safetensors")), &mut |progress| {
            if let Progress::Epoch { row, .. } = progress {
                curve.push(row.validation.unwrap());
            }
            ControlFlow::Continue(())
        });
        assert_eq!(summary.unwrap().curve.len(), 7);
        assert!(curve[6] < 0.8 * curve[0], "{curve:?}");
    }
}

#[test]
fn the_truth_is_given_in_the_first_epochs_of_a_training_alone() {
    let (task, _) = task(&RECIPE.replace("window = 4", "window = 4\nforced = 2"));
    let forced = |split, epoch| task.batch(Draw { split, epoch, ..draw(&[0]) }).unwrap().forced;
    assert!(forced(Split::Training, 0) && forced(Split::Training, 1));
    assert!(!forced(Split::Training, 2) && !forced(Split::Validation, 0));
}

#[test]
fn a_recipe_that_makes_no_sense_is_refused_by_key() {
    let check = |text: &str| ExtentNetTask::new(&Recipe::<ExtentNetKind>::parse(text)?, None).map(drop);
    let changes = [
        ("steps = 201", "steps = 1", "data.steps"),
        ("units = 7", "units = 0", "architecture.units"),
        ("{ kind = \"lstm\", units = 7 }", "{ kind = \"gru\", units = 7 }", "gru"),
        ("\"residual\"", "\"relative\"", "relative"),
        ("change = 1.5", "change = 0.0", "change"),
        ("axes = [6.0, 1.25]", "axes = [6.0, -1.25]", "axes[1]"),
        ("window = 4", "window = 4\nposition = 0.0", "loss.position"),
        ("window = 4", "window = 4\ndoubt = -1.0", "loss.doubt"),
        ("interval = 1.0\nframe", "interval = 2.0\nframe", "model.interval"),
    ];
    repository::refuses(RECIPE, &changes, check);
    let text = transformer(RECIPE);
    let changes = [
        ("heads = 3", "heads = 4", "architecture.heads"),
        ("window = 11", "window = 0", "architecture.window"),
        ("size = 12", "length = 12", "length"),
    ];
    repository::refuses(&text, &changes, check);
}

#[test]
fn the_recipes_of_the_repository_are_understood() {
    let recipes = repository::recipes(ExtentNetKind::NAME);
    assert_eq!(recipes.len(), 20);
    for text in recipes {
        let recipe = Recipe::<ExtentNetKind>::parse(&text).unwrap();
        ExtentNetTask::new(&recipe, Some(repository::turning_flights(201))).unwrap();
    }
}
