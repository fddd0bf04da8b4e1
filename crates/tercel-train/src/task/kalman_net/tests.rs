//! The training model against the run time, its gradient against differences, and trainings from end to end.

use std::sync::Arc;

use nalgebra::Vector2;
use tercel_core::filter::Filter;
use tercel_core::motion::Turn;
use tercel_core::sensor::Position;
use tercel_neural::filter::KalmanNet;

use super::*;
use crate::task::repository;

const TWO: &str = "kind = \"architecture-2\"\nin_mult = 2\nout_mult = 3\n";
const ONE: &str = "kind = \"architecture-1\"\ninput = 12\nhidden = 9\nlayers = 2\nhead = 6\n";

fn recipe(features: &str, options: &str, architecture: &str, rest: &str) -> Recipe<KalmanNetKind> {
    let text = format!(
        "version = 1\nkind = \"kalman-net\"\nname = \"net\"\nseed = 4\n[model]\nturn_rate = 0.02\n[model.network]\nfeatures = \
         {features}\ncovariance = \"joseph\"\n{options}\n[model.network.architecture]\n{architecture}\n{rest}\n"
    );
    Recipe::parse(&text).unwrap()
}

const PAPER: &str = "normalise = true\nmagnitudes = false\nsensor_frame = false";
const OURS: &str = "normalise = true\nmagnitudes = true\nsensor_frame = true\ngain_offset = [[0.4, 0.0], [0.0, 0.2], \
                    [0.1, 0.0], [0.0, 0.05]]";
const ALL: &str = "[\"f1\", \"f2\", \"f3\", \"f4\"]";

/// Data of a few flights, short, a third of it missing.
const DATA: &str = "[data]\ntraining = 6\nvalidation = 3\ndetection = [0.6, 0.7]\n";

fn rollout(task: &KalmanNetTask, members: u64) -> Rollout {
    let samples: Vec<u64> = (0..members).collect();
    task.batch(Draw { split: Split::Training, epoch: 0, seed: 4, samples: &samples }).unwrap()
}

fn estimates(task: &KalmanNetTask, set: &ParameterSet, rollout: &Rollout, steps: usize) -> Vec<Vec<f32>> {
    let weights = Weights::frozen(set);
    let mut state = State::first(&task.network, rollout.members);
    (1..=steps)
        .map(|step| {
            state = task.options.step(&task.network, &weights, state.clone(), rollout, step);
            values(state.estimate())
        })
        .collect()
}

#[test]
fn the_model_in_training_equals_the_run_time() {
    for (features, options, architecture) in [
        ("[\"f2\", \"f4\"]", PAPER, ONE),
        ("[\"f4\", \"f1\", \"f3\"]", OURS, ONE),
        (ALL, PAPER, TWO),
        (ALL, OURS, TWO),
    ] {
        let recipe = recipe(features, options, architecture, DATA);
        let (task, set) = KalmanNetTask::new(&recipe).unwrap();
        agree(&task, &set, 60, 5);
    }
}

#[test]
fn the_shipped_models_equal_the_run_time() {
    for (model, text) in repository::models(KalmanNetKind::NAME) {
        let (task, mut set) = KalmanNetTask::new(&Recipe::parse(&text).unwrap()).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set, 199, 0);
    }
}

