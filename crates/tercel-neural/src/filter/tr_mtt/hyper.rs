//! Sizes and options of TrMTT, and what its network sees and says.

use nalgebra::{Vector2, Vector4};
use serde::{Deserialize, Serialize};

use crate::error::ModelError;
use crate::filter::sight::Sight;
use crate::layer::LayerShape;
use crate::model::Model;

/// Sizes and options of a [`TrMtt`](super::TrMtt): the table `hyper` of its card.
///
/// ```toml
/// window = 25             # steps that the network sees
/// size = 64               # width of a row between the layers
/// heads = 4               # heads of each attention; they divide the size
/// encoder = 3             # layers of the encoder
/// decoder = 3             # layers of the decoder
/// feed = 256              # width inside the feed-forward part of a layer
/// sensor_frame = true     # inputs and outputs in the frame of the line of sight
/// context = true          # the network sees the extent of the window and its range
/// scales = true           # it also scales the covariance
/// acceleration = 10.0     # process noise of the carrier, m/s² per axis, constant within a step
/// speed = 300.0           # standard deviation of a new object's velocity, m/s per axis
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrMttHyper {
    /// Steps that the network sees, the present one included.
    pub window: usize,
    /// Width of a row between the layers.
    pub size: usize,
    /// Heads of each attention.
    pub heads: usize,
    /// Layers of the encoder.
    pub encoder: usize,
    /// Layers of the decoder.
    pub decoder: usize,
    /// Width inside the feed-forward part of a layer.
    pub feed: usize,
    /// Whether inputs and outputs are in the frame of the line of sight.
    pub sensor_frame: bool,
    /// Whether the network sees the extent of the window and its range.
    pub context: bool,
    /// Whether the network also says by how much the deviations of the carrier are off.
    pub scales: bool,
    /// Standard deviation of the carrier's acceleration, constant within a step, m/s² per axis.
    pub acceleration: f64,
    /// Standard deviation of a new object's velocity, m/s per axis.
    pub speed: f64,
}

impl Default for TrMttHyper {
    fn default() -> Self {
        TrMttHyper { sensor_frame: true, context: true, scales: true, ..TrMttHyper::paper() }
    }
}

/// Unit of velocities, m/s.
const SPEED: f64 = 300.0;

/// Readings that a window needs before the network is asked.
pub(super) const LEAST: usize = 2;

/// The frame of a window: where its centre lies, how large it is, and which way it is turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    sight: Sight,
    centre: Vector2<f64>,
    extent: f64,
}

impl Frame {
    /// Half the larger side of the box around the readings, m: the unit of positions.
    pub fn extent(&self) -> f64 {
        self.extent
    }

    /// Which way it is turned.
    pub fn sight(&self) -> &Sight {
        &self.sight
    }

    /// A true state in the frame, as the network should say it.
    pub fn turned(&self, state: &Vector4<f64>) -> [f32; 4] {
        let place = self.sight.turned(state.xy() - self.centre) / self.extent;
        let velocity = self.sight.turned(Vector2::new(state[2], state[3])) / SPEED;
        [place.x as f32, place.y as f32, velocity.x as f32, velocity.y as f32]
    }

    /// The unit of each number of a state in the frame: m, m, m/s, m/s.
    pub fn units(&self) -> [f64; 4] {
        [self.extent, self.extent, SPEED, SPEED]
    }
}

impl TrMttHyper {
    /// As Mari and Snidaro have it: windows of 25 measurements alone, in the frame of the state.
    pub fn paper() -> Self {
        TrMttHyper {
            window: 25,
            size: 64,
            heads: 4,
            encoder: 3,
            decoder: 3,
            feed: 256,
            sensor_frame: false,
            context: false,
            scales: false,
            acceleration: 10.0,
            speed: 300.0,
        }
    }

    /// Width of an input row: one for each step of the window.
    pub fn inputs(&self) -> usize {
        if self.context { 5 } else { 3 }
    }

    /// Width of an output row: one for each step of the window.
    pub fn outputs(&self) -> usize {
        if self.scales { 6 } else { 4 }
    }

