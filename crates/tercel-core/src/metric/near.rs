//! Which points of two sets are near each other.

use super::scale::euclidean;

/// Points sorted along the axis over which they are spread widest, so that the few near a place are found without looking
/// at all.
///
/// ```
/// use tercel_core::metric::NearIndex;
///
/// let index = NearIndex::new(&[[0.0, 0.0], [500.0, 0.0], [3.0, 4.0]]);
/// let mut near: Vec<(usize, f64)> = index.within(&[0.0, 0.0], 5.0).collect();
/// near.sort_by_key(|entry| entry.0);
/// assert_eq!(near, [(0, 0.0), (2, 5.0)]);
/// ```
#[derive(Debug, Clone)]
pub struct NearIndex<'a, const D: usize> {
    points: &'a [[f64; D]],
    axis: usize,
    /// Numbers of the points, by rising coordinate on the axis.
    sorted: Vec<usize>,
}

impl<'a, const D: usize> NearIndex<'a, D> {
    /// Sorts the points (m).
    pub fn new(points: &'a [[f64; D]]) -> Self {
        let spread = |axis: usize| {
            let values = || points.iter().map(|point| point[axis]);
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        let axis = (0..D).max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(0);
        let mut sorted: Vec<usize> = (0..points.len()).collect();
        sorted.sort_by(|a, b| coordinate(&points[*a], axis).total_cmp(&coordinate(&points[*b], axis)));
        NearIndex { points, axis, sorted }
    }

    /// Numbers and Euclidean distances of the points that are no farther than `limit` (m) from `place`, in no particular
    /// order.
    pub fn within<'b>(&'b self, place: &'b [f64; D], limit: f64) -> impl Iterator<Item = (usize, f64)> + 'b {
        let own = coordinate(place, self.axis);
        let at = |number: usize| coordinate(&self.points[number], self.axis);
        // Differences are compared, not sums: rounding then never loses a point at the limit.
        let first = self.sorted.partition_point(|&number| own - at(number) > limit);
        let near = self.sorted[first..].iter().take_while(move |&&number| at(number) - own <= limit);
        near.map(move |&number| (number, euclidean(place, &self.points[number])))
            .filter(move |entry| entry.1 <= limit)
    }
}

/// The pairs of a point of `a` and a point of `b` that are no farther apart than `limit` (m), with their Euclidean
/// distance: by the point of `a`, then by that of `b`.
///
/// Time follows the number of points, and of pairs that are near on the axis over which `b` is spread widest.
///
/// ```
/// use tercel_core::metric::pairs_within;
///
/// let pairs = pairs_within(&[[0.0, 0.0], [90.0, 0.0]], &[[3.0, 4.0], [91.0, 0.0], [500.0, 0.0]], 20.0);
/// assert_eq!(pairs, [(0, 0, 5.0), (1, 1, 1.0)]);
/// ```
pub fn pairs_within<const D: usize>(a: &[[f64; D]], b: &[[f64; D]], limit: f64) -> Vec<(usize, usize, f64)> {
    let index = NearIndex::new(b);
    let mut pairs = Vec::new();
    for (i, place) in a.iter().enumerate() {
        let first = pairs.len();
        pairs.extend(index.within(place, limit).map(|(j, distance)| (i, j, distance)));
        pairs[first..].sort_unstable_by_key(|pair: &(usize, usize, f64)| pair.1);
    }
    pairs
}

/// Points without axes are all in one place.
fn coordinate<const D: usize>(point: &[f64; D], axis: usize) -> f64 {
    point.get(axis).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_pairs_are_those_that_a_search_through_all_finds(
            a in prop::collection::vec(prop::array::uniform2(0i32..9), 0..20),
            b in prop::collection::vec(prop::array::uniform2(0i32..9), 0..20),
            limit in 0i32..6,
        ) {
            let points = |set: Vec<[i32; 2]>| -> Vec<[f64; 2]> { set.iter().map(|x| x.map(f64::from)).collect() };
            let (a, b, limit) = (points(a), points(b), f64::from(limit));
            let all = (0..a.len()).flat_map(|i| (0..b.len()).map(move |j| (i, j)));
            let expected: Vec<_> = all
                .map(|(i, j)| (i, j, f64::hypot(a[i][0] - b[j][0], a[i][1] - b[j][1])))
                .filter(|pair| pair.2 <= limit)
                .collect();
            let found = pairs_within(&a, &b, limit);
            prop_assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(&expected) {
                prop_assert_eq!((found.0, found.1), (expected.0, expected.1));
                prop_assert!((found.2 - expected.2).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn points_without_a_place_or_without_axes_are_no_trouble() {
        assert!(pairs_within(&[[f64::NAN, 0.0]], &[[0.0, 0.0]], 1.0).is_empty());
        assert_eq!(pairs_within(&[[]], &[[], []], 1.0), [(0, 0, 0.0), (0, 1, 0.0)]);
    }

    #[test]
    fn distances_whose_squares_overflow_or_vanish_are_right() {
        for size in [1e200, 1e-200] {
            let pairs = pairs_within(&[[3.0 * size, 0.0]], &[[0.0, 4.0 * size]], 6.0 * size);
            assert!((pairs[0].2 / size - 5.0).abs() < 1e-12, "{pairs:?}");
        }
    }
}
