use tercel_core::filter::Filter;
use tercel_core::sensor::Position;
use tercel_neural::filter::{Derivative, LiquidKalman};
use tercel_neural::layer::{CellShape, Solver};

use super::*;
use crate::task::gaussians::{Surprise, gaussian};
use crate::task::{gaussians, repository};

const RECIPE: &str = "
version = 1
kind = \"liquid\"
name = \"small\"
seed = 3
[data]
training = 8
validation = 4
steps = 201
gap = 0.1
[model]
interval = 1.0
cell = { kind = \"ltc\", size = 7, unfolds = 4, solver = \"fused\" }
carried = true
jacobian = { kind = \"exact\" }
warm_up = 2
speed = 30.0
[model.form]
kind = \"residual\"
heading = true
learned_noise = true
velocity = 30.0
correction = [5.0, 2.0]
acceleration = 2.0
noise = 1.0
[loss]
window = 5
";

const PAPER: &str = "
version = 1
kind = \"liquid\"
name = \"small-paper\"
seed = 3
[data]
training = 8
validation = 4
steps = 12
[model]
interval = 1.0
cell = { kind = \"ltc\", size = 6, unfolds = 3, solver = \"fused\" }
carried = false
jacobian = { kind = \"difference\", step = 0.01 }
warm_up = 0
speed = 30.0
[model.form]
kind = \"absolute\"
minimum = [-2500.0, -2500.0, -50.0, -50.0]
maximum = [2500.0, 2500.0, 50.0, 50.0]
noise = [10.0, 10.0, 5.0, 5.0]
[loss]
window = 0
";

/// The task of a recipe whose model was changed, with parameters that have a say.
fn task(text: &str, change: impl FnOnce(&mut LiquidHyper)) -> (LiquidTask, ParameterSet) {
    let mut recipe = Recipe::<LiquidKind>::parse(text).unwrap();
    change(&mut recipe.model);
    let (task, mut set) = LiquidTask::new(&recipe).unwrap();
    for (name, values) in set.values_mut() {
        if name.starts_with("output") {
            values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.2 * (i as f32 * 1.3).sin());
        }
    }
    (task, set)
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

fn forms() -> Vec<LiquidHyper> {
    let recipe = Recipe::<LiquidKind>::parse(RECIPE).unwrap();
    let with = |change: &dyn Fn(&mut LiquidHyper)| {
        let mut hyper = recipe.model.clone();
        change(&mut hyper);
        hyper
    };
    let residual = |hyper: &mut LiquidHyper, heading, learned_noise| {
        if let Form::Residual(form) = &mut hyper.form {
            (form.heading, form.learned_noise) = (heading, learned_noise);
        }
    };
    vec![
        with(&|_| ()),
        with(&|h| h.cell = CellShape::Ltc { size: 5, unfolds: 12, solver: Solver::RungeKutta }),
        with(&|h| h.cell = CellShape::Cfc { size: 6, backbone: 9 }),
        with(&|h| h.cell = CellShape::Gru { size: 8 }),
        with(&|h| {
            h.cell = CellShape::Mlp { size: 6, hidden: 9 };
            h.carried = false;
        }),
        with(&|h| residual(h, false, true)),
        with(&|h| residual(h, true, false)),
        with(&|h| h.jacobian = Derivative::Difference { step: 0.1 }),
    ]
}

#[test]
fn the_filter_does_what_was_trained() {
    for hyper in forms() {
        let (task, set) = task(RECIPE, |old| *old = hyper.clone());
        agree(&task, &set);
    }
}

#[test]
fn the_shipped_model_does_what_was_trained() {
    for (model, text) in repository::models(LiquidKind::NAME) {
        let mut recipe = Recipe::<LiquidKind>::parse(&text).unwrap();
        recipe.data.steps = 201;
        let (task, mut set) = LiquidTask::new(&recipe).unwrap();
        repository::fill(&mut set, &model);
        if matches!(task.hyper.form, Form::Residual(_)) {
            agree(&task, &set);
        }
    }
}

/// Compares the differentiable model and the filter over 200 steps of three trajectories.
fn agree(task: &LiquidTask, set: &ParameterSet) {
    let watched = task.batch(draw(&[1, 2, 3])).unwrap();
    let model = Model::new(task.card(), set.tensors()).unwrap();
    let network = Arc::new(LiquidNetwork::from_model(&model).unwrap());
    let filters: Vec<_> = watched
        .deviations
        .iter()
        .map(|deviation| LiquidKalman::new(Arc::clone(&network), Position::<2>::new(*deviation).unwrap()))
        .collect();
    let place = |member: usize, step: usize| {
        let reading = &watched.readings[step];
        let place = &reading.places[2 * member..][..2];
        (reading.seen[member] != 0.0).then(|| [f64::from(place[0]), f64::from(place[1])].into())
    };
    let births = filters.iter().enumerate();
    let mut beliefs: Vec<_> =
        births.map(|(member, filter)| filter.birth(&place(member, 0).unwrap()).unwrap()).collect();
    let weights = Weights::frozen(set);
    let (mut state, trained_network) = (task.first(&watched), task.network(&weights));
    for step in 1..=200 {
        state = task.step(&weights, trained_network.as_ref(), &watched, state, step);
        let found = values(&state.both.posterior());
        for (member, (belief, filter)) in beliefs.iter_mut().zip(&filters).enumerate() {
            filter.predict(belief, 1.0);
            place(member, step).map(|place| filter.update(belief, &place).unwrap());
            let (ran, trained) = (filter.state(belief), gaussian(&found[member * GAUSSIAN..][..GAUSSIAN]));
            for i in 0..4 {
                let error = (trained.mean[i] - ran.mean[i]).abs();
                let scale = ran.mean[i].abs().max(10.0) + ran.deviations()[i];
                assert!(error < 1e-4 * scale, "{:?}, step {step}, {i}: {error}", task.hyper);
            }
            let off = (trained.covariance - ran.covariance).norm() / ran.covariance.norm();
            assert!(off < 1e-3, "{:?}, step {step}: {off}", task.hyper);
        }
    }
}

#[test]
fn the_gradients_of_a_step_are_its_slopes() {
    for heading in [false, true] {
        let (task, _) = task(RECIPE, |hyper| {
            if let Form::Residual(form) = &mut hyper.form {
                form.heading = heading;
            }
        });
        let watched = task.batch(draw(&[1, 2, 5])).unwrap();
        let step = (1..200).find(|step| watched.readings[*step].seen.contains(&0.0)).unwrap();
        let mut states = Vec::new();
        for member in 0..3 {
            let reading = &watched.readings[step].places[2 * member..][..2];
            let mean = Vector4::new(f64::from(reading[0]) - 3.0, f64::from(reading[1]) + 2.0, 5.0, -3.0);
            let root =
                Matrix4::from_fn(|i, j| if i == j { 5.0 } else { ((i * 4 + j + member) as f64).sin() });
            gaussians::push(&mut states, &mean, &(root * root.transpose()));
        }
        let jacobian = |member: usize| {
            task.hyper.form.straight(&Vector4::zeros(), task.span()).jacobian
                + Matrix4::from_fn(|i, j| 0.1 * ((i + 5 * j + member) as f64).cos())
        };
        let operation = Step {
            form: task.hyper.form,
            span: task.span(),
            jacobians: Arc::new((0..3).map(jacobian).collect()),
            reading: Arc::clone(&watched.readings[step]),
        };
        let outputs = (0..3 * 8).map(|i| 0.7 * (i as f32 * 1.3).sin()).collect();
        let mut set = ParameterSet::new(1);
        set.add("states", &[3, GAUSSIAN], Initial::Values(states)).unwrap();
        set.add("outputs", &[3, 8], Initial::Values(outputs)).unwrap();
        let both = |weights: &Weights| {
            let [states, outputs] = [0, 1].map(|place| weights.tensors()[place].clone());
            apply(operation.clone(), [states, outputs]).reshape([6, GAUSSIAN])
        };
        // The truth lies near the predictions, so that little is lost in single precision.
        let places = values(&both(&Weights::frozen(&set)));
        let truth = (0..24).map(|i| places[i / 4 * GAUSSIAN + i % 4] + 4.0 * (i as f32).cos()).collect();
        let truth: Arc<Vec<f32>> = Arc::new(truth);
        let value = |weights: &Weights| apply(Surprise { truth: Arc::clone(&truth) }, [both(weights)]);
        let trainable = Weights::trainable(&set);
        let found = trainable.gradients(&value(&trainable));
        for (place, by) in [(0, 0.1_f32), (1, 0.02)] {
            for index in 0..found[place].len() {
                let (row, column) = (index / GAUSSIAN, index % GAUSSIAN);
                // The frame of the heading counts as given.
                if place == 0 && heading && (2..4).contains(&column) {
                    continue;
                }
                // Covariances stay symmetric: both elements move together.
                let twin = (place == 0 && column >= 4).then(|| {
                    let (i, j) = ((column - 4) / 4, (column - 4) % 4);
                    row * GAUSSIAN + 4 + 4 * j + i
                });
                let twin = twin.filter(|twin| *twin != index);
                let moved = |by: f32| {
                    let mut set = set.clone();
                    let values_of = set.values_mut().nth(place).unwrap().1;
                    values_of[index] += by;
                    if let Some(twin) = twin {
                        values_of[twin] += by;
                    }
                    f64::from(values(&value(&Weights::frozen(&set)))[0])
                };
                let slope = (moved(by) - moved(-by)) / (2.0 * f64::from(by));
                let gradient = twin.map_or(0.0, |twin| found[place][twin]) + found[place][index];
                let error = (slope - f64::from(gradient)).abs();
                assert!(
                    error < 1e-3 + 0.02 * slope.abs(),
                    "{heading} {place} {index}: {gradient} for {slope}"
                );
            }
        }
        assert!(found.iter().all(|of| of.iter().any(|gradient| gradient.abs() > 1e-2)));
    }
}

#[test]
fn the_gradients_of_the_published_loss_are_its_slopes() {
    let (task, set) = task(PAPER, |_| ());
    let watched = task.batch(draw(&[1, 2, 3, 4])).unwrap();
    let loss = |weights: &Weights| task.loss(weights, &watched, 0, &mut None).unwrap().value;
    let weights = Weights::trainable(&set);
    let found = weights.gradients(&loss(&weights));
    for (place, gradients) in found.iter().enumerate() {
        for index in (0..gradients.len()).step_by(1 + gradients.len() / 20) {
            let moved = |by: f32| {
                let mut set = set.clone();
                set.values_mut().nth(place).unwrap().1[index] += by;
                f64::from(values(&loss(&Weights::frozen(&set)))[0])
            };
            let slope = (moved(1e-2) - moved(-1e-2)) / 2e-2;
            let gradient = f64::from(gradients[index]);
            assert!(
                (slope - gradient).abs() < 5e-5 + 1e-2 * slope.abs(),
                "{place} {index}: {gradient} for {slope}"
            );
        }
    }
}

#[test]
fn trajectories_move_as_they_are_said_to() {
    let data = LiquidData { steps: 400, ..LiquidData::default() };
    let (mut fastest, mut sharpest, mut turned) = (0.0_f64, 0.0_f64, 0.0_f64);
    for sample in 0..40 {
        let (states, _) = data.states(draw(&[]), sample);
        let again = Draw { epoch: 3, ..draw(&[]) };
        let (other, _) = data.states(again, sample);
        assert_eq!(states.len(), 400);
        for ((state, next), other) in states.iter().zip(&states[1..]).zip(&other) {
            let [v, w] = [state, next].map(|state| nalgebra::Vector2::new(state[2], state[3]));
            fastest = fastest.max(v.norm());
            sharpest = sharpest.max((w - v).norm());
            // The place changes by about the mean velocity.
            let off = next.xy() - state.xy() - 0.5 * (v + w);
            assert!(off.norm() < 0.06 + 0.005 * v.norm(), "{off}");
            // Another epoch rotates and reflects.
            assert!((v.norm() - other[2].hypot(other[3])).abs() < 1e-9);
            turned += (v - nalgebra::Vector2::new(other[2], other[3])).norm();
        }
    }
    assert!((45.0..50.0 + 1e-9).contains(&fastest), "{fastest}");
    assert!((5.0..50.0 * 12_f64.to_radians() + 1e-9).contains(&sharpest), "{sharpest}");
    assert!(turned > 1e4);
}

#[test]
fn measurements_stop_for_some_steps_and_have_the_errors_that_are_said() {
    let data = LiquidData { steps: 3000, detection: [1.0, 1.0], gap: 0.05, ..LiquidData::default() };
    let watched = Watched::new(&data, 30.0, draw(&[1, 2])).unwrap();
    for member in 0..2 {
        let (mut squares, mut count, mut silent, mut longest) = (0.0, 0.0, 0, 0);
        for (step, reading) in watched.readings.iter().enumerate() {
            if reading.seen[member] == 0.0 {
                silent += 1;
                longest = longest.max(silent);
                continue;
            }
            silent = 0;
            count += 1.0;
            for i in 0..2 {
                let truth = watched.truth[4 * (2 * step + member) + i];
                squares += 0.5 * f64::from(reading.places[2 * member + i] - truth).powi(2);
            }
        }
        let deviation = (squares / count).sqrt();
        assert!((deviation / watched.deviations[member] - 1.0).abs() < 0.1, "{deviation}");
        assert!((2400.0..2950.0).contains(&count) && (5..=10).contains(&longest), "{count} {longest}");
    }
}

#[test]
fn trainings_of_all_forms_lower_their_loss() {
    let gated = RECIPE
        .replace("kind = \"ltc\", size = 7, unfolds = 4, solver = \"fused\"", "kind = \"gru\", size = 7");
    for (text, update) in [(RECIPE.to_owned(), "window"), (gated, "window"), (PAPER.to_owned(), "batch")] {
        let data = [
            ("steps = 201", "steps = 40"),
            ("training = 8", "training = 96"),
            ("validation = 4", "validation = 64"),
        ];
        let text = data
            .iter()
            .fold(text, |text, (old, new)| text.replace(old, new))
            .replace("window = 5", "window = 20");
        let schedule = "[optimiser]\nrate = 1e-2\n[schedule]\nepochs = 4\nbatch = 16\n";
        let text = format!("{text}{schedule}update = \"{update}\"\n");
        repository::learns(&text, |row| row.validation);
    }
}

#[test]
fn impossible_recipes_are_refused_by_key() {
    let changes = [
        ("size = 7", "size = 0", "size"),
        ("unfolds = 4", "unfolds = 0", "unfolds"),
        ("interval = 1.0", "interval = 2.0", "model.interval"),
        ("acceleration = 2.0", "acceleration = -1.0", "form.acceleration"),
        ("steps = 201", "steps = 3", "data.steps"),
        ("gap = 0.1", "gap = 1.1", "data.gap"),
        ("gap = 0.1", "hold = [9.0, 5.0]", "data.hold"),
        ("gap = 0.1", "deviation = [0.0, 5.0]", "data.deviation"),
        ("gap = 0.1", "detection = [-0.1, 0.5]", "data.detection"),
        ("gap = 0.1", "speeds = 5.0", "speeds"),
        ("window = 5", "window = 2", "loss.window"),
        ("window = 5", "surprise = -1.0", "loss.surprise"),
        ("window = 5", "windows = 5", "windows"),
        ("heading = true", "headings = true", "headings"),
        ("\"exact\"", "\"rough\"", "rough"),
    ];
    repository::refuses(RECIPE, &changes, |text: &str| LiquidTask::new(&Recipe::parse(text)?).map(drop));
}

#[test]
fn the_recipes_of_the_repository_can_be_trained() {
    let recipes = repository::recipes(LiquidKind::NAME);
    let mut cells = Vec::new();
    for text in &recipes {
        let (task, _) = LiquidTask::new(&Recipe::parse(text).unwrap()).unwrap();
        cells.push(std::mem::discriminant(&task.hyper.cell));
    }
    cells.dedup();
    assert!(recipes.len() >= 5 && cells.len() >= 4, "{} {}", recipes.len(), cells.len());
}
