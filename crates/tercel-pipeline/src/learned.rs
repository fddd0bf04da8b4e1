//! Motion that a network has learned: models of the kinds `liquid` and `neural-imm`.

use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

use tercel_core::error::FilterError;
use tercel_core::filter::Filter;
use tercel_core::sensor::{Measurement, Sensor};
use tercel_neural::filter::{
    BankNetwork, LiquidBelief, LiquidKalman, LiquidNetwork, NeuralImm, NeuralImmBelief,
};
use tercel_neural::{Model, ModelError, shipped};

use crate::PipelineError;
use crate::config::LearnedMotion;
use crate::estimator::Recursion;

/// A learned motion, by the kind of its filter.
pub(crate) enum Learned {
    Liquid(Liquid),
    Bank(Bank),
}

/// A motion with one Gaussian.
pub(crate) struct Liquid {
    network: Arc<LiquidNetwork>,
    speed: f64,
}

/// A bank of turns that is corrected.
pub(crate) struct Bank {
    network: Arc<BankNetwork>,
    speed: f64,
}

const KEY: &str = "motion.learned.model";

impl Learned {
    /// Reads the model that a configuration names.
    ///
    /// # Errors
    /// When there is no such model, or it is of a kind that is no motion in the plane.
    pub fn open(config: &LearnedMotion) -> Result<Self, PipelineError> {
        let refused = |error: ModelError| PipelineError::config(KEY, &error.to_string());
        let model = model(&config.model)?;
        let chosen = |trained: f64| config.speed.map_or(trained, |speed| speed.get());
        match model.card().kind.as_str() {
            "liquid" => {
                let network = LiquidNetwork::from_model(&model).map_err(refused)?;
                let speed = chosen(network.hyper().speed);
                Ok(Learned::Liquid(Liquid { network: Arc::new(network), speed }))
            }
            "neural-imm" => {
                let network = BankNetwork::from_model(&model).map_err(refused)?;
                let speed = chosen(network.hyper().speed);
                Ok(Learned::Bank(Bank { network: Arc::new(network), speed }))
            }
            other => {
                let reason = format!(
                    "`{}` is of the kind `{other}`; expected one of the kinds `liquid` and `neural-imm`",
                    config.model
                );
                Err(PipelineError::config(KEY, &reason))
            }
        }
    }
}

/// The model of this name, or of this file.
fn model(name: &str) -> Result<Model, PipelineError> {
    if shipped::NAMES.contains(&name) {
        return shipped::model(name).map_err(|error| PipelineError::config(KEY, &error.to_string()));
    }
    Model::open(Path::new(name)).map_err(|error| match &error {
        ModelError::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
            let motions = shipped::NAMES
                .iter()
                .filter(|name| name.starts_with("liquid") || name.starts_with("neural-imm"));
            let known: Vec<&str> = motions.copied().collect();
            let reason = format!(
                "there is no file `{name}`, and no such model comes with Tercel; those that do are {}",
                known.join(", ")
            );
            PipelineError::config(KEY, &reason)
        }
        _ => PipelineError::config(KEY, &error.to_string()),
    })
}

impl Recursion<4> for Liquid {
    type Belief = LiquidBelief;

    fn with<const M: usize, R>(
        &self,
        sensor: &dyn Sensor<4, M>,
        _: bool,
        work: impl FnOnce(&dyn Filter<4, Belief = LiquidBelief, Measurement = Measurement<M>>) -> R,
    ) -> Result<R, FilterError> {
        let filter = LiquidKalman::<_, M>::new(Arc::clone(&self.network), sensor);
        Ok(work(&filter.with_speed(self.speed)?))
    }
}

impl Recursion<4> for Bank {
    type Belief = NeuralImmBelief;

    fn with<const M: usize, R>(
        &self,
        sensor: &dyn Sensor<4, M>,
        _: bool,
        work: impl FnOnce(&dyn Filter<4, Belief = NeuralImmBelief, Measurement = Measurement<M>>) -> R,
    ) -> Result<R, FilterError> {
        let filter = NeuralImm::<_, M>::new(Arc::clone(&self.network), &[sensor])?;
        Ok(work(&filter.with_speed(self.speed)?))
    }

    /// `straight`, `left_12`, `right_12`, ...: turns by degrees per second.
    fn modes(&self) -> Vec<String> {
        let name = |rate: &f64| {
            // To a hundredth of a degree, as one would write them.
            let degrees = (rate.to_degrees().abs() * 100.0).round() / 100.0;
            match *rate {
                0.0 => "straight".to_owned(),
                rate if rate > 0.0 => format!("left_{degrees}"),
                _ => format!("right_{degrees}"),
            }
        };
        self.network.hyper().rates.iter().map(name).collect()
    }
}
