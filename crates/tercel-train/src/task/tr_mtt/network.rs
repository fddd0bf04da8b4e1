//! The transformer, differentiable.

use std::sync::Arc;

use tercel_neural::filter::TrMttHyper;
use tercel_neural::layer::positions;

use crate::backend::{Tensor, constant};
use crate::layer::{Activation, Attention, LayerNorm, Linear, Mask};
use crate::{ParameterSet, TrainError, Weights};

/// Encoder and decoder of [`tercel_neural::filter::TransformerNetwork`].
#[derive(Debug)]
pub struct Transformer {
    positions: Vec<f32>,
    size: usize,
    embed: Linear,
    query: Linear,
    encoder: Vec<Block>,
    encoder_norm: LayerNorm,
    decoder: Vec<Block>,
    decoder_norm: LayerNorm,
    output: Linear,
}

#[derive(Debug)]
struct Block {
    own: (LayerNorm, Attention),
    cross: Option<(LayerNorm, Attention)>,
    norm: LayerNorm,
    feed: [Linear; 2],
}

impl Block {
    fn new(
        set: &mut ParameterSet,
        hyper: &TrMttHyper,
        name: &str,
        crossed: bool,
    ) -> Result<Self, TrainError> {
        let (size, feed) = (hyper.size, hyper.feed);
        let mut attention = |index: usize, part: &str| {
            let norm = LayerNorm::new(set, &format!("{name}.norm.{index}"), size)?;
            Ok::<_, TrainError>((norm, Attention::new(set, &format!("{name}.{part}"), size, hyper.heads)?))
        };
        let own = attention(0, "attention")?;
        let cross = if crossed { Some(attention(1, "cross")?) } else { None };
        let norm = LayerNorm::new(set, &format!("{name}.norm.{}", 1 + usize::from(crossed)), size)?;
        let feed = [
            Linear::new(set, &format!("{name}.feed.0"), size, feed, Activation::Relu)?,
            Linear::new(set, &format!("{name}.feed.1"), feed, size, Activation::Identity)?,
        ];
        Ok(Self { own, cross, norm, feed })
    }

    fn forward(&self, weights: &Weights, x: Tensor, memory: Option<&Tensor>, mask: &Arc<Mask>) -> Tensor {
        let (norm, attention) = &self.own;
        let normed = norm.forward(weights, x.clone());
        let mut x = x + attention.forward(weights, normed.clone(), normed, mask);
        if let (Some((norm, attention)), Some(memory)) = (&self.cross, memory) {
            let normed = norm.forward(weights, x.clone());
            x = x + attention.forward(weights, normed, memory.clone(), mask);
        }
        let normed = self.norm.forward(weights, x.clone());
        x + self.feed[1].forward(weights, self.feed[0].forward(weights, normed))
    }
}

impl Transformer {
    /// Adds the parameters to a set.
    pub fn new(set: &mut ParameterSet, hyper: &TrMttHyper) -> Result<Self, TrainError> {
        let size = hyper.size;
        let linear = Activation::Identity;
        let embed = Linear::new(set, "embed", hyper.inputs(), size, linear)?;
        let query = Linear::new(set, "query", hyper.inputs(), size, linear)?;
        let mut blocks = |name: &str, count: usize, crossed: bool| {
            (0..count)
                .map(|index| Block::new(set, hyper, &format!("{name}.{index}"), crossed))
                .collect::<Result<Vec<_>, _>>()
        };
        let encoder = blocks("encoder", hyper.encoder, false)?;
        let decoder = blocks("decoder", hyper.decoder, true)?;
        let encoder_norm = LayerNorm::new(set, "encoder.norm", size)?;
        let decoder_norm = LayerNorm::new(set, "decoder.norm", size)?;
        let output = Linear::new(set, "output", size, hyper.outputs(), linear)?;
        let positions = positions(hyper.window, size);
        Ok(Self { positions, size, embed, query, encoder, encoder_norm, decoder, decoder_norm, output })
    }

    /// The outputs of windows: row `window * steps + step`.
    pub fn forward(&self, weights: &Weights, inputs: Tensor, mask: &Arc<Mask>) -> Tensor {
        let rows = mask.seen.len();
        let positions = constant(self.positions.repeat(rows / mask.steps), [rows, self.size]);
        let mut x = self.embed.forward(weights, inputs.clone()) + positions.clone();
        for block in &self.encoder {
            x = block.forward(weights, x, None, mask);
        }
        let memory = self.encoder_norm.forward(weights, x);
        let mut x = self.query.forward(weights, inputs) + positions;
        for block in &self.decoder {
            x = block.forward(weights, x, Some(&memory), mask);
        }
        self.output.forward(weights, self.decoder_norm.forward(weights, x))
    }
}
