//! Which measurements of a scan lie near an object.

use nalgebra::Vector2;

use super::Scan;
use super::detection::Sight;
use crate::association::{Gate, PlaceIndex, Search};
use crate::filter::Filter;

/// The measurements of a scan, sorted by place. Its buffers serve scan after scan.
#[derive(Debug, Clone, Default)]
pub(super) struct Vicinity {
    index: PlaceIndex,
    search: Search,
    near: Vec<usize>,
}

impl Vicinity {
    /// Takes in the measurements of a scan, which lie at these places.
    pub fn build<const N: usize, F>(
        &mut self,
        filter: &F,
        scan: &Scan<'_, F::Measurement>,
        gate: &Gate,
        places: &[Option<Vector2<f64>>],
    ) where
        F: Filter<N> + ?Sized,
    {
        let mut search = Search::new(*gate);
        scan.measurements.iter().for_each(|measurement| filter.widen(&mut search, measurement));
        self.search = search;
        self.index.build(places);
    }

    /// How the sensor sees the object of this belief, and the measurements that may lie inside its gate, by
    /// rising number: none where the sensor cannot see it.
    pub fn look<const N: usize, F>(
        &mut self,
        filter: &F,
        belief: &F::Belief,
        scan: &Scan<'_, F::Measurement>,
    ) -> (Sight, &[usize])
    where
        F: Filter<N> + ?Sized,
    {
        let reach = filter.reach(belief, &self.search);
        let sight = scan.detection.sight(reach.as_ref());
        match reach {
            _ if sight.seen == 0.0 => self.near.clear(),
            Some(region) => self.index.within(&region, &mut self.near),
            None => self.near.splice(.., 0..scan.measurements.len()).for_each(drop),
        }
        (sight, &self.near)
    }
}