    /// The layers of the network, by name: `embed` and `query` (linear, of encoder and decoder), `encoder.N` and `decoder.N` with
    /// their parts, `encoder.norm`, `decoder.norm` and `output` (linear).
    pub fn layers(&self) -> Vec<(String, LayerShape)> {
        let Self { size, feed, .. } = *self;
        let norm = LayerShape::LayerNorm { size };
        let linear = |inputs, outputs| LayerShape::Linear { inputs, outputs };
        let mut layers: Vec<(String, LayerShape)> = vec![
            ("embed".into(), linear(self.inputs(), size)),
            ("query".into(), linear(self.inputs(), size)),
        ];
        let mut block = |name: String, attentions: &[&str]| {
            for (index, attention) in attentions.iter().enumerate() {
                layers.push((format!("{name}.norm.{index}"), norm));
                layers.push((format!("{name}.{attention}"), LayerShape::Attention { size }));
            }
            layers.push((format!("{name}.norm.{}", attentions.len()), norm));
            layers.push((format!("{name}.feed.0"), linear(size, feed)));
            layers.push((format!("{name}.feed.1"), linear(feed, size)));
        };
        (0..self.encoder).for_each(|index| block(format!("encoder.{index}"), &["attention"]));
        (0..self.decoder).for_each(|index| block(format!("decoder.{index}"), &["attention", "cross"]));
        layers.push(("encoder.norm".into(), norm));
        layers.push(("decoder.norm".into(), norm));
        layers.push(("output".into(), linear(size, self.outputs())));
        layers
    }

    /// Names and shapes of all tensors of the network.
    pub fn tensors(&self) -> Vec<(String, Vec<usize>)> {
        self.layers().iter().flat_map(|(name, shape)| shape.tensors(name)).collect()
    }

    /// The frame of a window of readings, if there are at least two. `origin` is where the sensor stands.
    pub fn frame(&self, window: &[Option<Vector2<f64>>], origin: &Vector2<f64>) -> Option<Frame> {
        let last = window.iter().rev().flatten().next()?;
        let sight = Sight::new(last - origin, self.sensor_frame);
        // The box lies along the axes of the frame, so that a scene that is turned is seen alike.
        let (mut low, mut high, mut count) = (Vector2::zeros(), Vector2::zeros(), 0);
        for reading in window.iter().flatten() {
            let away = sight.turned(reading - last);
            (low, high, count) = (low.inf(&away), high.sup(&away), count + 1);
        }
        let centre = last + sight.turned_back((low + high) / 2.0);
        let extent = ((high - low) / 2.0).amax().max(1.0);
        let frame = Frame { sight, centre, extent };
        (count >= LEAST && extent.is_finite()).then_some(frame)
    }

    /// Writes what the network sees of a window, and which of its steps have a reading (1 or 0).
    ///
    /// # Panics
    /// When `inputs` or `mask` hold fewer rows than the window has steps.
    pub fn see(&self, window: &[Option<Vector2<f64>>], frame: &Frame, inputs: &mut [f32], mask: &mut [f32]) {
        let rows = inputs.chunks_exact_mut(self.inputs()).zip(mask);
        for (reading, (row, mask)) in window.iter().zip(rows) {
            let place = reading.map(|reading| frame.sight.turned(reading - frame.centre) / frame.extent);
            let [x, y] = place.map_or([0.0; 2], |place| [place.x, place.y]);
            *mask = f32::from(u8::from(place.is_some()));
            let extent = (frame.extent / 3e3).ln();
            let range = (frame.sight.range().max(1.0) / 100e3).ln();
            let values = [x, y, f64::from(*mask), extent, range];
            row.iter_mut().zip(values).for_each(|(to, value)| *to = value as f32);
        }
    }

    /// What a row of outputs means: a state, and the logarithms by which the deviations of position and velocity are off.
    pub fn said(&self, frame: &Frame, row: &[f32]) -> (Vector4<f64>, [f64; 2]) {
        let pair = |i: usize| Vector2::new(f64::from(row[i]), f64::from(row[i + 1]));
        let place = frame.centre + frame.sight.turned_back(pair(0)) * frame.extent;
        let velocity = frame.sight.turned_back(pair(2)) * SPEED;
        let scales = if self.scales { [f64::from(row[4]), f64::from(row[5])] } else { [0.0; 2] };
        (Vector4::new(place.x, place.y, velocity.x, velocity.y), scales)
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
        let sizes = [
            ("window", self.window),
            ("size", self.size),
            ("heads", self.heads),
            ("encoder", self.encoder),
            ("decoder", self.decoder),
            ("feed", self.feed),
        ];
        crate::filter::checked_sizes(&sizes)?;
        if self.window < LEAST {
            return Err(format!("`window` is {}; expected at least {LEAST}", self.window));
        }
        if !self.size.is_multiple_of(self.heads) {
            return Err(format!("`heads` is {}; expected a divisor of `size`, {}", self.heads, self.size));
        }
        crate::filter::checked_positive(&[("acceleration", self.acceleration), ("speed", self.speed)])
    }

    /// The options of a model's card.
    pub(super) fn of(model: &Model) -> Result<Self, ModelError> {
        crate::filter::hyper_of(model, TrMttHyper::check)
    }
}
