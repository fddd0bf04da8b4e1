//! Attention of a sequence to its own past, with a cache.

use super::Linear;
use super::activation::softmax;
use super::attention::{Mix, Scores};
use super::dispatch::dispatch;

/// Lets each row of a sequence gather from the rows before it and from itself, step by step.
///
/// ## Recursion
/// With the query `q`, key `k` and value `v` of step `t`, cut into heads of `w = size / heads` columns, and `R(t)` that turns the
/// columns `2i` and `2i+1` of a head by the angle `t 10000^(-2i/w)`:
/// ```text
/// q = R(t) (x Wq + bq)      k = R(t) (x Wk + bk)      v = x Wv + bv           k, v: into the cache
/// y = [softmax(q Kᵀ / √w) V ..] Wo + bo                                       over the last steps, this one included
/// ```
/// The share of a past step depends on how long ago it was and not on when the sequence began. A model file holds the linear
/// layers `NAME.query`, `NAME.key`, `NAME.value` and `NAME.output`, all `[size, size]`.
///
/// ## Use it when
/// a transformer follows a stream. A step costs the same however long the stream is; what is older than the cache is forgotten.
///
/// ## Reference
/// Su et al. (2021); causal attention after Vaswani et al. (2017).
///
/// ```
/// use tercel_neural::layer::{KeyValues, Linear, RotaryAttention};
///
/// let zero = || Linear::new(2, 2, &[0.0; 4], &[0.0; 2]);
/// let same = || Linear::new(2, 2, &[1.0, 0.0, 0.0, 1.0], &[0.0; 2]);
/// // Queries of zero weigh all steps alike: the result is the mean of the last two.
/// let layer = RotaryAttention::new(1, zero(), zero(), same(), same());
/// let mut past = KeyValues::new(2, 2);
/// let (mut y, mut scratch) = ([0.0; 2], vec![0.0; layer.scratch(2)]);
/// for x in [9.0, 1.0, 3.0] {
///     layer.step(&[x, -x], &mut past, &mut y, &mut scratch);
/// }
/// assert_eq!(y, [2.0, -2.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RotaryAttention {
    heads: usize,
    query: Linear,
    key: Linear,
    value: Linear,
    output: Linear,
}

/// Keys and values of the last steps of one sequence, in a ring.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyValues {
    window: usize,
    /// Steps so far.
    count: u64,
    /// Column by column, a slot for each step.
    keys: Vec<f32>,
    /// Slot by slot.
    values: Vec<f32>,
}

impl KeyValues {
    /// Room for the last `window` steps of rows of `size` numbers.
    ///
    /// # Panics
    /// When there is no room for one.
    pub fn new(size: usize, window: usize) -> Self {
        assert!(window > 0, "a cache of keys and values needs room for a step");
        KeyValues { window, count: 0, keys: vec![0.0; size * window], values: vec![0.0; size * window] }
    }

    /// Steps that are remembered.
    pub fn len(&self) -> usize {
        self.window.min(usize::try_from(self.count).unwrap_or(usize::MAX))
    }

    /// Whether nothing is remembered.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.count = 0;
        self.keys.fill(0.0);
        self.values.fill(0.0);
    }

    /// Replaces what is remembered by the mean of it and of `other` under these weights if both are of the same step, and
    /// otherwise by that of the greater weight.
    ///
    /// # Panics
    /// When the two are caches of different layers.
    pub fn merge(&mut self, weight: f64, other: &KeyValues, other_weight: f64) {
        assert_eq!(
            (self.keys.len(), self.window),
            (other.keys.len(), other.window),
            "caches of different layers"
        );
        if self.count != other.count {
            if other_weight > weight {
                self.count = other.count;
                self.keys.copy_from_slice(&other.keys);
                self.values.copy_from_slice(&other.values);
            }
            return;
        }
        let total = weight + other_weight;
        let share = if total > 0.0 { (other_weight / total) as f32 } else { 0.0 };
        let all = self.keys.iter_mut().chain(&mut self.values).zip(other.keys.iter().chain(&other.values));
        all.for_each(|(ours, theirs)| *ours += share * (theirs - *ours));
    }
}

/// Turns the columns of each head of a row as those of step `step`.
///
/// ```
/// let mut row = [1.0, 0.0, 1.0, 0.0];
/// tercel_neural::layer::rotate(&mut row, 2, 1);
/// assert!((row[0] - f32::cos(1.0)).abs() < 1e-6 && row[1] == row[3]);
/// ```
pub fn rotate(row: &mut [f32], heads: usize, step: u64) {
    let width = row.len() / heads;
    for first in (0..width).step_by(2) {
        // In double precision: steps may be many.
        let angle = step as f64 / 10_000_f64.powf(first as f64 / width as f64);
        let (sine, cosine) = angle.sin_cos();
        let (sine, cosine) = (sine as f32, cosine as f32);
        for head in row.chunks_exact_mut(width) {
            let (a, b) = (head[first], head[first + 1]);
            (head[first], head[first + 1]) = (a * cosine - b * sine, a * sine + b * cosine);
        }
    }
}

impl RotaryAttention {
    /// A layer of these heads.
    ///
    /// # Panics
    /// When a layer is not square, the sizes differ, or the heads do not cut them into pieces of an even width.
    pub fn new(heads: usize, query: Linear, key: Linear, value: Linear, output: Linear) -> Self {
        let size = query.outputs();
        for layer in [&query, &key, &value, &output] {
            assert_eq!([layer.inputs(), layer.outputs()], [size; 2], "sizes of an attention layer");
        }
        assert!(heads > 0 && size.is_multiple_of(2 * heads), "{heads} heads in a size of {size}");
        RotaryAttention { heads, query, key, value, output }
    }

    /// Width of a row.
    pub fn size(&self) -> usize {
        self.query.outputs()
    }

    /// Numbers of scratch space for a cache of this many steps.
    pub fn scratch(&self, window: usize) -> usize {
        2 * self.size() + window
    }

    /// Writes what the next row of a sequence gathers, and puts it into the cache in the place of the oldest.
    ///
    /// # Panics
    /// When the slices or the cache do not fit the layer, or the scratch space is too small.
    pub fn step(&self, input: &[f32], past: &mut KeyValues, output: &mut [f32], scratch: &mut [f32]) {
        let (size, window) = (self.size(), past.window);
        super::same_batch(&[(input.len(), size), (output.len(), size), (past.values.len(), size * window)]);
        let (query, rest) = scratch.split_at_mut(size);
        let (mixed, rest) = rest.split_at_mut(size);
        let shares = &mut rest[..window];
        let slot = (past.count % window as u64) as usize;
        self.key.forward(input, query);
        rotate(query, self.heads, past.count);
        for (column, key) in past.keys.chunks_exact_mut(window).zip(&*query) {
            column[slot] = *key;
        }
        self.value.forward(input, &mut past.values[slot * size..][..size]);
        self.query.forward(input, query);
        rotate(query, self.heads, past.count);
        past.count += 1;
        let (width, used) = (size / self.heads, past.len());
        let scale = 1.0 / (width as f32).sqrt();
        for head in 0..self.heads {
            let own = head * width..(head + 1) * width;
            let columns = &past.keys[own.start * window..own.end * window];
            dispatch(Scores { query: &query[own.clone()], columns, scale, shares });
            shares[used..].fill(f32::NEG_INFINITY);
            softmax(window, shares);
            let mixed = &mut mixed[own.clone()];
            dispatch(Mix { shares: &shares[..used], values: &past.values, size, own, mixed });
        }
        self.output.forward(mixed, output);
    }
}
