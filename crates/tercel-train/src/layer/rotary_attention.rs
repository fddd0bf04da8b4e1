//! Attention of sequences to their own past, with a cache.

use std::sync::Arc;

use tercel_neural::layer::rotate;

use super::{Activation, Linear};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply, detached};
use crate::{ParameterSet, TrainError, Weights};

/// Lets each row of a sequence gather from the rows before it and from itself, step by step.
///
/// ## Recursion
///
/// That of [`tercel_neural::layer::RotaryAttention`], for a batch of sequences in which tokens may be missing.
///
/// Parameters: the linear layers `NAME.query`, `NAME.key`, `NAME.value` and `NAME.output`.
///
/// ## Reference
///
/// J. Su et al., "RoFormer: enhanced transformer with rotary position embedding", arXiv 2104.09864 (2021).
#[derive(Debug, Clone)]
pub struct RotaryAttention {
    heads: usize,
    window: usize,
    query: Linear,
    key: Linear,
    value: Linear,
    output: Linear,
}

/// Keys and values of past steps: row `step * batch + member`.
#[derive(Debug, Clone, Default)]
pub struct KeyValues {
    rows: Option<[Tensor; 2]>,
    /// The number of the token of each row in its sequence, if there was one.
    tokens: Vec<Option<u64>>,
}

impl KeyValues {
    /// The same values, from which no gradient flows back, without steps that no member will look at: `next` is the number of the
    /// next token of each.
    pub fn detached(self, window: usize, next: &[u64]) -> Self {
        let Some(rows) = self.rows else { return self };
        let batch = next.len();
        let seen = |step: &[Option<u64>]| {
            step.iter()
                .zip(next)
                .any(|(token, next)| token.is_some_and(|token| token + window as u64 > *next))
        };
        let steps = self.tokens.len() / batch;
        let first = self.tokens.chunks_exact(batch).position(seen).unwrap_or(steps - 1);
        let rows = rows.map(|rows| detached(rows.narrow(0, first * batch, (steps - first) * batch)));
        KeyValues { rows: Some(rows), tokens: self.tokens[first * batch..].to_vec() }
    }
}

impl RotaryAttention {
    /// Adds the parameters of a layer for rows of `size` numbers, which looks at the last `window` tokens, to a set.
    ///
    /// # Errors
    ///
    /// If a size is zero, the heads do not cut it into pieces of an even width, or the name is taken.
    pub fn new(
        set: &mut ParameterSet,
        name: &str,
        size: usize,
        [heads, window]: [usize; 2],
    ) -> Result<Self, TrainError> {
        if heads == 0 || !size.is_multiple_of(2 * heads) {
            let problem = format!("{heads} heads do not cut a size of {size} into pieces of an even width");
            return Err(TrainError::Parameter { name: name.to_owned(), problem });
        }
        let mut part =
            |part: &str| Linear::new(set, &format!("{name}.{part}"), size, size, Activation::Identity);
        Ok(Self {
            heads,
            window,
            query: part("query")?,
            key: part("key")?,
            value: part("value")?,
            output: part("output")?,
        })
    }

    /// What the next rows gather, `[batch, size]`, and the cache with them. `tokens` are their numbers in their sequences; rows
    /// without one gather nothing and are not seen.
    pub fn step(
        &self,
        weights: &Weights,
        x: Tensor,
        tokens: &Arc<Vec<Option<u64>>>,
        past: KeyValues,
    ) -> (Tensor, KeyValues) {
        let turned = |x: Tensor| apply(Rotate { heads: self.heads, tokens: Arc::clone(tokens) }, [x]);
        let query = turned(self.query.forward(weights, x.clone()));
        let key = turned(self.key.forward(weights, x.clone()));
        let value = self.value.forward(weights, x);
        let rows = match past.rows {
            Some([keys, values]) => [Tensor::cat(vec![keys, key], 0), Tensor::cat(vec![values, value], 0)],
            None => [key, value],
        };
        let mut all = past.tokens;
        all.extend_from_slice(tokens);
        let gather = Gather {
            heads: self.heads,
            window: self.window as u64,
            own: Arc::clone(tokens),
            past: Arc::new(all.clone()),
        };
        let [keys, values] = rows.clone();
        let gathered = apply(gather, [query, keys, values]);
        (self.output.forward(weights, gathered), KeyValues { rows: Some(rows), tokens: all })
    }
}

/// Turns rows by the numbers of their tokens.
#[derive(Debug, Clone)]
struct Rotate {
    heads: usize,
    tokens: Arc<Vec<Option<u64>>>,
}

impl Rotate {
    fn turn(&self, values: &mut [f32]) {
        let size = values.len() / self.tokens.len();
        for (row, token) in values.chunks_exact_mut(size).zip(self.tokens.iter()) {
            rotate(row, self.heads, token.unwrap_or(0));
        }
    }
}

