//! Attention with several heads.

use super::Linear;
use super::activation::softmax;
use super::dispatch::{Arithmetic, Kernel, dispatch};

/// Lets each row of one sequence gather from the rows of another, or of the same one.
///
/// ## Definition
/// With queries `Q = x Wq + bq`, keys `K = m Wk + bk` and values `V = m Wv + bv` of a sequence `x` and a memory `m`, cut into
/// heads of `size / heads` columns:
/// ```text
/// head = softmax(Q Kᵀ / √(size / heads)) V          rows of m that are masked get no share
/// y    = [head ..] Wo + bo
/// ```
/// A model file holds the linear layers `NAME.query`, `NAME.key`, `NAME.value` and `NAME.output`, all `[size, size]`.
///
/// ## Use it when
/// what matters lies anywhere in a window. The cost grows with the square of its length.
///
/// ## Reference
/// Vaswani et al. (2017), section 3.2.
///
/// ```
/// use tercel_neural::layer::{Attention, Linear};
///
/// let zero = || Linear::new(2, 2, &[0.0; 4], &[0.0; 2]);
/// let same = || Linear::new(2, 2, &[1.0, 0.0, 0.0, 1.0], &[0.0; 2]);
/// // Queries of zero weigh all rows alike: the result is the mean of those that are not masked.
/// let layer = Attention::new(1, zero(), zero(), same(), same());
/// let memory = [1.0, 2.0, 3.0, 4.0, 9.0, 9.0];
/// let (mut y, mut scratch) = ([0.0; 2], vec![0.0; layer.scratch(1, 3)]);
/// layer.forward(&[0.0, 0.0], &memory, &[1.0, 1.0, 0.0], &mut y, &mut scratch);
/// assert_eq!(y, [2.0, 3.0]);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Attention {
    heads: usize,
    query: Linear,
    key: Linear,
    value: Linear,
    output: Linear,
}

impl Attention {
    /// A layer of these heads.
    ///
    /// # Panics
    /// When a layer is not square, the sizes differ, or the heads do not divide them.
    pub fn new(heads: usize, query: Linear, key: Linear, value: Linear, output: Linear) -> Self {
        let size = query.outputs();
        for layer in [&query, &key, &value, &output] {
            assert_eq!([layer.inputs(), layer.outputs()], [size; 2], "sizes of an attention layer");
        }
        assert!(heads > 0 && size.is_multiple_of(heads), "{heads} heads in a size of {size}");
        Attention { heads, query, key, value, output }
    }

    /// Width of a row.
    pub fn size(&self) -> usize {
        self.query.outputs()
    }

    /// Numbers of scratch space for these numbers of rows of the sequence and of the memory.
    pub fn scratch(&self, rows: usize, memory: usize) -> usize {
        2 * self.size() * (rows + memory) + memory
    }

    /// Writes what the rows of `input` gather from those of `memory`, of which those with a `mask` of zero are left out.
    ///
    /// # Panics
    /// When the slices do not fit each other, or the scratch space is too small.
    pub fn forward(
        &self,
        input: &[f32],
        memory: &[f32],
        mask: &[f32],
        output: &mut [f32],
        scratch: &mut [f32],
    ) {
        let (size, keys) = (self.size(), mask.len());
        super::same_batch(&[(memory.len(), size), (keys, 1)]);
        let rows = super::same_batch(&[(input.len(), size), (output.len(), size)]);
        let (queries, rest) = scratch.split_at_mut(rows * size);
        let (mixed, rest) = rest.split_at_mut(rows * size);
        let (values, rest) = rest.split_at_mut(keys * size);
        let (turned, rest) = rest.split_at_mut(keys * size);
        let shares = &mut rest[..keys];
        self.query.forward(input, queries);
        // Keys are needed column by column; the values' place serves until it is filled.
        self.key.forward(memory, values);
        for (key, row) in values.chunks_exact(size).enumerate() {
            row.iter().enumerate().for_each(|(column, value)| turned[column * keys + key] = *value);
        }
        self.value.forward(memory, values);
        let width = size / self.heads;
        let scale = 1.0 / (width as f32).sqrt();
        for (query, mixed) in queries.chunks_exact(size).zip(mixed.chunks_exact_mut(size)) {
            for head in 0..self.heads {
                let own = head * width..(head + 1) * width;
                let columns = &turned[own.start * keys..own.end * keys];
                dispatch(Scores { query: &query[own.clone()], columns, scale, shares });
                for (share, mask) in shares.iter_mut().zip(mask) {
                    if *mask == 0.0 {
                        *share = f32::NEG_INFINITY;
                    }
                }
                softmax(keys, shares);
                dispatch(Mix { shares, values, size, own: own.clone(), mixed: &mut mixed[own] });
            }
        }
        self.output.forward(mixed, output);
    }
}

/// Scaled products of a query with all keys, which lie column by column.
pub(super) struct Scores<'a> {
    pub query: &'a [f32],
    pub columns: &'a [f32],
    pub scale: f32,
    pub shares: &'a mut [f32],
}

impl Kernel for Scores<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, _: A) {
        let Scores { query, columns, scale, shares } = self;
        shares.fill(0.0);
        for (factor, column) in query.iter().zip(columns.chunks_exact(shares.len())) {
            let factor = factor * scale;
            shares.iter_mut().zip(column).for_each(|(share, key)| *share = A::fused(factor, *key, *share));
        }
    }
}

/// The mean of the values under the shares, for the columns of one head.
pub(super) struct Mix<'a> {
    pub shares: &'a [f32],
    pub values: &'a [f32],
    pub size: usize,
    pub own: std::ops::Range<usize>,
    pub mixed: &'a mut [f32],
}

impl Kernel for Mix<'_> {
    #[inline(always)]
    fn run<A: Arithmetic>(self, _: A) {
        let Mix { shares, values, size, own, mixed } = self;
        mixed.fill(0.0);
        for (share, row) in shares.iter().zip(values.chunks_exact(size)) {
            for (mixed, value) in mixed.iter_mut().zip(&row[own.clone()]) {
                *mixed = A::fused(*share, *value, *mixed);
            }
        }
    }
}

/// Sinusoidal positions: rows that tell the steps of a sequence apart, `[steps, size]`.
///
/// ```text
/// p(t, 2i) = sin(t / 10000^(2i/size))        p(t, 2i+1) = cos(t / 10000^(2i/size))
/// ```
///
/// ## Reference
/// Vaswani et al. (2017), section 3.5.
///
/// ```
/// assert_eq!(tercel_neural::layer::positions(1, 4), [0.0, 1.0, 0.0, 1.0]);
/// ```
pub fn positions(steps: usize, size: usize) -> Vec<f32> {
    let place = |index: usize| (index / size, index % size);
    (0..steps * size)
        .map(|index| {
            let (step, column) = place(index);
            let exponent = (column - column % 2) as f64 / size as f64;
            let angle = step as f64 / 10_000_f64.powf(exponent);
            (if column % 2 == 0 { angle.sin() } else { angle.cos() }) as f32
        })
        .collect()
}