/// Compares the model in training and the run time over some flights of these many steps, of which at least so many are missed.
fn agree(task: &KalmanNetTask, set: &ParameterSet, steps: usize, misses: usize) {
    let rollout = rollout(task, 3);
    let found = estimates(task, set, &rollout, steps);
    let network = GainNetwork::from_model(&Model::new(task.card(), set.tensors()).unwrap()).unwrap();
    let network = Arc::new(network);
    for member in 0..3 {
        let origin = &rollout.origins[2 * member..][..2];
        let filter = KalmanNet::new(
            Arc::clone(&network),
            Turn::new(task.model.turn_rate, 1.0),
            Position::new(50.0).unwrap(),
        )
        .seen_from(-Vector2::new(f64::from(origin[0]), f64::from(origin[1])));
        let mut belief = filter.birth(&[0.0, 0.0].into()).unwrap();
        let mut state = filter.state(&belief);
        state.mean = nalgebra::Vector4::zeros();
        filter.set_state(&mut belief, &state);
        let mut missed = 0;
        for step in 1..=steps {
            filter.predict(&mut belief, 1.0);
            if rollout.seen[step][member] == 1.0 {
                let reading = &rollout.readings[step][2 * member..][..2];
                filter.update(&mut belief, &[f64::from(reading[0]), f64::from(reading[1])].into()).unwrap();
            } else {
                missed += 1;
            }
            let expected = filter.state(&belief).mean;
            let found = &found[step - 1][4 * member..][..4];
            let scale = expected.norm().max(100.0);
            for (found, expected) in found.iter().zip(expected.iter()) {
                let error = (f64::from(*found) - expected).abs() / scale;
                assert!(error < 1e-4, "step {step}: {found} for {expected}");
            }
        }
        assert!(missed >= misses);
    }
}

#[test]
fn the_gradient_through_the_recursion_equals_differences() {
    for (features, options, architecture) in [(ALL, OURS, TWO), ("[\"f2\", \"f4\", \"f1\"]", OURS, ONE)] {
        let recipe = recipe(features, options, architecture, DATA);
        let (task, set) = KalmanNetTask::new(&recipe).unwrap();
        let rollout = rollout(&task, 4);
        let loss = |set: &ParameterSet, trainable: bool| {
            let weights = if trainable { Weights::trainable(set) } else { Weights::frozen(set) };
            let mut state = State::first(&task.network, 4);
            let mut all = Vec::new();
            for step in 1..=6 {
                state = task.options.step(&task.network, &weights, state, &rollout, step);
                all.push(state.estimate().clone());
            }
            let loss = task.judge(&rollout, all, 1);
            (weights, loss)
        };
        let (weights, found) = loss(&set, true);
        let gradients = weights.gradients(&found.value);
        let scale = gradients.iter().flatten().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        for (place, gradient) in gradients.iter().enumerate() {
            let norm = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
            // Slopes far below the others drown in the rounding of single precision.
            if norm < 1e-2 * scale {
                continue;
            }
            let length = 3e-3;
            let moved = |sign: f64| {
                let mut set = set.clone();
                let (_, values) = set.values_mut().nth(place).unwrap();
                for (value, g) in values.iter_mut().zip(gradient) {
                    *value += (sign * length * f64::from(*g) / norm) as f32;
                }
                f64::from(values_of(&loss(&set, false).1))
            };
            let slope = (moved(1.0) - moved(-1.0)) / (2.0 * length);
            let name = set.iter().nth(place).unwrap().name();
            // The direction of the line of sight counts as given in the gradient, but moves in the
            // difference.
            assert!((slope - norm).abs() < 0.03 * norm, "{options} {name}: slope {slope} for {norm}");
        }
    }
}

/// The gradient of an operation with respect to each number that goes in, against differences.
fn check_operation<const N: usize>(
    operation: impl crate::backend::Operation<N>,
    widths: [usize; N],
    size: f32,
) {
    use crate::backend::apply;
    let batch = 3;
    let mut state = 12345_u32;
    let mut numbers = |count: usize| -> Vec<f32> {
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        (0..count).map(|_| next()).collect()
    };
    let mut set = ParameterSet::new(1);
    for (input, width) in widths.iter().enumerate() {
        let values = numbers(batch * width).iter().map(|x| x * size).collect();
        set.add(&input.to_string(), &[batch, *width], crate::Initial::Values(values)).unwrap();
    }
    let value = |weights: &Weights| {
        let tensors: [Tensor; N] = std::array::from_fn(|n| weights.tensors()[n].clone());
        apply(operation.clone(), tensors)
    };
    let weights = Weights::trainable(&set);
    let found = value(&weights);
    let [rows, columns] = found.dims();
    let factors = numbers(rows * columns);
    let loss = (found * constant(factors.clone(), [rows, columns])).sum().reshape([1, 1]);
    let gradients = weights.gradients(&loss);
    let sum = |set: &ParameterSet| -> f64 {
        let found = values(&value(&Weights::frozen(set)));
        found.iter().zip(&factors).map(|(v, f)| f64::from(*v) * f64::from(*f)).sum()
    };
    let scale = gradients.iter().flatten().fold(0.0_f64, |most, g| most.max(f64::from(g.abs())));
    for (place, gradient) in gradients.iter().enumerate() {
        for (index, found) in gradient.iter().enumerate() {
            let moved = |by: f32| {
                let mut set = set.clone();
                set.values_mut().nth(place).unwrap().1[index] += by;
                sum(&set)
            };
            let by = 4e-3 * size;
            let slope = (moved(by) - moved(-by)) / (2.0 * f64::from(by));
            let error = (slope - f64::from(*found)).abs();
            // Readings are given: their gradient is not asked for, and found as zero.
            let given = place == 0 && N == 5;
            assert!(given || error < 4e-3 * scale, "{operation:?} {place} {index}: {found} for {slope}");
        }
    }
}

