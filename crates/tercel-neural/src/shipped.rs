//! The models that come with Tercel.

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
    "mnemonic",
    "neural-imm",
    "rmmnet-aircraft",
    "rmmnet-aircraft-paper",
    "rmmnet-crossing",
    "rmmnet-vehicle",
    "rmmnet-vehicle-paper",
    "tr-mtt",
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
    fn a_model_that_is_not_there_is_refused_with_those_that_are() {
        let error = model("neural-im").unwrap_err().to_string();
        assert!(error.contains("`neural-im`") && error.contains("neural-imm"), "{error}");
    }
}
