//! Measurements that come from no object that is tracked.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::Detection;
use crate::error::FilterError;

/// Clutter intensity: expected number of clutter measurements per scan and m² of the plane.
///
/// It is per m² whatever the sensor: what is measured beyond the plane is spread evenly over a width that the sensor states, the
/// heights of [`Position<3>`](crate::sensor::Position::with_clutter_heights) and the range rates of
/// [`RangeBearingRate`](crate::sensor::RangeBearingRate::with_clutter_rates). For bearings alone it is per rad.
#[derive(Debug, Clone, PartialEq)]
pub enum Clutter {
    /// The same everywhere.
    Uniform(f64),
    /// Learned where it comes from.
    Map(ClutterMap),
}

/// Intensity that stands for none.
const LEAST: f64 = 1e-30;

impl Clutter {
    /// A uniform intensity of `expected` clutter measurements a scan over a region of `area` m².
    ///
    /// # Errors
    /// When the number is negative or the area is not positive.
    pub fn per_scan(expected: f64, area: f64) -> Result<Self, FilterError> {
        let area = FilterError::positive("area of the clutter region", area)?;
        if expected >= 0.0 && expected.is_finite() {
            return Ok(Clutter::Uniform(expected / area));
        }
        let expectation = "must be finite and not negative";
        Err(FilterError::Parameter { parameter: "clutter per scan", value: expected, expected: expectation })
    }

    /// The intensity at `place`, per scan and m². Never zero, so that likelihood ratios stay finite.
    pub fn intensity(&self, place: Option<&Vector2<f64>>) -> f64 {
        let intensity = match (self, place) {
            (Clutter::Uniform(intensity), _) => *intensity,
            (Clutter::Map(map), Some(place)) => map.intensity(place),
            (Clutter::Map(map), None) => map.background,
        };
        intensity.max(LEAST)
    }

    /// The intensity where nothing is special, per scan and m².
    pub fn background(&self) -> f64 {
        match self {
            Clutter::Uniform(intensity) => intensity.max(LEAST),
            Clutter::Map(map) => map.background,
        }
    }
}

/// A map of fixed clutter (shores, quays, buoys), learned from the scans themselves.
///
/// ## Definition
/// The plane is cut into square cells. Each cell keeps the mean number of measurements per scan that no track explains, as an
/// exponential average over about the last `memory` scans in which the sensor could see the cell:
/// ```text
/// rate ← rate + (count - rate) / memory        intensity = background + rate / cell²
/// ```
/// Every cell starts at zero, so that one detection of an object that passes by leaves hardly a trace.
/// A measurement counts in its cell and, by bilinear weights, in the three nearest others, so that the map has no edges.
///
/// ## Use it when
/// the same places answer scan after scan. Give the map of each sensor to the tracker with every scan and teach it with what
/// the tracker did not explain: see [`learn`](ClutterMap::learn).
///
/// ## Reference
/// The classical clutter map of radar practice; Musicki and Evans (2004) discuss it for tracking.
#[derive(Debug, Clone, PartialEq)]
pub struct ClutterMap {
    cell: f64,
    background: f64,
    memory: f64,
    cells: BTreeMap<[i64; 2], Cell>,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Cell {
    /// Mean measurements per scan in view.
    rate: f64,
    /// Weight that the current scan has put here.
    count: f64,
}

impl ClutterMap {
    /// A map without fixed clutter: cells of width `cell` (m), a `background` intensity (per scan and m²) that holds
    /// everywhere, and a memory of `memory` scans.
    ///
    /// # Errors
    /// When one is not positive and finite.
    pub fn new(cell: f64, background: f64, memory: f64) -> Result<Self, FilterError> {
        Ok(ClutterMap {
            cell: FilterError::positive("clutter map cell", cell)?,
            background: FilterError::positive("clutter background", background)?,
            memory: FilterError::positive("clutter map memory", memory)?.max(1.0),
            cells: BTreeMap::new(),
        })
    }

