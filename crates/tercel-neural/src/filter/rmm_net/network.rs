//! The network: a memory, and heads that speak about the motion, a scan and the extent.

use super::KIND;
use super::hyper::{Form, RmmNetHyper};
use super::layers::{AlignedLayers, PublishedLayers};
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::model::Model;

/// The network of an [`RmmNet`](super::RmmNet).
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct RmmNetwork {
    hyper: RmmNetHyper,
    pub(super) layers: Layers,
}

/// The layers of a form, with its options.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Layers {
    Aligned(AlignedLayers),
    Published(PublishedLayers),
}

impl RmmNetwork {
    /// Builds the network of a model of the kind `rmmnet`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = RmmNetHyper::of(model)?;
        let mut weights = model.weights();
        let layers = match &hyper.form {
            Form::Aligned(form) => {
                Layers::Aligned(AlignedLayers::take(&mut weights, form.clone(), hyper.memory)?)
            }
            Form::Published(form) => {
                Layers::Published(PublishedLayers::take(&mut weights, form.clone(), hyper.memory)?)
            }
        };
        weights.finish()?;
        Ok(RmmNetwork { hyper, layers })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &RmmNetHyper {
        &self.hyper
    }

    /// Numbers of memory for one object.
    pub fn memory(&self) -> usize {
        match &self.layers {
            Layers::Aligned(layers) => layers.memory(),
            Layers::Published(layers) => layers.memory(),
        }
    }

    /// Numbers of scratch space that a step of one object needs, without its points.
    pub(super) fn scratch(&self) -> usize {
        match &self.layers {
            Layers::Aligned(layers) => layers.scratch(),
            Layers::Published(layers) => layers.scratch(),
        }
    }

    /// Numbers of room for the points of a scan and what is made of them.
    pub(super) fn room(&self, count: usize) -> usize {
        match &self.layers {
            Layers::Aligned(layers) => layers.room(count),
            Layers::Published(_) => 0,
        }
    }
}
