//! The transformer.

use super::KIND;
use super::hyper::TrMttHyper;
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::filter::memory::Room;
use crate::layer::{Attention, LayerNorm, Linear, positions};
use crate::model::{Model, Weights};

/// The network of a [`TrMtt`](super::TrMtt): an encoder and a decoder, from a window of readings to the states of its steps.
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct TransformerNetwork {
    hyper: TrMttHyper,
    positions: Vec<f32>,
    embed: Linear,
    query: Linear,
    encoder: Vec<Block>,
    encoder_norm: LayerNorm,
    decoder: Vec<Block>,
    decoder_norm: LayerNorm,
    output: Linear,
}

/// A layer of the encoder or of the decoder: attentions and a feed-forward part, each with a normalisation before it and a
/// shortcut around it.
#[derive(Debug, Clone, PartialEq)]
struct Block {
    own: (LayerNorm, Attention),
    cross: Option<(LayerNorm, Attention)>,
    norm: LayerNorm,
    feed: [Linear; 2],
}

impl Block {
    fn new(
        weights: &mut Weights<'_>,
        hyper: &TrMttHyper,
        name: &str,
        crossed: bool,
    ) -> Result<Self, ModelError> {
        let (size, heads) = (hyper.size, hyper.heads);
        let mut attention = |index: usize, part: &str| {
            let norm = weights.layer_norm(&format!("{name}.norm.{index}"), size)?;
            Ok::<_, ModelError>((norm, weights.attention(&format!("{name}.{part}"), size, heads)?))
        };
        let own = attention(0, "attention")?;
        let cross = if crossed { Some(attention(1, "cross")?) } else { None };
        let norm = weights.layer_norm(&format!("{name}.norm.{}", 1 + usize::from(crossed)), size)?;
        let feed = [
            weights.linear(&format!("{name}.feed.0"), size, hyper.feed)?,
            weights.linear(&format!("{name}.feed.1"), hyper.feed, size)?,
        ];
        Ok(Block { own, cross, norm, feed })
    }

    /// Moves the rows `x` on. `memory` is what the decoder looks at.
    fn forward(&self, x: &mut [f32], memory: &[f32], mask: &[f32], scratch: &mut [f32]) {
        let mut room = Room(scratch);
        let normed = room.take(x.len());
        let change = room.take(x.len());
        let (norm, attention) = &self.own;
        norm.forward(x, normed);
        attention.forward(normed, normed, mask, change, room.0);
        add(x, change);
        if let Some((norm, attention)) = &self.cross {
            norm.forward(x, normed);
            attention.forward(normed, memory, mask, change, room.0);
            add(x, change);
        }
        let wide = room.take(mask.len() * self.feed[0].outputs());
        self.norm.forward(x, normed);
        self.feed[0].forward_relu(normed, wide);
        self.feed[1].forward(wide, change);
        add(x, change);
    }

    fn scratch(&self, steps: usize) -> usize {
        let inner = self.own.1.scratch(steps, steps).max(steps * self.feed[0].outputs());
        2 * steps * self.norm.size() + inner
    }
}

fn add(x: &mut [f32], change: &[f32]) {
    x.iter_mut().zip(change).for_each(|(x, change)| *x += change);
}

impl TransformerNetwork {
    /// Builds the network of a model of the kind `tr-mtt`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = TrMttHyper::of(model)?;
        let mut weights = model.weights();
        let embed = weights.linear("embed", hyper.inputs(), hyper.size)?;
        let query = weights.linear("query", hyper.inputs(), hyper.size)?;
        let mut blocks = |name: &str, count: usize, crossed: bool| {
            let block = |index| Block::new(&mut weights, &hyper, &format!("{name}.{index}"), crossed);
            (0..count).map(block).collect::<Result<Vec<_>, ModelError>>()
        };
        let (encoder, decoder) =
            (blocks("encoder", hyper.encoder, false)?, blocks("decoder", hyper.decoder, true)?);
        let encoder_norm = weights.layer_norm("encoder.norm", hyper.size)?;
        let decoder_norm = weights.layer_norm("decoder.norm", hyper.size)?;
        let output = weights.linear("output", hyper.size, hyper.outputs())?;
        weights.finish()?;
        let positions = positions(hyper.window, hyper.size);
        Ok(TransformerNetwork {
            hyper,
            positions,
            embed,
            query,
            encoder,
            encoder_norm,
            decoder,
            decoder_norm,
            output,
        })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &TrMttHyper {
        &self.hyper
    }

    /// Numbers of scratch space for a window.
    pub(super) fn scratch(&self) -> usize {
        let steps = self.hyper.window;
        let blocks = self.encoder.iter().chain(&self.decoder);
        2 * steps * self.hyper.size + blocks.map(|block| block.scratch(steps)).max().unwrap_or(0)
    }

    /// Writes the outputs of a window, one row for each step. At least one step must not be masked.
    pub(super) fn forward(&self, inputs: &[f32], mask: &[f32], outputs: &mut [f32], scratch: &mut [f32]) {
        let count = self.positions.len();
        let mut room = Room(scratch);
        let (x, memory) = (room.take(count), room.take(count));
        self.embed.forward(inputs, x);
        add(x, &self.positions);
        for block in &self.encoder {
            block.forward(x, &[], mask, room.0);
        }
        self.encoder_norm.forward(x, memory);
        self.query.forward(inputs, x);
        add(x, &self.positions);
        for block in &self.decoder {
            block.forward(x, memory, mask, room.0);
        }
        let normed = &mut room.0[..count];
        self.decoder_norm.forward(x, normed);
        self.output.forward(normed, outputs);
    }
}