    /// The intensity at `place`, per scan and m².
    pub fn intensity(&self, place: &Vector2<f64>) -> f64 {
        let rate: f64 = self
            .corners(place)
            .iter()
            .filter_map(|(cell, weight)| Some(weight * self.cells.get(cell)?.rate))
            .sum();
        self.background + rate / (self.cell * self.cell)
    }

    /// Takes in a scan: the place of each measurement and the probability (0 to 1) that it was clutter. Cells that
    /// `detection` says the sensor cannot see keep what they know.
    pub fn learn(&mut self, unexplained: impl Iterator<Item = (Vector2<f64>, f64)>, detection: &Detection) {
        for (place, probability) in unexplained {
            if !(place.x.is_finite() && place.y.is_finite()) {
                continue;
            }
            for (cell, weight) in self.corners(&place) {
                self.cells.entry(cell).or_default().count += weight * probability;
            }
        }
        let (width, memory) = (self.cell, self.memory);
        self.cells.retain(|index, cell| {
            let centre = Vector2::new(index[0] as f64, index[1] as f64) * width;
            if cell.count == 0.0 && detection.probability(Some(&centre)) == 0.0 {
                return true;
            }
            cell.rate += (cell.count - cell.rate) / memory;
            cell.count = 0.0;
            // Forgotten cells would only grow the map.
            cell.rate > 1e-6
        });
    }

    /// The four cells around a place and their bilinear weights; a cell's index times the width is its centre.
    fn corners(&self, place: &Vector2<f64>) -> [([i64; 2], f64); 4] {
        let scaled = place / self.cell;
        let base = [scaled.x.floor(), scaled.y.floor()];
        let (fx, fy) = (scaled.x - base[0], scaled.y - base[1]);
        let (i, j) = (base[0] as i64, base[1] as i64);
        let (k, l) = (i.saturating_add(1), j.saturating_add(1));
        [
            ([i, j], (1.0 - fx) * (1.0 - fy)),
            ([k, j], fx * (1.0 - fy)),
            ([i, l], (1.0 - fx) * fy),
            ([k, l], fx * fy),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn a_quay_that_always_answers_becomes_clutter_and_open_water_does_not() {
        let mut map = ClutterMap::new(10.0, 1e-6, 20.0).unwrap();
        let everywhere = Detection::uniform(0.9).unwrap();
        for _ in 0..200 {
            map.learn([(vector![100.0, 50.0], 1.0)].into_iter(), &everywhere);
        }
        assert!((map.intensity(&vector![100.0, 50.0]) - (1e-6 + 0.01)).abs() < 1e-3);
        assert_eq!(map.intensity(&vector![300.0, 50.0]), 1e-6);
        for _ in 0..500 {
            map.learn(std::iter::empty(), &everywhere);
        }
        assert!(map.intensity(&vector![100.0, 50.0]) < 1e-4);
    }

    #[test]
    fn the_mass_of_the_map_is_the_number_of_clutter_measurements() {
        let mut map = ClutterMap::new(7.0, 1e-9, 10.0).unwrap();
        let everywhere = Detection::uniform(0.9).unwrap();
        map.learn([(vector![3.3, -8.1], 1.0), (vector![40.0, 2.0], 0.5)].into_iter(), &everywhere);
        let mass: f64 = map.cells.values().map(|cell| cell.rate).sum();
        assert!((mass * 10.0 - 1.5).abs() < 1e-12);
    }

    #[test]
    fn cells_out_of_view_keep_what_they_know() {
        let mut map = ClutterMap::new(10.0, 1e-6, 20.0).unwrap();
        let near = Detection::by_range(vec![(50.0, 0.9), (60.0, 0.0)]).unwrap();
        for _ in 0..30 {
            map.learn([(vector![20.0, 0.0], 1.0)].into_iter(), &near);
        }
        let known = map.intensity(&vector![20.0, 0.0]);
        let elsewhere = near.at(vector![1000.0, 0.0]);
        for _ in 0..30 {
            map.learn(std::iter::empty(), &elsewhere);
        }
        assert_eq!(map.intensity(&vector![20.0, 0.0]), known);
    }
}
