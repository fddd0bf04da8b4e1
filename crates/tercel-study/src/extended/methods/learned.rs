//! Learned filters, with the models that come with Tercel or others in their place.

use std::sync::Arc;

use tercel_core::error::FilterError;
use tercel_neural::filter::{ExtentNet, ExtentNetwork, RmmNet, RmmNetwork};
use tercel_neural::shipped::Models;

use super::matrix::sensor;
use super::{Method, Recording, StepEstimate};
use crate::error::StudyError;
use crate::extended::recording::follow;

/// An RMMNet, told how points spread.
pub(super) struct Remembering(Arc<RmmNetwork>);

impl Remembering {
    /// With the model of this name.
    pub fn new(models: &Models, model: &str) -> Result<Self, StudyError> {
        Ok(Remembering(Arc::new(RmmNetwork::from_model(&models.get(model)?)?)))
    }
}

impl Method for Remembering {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        follow::<4, _>(recording, &RmmNet::new(Arc::clone(&self.0), sensor(recording)?))
    }
}

/// A network without a model of motion or sensor.
pub(super) struct Alone(Arc<ExtentNetwork>);

impl Alone {
    /// With the model of this name.
    pub fn new(models: &Models, model: &str) -> Result<Self, StudyError> {
        Ok(Alone(Arc::new(ExtentNetwork::from_model(&models.get(model)?)?)))
    }
}

impl Method for Alone {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        follow::<4, _>(recording, &ExtentNet::new(Arc::clone(&self.0), sensor(recording)?))
    }
}
