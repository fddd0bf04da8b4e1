//! Attention with several heads.

use std::sync::Arc;

use super::{Activation, Linear};
use crate::backend::product::{add_product, add_product_transposed, add_transposed_product};
use crate::backend::{Forward, Matrix, Operation, Past, Tensor, apply};
use crate::{ParameterSet, TrainError, Weights};

/// Lets each row of one sequence gather from the rows of another, or of the same one.
///
/// ## Definition
///
/// With queries `Q = x Wq + bq`, keys `K = m Wk + bk` and values `V = m Wv + bv`, cut into heads of `size / heads` columns:
///
/// ```text
/// head = softmax(Q Kᵀ / √(size / heads)) V          rows of m that are masked get no share
/// y    = [head ..] Wo + bo
/// ```
///
/// Parameters: the linear layers `NAME.query`, `NAME.key`, `NAME.value` and `NAME.output`. Unlike for recurrent layers, the rows
/// of a window lie together: row `window * steps + step`.
///
/// ## Reference
///
/// A. Vaswani et al., "Attention is all you need", NeurIPS 2017, section 3.2.
#[derive(Debug, Clone)]
pub struct Attention {
    heads: usize,
    query: Linear,
    key: Linear,
    value: Linear,
    output: Linear,
}

impl Attention {
    /// Adds the parameters of a layer for rows of `size` numbers to a set.
    ///
    /// # Errors
    ///
    /// If the size is zero, the heads do not divide it, or the name is taken.
    pub fn new(set: &mut ParameterSet, name: &str, size: usize, heads: usize) -> Result<Self, TrainError> {
        if heads == 0 || !size.is_multiple_of(heads) {
            let problem = format!("{heads} heads do not divide a size of {size}");
            return Err(TrainError::Parameter { name: name.to_owned(), problem });
        }
        let mut part =
            |part: &str| Linear::new(set, &format!("{name}.{part}"), size, size, Activation::Identity);
        Ok(Self {
            heads,
            query: part("query")?,
            key: part("key")?,
            value: part("value")?,
            output: part("output")?,
        })
    }

    /// What the rows of `x` gather from those of `memory`, window by window. The mask has a number for each row of the memory,
    /// zero where it is left out, and not all of a window.
    pub fn forward(&self, weights: &Weights, x: Tensor, memory: Tensor, mask: &Arc<Mask>) -> Tensor {
        let query = self.query.forward(weights, x);
        let key = self.key.forward(weights, memory.clone());
        let value = self.value.forward(weights, memory);
        let gather = Gather { heads: self.heads, mask: Arc::clone(mask) };
        self.output.forward(weights, apply(gather, [query, key, value]))
    }
}

/// Which rows of windows may be looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    /// Rows of a window.
    pub steps: usize,
    /// For each row of each window, zero if it is left out.
    pub seen: Vec<f32>,
}

/// Shares of the values for the queries, of inputs `Q`, `K`, `V`.
#[derive(Debug, Clone)]
struct Gather {
    heads: usize,
    mask: Arc<Mask>,
}

/// One head of one window: its rows packed together.
struct Head {
    rows: Vec<f32>,
    first: usize,
    steps: usize,
    columns: usize,
    start: usize,
    width: usize,
}

impl Head {
    fn of(values: &[f32], columns: usize, [first, steps, start, width]: [usize; 4]) -> Self {
        let rows = (first..first + steps).flat_map(|row| &values[row * columns + start..][..width]);
        Head { rows: rows.copied().collect(), first, steps, columns, start, width }
    }

    fn empty(columns: usize, [first, steps, start, width]: [usize; 4]) -> Self {
        Head { rows: vec![0.0; steps * width], first, steps, columns, start, width }
    }

    fn store(&self, values: &mut [f32]) {
        for (row, from) in (self.first..self.first + self.steps).zip(self.rows.chunks_exact(self.width)) {
            values[row * self.columns + self.start..][..self.width].copy_from_slice(from);
        }
    }
}

