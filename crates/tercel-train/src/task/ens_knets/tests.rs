//! The training model against the run time, its gradient against differences, and a training from end to end.

use nalgebra::Vector4;
use tercel_core::filter::{Estimate, Filter};
use tercel_core::sensor::Measurement;
use tercel_neural::filter::{Architecture, EnsKNets, KalmanNetHyper, OfflineEnsKNets};

use super::*;
use crate::backend::{Tape, leaf};
use crate::task::repository;

/// KalmanNets with random weights beside an alpha-beta filter, for straight flight and turns to both sides.
fn nets() -> Vec<Model> {
    [0.0, 0.1, -0.1]
        .into_iter()
        .enumerate()
        .map(|(index, rate)| {
            let hyper = KalmanNetHyper {
                gain_offset: Some([[0.5, 0.0], [0.0, 0.3], [0.1, 0.0], [0.0, 0.05]]),
                sensor_frame: true,
                ..KalmanNetHyper::paper(Architecture::Stacked { input: 4, hidden: 3, layers: 1, head: 0 })
            };
            let mut card = Card::new("net", "kalman-net", &["x", "y", "vx", "vy"]);
            card.hyper = hyper.to_table().unwrap();
            for (name, value, unit) in [("turn_rate", rate, "rad/s"), ("interval", 1.0, "s")] {
                card.scales.insert(name.into(), Scale { value, unit: unit.into() });
            }
            let mut state = index as f32;
            let mut number = || {
                state += 0.7;
                0.02 * state.sin()
            };
            let tensors = hyper.tensors().into_iter().map(|(name, shape)| {
                let values = (0..shape.iter().product()).map(|_| number()).collect();
                (name, Stored { shape, values })
            });
            Model::new(card, tensors.collect()).unwrap()
        })
        .collect()
}

const DATA: &str = "stated = 0.5\n[data.flights]\ntraining = 6\nvalidation = 3\ndetection = [0.6, 0.7]\n";
const BOTH: &str = "correction = { hidden = 5, layers = 2 }\nclassification = { hidden = 4, layers = 1 }\n";
const ATTENTION: &str = "attention = { sign = \"minus\", temperature = 0.9, stay = 0.97 }\n";

fn recipe(data: &str, model: &str, rest: &str) -> String {
    format!(
        "version = 1\nkind = \"ens-knets\"\nname = \"small\"\nseed = 3\n[data]\n{data}[model]\nnets = []\n\
         acceleration = 10.0\nspeed = 300.0\n{model}{rest}"
    )
}

fn task(data: &str, model: &str, rest: &str) -> Result<(EnsKNetsTask, ParameterSet), TrainError> {
    EnsKNetsTask::of_nets(&Recipe::parse(&recipe(data, model, rest))?, &nets())
}

fn relative() -> String {
    format!("normalisation = \"relative\"\n{ATTENTION}{BOTH}")
}

fn draw(samples: &[u64]) -> Draw<'_> {
    Draw { split: Split::Training, epoch: 0, seed: 3, samples }
}

fn shaken(set: &mut ParameterSet) {
    for (index, (_, values)) in set.values_mut().enumerate() {
        values.iter_mut().enumerate().for_each(|(i, value)| *value += 0.1 * ((i + index) as f32).sin());
    }
}

