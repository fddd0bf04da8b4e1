//! Instance normalisation that knows only the past.

/// Added to the variance, so that a channel that never changed gives zero.
const EPSILON: f32 = 1e-5;

/// Normalises each channel of a sequence by the mean and variance of its steps so far.
///
/// ## Recursion
/// With step `t`, sum of squared deviations `M` and the input `x` of a channel:
/// ```text
/// m' = m + (x - m) / t        M' = M + (x - m)(x - m')        y = (x - m') / √(M' / t + 1e-5)
/// ```
/// The memory of a row is `t`, then `m` of each channel, then `M` of each.
///
/// ## Use it when
/// a network was trained on normalised sequences and must run as they come. The usual instance normalisation takes the whole
/// sequence, its future included.
///
/// ## Reference
/// Welford (1962) for the recursion; Ulyanov et al. (2016) for the normalisation, without its affine part.
///
/// ```
/// use tercel_neural::layer::RunningNorm;
///
/// let norm = RunningNorm::new(1);
/// let (mut memory, mut y) = (vec![0.0; norm.memory()], [0.0]);
/// norm.step(&[5.0], &mut memory, &mut y);
/// assert_eq!(y, [0.0]);
/// norm.step(&[7.0], &mut memory, &mut y);
/// assert!((y[0] - 1.0).abs() < 1e-4);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunningNorm {
    channels: usize,
}

impl RunningNorm {
    /// For rows of this many channels.
    pub fn new(channels: usize) -> Self {
        RunningNorm { channels }
    }

    /// Numbers that a row remembers. A new memory is all zeros.
    pub fn memory(&self) -> usize {
        1 + 2 * self.channels
    }

    /// Takes the input `[batch, channels]` into the memory `[batch, 1 + 2 channels]`, and writes it normalised.
    ///
    /// # Panics
    /// When the slices do not hold the same number of rows.
    pub fn step(&self, input: &[f32], memory: &mut [f32], output: &mut [f32]) {
        let (channels, held) = (self.channels, self.memory());
        super::same_batch(&[(input.len(), channels), (memory.len(), held), (output.len(), channels)]);
        let rows = input.chunks_exact(channels).zip(memory.chunks_exact_mut(held));
        for ((input, memory), output) in rows.zip(output.chunks_exact_mut(channels)) {
            let (count, moments) = memory.split_at_mut(1);
            let (means, squares) = moments.split_at_mut(channels);
            count[0] += 1.0;
            let count = count[0];
            for (((x, mean), square), y) in input.iter().zip(means).zip(squares).zip(output) {
                let before = x - *mean;
                *mean += before / count;
                let after = x - *mean;
                *square += before * after;
                *y = after / (*square / count + EPSILON).sqrt();
            }
        }
    }
}