impl Gather {
    /// The places of all heads: first row, rows, first column, columns.
    fn places(&self, columns: usize) -> impl Iterator<Item = [usize; 4]> {
        let (steps, width) = (self.mask.steps, columns / self.heads);
        let (windows, heads) = (self.mask.seen.len() / steps, self.heads);
        (0..windows)
            .flat_map(move |window| (0..heads).map(move |head| [window * steps, steps, head * width, width]))
    }
}

impl Operation<3> for Gather {
    /// The shares of all heads, `[steps, steps]` each.
    type Saved = Vec<f32>;

    fn forward(&self, [query, key, value]: &[Matrix; 3]) -> Forward<Self::Saved> {
        let columns = query.columns();
        let mut values = vec![0.0; query.rows() * columns];
        let mut saved = Vec::with_capacity(self.mask.seen.len() * self.mask.steps * self.heads);
        for place in self.places(columns) {
            let [first, steps, _, width] = place;
            let [q, k, v] = [query, key, value].map(|input| Head::of(input.values(), columns, place));
            let mut shares = vec![0.0; steps * steps];
            add_product_transposed(&mut shares, &q.rows, &k.rows, [steps, width, steps]);
            let scale = 1.0 / (width as f32).sqrt();
            for row in shares.chunks_exact_mut(steps) {
                softmax(row, &self.mask.seen[first..first + steps], scale);
            }
            let mut out = Head::empty(columns, place);
            add_product(&mut out.rows, &shares, &v.rows, [steps, steps, width]);
            out.store(&mut values);
            saved.extend_from_slice(&shares);
        }
        Forward { values, shape: [query.rows(), columns], saved }
    }

    fn backward(&self, past: Past<'_, Self::Saved, 3>, gradient: &[f32]) -> [Option<Vec<f32>>; 3] {
        let [query, key, value] = past.inputs;
        let columns = query.columns();
        let mut found = [0; 3].map(|_| vec![0.0; gradient.len()]);
        for (index, place) in self.places(columns).enumerate() {
            let [_, steps, _, width] = place;
            let [q, k, v] = [query, key, value].map(|input| Head::of(input.values(), columns, place));
            let g = Head::of(gradient, columns, place);
            let shares = &past.saved[index * steps * steps..][..steps * steps];
            let [mut of_q, mut of_k, mut of_v] = [0; 3].map(|_| Head::empty(columns, place));
            add_transposed_product(&mut of_v.rows, shares, &g.rows, [steps, steps, width]);
            let mut of_scores = vec![0.0; steps * steps];
            add_product_transposed(&mut of_scores, &g.rows, &v.rows, [steps, width, steps]);
            let scale = 1.0 / (width as f32).sqrt();
            for (of, shares) in of_scores.chunks_exact_mut(steps).zip(shares.chunks_exact(steps)) {
                let mean: f32 = of.iter().zip(shares).map(|(of, share)| of * share).sum();
                of.iter_mut().zip(shares).for_each(|(of, share)| *of = share * (*of - mean) * scale);
            }
            add_product(&mut of_q.rows, &of_scores, &k.rows, [steps, steps, width]);
            add_transposed_product(&mut of_k.rows, &of_scores, &q.rows, [steps, steps, width]);
            for (head, found) in [of_q, of_k, of_v].iter().zip(&mut found) {
                head.store(found);
            }
        }
        found.map(Some)
    }
}

/// Shares of a row of scores times `scale`, without those that are masked.
fn softmax(scores: &mut [f32], mask: &[f32], scale: f32) {
    let seen = |mask: &f32| *mask != 0.0;
    let tops = scores.iter().zip(mask).filter(|(_, mask)| seen(mask)).map(|(score, _)| *score);
    let top = tops.fold(f32::NEG_INFINITY, f32::max);
    for (score, mask) in scores.iter_mut().zip(mask) {
        *score = if seen(mask) { ((*score - top) * scale).exp() } else { 0.0 };
    }
    let sum: f32 = scores.iter().sum();
    scores.iter_mut().for_each(|score| *score /= sum);
}