impl Operation<1> for Rotate {
    type Saved = ();

    fn forward(&self, [x]: &[Matrix; 1]) -> Forward<()> {
        let mut values = x.values().to_vec();
        self.turn(&mut values);
        Forward { values, shape: [x.rows(), x.columns()], saved: () }
    }

    fn backward(&self, _: Past<'_, (), 1>, gradient: &[f32]) -> [Option<Vec<f32>>; 1] {
        // The turn back is the turn of the mirror image.
        let mirror = |values: &mut [f32]| values.iter_mut().skip(1).step_by(2).for_each(|x| *x = -*x);
        let mut found = gradient.to_vec();
        mirror(&mut found);
        self.turn(&mut found);
        mirror(&mut found);
        [Some(found)]
    }
}

/// Shares of the values for the queries of one step, of inputs `Q`, `K`, `V`.
#[derive(Debug, Clone)]
struct Gather {
    heads: usize,
    window: u64,
    own: Arc<Vec<Option<u64>>>,
    past: Arc<Vec<Option<u64>>>,
}

impl Gather {
    /// The rows that a member looks at.
    fn seen(&self, member: usize) -> impl Iterator<Item = usize> {
        let (own, window) = (self.own[member], self.window);
        let all = (member..self.past.len()).step_by(self.own.len());
        all.filter(move |row| match (own, self.past[*row]) {
            (Some(own), Some(token)) => token <= own && own - token < window,
            _ => false,
        })
    }
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    let (mut left, mut right) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in (&mut left).zip(&mut right) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f32 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

fn add_scaled(out: &mut [f32], values: &[f32], scale: f32) {
    out.iter_mut().zip(values).for_each(|(out, value)| *out += scale * value);
}

impl Operation<3> for Gather {
    /// The shares: for each member and head those of the rows that it looks at, one after the other.
    type Saved = Vec<f32>;

    fn forward(&self, [query, key, value]: &[Matrix; 3]) -> Forward<Vec<f32>> {
        let size = query.columns();
        let width = size / self.heads;
        let scale = 1.0 / (width as f32).sqrt();
        let mut values = vec![0.0; query.rows() * size];
        let mut saved = Vec::new();
        for (member, out) in values.chunks_exact_mut(size).enumerate() {
            let rows: Vec<usize> = self.seen(member).collect();
            for head in 0..self.heads {
                let part = |input: &Matrix, row: usize| row * input.columns() + head * width;
                let own = &query.values()[part(query, member)..][..width];
                let first = saved.len();
                saved.extend(
                    rows.iter().map(|row| dot(own, &key.values()[part(key, *row)..][..width]) * scale),
                );
                let shares = &mut saved[first..];
                let top = shares.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                shares.iter_mut().for_each(|share| *share = (*share - top).exp());
                let sum: f32 = shares.iter().sum();
                shares.iter_mut().for_each(|share| *share /= sum);
                for (row, share) in rows.iter().zip(&*shares) {
                    let values = &value.values()[part(value, *row)..][..width];
                    add_scaled(&mut out[head * width..][..width], values, *share);
                }
            }
        }
        Forward { values, shape: [query.rows(), size], saved }
    }

    fn backward(&self, past: Past<'_, Vec<f32>, 3>, gradient: &[f32]) -> [Option<Vec<f32>>; 3] {
        let [query, key, value] = past.inputs;
        let size = query.columns();
        let width = size / self.heads;
        let scale = 1.0 / (width as f32).sqrt();
        let mut of_query = vec![0.0; query.rows() * size];
        let [mut of_key, mut of_value] = [0; 2].map(|_| vec![0.0; key.rows() * size]);
        let mut shares = past.saved.as_slice();
        for (member, gradient) in gradient.chunks_exact(size).enumerate() {
            let rows: Vec<usize> = self.seen(member).collect();
            for head in 0..self.heads {
                let (own, rest) = shares.split_at(rows.len());
                shares = rest;
                let at = |row: usize| row * size + head * width..row * size + (head + 1) * width;
                let gradient = &gradient[head * width..][..width];
                let slopes: Vec<f32> =
                    rows.iter().map(|row| dot(gradient, &value.values()[at(*row)])).collect();
                let mean = dot(&slopes, own);
                for ((row, share), slope) in rows.iter().zip(own).zip(&slopes) {
                    add_scaled(&mut of_value[at(*row)], gradient, *share);
                    let slope = share * (slope - mean) * scale;
                    add_scaled(&mut of_query[at(member)], &key.values()[at(*row)], slope);
                    add_scaled(&mut of_key[at(*row)], &query.values()[at(member)], slope);
                }
            }
        }
        [Some(of_query), Some(of_key), Some(of_value)]
    }
}
