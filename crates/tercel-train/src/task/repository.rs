//! The recipes and models of the repository, as the tests of the tasks need them.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use tercel_neural::{Model, shipped};

use super::train;
use crate::trainer::{Row, Run, Tracks};
use crate::{ParameterSet, TrainError};

/// The recipes of a kind.
pub fn recipes(kind: &str) -> Vec<String> {
    let files = std::fs::read_dir(folder()).unwrap();
    let texts = files.map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap());
    texts.filter(|text| crate::recipe::kind(text).unwrap() == kind).collect()
}

/// A recipe that is changed in one place, old to new, is refused with a message that has the key.
pub fn refuses(recipe: &str, changes: &[(&str, &str, &str)], check: impl Fn(&str) -> Result<(), TrainError>) {
    for (old, new, key) in changes {
        assert!(recipe.contains(old), "{old}");
        let refusal = check(&recipe.replacen(old, new, 1)).unwrap_err().to_string();
        assert!(refusal.contains(key), "{new}: {refusal}");
    }
}

/// A small training makes this loss smaller, and ends with a model of which a filter can be made.
pub fn learns(recipe: &str, loss: impl Fn(&Row) -> Option<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let run = Run::new(folder.path().join("small.safetensors"));
    let summary = train(recipe, &run, &mut |_| ControlFlow::Continue(())).unwrap();
    let losses: Vec<f64> = summary.curve.iter().filter_map(loss).collect();
    assert!(losses.len() == summary.curve.len() && losses.last() < losses.first(), "{losses:?}");
    tercel_neural::filter::check(&Model::open(&run.model).unwrap()).unwrap();
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes")
}

/// The shipped models of a kind, each with its recipe, whose data are a few flights. Of models with the same options the first, since
/// they differ in what they have learned alone.
pub fn models(kind: &str) -> Vec<(Model, String)> {
    let mut models: Vec<Model> = Vec::new();
    for model in shipped::NAMES.into_iter().map(model).filter(|model| model.card().kind == kind) {
        if models.iter().all(|other| other.card().hyper != model.card().hyper) {
            models.push(model);
        }
    }
    models
        .into_iter()
        .map(|model| (recipe(&model.card().name), model))
        .map(|(text, model)| (model, text))
        .collect()
}

/// The shipped model of this name.
pub fn model(name: &str) -> Model {
    shipped::model(name).unwrap()
}

fn recipe(name: &str) -> String {
    let text = std::fs::read_to_string(folder().join(format!("{name}.toml"))).unwrap();
    let mut recipe: toml::Table = text.parse().unwrap();
    let data = recipe["data"].as_table_mut().unwrap();
    let flights = if data.contains_key("flights") { data["flights"].as_table_mut().unwrap() } else { data };
    flights.insert("training".into(), 8.into());
    flights.insert("validation".into(), 4.into());
    toml::to_string(&recipe).unwrap()
}

/// Gives parameters the values of a model.
pub fn fill(set: &mut ParameterSet, model: &Model) {
    for (name, values) in set.values_mut() {
        values.copy_from_slice(&model.tensors()[name].values);
    }
}

/// Aircraft that turn, with a speed that is never quite the same, every four seconds.
pub fn turning_flights(steps: usize) -> Tracks {
    let flight = |number: usize| {
        let mut place = nalgebra::Vector2::zeros();
        let state = |step: usize| {
            let (k, phase) = (step as f64, 0.7 * number as f64);
            let (course, speed) =
                (0.08 * k + (0.05 * k + phase).sin(), 100.0 + 12.0 * (2.1 * k + phase).sin());
            let velocity = nalgebra::Vector2::new(course.cos(), course.sin()) * speed;
            place += velocity * 4.0;
            nalgebra::Vector4::new(place.x, place.y, velocity.x, velocity.y)
        };
        (0..steps).map(state).collect()
    };
    Tracks::new((0..10).map(flight).collect())
}
