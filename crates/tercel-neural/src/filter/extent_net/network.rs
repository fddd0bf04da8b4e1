//! The network: layers that remember, and two heads.

use super::KIND;
use super::frame::{DOUBTED, SEEN, TOLD};
use super::hyper::{Architecture, ExtentNetHyper};
use crate::error::ModelError;
use crate::filter::LABELS;
use crate::filter::memory::{Memory, Room};
use crate::layer::activation::silu;
use crate::layer::{KeyValues, Linear, Lstm, RmsNorm, RotaryAttention, SwiGlu};
use crate::model::{Model, Weights};

/// The network of an [`ExtentNet`](super::ExtentNet).
///
/// It is loaded once and shared by all filters of that model.
#[derive(Debug, Clone, PartialEq)]
pub struct ExtentNetwork {
    hyper: ExtentNetHyper,
    body: Body,
    output: Linear,
    doubt: Linear,
}

#[derive(Debug, Clone, PartialEq)]
enum Body {
    Lstm(Lstm),
    Transformer(Box<Decoder>),
}

#[derive(Debug, Clone, PartialEq)]
struct Decoder {
    embed: Linear,
    blocks: Vec<Block>,
    norm: RmsNorm,
    window: usize,
}

#[derive(Debug, Clone, PartialEq)]
struct Block {
    norms: [RmsNorm; 2],
    attention: RotaryAttention,
    feed: SwiGlu,
}

/// What the network remembers of one object: the cells of an LSTM, or keys and values of each layer of a decoder.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Past {
    cells: Memory,
    caches: Vec<KeyValues>,
}

impl Past {
    /// Forgets everything.
    fn clear(&mut self) {
        self.cells.stage().0.fill(0.0);
        self.cells.commit();
        self.caches.iter_mut().for_each(KeyValues::clear);
    }

    pub fn merge(&mut self, weight: f64, other: &Past, other_weight: f64) {
        self.cells.merge(weight, &other.cells, other_weight);
        for (ours, theirs) in self.caches.iter_mut().zip(&other.caches) {
            ours.merge(weight, theirs, other_weight);
        }
    }
}

impl Decoder {
    fn take(weights: &mut Weights<'_>, architecture: [usize; 5]) -> Result<Self, ModelError> {
        let [size, heads, layers, feed, window] = architecture;
        let embed = weights.linear("embed", SEEN, size)?;
        let block = |index: usize| {
            let name = |part: &str| format!("block.{index}.{part}");
            Ok::<_, ModelError>(Block {
                norms: [weights.rms_norm(&name("norm.0"), size)?, weights.rms_norm(&name("norm.1"), size)?],
                attention: weights.rotary_attention(&name("attention"), size, heads)?,
                feed: weights.swi_glu(&name("feed"), size, feed)?,
            })
        };
        let blocks = (0..layers).map(block).collect::<Result<Vec<_>, _>>()?;
        Ok(Decoder { embed, blocks, norm: weights.rms_norm("norm", size)?, window })
    }

    fn scratch(&self) -> usize {
        let inner = |block: &Block| block.attention.scratch(self.window).max(block.feed.scratch(1));
        3 * self.norm.size() + self.blocks.iter().map(inner).max().unwrap_or(0)
    }

    /// The row of a token after all layers.
    fn step<'r>(&self, seen: &[f32], caches: &mut [KeyValues], mut room: Room<'r>) -> &'r [f32] {
        let size = self.norm.size();
        let (x, normed, change) = (room.take(size), room.take(size), room.take(size));
        self.embed.forward(seen, x);
        silu(x);
        for (block, cache) in self.blocks.iter().zip(caches) {
            block.norms[0].forward(x, normed);
            block.attention.step(normed, cache, change, room.0);
            x.iter_mut().zip(&*change).for_each(|(x, change)| *x += change);
            block.norms[1].forward(x, normed);
            block.feed.forward(normed, change, room.0);
            x.iter_mut().zip(&*change).for_each(|(x, change)| *x += change);
        }
        self.norm.forward(x, normed);
        normed
    }
}

impl ExtentNetwork {
    /// Builds the network of a model of the kind `extent-net`.
    ///
    /// # Errors
    /// When the model is of another kind, made for another state than `x, y, vx, vy`, its options make no sense, or its tensors
    /// are not those of the architecture.
    pub fn from_model(model: &Model) -> Result<Self, ModelError> {
        model.expect(KIND, &LABELS)?;
        let hyper = ExtentNetHyper::of(model)?;
        let mut weights = model.weights();
        let body = match hyper.architecture {
            Architecture::Lstm { units } => Body::Lstm(weights.lstm("memory", SEEN, units)?),
            Architecture::Transformer { size, heads, layers, feed, window } => {
                let decoder = Decoder::take(&mut weights, [size, heads, layers, feed, window])?;
                Body::Transformer(Box::new(decoder))
            }
        };
        let size = hyper.architecture.size();
        let output = weights.linear("output", size, TOLD)?;
        let doubt = weights.linear("doubt", size, DOUBTED)?;
        weights.finish()?;
        Ok(ExtentNetwork { hyper, body, output, doubt })
    }

    /// Sizes and options.
    pub fn hyper(&self) -> &ExtentNetHyper {
        &self.hyper
    }

    /// The memory of an object of which nothing was seen.
    pub(super) fn past(&self) -> Past {
        let own = SEEN + TOLD + DOUBTED;
        match &self.body {
            Body::Lstm(layer) => {
                let cells = vec![0.0; 2 * layer.size()];
                Past { cells: Memory::new(&cells, own + layer.scratch(1)), caches: Vec::new() }
            }
            Body::Transformer(decoder) => {
                let cache = KeyValues::new(decoder.norm.size(), decoder.window);
                let caches = vec![cache; decoder.blocks.len()];
                Past { cells: Memory::new(&[], own + decoder.scratch()), caches }
            }
        }
    }

    /// What the network says of a scan. Where that is not finite it forgets the object, and says nothing.
    pub(super) fn step(&self, seen: &[f64; SEEN], past: &mut Past) -> Option<([f64; TOLD], [f64; DOUBTED])> {
        let Past { cells, caches } = past;
        let (next, scratch) = cells.stage();
        let mut room = Room(scratch);
        let (inputs, told, doubted) = (room.take(SEEN), room.take(TOLD), room.take(DOUBTED));
        inputs.iter_mut().zip(seen).for_each(|(to, value)| *to = *value as f32);
        let row = match &self.body {
            Body::Lstm(layer) => {
                let (output, cell) = next.split_at_mut(layer.size());
                layer.step(inputs, output, cell, room.0);
                &*output
            }
            Body::Transformer(decoder) => decoder.step(inputs, caches, room),
        };
        self.output.forward(row, told);
        self.doubt.forward(row, doubted);
        let finite = told.iter().chain(&*doubted).all(|value| value.is_finite());
        let said =
            (std::array::from_fn(|i| f64::from(told[i])), std::array::from_fn(|i| f64::from(doubted[i])));
        if finite {
            cells.commit();
            return Some(said);
        }
        past.clear();
        None
    }
}
