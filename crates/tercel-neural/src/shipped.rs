//! The models that come with Tercel.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use crate::error::ModelError;
use crate::model::Model;

/// Names of the models that come with Tercel, which were trained by the recipes of the same names.
pub const NAMES: [&str; COUNT] = {
    let mut names = [""; COUNT];
    let mut i = 0;
    while i < COUNT {
        names[i] = FILES[i].0;
        i += 1;
    }
    names
};

const COUNT: usize = FILES.len();

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../../models/", $name, ".safetensors")))),*]
    };
}

/// Name and content of each file.
const FILES: &[(&str, &[u8])] = files![
    "att-ens-kalmannets",
    "att-ens-kalmannets-paper",
    "deep-mtt",
    "ens-knets-classification-paper",
    "ens-knets-correction-paper",
    "ens-knets-paper",
    "kalman-net-left",
    "kalman-net-left-paper",
    "kalman-net-right",
    "kalman-net-right-paper",
    "kalman-net-straight",
    "kalman-net-straight-paper",
    "liquid",
    "liquid-cfc",
    "liquid-gru",
    "liquid-mlp",
    "liquid-paper",
    "lstm-aircraft",
    "lstm-aircraft-paper",
    "lstm-data-100",
    "lstm-data-1000",
    "lstm-data-20000",
    "lstm-data-300",
    "lstm-data-5000",
    "lstm-vehicle",
    "lstm-vehicle-paper",
    "mnemonic",
    "neural-imm",
    "neural-imm-liquid",
    "neural-imm-position",
    "rmmnet-ablation-full",
    "rmmnet-ablation-only-prediction",
    "rmmnet-ablation-only-update",
    "rmmnet-ablation-without-memory",
    "rmmnet-ablation-without-prediction",
    "rmmnet-ablation-without-update",
    "rmmnet-aircraft",
    "rmmnet-aircraft-paper",
    "rmmnet-aircraft-random",
    "rmmnet-crossing",
    "rmmnet-data-100",
    "rmmnet-data-1000",
    "rmmnet-data-20000",
    "rmmnet-data-300",
    "rmmnet-data-5000",
    "rmmnet-imitation-1",
    "rmmnet-imitation-10",
    "rmmnet-imitation-3",
    "rmmnet-imitation-5",
    "rmmnet-vehicle",
    "rmmnet-vehicle-paper",
    "tr-mtt",
    "transformer-aircraft",
    "transformer-aircraft-paper",
    "transformer-data-100",
    "transformer-data-1000",
    "transformer-data-20000",
    "transformer-data-300",
    "transformer-data-5000",
    "transformer-vehicle",
    "transformer-vehicle-paper",
];

/// The model of this name.
///
/// ```
/// use std::sync::Arc;
/// use tercel_neural::filter::{BankNetwork, NeuralImm};
/// use tercel_neural::shipped;
/// use tercel_core::{filter::Filter, sensor::{Measurement, RangeBearing}};
///
/// let network = Arc::new(BankNetwork::from_model(&shipped::model("neural-imm")?)?);
/// let filter = NeuralImm::new(network, &[RangeBearing::new(50.0, 0.009)?])?;
/// let mut belief = filter.birth(&[80_000.0, 0.30].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[80_150.0, 0.301].into())?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When there is no model of this name.
pub fn model(name: &str) -> Result<Model, ModelError> {
    match FILES.iter().find(|(known, _)| *known == name) {
        Some((_, content)) => Model::from_bytes(name, content),
        None => Err(ModelError::NotShipped { name: name.to_owned(), known: NAMES.join(", ") }),
    }
}

/// The models that come with Tercel, of which some are replaced by others: how a model of one's own is put where a shipped one
/// is used.
///
/// ```
/// use tercel_neural::shipped::{self, Models};
///
/// let mine = shipped::model("neural-imm")?; // or `Model::open`
/// let models = Models::default().with("neural-imm", mine)?;
/// assert_eq!(models.get("neural-imm")?.card().kind, "neural-imm");
/// # Ok::<(), tercel_neural::ModelError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Models {
    own: BTreeMap<String, Model>,
    asked: RefCell<BTreeSet<String>>,
}

impl Models {
    /// Puts a model in the place of the shipped one of this name.
    ///
    /// # Errors
    /// When there is no shipped model of this name, or it is of another kind.
    pub fn with(mut self, name: &str, own: Model) -> Result<Self, ModelError> {
        let kind = model(name)?.card().kind.clone();
        if own.card().kind != kind {
            let (file, found) = (own.file().clone(), own.card().kind.clone());
            return Err(ModelError::Kind { file, found, expected: kind });
        }
        self.own.insert(name.to_owned(), own);
        Ok(self)
    }

    /// The models that take the place of shipped ones, by the names of those.
    pub fn replacements(&self) -> impl Iterator<Item = (&str, &Model)> {
        self.own.iter().map(|(name, model)| (name.as_str(), model))
    }

    /// Names of the models that were asked for.
    pub fn asked(&self) -> Vec<String> {
        self.asked.borrow().iter().cloned().collect()
    }

    /// The model of this name.
    ///
    /// # Errors
    /// As [`model`].
    pub fn get(&self, name: &str) -> Result<Model, ModelError> {
        self.asked.borrow_mut().insert(name.to_owned());
        self.own.get(name).map_or_else(|| model(name), |own| Ok(own.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter;

    #[test]
    fn every_model_makes_a_filter_and_is_called_as_its_file() {
        for name in NAMES {
            let model = model(name).unwrap();
            filter::check(&model).unwrap();
            assert_eq!(model.card().name, name);
        }
    }

    #[test]
    fn a_model_of_another_kind_replaces_nothing() {
        let own = || model("mnemonic").unwrap();
        let error = Models::default().with("neural-imm", own()).unwrap_err().to_string();
        assert!(error.contains("mnemonic") && error.contains("neural-imm"), "{error}");
        assert!(Models::default().with("mine", own()).is_err());
    }

    #[test]
    fn a_model_that_is_not_there_is_refused_with_those_that_are() {
        let error = model("neural-im").unwrap_err().to_string();
        assert!(error.contains("`neural-im`") && error.contains("neural-imm"), "{error}");
    }
}