#[test]
fn the_gradient_of_the_loss_is_its_slope() {
    for form in ["mean-square", "root"] {
        let rest = format!("[loss]\nform = \"{form}\"\nposition = 2.0\nskip = 10\nentropy = 0.3\n");
        let (task, _) = task(DATA, &relative(), &rest).unwrap();
        let flights = task.batch(draw(&[0, 1, 2])).unwrap().flights;
        let rows = flights.rows * 3;
        let fusion = Fusion { flights, plan: task.plan.clone() };
        let start = |width: usize, salt: f32| -> Vec<f32> {
            (0..rows * width).map(|i| 0.4 * ((i as f32) * 0.7 + salt).sin()).collect()
        };
        let starts = [start(12, 0.0), start(3, 1.0)];
        let leaves = [leaf(starts[0].clone(), [rows, 12]), leaf(starts[1].clone(), [rows, 3])];
        let loss = apply(fusion.clone(), leaves.clone()).slice([0..1, 0..1]);
        let mut tape = Tape::backward(&loss).unwrap();
        for (which, width) in [(0, 12), (1, 3)] {
            let gradient = tape.gradient(&leaves[which]).unwrap();
            for column in 0..width {
                // All rows at once: a single one would drown in the rounding.
                let moved = |step: f32| {
                    let mut values = starts.clone();
                    values[which].chunks_exact_mut(width).for_each(|row| row[column] += step);
                    let [corrections, logits] = values;
                    let inputs = [constant(corrections, [rows, 12]), constant(logits, [rows, 3])];
                    crate::backend::values(&apply(fusion.clone(), inputs))[0]
                };
                let slope = (moved(0.05) - moved(-0.05)) / 0.1;
                let found: f32 = gradient.chunks_exact(width).map(|row| row[column]).sum();
                assert!(
                    (slope - found).abs() < 2e-4 + 0.02 * slope.abs(),
                    "{form} {column}: {slope} {found}"
                );
            }
        }
    }
}

#[test]
fn heads_of_zero_give_the_average_whose_loss_is_one_and_a_share_for_the_classes() {
    for form in ["mean-square", "root"] {
        let (task, set) = task(
            DATA,
            &format!("{}zero_heads = true\n", relative()),
            &format!("[loss]\nform = \"{form}\"\n"),
        )
        .unwrap();
        let samples: Vec<u64> = (0..6).collect();
        let batch = task.batch(draw(&samples)).unwrap();
        let loss = task.loss(&Weights::frozen(&set), &batch, 0, &mut None).unwrap();
        assert!((values(&loss.value)[0] - 1.1).abs() < 1e-4, "{:?}", loss.parts);
        assert!((loss.parts[1].1 - 3.0_f64.ln()).abs() < 1e-4, "{:?}", loss.parts);
    }
}

/// What the run time says at the measurements of a flight of the training, and without them.
fn estimates(task: &EnsKNetsTask, set: &ParameterSet, sample: u64) -> Vec<(Estimate<4>, Vector4<f64>)> {
    let mut tensors = set.tensors();
    tensors.extend(task.frozen());
    let network = EnsembleNetwork::from_model(&Model::new(task.card(), tensors).unwrap()).unwrap();
    let observed = task.data.flights().observed(draw(&[sample]), sample).unwrap();
    let sensor = task.data.sensor();
    let measure = task.data.measure(&observed.radar, true).unwrap();
    let plots: Vec<Option<Measurement<2>>> =
        observed.plots.iter().map(|plot| plot.as_ref().map(&measure)).collect();
    let first = plots[0].unwrap();
    let found = if network.hyper().normalisation == Normalisation::Sequence {
        let offline = OfflineEnsKNets::new(Arc::new(network), sensor).unwrap();
        offline.estimates(&first, plots[1..].iter().map(|plot| (1.0, *plot))).unwrap()
    } else {
        let filter = EnsKNets::new(Arc::new(network), sensor).unwrap();
        let mut belief = filter.birth(&first).unwrap();
        let mut found = vec![filter.estimate(&belief)];
        for plot in &plots[1..] {
            filter.predict(&mut belief, 1.0);
            if let Some(plot) = plot {
                filter.update(&mut belief, plot).unwrap();
            }
            found.push(filter.estimate(&belief));
        }
        found
    };
    found.into_iter().zip(observed.flight.states().iter().copied()).collect()
}

