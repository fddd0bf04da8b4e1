//! How likely a sensor sees an object.

use std::f64::consts::TAU;

use nalgebra::Vector2;

use crate::association::Region;
use crate::error::FilterError;
use crate::sensor::wrapped;

/// Probability that a scan holds a measurement of an object that is there, and what it means when it holds none.
///
/// A sensor that *scans* looks once at its field of view, so an object that gave no measurement was missed. *Reports* are
/// what objects say of themselves (AIS, ADS-B, GPS): each speaks of one object, and the silence of the others means nothing.
///
/// ```
/// use tercel_core::multi::Detection;
/// use nalgebra::vector;
///
/// // A lidar that sees well to 60 m and nothing beyond 110 m.
/// let lidar = Detection::by_range(vec![(60.0, 0.9), (110.0, 0.0)])?.at(vector![10.0, 0.0]);
/// assert_eq!(lidar.probability(Some(&vector![95.0, 0.0])), 0.45);
/// assert_eq!(lidar.probability(Some(&vector![500.0, 0.0])), 0.0);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Ranges (rising) and the probability at each.
    table: Vec<(f64, f64)>,
    position: Vector2<f64>,
    reports: bool,
    sector: Option<Sector>,
}

/// The bearings that a scan looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sector {
    /// Where it begins, counter-clockwise, rad.
    from: f64,
    /// rad.
    width: f64,
}

impl Detection {
    /// The same probability everywhere.
    ///
    /// # Errors
    /// When it is not between 0 and 1.
    pub fn uniform(probability: f64) -> Result<Self, FilterError> {
        Detection::by_range(vec![(0.0, probability)])
    }

    /// Of reports: every measurement speaks of one object, and none is missed.
    pub fn reports() -> Self {
        Detection { table: vec![(0.0, 1.0)], position: Vector2::zeros(), reports: true, sector: None }
    }

    /// True for reports.
    pub fn is_reports(&self) -> bool {
        self.reports
    }

    /// A probability that depends on the distance from the sensor: linear between the entries (range in m, probability) of
    /// the table, constant before the first and after the last.
    ///
    /// # Errors
    /// When the table is empty, its ranges do not rise, or a probability is not between 0 and 1.
    pub fn by_range(table: Vec<(f64, f64)>) -> Result<Self, FilterError> {
        if table.is_empty() {
            return Err(FilterError::Parameter {
                parameter: "entries of the detection table",
                value: 0.0,
                expected: "must be at least one",
            });
        }
        for &(range, probability) in &table {
            FilterError::probability("detection probability", probability)?;
            if !(range >= 0.0 && range.is_finite()) {
                return Err(FilterError::Parameter {
                    parameter: "range of the detection table",
                    value: range,
                    expected: "must be finite and not negative",
                });
            }
        }
        match table.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
            Some(pair) => Err(FilterError::Parameter {
                parameter: "range of the detection table",
                value: pair[1].0,
                expected: "must be above the range before it",
            }),
            None => Ok(Detection { table, position: Vector2::zeros(), reports: false, sector: None }),
        }
    }

    /// Moves the sensor to `position`, m.
    pub fn at(mut self, position: Vector2<f64>) -> Self {
        self.position = position;
        self
    }

    /// Looks only at the bearings from `from` counter-clockwise over `width` (rad): what lies elsewhere is neither seen nor
    /// missed. A width of a whole turn or more looks everywhere.
    pub fn looking(mut self, from: f64, width: f64) -> Self {
        self.sector = (width < TAU).then_some(Sector { from, width });
        self
    }

    /// Probability of detecting an object at `place`. Where the place is not known the probability at range zero is taken.
    pub fn probability(&self, place: Option<&Vector2<f64>>) -> f64 {
        if let (Some(sector), Some(place)) = (self.sector, place)
            && sector.depth(&(place - self.position)) < 0.0
        {
            return 0.0;
        }
        self.in_view(place)
    }

    /// The same where bearings do not matter.
    fn in_view(&self, place: Option<&Vector2<f64>>) -> f64 {
        let (first, last) = (self.table[0], self.table[self.table.len() - 1]);
        if self.table.len() == 1 {
            return first.1;
        }
        let range = place.map_or(0.0, |place| (place - self.position).norm());
        match self.table.iter().position(|entry| entry.0 > range) {
            Some(0) => first.1,
            None => last.1,
            Some(after) => {
                let ((r0, p0), (r1, p1)) = (self.table[after - 1], self.table[after]);
                p0 + (p1 - p0) * (range - r0) / (r1 - r0)
            }
        }
    }

    /// How an object is seen whose measurements are expected in this region; see [`probability`](Detection::probability). One
    /// that may lie on either side of the edge of a sector may be seen, and is not missed.
    pub(super) fn sight(&self, region: Option<&Region>) -> Sight {
        let place = region.map(|region| region.centre);
        let seen = self.in_view(place.as_ref());
        let missed = if self.reports { 0.0 } else { seen };
        let (Some(sector), Some(region)) = (self.sector, region) else { return Sight { seen, missed } };
        let offset = region.centre - self.position;
        let room = 0.5 * (region.high - region.low).norm();
        let margin = room / offset.norm().max(f64::MIN_POSITIVE);
        match sector.depth(&offset) {
            depth if depth > margin => Sight { seen, missed },
            depth if depth < -margin => Sight::default(),
            _ => Sight { seen, missed: 0.0 },
        }
    }
}

impl Sector {
    /// How far inside the sector a bearing lies, rad; negative outside.
    fn depth(&self, offset: &Vector2<f64>) -> f64 {
        let middle = self.from + 0.5 * self.width;
        0.5 * self.width - wrapped(offset.y.atan2(offset.x) - middle).abs()
    }
}

/// How likely an object is seen, and how much it says when it is not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sight {
    /// Probability that it gives a measurement.
    pub seen: f64,
    /// Probability that it would have given one, when it gave none: zero when its silence means nothing.
    pub missed: f64,
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use nalgebra::vector;

    #[test]
    fn what_lies_outside_the_sector_is_neither_seen_nor_missed() {
        // From 45 degrees before the negative x axis to 45 degrees behind it.
        let radar = Detection::uniform(0.9).unwrap().looking(0.75 * PI, 0.5 * PI);
        let spread = nalgebra::Matrix2::identity() * 25.0;
        let sight = |x, y| radar.sight(Some(&Region::ellipse(vector![x, y], &spread, 9.0)));
        assert_eq!(sight(-1000.0, 10.0), Sight { seen: 0.9, missed: 0.9 });
        assert_eq!(sight(-1000.0, -10.0), Sight { seen: 0.9, missed: 0.9 });
        assert_eq!(sight(1000.0, 0.0), Sight { seen: 0.0, missed: 0.0 });
        // 7 m beyond the edge, of which the object is known to 5 m.
        assert_eq!(sight(-1000.0, 1010.0), Sight { seen: 0.9, missed: 0.0 });
        assert_eq!(radar.probability(Some(&vector![-1000.0, 1010.0])), 0.0);
    }

    #[test]
    fn a_bad_table_is_refused() {
        assert!(Detection::by_range(vec![]).is_err());
        assert!(Detection::by_range(vec![(0.0, 1.2)]).is_err());
        assert!(Detection::by_range(vec![(10.0, 0.5), (10.0, 0.4)]).is_err());
        assert!(Detection::by_range(vec![(f64::NAN, 0.5)]).is_err());
    }
}