#[test]
fn gradients_of_the_operations_equal_differences() {
    use super::operations::{Columns, Correction, Features, Hold};
    let origins = Arc::new(vec![9e4, 2e4, -5e4, 7e4, -6e4, -8e4]);
    for (normalise, magnitudes, sensor_frame) in
        [(true, false, false), (true, true, true), (false, true, true), (false, false, false)]
    {
        let scales = magnitudes.then_some(([100.0, 50.0, 70.0, 30.0], 1e5));
        let features = tercel_neural::filter::Feature::ALL.to_vec();
        let origins = Arc::clone(&origins);
        let operation = Features { features, normalise, sensor_frame, scales, origins };
        check_operation(operation, [2, 2, 4, 4, 4], 100.0);
    }
    for sensor_frame in [true, false] {
        let offset = [0.4, 0.1, -0.1, 0.3, 0.05, 0.0, 0.02, 0.06];
        let readings = Arc::new(vec![0.5, -1.0, 2.0, 0.3, 9.0, 9.0]);
        let (origins, seen) = (Arc::clone(&origins), Arc::new(vec![1.0, 1.0, 0.0]));
        check_operation(Correction { sensor_frame, offset, origins, readings, seen }, [8, 4], 1.0);
    }
    check_operation(Hold { seen: Arc::new(vec![1.0, 0.0, 1.0]) }, [3, 3], 1.0);
    check_operation(Columns { columns: vec![4, 1, 1] }, [5], 1.0);
}

fn values_of(loss: &Loss) -> f32 {
    values(&loss.value)[0]
}

#[test]
fn windows_see_the_same_trajectory_as_one_pass() {
    let whole = recipe(ALL, OURS, TWO, DATA);
    let cut = recipe(ALL, OURS, TWO, &format!("{DATA}[loss]\nwindow = 25\nskip = 10\n"));
    let (one, set) = KalmanNetTask::new(&whole).unwrap();
    let (many, _) = KalmanNetTask::new(&cut).unwrap();
    let rollout = rollout(&one, 2);
    assert_eq!((one.windows(&rollout), many.windows(&rollout)), (1, 8));
    let total = |task: &KalmanNetTask| {
        let (weights, mut memory) = (Weights::frozen(&set), None);
        let mut sums = (0.0, 0.0);
        for window in 0..task.windows(&rollout) {
            let loss = task.loss(&weights, &rollout, window, &mut memory).unwrap();
            sums = (sums.0 + f64::from(values_of(&loss)) * loss.terms, sums.1 + loss.terms);
        }
        sums
    };
    let (whole, cut) = (total(&one), total(&many));
    assert_eq!(whole.1 - cut.1, 4.0 * 2.0 * 10.0, "the skipped steps");
    assert!(cut.0 < whole.0);
    let whole = recipe(ALL, OURS, TWO, &format!("{DATA}[loss]\nskip = 10\n"));
    let (one, _) = KalmanNetTask::new(&whole).unwrap();
    let whole = total(&one);
    assert!((whole.0 - cut.0).abs() < 1e-5 * whole.0, "{whole:?} {cut:?}");
}