/// The differentiable model and the run time give the same over a whole flight, of which a third is not seen.
#[test]
fn the_run_time_says_what_was_trained() {
    let attention = "attention = { sign = \"minus\" }\n";
    for model in [
        format!("normalisation = \"running\"\n{BOTH}"),
        format!("normalisation = \"running\"\n{attention}{BOTH}"),
        "normalisation = \"running\"\nclassification = { hidden = 4, layers = 2 }\n".to_owned(),
        format!("normalisation = \"sequence\"\n{BOTH}"),
        format!("normalisation = \"relative\"\n{BOTH}"),
        relative(),
    ] {
        let data = DATA.replace("0.5", "1.0");
        let (task, mut set) = task(&data, &model, "").unwrap();
        shaken(&mut set);
        assert!(agree(&task, &set) > 30, "{model}");
    }
}

#[test]
fn the_shipped_models_say_what_was_trained() {
    for (model, text) in repository::models(EnsKNetsKind::NAME) {
        let mut recipe = Recipe::<EnsKNetsKind>::parse(&text).unwrap();
        (recipe.data.stated, recipe.loss.usual, recipe.model.dropout) = (1.0, 1, 0.0);
        let net = |path: &PathBuf| repository::model(path.file_stem().unwrap().to_str().unwrap());
        let nets: Vec<Model> = recipe.model.nets.iter().map(net).collect();
        let (task, mut set) = EnsKNetsTask::of_nets(&recipe, &nets).unwrap();
        repository::fill(&mut set, &model);
        agree(&task, &set);
    }
}

/// Compares the differentiable model and the run time over a flight, and says how many of its steps had no measurement.
fn agree(task: &EnsKNetsTask, set: &ParameterSet) -> usize {
    let batch = task.batch(draw(&[4])).unwrap();
    let flight = batch.flights.flights[0].clone();
    let [corrections, logits] = task.outputs(&Weights::frozen(set), &batch).map(|x| values(&x));
    let ran = estimates(task, set, 4);
    for (instant, errors) in flight.instants.iter().zip(flight.errors.chunks(3)) {
        let outputs = (&corrections[12 * instant.row..][..12], &logits[3 * instant.row..][..3]);
        let fused = task.plan.fuse(instant, errors, outputs.0, outputs.1);
        let (estimate, truth) = &ran[instant.step];
        let error = estimate.mean - truth;
        // Lengths, since the training sees errors in another frame.
        for (trained, ran) in [
            (fused.error.xy().norm(), error.xy().norm()),
            (fused.error.fixed_rows::<2>(2).norm(), error.fixed_rows::<2>(2).norm()),
        ] {
            let gap = (f64::from(trained) - ran).abs();
            assert!(gap < 1e-4 * ran + 0.02, "step {}: {trained} {ran}", instant.step);
        }
        for (trained, ran) in fused.probabilities.iter().zip(&estimate.modes) {
            assert!((f64::from(*trained) - ran).abs() < 1e-4, "step {}", instant.step);
        }
    }
    flight.instants.iter().filter(|instant| instant.held > 0).count()
}

#[test]
fn a_training_from_a_recipe_improves_the_ensemble_and_the_run_time_opens_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut paths = Vec::new();
    for (index, net) in nets().iter().enumerate() {
        let path = folder.path().join(format!("net-{index}.safetensors"));
        net.save(&path).unwrap();
        paths.push(path.display().to_string());
    }
    let text = recipe(
        "[data.flights]\ntraining = 16\nvalidation = 8\nfresh = \"nothing\"\n",
        &format!("{}zero_heads = true\ndropout = 0.1\n", relative()),
        "[schedule]\nepochs = 4\nbatch = 8\n[optimiser]\nrate = 1e-2\n",
    )
    .replace("nets = []", &format!("nets = {paths:?}"));
    let run = Run { threads: 1, ..Run::new(folder.path().join("ensemble.safetensors")) };
    let summary = crate::task::train(&text, &run, &mut |_| ControlFlow::Continue(())).unwrap();
    let validation: Vec<f64> = summary.curve.iter().map(|row| row.validation.unwrap()).collect();
    assert!(validation[3] < validation[0], "{validation:?}");
    let model = Model::open(&run.model).unwrap();
    assert_eq!(EnsembleNetwork::from_model(&model).unwrap().hyper().rates, [0.0, 0.1, -0.1]);
    assert_eq!(model.tensors()["net.1.gain.weight"], nets()[1].tensors()["gain.weight"]);
}

