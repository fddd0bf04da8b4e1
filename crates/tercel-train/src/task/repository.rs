//! The recipes and models of the repository, as the tests of the tasks need them.

use std::path::{Path, PathBuf};

use tercel_neural::{Model, shipped};

use crate::{ParameterSet, TrainError};

/// The recipes of a kind.
pub fn recipes(kind: &str) -> Vec<String> {
    let files = std::fs::read_dir(folder()).unwrap();
    let texts = files.map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap());
    texts.filter(|text| crate::recipe::kind(text).unwrap() == kind).collect()
}

/// Why a recipe that was changed in one place is refused.
pub fn refusal(
    recipe: &str,
    (old, new): (&str, &str),
    check: impl Fn(&str) -> Result<(), TrainError>,
) -> String {
    assert!(recipe.contains(old), "{old}");
    check(&recipe.replacen(old, new, 1)).unwrap_err().to_string()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes")
}

/// The shipped models of a kind, each with its recipe, whose data are a few flights.
pub fn models(kind: &str) -> Vec<(Model, String)> {
    let models = shipped::NAMES.into_iter().map(model);
    let models = models.filter(|model| model.card().kind == kind);
    models.map(|model| (recipe(&model.card().name), model)).map(|(text, model)| (model, text)).collect()
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
