//! The trainer on a small task: predict the next value of a wave whose past the network must remember.

use std::cell::RefCell;
use std::fs;

use rand::RngExt;
use serde::Deserialize;

use super::*;
use crate::Weights;
use crate::backend::constant;
use crate::layer::{Activation, Linear, Lstm, LstmState};

#[derive(Debug)]
struct Wave;

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Nothing {}

impl Kind for Wave {
    const NAME: &'static str = "wave";
    type Data = Nothing;
    type Model = Nothing;
    type Loss = Nothing;
}

/// Windows of `STEPS` steps each.
const STEPS: usize = 5;

struct WaveTask {
    lstm: Lstm,
    head: Linear,
    windows: usize,
    /// Samples whose loss is not finite.
    broken: fn(u64) -> bool,
    validation: usize,
}

struct Batch {
    /// Row `t * members + member`.
    values: Vec<f32>,
    members: usize,
}

impl WaveTask {
    fn new(windows: usize) -> (Self, ParameterSet) {
        let mut set = ParameterSet::new(5);
        let lstm = Lstm::new(&mut set, "lstm.0", 1, 6).unwrap();
        let head = Linear::new(&mut set, "head", 6, 1, Activation::Identity).unwrap();
        (Self { lstm, head, windows, broken: |_| false, validation: 6 }, set)
    }
}

impl Task for WaveTask {
    type Batch = Batch;
    type Memory = LstmState;

    fn card(&self) -> Card {
        Card::new("", "wave", &["value"])
    }