#[test]
fn dropout_depends_on_the_epoch_and_not_on_the_thread_and_spares_the_validation() {
    let (task, _) = task(DATA, &format!("{}dropout = 0.2\n", relative()), "").unwrap();
    let random = |split, epoch| {
        task.batch(Draw { split, epoch, ..draw(&[0, 1]) }).unwrap().random.map(|random| random.get_stream())
    };
    assert_eq!(random(Split::Training, 1), random(Split::Training, 1));
    assert_ne!(random(Split::Training, 1), random(Split::Training, 2));
    assert_eq!(random(Split::Validation, 0), None);
}

#[test]
fn flights_that_come_again_are_the_same_in_whichever_epoch_they_are_followed_first() {
    let data = DATA.replace("training", "fresh = \"nothing\"\ntraining");
    let inputs = |epochs: &[usize]| {
        let (task, _) = task(&data, &relative(), "[loss]\nusual = 1\n").unwrap();
        let last =
            epochs.iter().map(|epoch| task.batch(Draw { epoch: *epoch, ..draw(&[3]) }).unwrap()).next_back();
        last.unwrap().flights.flights[0].inputs.clone()
    };
    assert_eq!(inputs(&[0, 1]), inputs(&[5]));
}

#[test]
fn recipes_that_make_no_sense_are_refused_by_key() {
    for (old, new, key) in [
        ("stated = 0.5", "stated = 1.5", "data.stated"),
        ("stated = 0.5", "nominal = { range = 0.0 }", "data.nominal.range"),
        ("stated = 0.5", "deviation = -1.0", "data.deviation"),
        ("training = 6", "training = 0", "data.training"),
        ("hidden = 5", "hidden = 0", "hidden"),
        ("stay = 0.97", "stay = 0.2", "attention.stay"),
        ("temperature", "warmth", "warmth"),
        ("layers = 1 }", "layers = 1 }\ndropout = 1.0", "model.dropout"),
        ("layers = 1 }", "layers = 1 }\n[loss]\nskip = 199", "loss.skip"),
        ("layers = 1 }", "layers = 1 }\n[loss]\nentropy = -1.0", "loss.entropy"),
        (BOTH, "", "correction"),
    ] {
        let text = recipe(DATA, &relative(), "").replacen(old, new, 1);
        let refused =
            Recipe::parse(&text).and_then(|recipe| EnsKNetsTask::of_nets(&recipe, &nets()).map(drop));
        let error = refused.unwrap_err().to_string();
        assert!(error.contains(key), "{key}: {error}");
    }
    let text = recipe(DATA, &relative(), "").replace("nets = []", "nets = [\"nowhere.safetensors\"]");
    let error = EnsKNetsTask::new(&Recipe::parse(&text).unwrap()).map(drop).unwrap_err().to_string();
    assert!(error.contains("nowhere.safetensors"), "{error}");
    let mut bare = nets();
    let mut card = bare[0].card().clone();
    card.scales.remove("turn_rate").unwrap();
    bare[0] = Model::new(card, bare[0].tensors().clone()).unwrap();
    let recipe = Recipe::parse(&recipe(DATA, &relative(), "")).unwrap();
    let error = EnsKNetsTask::of_nets(&recipe, &bare).map(drop).unwrap_err().to_string();
    assert!(error.contains("turn_rate"), "{error}");
}

#[test]
fn the_recipes_of_the_repository_can_be_trained() {
    let recipes = repository::recipes(EnsKNetsKind::NAME);
    for text in &recipes {
        let mut recipe = Recipe::<EnsKNetsKind>::parse(text).unwrap();
        recipe.loss.usual = 1;
        EnsKNetsTask::of_nets(&recipe, &nets()).unwrap();
    }
    assert!(recipes.len() >= 5, "{}", recipes.len());
}
