//! The network, differentiable.

use std::sync::Arc;

use tercel_neural::filter::extent_net::{Architecture, DOUBTED, SEEN, TOLD};

use crate::backend::{Tensor, constant, detached};
use crate::layer::{Activation, KeyValues, Linear, Lstm, LstmState, RmsNorm, RotaryAttention, SwiGlu, silu};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The network of [`tercel_neural::filter::ExtentNetwork`].
#[derive(Debug)]
pub struct Network {
    body: Body,
    output: Linear,
    doubt: Linear,
}

#[derive(Debug)]
enum Body {
    Lstm(Lstm),
    Transformer { embed: Linear, blocks: Vec<Block>, norm: RmsNorm, window: usize },
}

#[derive(Debug)]
struct Block {
    norms: [RmsNorm; 2],
    attention: RotaryAttention,
    feed: SwiGlu,
}

/// What the network remembers of a batch.
#[derive(Debug, Clone)]
pub enum Past {
    Lstm(Box<LstmState>),
    Transformer(Vec<KeyValues>),
}

impl Network {
    pub fn new(set: &mut ParameterSet, architecture: &Architecture) -> Result<Self, TrainError> {
        let size = architecture.size();
        let body = match *architecture {
            Architecture::Lstm { units } => Body::Lstm(Lstm::new(set, "memory", SEEN, units)?),
            Architecture::Transformer { size, heads, layers, feed, window } => {
                let embed = Linear::new(set, "embed", SEEN, size, Activation::Identity)?;
                let mut block = |index: usize| {
                    let name = |part: &str| format!("block.{index}.{part}");
                    Ok::<_, TrainError>(Block {
                        norms: [
                            RmsNorm::new(set, &name("norm.0"), size)?,
                            RmsNorm::new(set, &name("norm.1"), size)?,
                        ],
                        attention: RotaryAttention::new(set, &name("attention"), size, [heads, window])?,
                        feed: SwiGlu::new(set, &name("feed"), size, feed)?,
                    })
                };
                let blocks = (0..layers).map(&mut block).collect::<Result<Vec<_>, _>>()?;
                Body::Transformer { embed, blocks, norm: RmsNorm::new(set, "norm", size)?, window }
            }
        };
        // What it is not sure of at first it says nothing of.
        let mut head = |name: &str, outputs: usize, weight: Initial| {
            let bias = Initial::Constant(0.0);
            Linear::with_initial(set, name, [size, outputs], Activation::Identity, [weight, bias])
        };
        let small = Initial::Uniform { bound: 0.1 / (size as f32).sqrt() };
        let output = head("output", TOLD, small)?;
        let doubt = head("doubt", DOUBTED, Initial::Constant(0.0))?;
        Ok(Network { body, output, doubt })
    }

    /// The memory of a batch of which nothing was seen.
    pub fn past(&self, members: usize) -> Past {
        match &self.body {
            Body::Lstm(layer) => Past::Lstm(Box::new(LstmState::zero(members, layer.size()))),
            Body::Transformer { blocks, .. } => Past::Transformer(vec![KeyValues::default(); blocks.len()]),
        }
    }

    /// The same memory, from which no gradient flows back. `next` are the numbers of the next scans.
    pub fn detached(&self, past: Past, next: &[u64]) -> Past {
        match (past, &self.body) {
            (Past::Transformer(caches), Body::Transformer { window, .. }) => {
                Past::Transformer(caches.into_iter().map(|cache| cache.detached(*window, next)).collect())
            }
            (Past::Lstm(state), _) => Past::Lstm(Box::new(state.detached())),
            (past, _) => past,
        }
    }

    /// What the network says of scans, `[members, TOLD]`, and how sure it is, `[members, DOUBTED]`. `scans` are their numbers; members
    /// without one remember what they did.
    pub fn step(
        &self,
        weights: &Weights,
        seen: Tensor,
        scans: &Arc<Vec<Option<u64>>>,
        past: Past,
    ) -> (Tensor, Tensor, Past) {
        let (row, past) = match (&self.body, past) {
            (Body::Transformer { embed, blocks, norm, .. }, Past::Transformer(caches)) => {
                let mut x = silu(embed.forward(weights, seen));
                let mut next = Vec::with_capacity(blocks.len());
                for (block, cache) in blocks.iter().zip(caches) {
                    let normed = block.norms[0].forward(weights, x.clone());
                    let (change, cache) = block.attention.step(weights, normed, scans, cache);
                    x = x + change;
                    let normed = block.norms[1].forward(weights, x.clone());
                    x = x + block.feed.forward(weights, normed);
                    next.push(cache);
                }
                (norm.forward(weights, x), Past::Transformer(next))
            }
            (Body::Lstm(layer), Past::Lstm(before)) => {
                let after = kept(layer.step(weights, seen, (*before).clone()), *before, scans);
                (after.hidden.clone(), Past::Lstm(Box::new(after)))
            }
            // A network makes its own memory.
            (_, past) => (seen, past),
        };
        // What is said of the doubt leaves the estimates as they are.
        let doubt = self.doubt.forward(weights, detached(row.clone()));
        (self.output.forward(weights, row), doubt, past)
    }
}

/// The memory after a step of the members that have a scan, and before it of the others.
fn kept(after: LstmState, before: LstmState, scans: &[Option<u64>]) -> LstmState {
    if scans.iter().all(Option::is_some) {
        return after;
    }
    let [members, size] = after.hidden.dims();
    let mask = |of: fn(&Option<u64>) -> bool| {
        let rows = scans.iter().flat_map(|scan| std::iter::repeat_n(f32::from(u8::from(of(scan))), size));
        constant(rows.collect(), [members, size])
    };
    let (new, old) = (mask(Option::is_some), mask(Option::is_none));
    let mixed = |after: Tensor, before: Tensor| after * new.clone() + before * old.clone();
    LstmState { hidden: mixed(after.hidden, before.hidden), cell: mixed(after.cell, before.cell) }
}
