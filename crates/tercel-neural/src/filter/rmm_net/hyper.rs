//! Sizes and options of an RMMNet.

use serde::{Deserialize, Serialize};

use super::features::{EXTENT_SEEN, SCAN_SEEN, motion_seen};
use super::published::Published;
use super::regression::Identification;
use super::track::{EXTENT, MOTION, SCAN};
use super::view::POINT;
use crate::error::ModelError;
use crate::filter::{checked_positive, checked_sizes};
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of an [`RmmNet`](super::RmmNet): the table `hyper` of its card.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RmmNetHyper {
    /// The time step that the network was trained for, s.
    pub interval: f64,
    /// Units of the memory.
    pub memory: usize,
    /// What the network sees and says.
    pub form: Form,
}

/// What the network sees and says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Form {
    /// In the frame of the object, with the points themselves.
    Aligned(Aligned),
    /// In the frame of the plane, as published.
    Published(Published),
}

/// The network works in the frame of the object, and sees the points themselves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Aligned {
    /// Width of the layers between the memory and what is said.
    pub hidden: usize,
    /// Width of what the encoder makes of a point.
    pub encoder: usize,
    /// Unit of velocities, m/s.
    pub velocity: f64,
    /// Deviation of the jump of the velocity in an interval where the network says nothing, m/s per axis.
    pub change: f64,
    /// Speed below which an object keeps its direction, m/s.
    pub standing: f64,
    /// Semi-axes of a new object, along and across, m.
    pub axes: [f64; 2],
    /// How many points these are worth.
    pub worth: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
    /// How weights of past velocities are identified.
    pub identification: Identification,
}

/// Widths of what the network sees and says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// What the memory sees.
    pub motion_seen: usize,
    /// What is said about the motion.
    pub motion_said: usize,
    /// What the encoder sees of a point.
    pub point: usize,
    /// What is seen of a scan besides its points.
    pub scan_seen: usize,
    /// What is said about a scan.
    pub scan_said: usize,
    /// What is seen of an extent.
    pub extent_seen: usize,
    /// What is said about it.
    pub extent_said: usize,
}

impl Default for Aligned {
    fn default() -> Self {
        Aligned {
            hidden: 64,
            encoder: 32,
            velocity: 3.0,
            change: 1.5,
            standing: 0.3,
            axes: [6.0, 1.25],
            worth: 4.0,
            speed: 5.0,
            identification: Identification::default(),
        }
    }
}

impl Aligned {
    /// Widths of what is seen and said.
    pub fn sizes(&self) -> Sizes {
        let order = self.identification.order;
        Sizes {
            motion_seen: motion_seen(order),
            motion_said: MOTION + order,
            point: POINT,
            scan_seen: SCAN_SEEN,
            scan_said: SCAN,
            extent_seen: EXTENT_SEEN,
            extent_said: EXTENT,
        }
    }

    fn layers(&self, memory: usize) -> Vec<(String, LayerShape)> {
        let Aligned { hidden, encoder, .. } = *self;
        let linear = |name: &str, inputs, outputs| (name.to_owned(), LayerShape::Linear { inputs, outputs });
        let sizes = self.sizes();
        vec![
            ("memory".to_owned(), LayerShape::Lstm { inputs: sizes.motion_seen, size: memory }),
            linear("motion.hidden", memory + sizes.motion_seen, hidden),
            linear("motion.output", hidden, sizes.motion_said),
            linear("points.first", sizes.point, encoder),
            linear("points.second", encoder, encoder),
            linear("scan.hidden", 2 * encoder + sizes.scan_seen + memory, hidden),
            linear("scan.output", hidden, sizes.scan_said),
            linear("extent.hidden", hidden + sizes.extent_seen, hidden),
            linear("extent.output", hidden, sizes.extent_said),
        ]
    }

    fn check(&self) -> Result<(), String> {
        checked_sizes(&[("form.hidden", self.hidden), ("form.encoder", self.encoder)])?;
        checked_positive(&[
            ("form.velocity", self.velocity),
            ("form.change", self.change),
            ("form.standing", self.standing),
            ("form.axes[0]", self.axes[0]),
            ("form.axes[1]", self.axes[1]),
            ("form.worth", self.worth),
            ("form.speed", self.speed),
            ("form.identification.kept", self.identification.kept),
            ("form.identification.variance", self.identification.variance),
            ("form.identification.residual", self.identification.residual),
        ])?;
        let Identification { order, kept, .. } = self.identification;
        if order > LONGEST {
            return Err(format!("`form.identification.order` is {order}; expected at most {LONGEST}"));
        }
        if kept > 1.0 {
            return Err(format!("`form.identification.kept` is {kept}; it is a share, so at most 1"));
        }
        Ok(())
    }
}

/// Most past velocities on which a motion may depend.
pub(super) const LONGEST: usize = 64;

impl RmmNetHyper {
    /// The layers of the network, by name.
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        match &self.form {
            Form::Aligned(form) => form.layers(self.memory),
            Form::Published(form) => form.layers(self.memory),
        }
    }

    /// Names and shapes of all tensors of the network.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.layers().iter().flat_map(|(name, shape)| shape.tensors(name)).collect()
    }

    /// This as the table `hyper` of a card.
    ///
    /// # Errors
    /// When a size does not fit a TOML integer.
    pub fn to_table(&self) -> Result<toml::Table, String> {
        toml::Table::try_from(self).map_err(|error| error.to_string())
    }

    /// What cannot be, if anything.
    ///
    /// # Errors
    /// Names the option, what it is and what was expected.
    pub fn check(&self) -> Result<(), String> {
        checked_sizes(&[("memory", self.memory)])?;
        checked_positive(&[("interval", self.interval)])?;
        match &self.form {
            Form::Aligned(form) => form.check(),
            Form::Published(form) => form.check(),
        }
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        crate::filter::hyper_of(model, RmmNetHyper::check)
    }
}
