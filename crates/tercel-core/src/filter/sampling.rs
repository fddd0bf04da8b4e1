//! What filters made of particles share.

use crate::sensor::Measurement;

/// Number of equally weighted particles that would say as much as these, `1 / Σ wᵢ²`, from logarithms of weights that add
/// up to one.
pub(super) fn effective(ln_weights: &[f64]) -> f64 {
    1.0 / ln_weights.iter().map(|weight| (2.0 * weight).exp()).sum::<f64>()
}

/// Fills `chosen` with `count` copies from a weighted list, each item about as often as its weight says: systematic
/// resampling of Kitagawa (1996), appendix. The weights add up to one, and `offset`, between 0 and 1, is the random part.
pub(crate) fn resample<'a, T: Clone + 'a>(
    weighted: impl Iterator<Item = (f64, &'a T)>,
    offset: f64,
    count: usize,
    chosen: &mut Vec<T>,
) {
    let step = 1.0 / count as f64;
    let mut mark = offset * step;
    let mut sum = 0.0;
    let mut last = None;
    chosen.clear();
    for (weight, item) in weighted {
        sum += weight;
        while mark < sum && chosen.len() < count {
            chosen.push(item.clone());
            mark += step;
        }
        if weight > 0.0 || last.is_none() {
            last = Some(item);
        }
    }
    // The weights add up to one only up to rounding, so the last mark may lie beyond their sum.
    if let Some(last) = last {
        chosen.resize(count, last.clone());
    }
}

/// A seed that differs with every measurement: FNV-1a over the bytes of the filter's seed and the measured values.
pub(crate) fn seed_of<const M: usize>(seed: u64, measurement: &Measurement<M>) -> u64 {
    let values = measurement.value.iter().map(|value| value.to_bits());
    std::iter::once(seed)
        .chain(values)
        .flat_map(u64::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(weights: &[f64], offset: f64, count: usize) -> Vec<usize> {
        let items: Vec<usize> = (0..weights.len()).collect();
        let mut chosen = vec![99];
        resample(weights.iter().copied().zip(&items), offset, count, &mut chosen);
        chosen
    }

    #[test]
    fn items_are_drawn_as_often_as_their_weights_say() {
        assert_eq!(drawn(&[0.5, 0.0, 0.3, 0.2], 0.5, 10), [0, 0, 0, 0, 0, 2, 2, 2, 3, 3]);
        assert_eq!(drawn(&[0.25, 0.75], 0.9, 2), [1, 1]);
    }

    #[test]
    fn weights_that_miss_one_by_rounding_still_fill_the_list() {
        // The last item has no weight, so the gap goes to the one before.
        assert_eq!(drawn(&[0.4, 0.5, 0.0], 0.9999, 4), [0, 1, 1, 1]);
        assert_eq!(drawn(&[f64::NAN, f64::NAN], 0.5, 2), [0, 0]);
    }

    #[test]
    fn equal_weights_are_all_effective() {
        assert!((effective(&[-(4.0_f64.ln()); 4]) - 4.0).abs() < 1e-12);
        assert_eq!(effective(&[0.0, f64::NEG_INFINITY]), 1.0);
    }
}