    fn samples(&self, split: Split) -> usize {
        match split {
            Split::Training => 22,
            Split::Validation => self.validation,
        }
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Batch, TrainError> {
        let members = draw.samples.len();
        let length = STEPS * self.windows + 1;
        let mut values = vec![0.0; length * members];
        for (member, sample) in draw.samples.iter().enumerate() {
            let mut random = draw.random(*sample);
            let (phase, pace) = (random.random::<f32>() * 6.0, 0.2 + random.random::<f32>());
            for step in 0..length {
                values[step * members + member] = (phase + pace * step as f32).sin();
            }
            if draw.split == Split::Training && (self.broken)(*sample) {
                values[member] = f32::NAN;
            }
        }
        Ok(Batch { values, members })
    }

    fn windows(&self, _: &Batch) -> usize {
        self.windows
    }

    fn loss(
        &self,
        weights: &Weights,
        batch: &Batch,
        window: usize,
        memory: &mut Option<LstmState>,
    ) -> Result<Loss, TrainError> {
        let rows = STEPS * batch.members;
        let start = window * rows;
        let part = |from: usize| constant(batch.values[from..from + rows].to_vec(), [rows, 1]);
        let state = memory.take().unwrap_or_else(|| LstmState::zero(batch.members, self.lstm.size()));
        let (outputs, state) = self.lstm.resume(weights, part(start), state);
        *memory = Some(state.detached());
        let error = self.head.forward(weights, outputs) - part(start + batch.members);
        let value = (error.clone() * error).mean().reshape([1, 1]);
        Ok(Loss { value, terms: rows as f64, parts: vec![("window", window as f64)] })
    }
}

fn recipe(schedule: &str) -> Recipe<Wave> {
    let text = format!(
        "version = 1\nkind = \"wave\"\nname = \"wave\"\nseed = 3\n[data]\n[model]\n[optimiser]\nrate = 0.02\n[schedule]\n\
         batch = 8\n{schedule}\n"
    );
    Recipe::parse(&text).unwrap()
}

fn go_on(_: Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Trains in a folder, ending after so many epochs.
fn trained(folder: &std::path::Path, schedule: &str, windows: usize, run: &Run, epochs: usize) -> Summary {
    let (task, set) = WaveTask::new(windows);
    let run = Run { model: folder.join("wave.safetensors"), ..run.clone() };
    let mut observer = |progress: Progress<'_>| match progress {
        Progress::Epoch { row, .. } if row.epoch + 1 == epochs => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    train(&recipe(schedule), &task, set, &run, &mut observer).unwrap()
}

fn run(threads: usize, resume: bool) -> Run {
    Run { threads, resume, ..Run::new("") }
}

#[test]
fn four_epochs_equal_two_and_two_resumed_bit_for_bit() {
    for schedule in ["epochs = 4", "epochs = 4\nupdate = \"window\"\nwarm_up = 7"] {
        let (straight, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let whole = trained(straight.path(), schedule, 3, &run(2, false), 99);
        let half = trained(parts.path(), schedule, 3, &run(2, false), 2);
        assert_eq!((whole.end, half.end), (End::Complete, End::Stopped));
        assert_ne!(half.last, whole.last);
        let rest = trained(parts.path(), schedule, 3, &run(2, true), 99);
        assert_eq!(rest.last, whole.last);
        assert_eq!(rest.best, whole.best);
        let untimed = |summary: &Summary| -> Vec<Row> {
            summary.curve.iter().map(|row| Row { seconds: 0.0, ..row.clone() }).collect()
        };
        assert_eq!(untimed(&rest), untimed(&whole));
        let model = |folder: &tempfile::TempDir| fs::read(folder.path().join("wave.safetensors")).unwrap();
        assert_eq!(model(&parts), model(&straight));
    }
}

#[test]
fn a_training_killed_within_an_epoch_goes_on_from_the_last_whole_one() {
    let (straight, killed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let whole = trained(straight.path(), "epochs = 3", 1, &run(1, false), 99);
    let (task, set) = WaveTask::new(1);
    let place = Run { model: killed.path().join("wave.safetensors"), ..run(1, false) };
    let mut observer = |progress: Progress<'_>| match progress {
        Progress::Batch { epoch: 1, done: 2, .. } => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    train(&recipe("epochs = 3"), &task, set, &place, &mut observer).unwrap();
    let rest = trained(killed.path(), "epochs = 3", 1, &run(1, true), 99);
    assert_eq!(rest.last, whole.last);
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let result = |threads| {
        let folder = tempfile::tempdir().unwrap();
        trained(folder.path(), "epochs = 2\nshards = 4", 2, &run(threads, false), 99).last
    };
    let one = result(1);
    assert_eq!(one, result(2));
    assert_eq!(one, result(3));
}

#[test]
fn shards_together_have_the_gradient_of_the_batch() {
    let (task, set) = WaveTask::new(1);
    let samples: Vec<u64> = (0..7).collect();
    let draw = Draw { split: Split::Training, epoch: 0, seed: 3, samples: &samples };
    let gradients = |count| {
        let mut tally = Shards::new(&task, draw, count, 1).unwrap().gradients(0, &set).unwrap();
        let loss = tally.mean();
        (loss, tally.take_gradients())
    };
    let (whole, parts) = (gradients(1), gradients(3));
    assert!((whole.0 - parts.0).abs() < 1e-6 * whole.0);
    for (whole, part) in whole.1.iter().flatten().zip(parts.1.iter().flatten()) {
        assert!((whole - part).abs() < 1e-6, "{whole} {part}");
    }
}

#[test]
fn a_wave_is_learned_and_the_best_epoch_is_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let summary = trained(folder.path(), "epochs = 40\nfloor = 0.1", 3, &run(2, false), 99);
    let validation: Vec<f64> = summary.curve.iter().map(|row| row.validation.unwrap()).collect();
    let best = validation.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(validation[summary.best_epoch], best);
    assert!(best < 0.1 * validation[0], "{best} of {}", validation[0]);
    let model = Model::open(&folder.path().join("wave.safetensors")).unwrap();
    assert_eq!(*model.tensors(), summary.best.tensors());
    let card = model.card();
    assert_eq!((card.name.as_str(), card.kind.as_str(), card.data.training), ("wave", "wave", 22));
    assert_eq!(card.epochs as usize, summary.best_epoch + 1);
    assert!((card.metrics["validation_loss"] - best).abs() < 1e-12);
    let curve = fs::read_to_string(folder.path().join("wave.curve.ndjson")).unwrap();
    let rows: Vec<Row> = curve.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(rows.len(), 40);
    assert_eq!(rows[7].parts["window"], Some(1.0));
}

#[test]
fn batches_that_are_not_finite_are_skipped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (mut task, set) = WaveTask::new(1);
    task.broken = |sample| sample == 4;
    let place = Run { model: folder.path().join("wave.safetensors"), ..run(1, false) };
    let summary = train(&recipe("epochs = 2"), &task, set.clone(), &place, &mut go_on).unwrap();
    assert!(summary.curve.iter().all(|row| row.skipped == 1 && row.loss.is_some()));
    assert!(summary.last.iter().all(|entry| entry.values().iter().all(|value| value.is_finite())));
    task.broken = |_| true;
    let error = train(&recipe("epochs = 2"), &task, set, &place, &mut go_on).unwrap_err();
    assert!(matches!(error, TrainError::Diverged { epoch: 0, batches: 3 }), "{error}");
}

#[test]
fn a_training_without_progress_ends_early() {
    let folder = tempfile::tempdir().unwrap();
    let (task, set) = WaveTask::new(1);
    let place = Run { model: folder.path().join("wave.safetensors"), ..run(1, false) };
    let text = "version = 1\nkind = \"wave\"\nname = \"wave\"\n[data]\n[model]\n[optimiser]\nrate = 1e-30\nweight_decay = 0.0\n\
                [schedule]\nbatch = 8\nepochs = 50\npatience = 3\n";
    let recipe = Recipe::<Wave>::parse(text).unwrap();
    let summary = train(&recipe, &task, set, &place, &mut go_on).unwrap();
    assert_eq!((summary.end, summary.curve.len()), (End::Early, 4));
}

#[test]
fn a_checkpoint_that_does_not_fit_is_refused_with_what_helps() {
    let folder = tempfile::tempdir().unwrap();
    let (task, set) = WaveTask::new(1);
    let place = Run { model: folder.path().join("wave.safetensors"), ..run(1, true) };
    let attempt = |recipe: &Recipe<Wave>| {
        train(recipe, &task, set.clone(), &place, &mut go_on).unwrap_err().to_string()
    };
    assert!(attempt(&recipe("epochs = 2")).contains("start without resuming"));
    trained(folder.path(), "epochs = 2", 1, &run(1, false), 99);
    assert!(attempt(&recipe("epochs = 3")).contains("hash"));
    let bytes = fs::read(place.checkpoint()).unwrap();
    fs::write(place.checkpoint(), &bytes[..bytes.len() / 2]).unwrap();
    assert!(attempt(&recipe("epochs = 2")).contains("damaged"));
}

#[test]
fn a_target_that_cannot_be_written_fails_before_the_first_step() {
    let folder = tempfile::tempdir().unwrap();
    let (task, set) = WaveTask::new(1);
    let steps = RefCell::new(0);
    let mut observer = |_: Progress<'_>| {
        *steps.borrow_mut() += 1;
        ControlFlow::Continue(())
    };
    let place = Run { model: folder.path().join("missing").join("wave.safetensors"), ..run(1, false) };
    let error = train(&recipe("epochs = 1"), &task, set.clone(), &place, &mut observer).unwrap_err();
    assert!(error.to_string().contains("missing"), "{error}");
    let empty = WaveTask { validation: 0, ..task };
    let place = Run { model: folder.path().join("wave.safetensors"), ..place };
    let error = train(&recipe("epochs = 1"), &empty, set, &place, &mut observer).unwrap_err();
    assert!(error.to_string().contains("validation"), "{error}");
    assert_eq!(*steps.borrow(), 0);
}

#[test]
fn a_target_that_fails_later_leaves_the_last_good_model() {
    let folder = tempfile::tempdir().unwrap();
    let (task, set) = WaveTask::new(1);
    let place = Run { model: folder.path().join("wave.safetensors"), ..run(1, false) };
    let good = RefCell::new(Vec::new());
    let mut observer = |progress: Progress<'_>| {
        if let Progress::Epoch { .. } = progress {
            *good.borrow_mut() = fs::read(&place.model).unwrap();
            // A directory in the place of the checkpoint: the rename onto it fails, as a full disk would.
            fs::remove_file(place.checkpoint()).unwrap();
            fs::create_dir(place.checkpoint()).unwrap();
        }
        ControlFlow::Continue(())
    };
    let recipe = recipe("epochs = 3");
    let error = train(&recipe, &task, set, &place, &mut observer).unwrap_err();
    assert!(error.to_string().contains("checkpoint"), "{error}");
    assert!(Model::open(&place.model).is_ok() && !good.borrow().is_empty());
}
