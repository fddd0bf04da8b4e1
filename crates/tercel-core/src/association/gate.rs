//! Gating in the plane: which measurements are near enough to an object to be compared.

use nalgebra::{SMatrix, Vector2};

use super::Region;

/// Measurements sorted into the cells of a grid, so that the few near an object are found without looking at all.
///
/// ```
/// use tercel_core::association::PlaceIndex;
/// use nalgebra::{Matrix2, vector};
///
/// let mut index = PlaceIndex::default();
/// index.build(&[Some(vector![0.0, 0.0]), Some(vector![500.0, 0.0]), None]);
/// let mut found = Vec::new();
/// index.near(&vector![1.0, 2.0], &(Matrix2::identity() * 25.0), 9.0, &mut found);
/// assert_eq!(found, [0, 2]); // the second is far; a measurement without a place is near everything
/// ```
#[derive(Debug, Clone, Default)]
pub struct PlaceIndex {
    cell: f64,
    /// Measurements with a place, by column and row of their cell.
    sorted: Vec<([i64; 2], u32)>,
    places: Vec<Vector2<f64>>,
    /// Measurements that do not say where they are.
    unplaced: Vec<u32>,
}

impl PlaceIndex {
    /// Takes in the places of the measurements of a scan. Cells are made so wide that each holds about one.
    pub fn build(&mut self, places: &[Option<Vector2<f64>>]) {
        self.cell = cell_width(places);
        self.sorted.clear();
        self.unplaced.clear();
        self.places.clear();
        for (number, place) in (0..).zip(places) {
            match place {
                Some(place) => self.sorted.push((self.cell_of(place), number)),
                None => self.unplaced.push(number),
            }
            self.places.push(place.unwrap_or_default());
        }
        self.sorted.sort_unstable();
    }

    // A float too large for an integer saturates, which keeps far places far.
    fn cell_of(&self, place: &Vector2<f64>) -> [i64; 2] {
        [(place.x / self.cell).floor() as i64, (place.y / self.cell).floor() as i64]
    }

    /// Writes to `found`, in rising order, the measurements that may have a squared Mahalanobis distance from `centre` of at
    /// most `limit` under `covariance`: all within the box around that ellipse, and all without a place.
    pub fn near(
        &self,
        centre: &Vector2<f64>,
        covariance: &SMatrix<f64, 2, 2>,
        limit: f64,
        found: &mut Vec<usize>,
    ) {
        self.within(&Region::ellipse(*centre, covariance, limit), found);
    }

    /// Writes to `found`, in rising order, the measurements inside a region, and all without a place.
    pub fn within(&self, region: &Region, found: &mut Vec<usize>) {
        found.clear();
        let (low, high) = (self.cell_of(&region.low), self.cell_of(&region.high));
        let mut take = |entries: &[([i64; 2], u32)]| {
            for &(_, number) in entries {
                if region.contains(&self.places[number as usize]) {
                    found.push(number as usize);
                }
            }
        };
        // Walking more columns than there are measurements would cost more than looking at each.
        if high[0].saturating_sub(low[0]) > self.sorted.len() as i64 {
            take(&self.sorted);
        } else {
            for column in low[0]..=high[0] {
                let first = self.sorted.partition_point(|entry| entry.0 < [column, low[1]]);
                let last = self.sorted.partition_point(|entry| entry.0 <= [column, high[1]]);
                take(&self.sorted[first..last.max(first)]);
            }
        }
        found.extend(self.unplaced.iter().map(|&number| number as usize));
        found.sort_unstable();
    }
}

/// Width of square cells of which the box around all places has as many as there are places.
fn cell_width(places: &[Option<Vector2<f64>>]) -> f64 {
    let placed = || places.iter().flatten();
    let low = placed().fold(Vector2::repeat(f64::INFINITY), |a, b| a.inf(b));
    let high = placed().fold(Vector2::repeat(f64::NEG_INFINITY), |a, b| a.sup(b));
    let span = high - low;
    // A line of places has no area; its length then sets the width.
    let width = (span.x * span.y / places.len() as f64).sqrt().max(span.max() / places.len() as f64);
    if width.is_finite() && width > 0.0 { width } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_index_finds_what_a_search_through_all_finds(
            places in prop::collection::vec((-1e3..1e3f64, -1e3..1e3f64), 0..60),
            centre in (-1e3..1e3f64, -1e3..1e3f64),
            (a, b, c) in (1.0..200.0f64, 1.0..200.0f64, -0.9..0.9f64),
        ) {
            let covariance = SMatrix::<f64, 2, 2>::new(a * a, a * b * c, a * b * c, b * b);
            let centre = Vector2::new(centre.0, centre.1);
            let places: Vec<_> = places.into_iter().map(|(x, y)| Some(Vector2::new(x, y))).collect();
            let mut index = PlaceIndex::default();
            index.build(&places);
            let mut found = Vec::new();
            index.near(&centre, &covariance, 9.0, &mut found);
            let inverse = covariance.try_inverse().unwrap();
            for (number, place) in places.iter().enumerate() {
                let offset = place.unwrap() - centre;
                if (offset.transpose() * inverse * offset)[0] <= 9.0 {
                    prop_assert!(found.contains(&number));
                }
            }
        }
    }

    #[test]
    fn places_beyond_every_cell_are_still_found() {
        let mut index = PlaceIndex::default();
        index.build(&[Some(Vector2::new(1e300, -1e300))]);
        let mut found = Vec::new();
        index.near(&Vector2::new(1e300, -1e300), &SMatrix::identity(), 9.0, &mut found);
        assert_eq!(found, [0]);
    }
}
