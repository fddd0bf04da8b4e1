//! The models that come with Tercel, as the tests of the tasks need them.

use std::path::Path;

use tercel_neural::{Model, shipped};

use crate::ParameterSet;

/// The shipped models of a kind, each with its recipe, whose data are a few flights.
pub fn of_kind(kind: &str) -> Vec<(Model, String)> {
    let models = shipped::NAMES.into_iter().map(model);
    let models = models.filter(|model| model.card().kind == kind);
    models.map(|model| (recipe(&model.card().name), model)).map(|(text, model)| (model, text)).collect()
}

/// The shipped model of this name.
pub fn model(name: &str) -> Model {
    shipped::model(name).unwrap()
}

fn recipe(name: &str) -> String {
    let recipes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recipes");
    let text = std::fs::read_to_string(recipes.join(format!("{name}.toml"))).unwrap();
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
