//! Which measurements of a scan lie near an object.

use nalgebra::Vector2;

use super::Scan;
use super::detection::Sight;
use crate::association::{Gate, PlaceIndex};
use crate::filter::Filter;

/// The measurements of a scan, sorted by place. Its buffers serve scan after scan.
#[derive(Debug, Clone, Default)]
pub(super) struct Vicinity {
    index: PlaceIndex,
    near: Vec<usize>,
}

impl Vicinity {
    /// Takes in the places of a scan's measurements.
    pub fn build(&mut self, places: &[Option<Vector2<f64>>]) {
        self.index.build(places);
    }

    /// How the sensor sees the object of this belief, and the measurements that may lie inside its gate, by
    /// rising number: none where the sensor cannot see it.
    pub fn look<const N: usize, F>(
        &mut self,
        filter: &F,
        belief: &F::Belief,
        scan: &Scan<'_, F::Measurement>,
        gate: &Gate,
    ) -> (Sight, &[usize])
    where
        F: Filter<N> + ?Sized,
    {
        let reach = filter.reach(belief);
        let (centre, spread) = (reach.as_ref().map(|reach| &reach.0), reach.as_ref().map(|reach| &reach.1));
        let sight = scan.detection.sight(centre, spread);
        match reach {
            _ if sight.seen == 0.0 => self.near.clear(),
            Some((centre, spread)) => {
                self.index.near(&centre, &spread, gate.search_limit(), &mut self.near);
            }
            None => self.near.splice(.., 0..scan.measurements.len()).for_each(drop),
        }
        (sight, &self.near)
    }
}