#[test]
fn a_training_from_a_recipe_improves_the_filter_and_the_run_time_opens_it() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = recipe(
        ALL,
        OURS,
        TWO,
        "[data]\ntraining = 4\nvalidation = 4\n[schedule]\nepochs = 3\nbatch = 4\nshards = 1\nupdate = \"window\"\n\
         [optimiser]\nrate = 3e-3\n[loss]\nwindow = 100\n",
    );
    let run = Run { threads: 1, ..Run::new(folder.path().join("net.safetensors")) };
    let summary = crate::task::train(recipe.text(), &run, &mut |_| ControlFlow::Continue(())).unwrap();
    let validation: Vec<f64> = summary.curve.iter().map(|row| row.validation.unwrap()).collect();
    assert!(validation[2] < validation[0], "{validation:?}");
    let model = Model::open(&run.model).unwrap();
    assert_eq!(model.card().scales["turn_rate"].value, 0.02);
    GainNetwork::from_model(&model).unwrap();
}

#[test]
fn the_published_networks_have_the_published_sizes() {
    let count = |hyper: &KalmanNetHyper| {
        let mut set = ParameterSet::new(1);
        Network::new(&mut set, hyper, false).unwrap();
        set.count()
    };
    use tercel_neural::filter::Architecture;
    assert_eq!(count(&KalmanNetHyper::paper(Architecture::one())), 419_256);
    assert_eq!(count(&KalmanNetHyper::paper(Architecture::two())), 29_088);
}

#[test]
fn epochs_see_new_flights_only_if_they_should() {
    let rollouts = |fresh: &str| {
        let recipe = recipe(ALL, PAPER, TWO, &format!("[data]\ntraining = 6\nfresh = \"{fresh}\"\n"));
        let (task, _) = KalmanNetTask::new(&recipe).unwrap();
        [0, 1].map(|epoch| {
            task.batch(Draw { split: Split::Training, epoch, seed: 4, samples: &[2, 5] }).unwrap()
        })
    };
    let same = |[a, b]: &[Rollout; 2]| {
        let relative =
            |r: &Rollout| r.truth.iter().zip(&r.truth[8..]).map(|(a, b)| (b - a).round()).collect::<Vec<_>>();
        (relative(a) == relative(b), a.readings == b.readings)
    };
    assert_eq!(same(&rollouts("nothing")), (true, true));
    assert_eq!(same(&rollouts("noise")), (true, false));
    assert_eq!(same(&rollouts("flights")), (false, false));
}

#[test]
fn recipes_that_make_no_sense_are_refused_by_key() {
    let refused = |features: &str, options: &str, architecture: &str, rest: &str| {
        KalmanNetTask::new(&recipe(features, options, architecture, rest)).unwrap_err().to_string()
    };
    for (rest, key) in [
        ("[data]\nscenario = \"atc-test\"", "data.scenario"),
        ("[data]\nscenario = \"nowhere\"", "atc-train"),
        ("[data]\ntraining = 0", "data.training"),
        ("[data]\ndetection = [0.9, 0.6]", "data.detection"),
        ("[data]\n[loss]\nposition = 0.0", "loss.position"),
        ("[data]\n[loss]\nskip = 200", "loss.skip"),
        ("[data]\n[loss]\nwindow = 4\nskip = 4", "loss.skip"),
    ] {
        let error = refused(ALL, PAPER, TWO, rest);
        assert!(error.contains(key), "{error}");
    }
    assert!(refused("[\"f2\"]", PAPER, TWO, "[data]").contains("features"));
    assert!(refused("[]", PAPER, ONE, "[data]").contains("features"));
    assert!(refused(ALL, PAPER, &ONE.replace("9", "0"), "[data]").contains("hidden"));
}

#[test]
fn the_recipes_of_the_repository_can_be_trained() {
    let recipes = repository::recipes(KalmanNetKind::NAME);
    for text in &recipes {
        KalmanNetTask::new(&Recipe::parse(text).unwrap()).unwrap();
    }
    assert!(recipes.len() >= 2, "{}", recipes.len());
}
