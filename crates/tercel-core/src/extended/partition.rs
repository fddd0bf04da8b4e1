//! Cutting a scan into the points that may come from one object each.

use nalgebra::Vector2;

use super::Points;
use crate::association::PlaceIndex;

/// Cuts points into cells: two points share a cell when a chain of points with steps of at most `distance`
/// metres joins them.
///
/// ## Definition
/// The connected components of the graph whose edges join points at most `distance` apart, in the order of
/// their first point.
///
/// ## Use it when
/// a tracker of many objects is to take extended ones: each cell is one measurement. The distance should be
/// above the usual gap between the points of one object and below the gap between objects. Objects that touch
/// come as one cell.
///
/// ## Reference
/// Granström, Lundquist and Orguner (2012), section IV.A, with one distance. A grid finds neighbours, so the
/// cost grows with the number of points and not with its square.
///
/// ```
/// use nalgebra::vector;
/// use tercel_core::extended::distance_partition;
///
/// let scan = [vector![0.0, 0.0], vector![50.0, 0.0], vector![1.5, 0.0], vector![3.0, 0.0]];
/// let cells = distance_partition(&scan, 2.0);
/// assert_eq!(cells.iter().map(|cell| cell.count()).collect::<Vec<_>>(), [3, 1]);
/// ```
pub fn distance_partition(points: &[Vector2<f64>], distance: f64) -> Vec<Points> {
    let mut index = PlaceIndex::default();
    let finite = |point: &Vector2<f64>| point.iter().all(|x| x.is_finite());
    index.build(&points.iter().map(|point| Some(*point).filter(finite)).collect::<Vec<_>>());
    let spread = nalgebra::Matrix2::identity();
    let mut cell_of = vec![usize::MAX; points.len()];
    let mut near = Vec::new();
    let mut open = Vec::new();
    let mut cells: Vec<Vec<Vector2<f64>>> = Vec::new();
    for start in 0..points.len() {
        if cell_of[start] != usize::MAX {
            continue;
        }
        let cell = cells.len();
        cells.push(Vec::new());
        cell_of[start] = cell;
        open.push(start);
        while let Some(at) = open.pop() {
            cells[cell].push(points[at]);
            if !finite(&points[at]) {
                continue;
            }
            index.near(&points[at], &spread, distance * distance, &mut near);
            for &other in &near {
                let apart = (points[other] - points[at]).norm();
                if cell_of[other] == usize::MAX && apart <= distance {
                    cell_of[other] = cell;
                    open.push(other);
                }
            }
        }
    }
    cells.into_iter().map(Points::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn cells_are_the_connected_components() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        for distance in [0.0, 0.5, 2.0, 1e3] {
            let points: Vec<_> = (0..200)
                .map(|_| Vector2::new(random.random::<f64>(), random.random::<f64>()) * 30.0)
                .collect();
            let cells = distance_partition(&points, distance);
            assert_eq!(cells.iter().map(Points::count).sum::<usize>(), 200);
            for (place, cell) in cells.iter().enumerate() {
                for other in &cells[place + 1..] {
                    let gaps =
                        cell.points().iter().flat_map(|a| other.points().iter().map(move |b| (a - b).norm()));
                    assert!(gaps.fold(f64::INFINITY, f64::min) > distance);
                }
                let joined = cell.points().iter().all(|a| {
                    cell.count() == 1 || cell.points().iter().any(|b| a != b && (a - b).norm() <= distance)
                });
                assert!(joined, "a point of a cell of {} is apart from the rest", cell.count());
            }
        }
    }

    #[test]
    fn a_point_that_is_nowhere_is_alone() {
        let points = [Vector2::new(0.0, 0.0), Vector2::new(f64::NAN, 0.0), Vector2::new(0.5, 0.0)];
        assert_eq!(distance_partition(&points, 1.0).len(), 2);
        assert!(distance_partition(&[], 1.0).is_empty());
    }
}
