//! The form of the publication.

use std::sync::Arc;

use tercel_core::extended::{Points, Scattering};
use tercel_neural::filter::rmm_net::{Extended, Kinematics, Moments, Published, widths};

use super::State;
use super::data::Rides;
use super::head::Head;
use super::operations::PublishedStep;
use super::rows::{EXTENDED, extended, extended_numbers, shifted, wide};
use crate::backend::{Tensor, apply, constant};
use crate::layer::{Lstm, LstmState};
use crate::{ParameterSet, TrainError, Weights};

/// The network, and what counts as given.
#[derive(Debug)]
pub struct PublishedNet {
    pub options: Arc<Published>,
    dt: f64,
    scattering: Scattering,
    memory: Option<Lstm>,
    prediction: Option<[Head; 3]>,
    update: Option<Head>,
}

/// The moments of a scan, if it has points, and by how much the origin moves.
type Seen = (Option<Moments>, [f64; 2]);

/// Square factors start with this on their diagonal: their products are small then, and have slopes.
const FIRST: f32 = 0.1;

/// Numbers for a square factor of this many rows, after `before` zeros and with `after` behind it.
fn factor(before: usize, rows: usize, after: usize) -> Vec<f32> {
    let mut values = vec![0.0; before + rows * rows + after];
    (0..rows).for_each(|i| values[before + i * (rows + 1)] = FIRST);
    values
}

impl PublishedNet {
    pub fn new(
        set: &mut ParameterSet,
        options: &Published,
        units: usize,
        dt: f64,
        scattering: Scattering,
    ) -> Result<Self, TrainError> {
        let (seen, context, blocks) = (options.seen(units), options.context(units), options.blocks);
        let memory =
            if blocks.memory { Some(Lstm::new(set, "memory", widths::ESTIMATE_SEEN, units)?) } else { None };
        let prediction = if blocks.prediction {
            let first = [vec![0.0; widths::SAID[0]], factor(0, 4, 0), factor(0, 2, 3)];
            let mut head = |i: usize| {
                let sizes = [seen, units, widths::SAID[i]];
                Head::saying(set, widths::PREDICTIONS[i], sizes, first[i].clone())
            };
            Some([head(0)?, head(1)?, head(2)?])
        } else {
            None
        };
        let update = if blocks.update {
            let sizes = [widths::SCAN_SEEN + context, units, widths::SAID[3]];
            Some(Head::saying(set, "update", sizes, factor(2, 2, 0))?)
        } else {
            None
        };
        Ok(PublishedNet { options: Arc::new(options.clone()), dt, scattering, memory, prediction, update })
    }

    pub fn first(&self, rides: &Rides) -> State {
        let (extent, weight) = self.options.first_extent();
        let row = |(motion, _): &(Kinematics<f64>, f64)| {
            let first = extended_numbers(&Extended { motion: *motion, extent, weight });
            shifted(first, motion.place).map(|x| x as f32)
        };
        State {
            tracks: constant(rides.births.iter().flat_map(row).collect(), [rides.members, EXTENDED]),
            memory: LstmState::zero(rides.members, self.memory.as_ref().map_or(1, Lstm::size)),
            origins: rides.births.iter().map(|(motion, _)| motion.place).collect(),
            known: Vec::new(),
        }
    }

    /// One step of the batch: the state after it, and its row for the costs.
    pub fn step(&self, weights: &Weights, rides: &Rides, state: State, step: usize) -> (State, Tensor) {
        let (options, members) = (&self.options, rides.members);
        let State { tracks, mut memory, mut origins, known } = state;
        let before: Vec<Extended<f64>> = wide(&tracks).iter().map(|row| extended(row)).collect();
        let mut seen = vec![0.0; members * widths::ESTIMATE_SEEN];
        for (estimate, row) in before.iter().zip(seen.chunks_exact_mut(widths::ESTIMATE_SEEN)) {
            options.see_estimate(estimate, row);
        }
        let seen = constant(seen, [members, widths::ESTIMATE_SEEN]);
        let (context, joined) = match &self.memory {
            Some(layer) => {
                memory = layer.step(weights, seen.clone(), memory);
                (memory.hidden.clone(), vec![memory.hidden.clone(), seen])
            }
            None => (seen.clone(), vec![seen]),
        };
        let prediction = match &self.prediction {
            Some(heads) => {
                let said = heads.iter().map(|head| head.say(weights, joined.clone()).1).collect();
                Tensor::cat(said, 1)
            }
            None => constant(vec![0.0; members * widths::PREDICTED], [members, widths::PREDICTED]),
        };
        let (moments, scans) = self.see_scans((&before, &origins), &wide(&prediction), &rides.scans[step]);
        let scan = match &self.update {
            Some(head) => head.say(weights, vec![constant(scans, [members, widths::SCAN_SEEN]), context]).1,
            None => constant(vec![0.0; members * widths::SAID[3]], [members, widths::SAID[3]]),
        };
        let operation = PublishedStep { options: Arc::clone(options), dt: self.dt, seen: Arc::new(moments) };
        for (origin, (_, shift)) in origins.iter_mut().zip(operation.seen.iter()) {
            (0..2).for_each(|i| origin[i] += shift[i]);
        }
        let row = apply(operation, [tracks, prediction, scan]);
        (State { tracks: row.clone(), memory, origins, known }, row)
    }

    /// The moments of scans with points, how far the predictions are from the origins, and what is seen of the scans.
    fn see_scans(
        &self,
        (before, origins): (&[Extended<f64>], &[[f64; 2]]),
        said: &[Vec<f64>],
        scans: &[Points],
    ) -> (Vec<Seen>, Vec<f32>) {
        let (scale, noise) = (self.scattering.scale(), self.scattering.noise());
        let mut rows = vec![0.0; scans.len() * widths::SCAN_SEEN];
        let mut moments = Vec::with_capacity(scans.len());
        for (member, row) in rows.chunks_exact_mut(widths::SCAN_SEEN).enumerate() {
            let points = &scans[member];
            let prior = before[member].predict(&self.options, &said[member], self.dt);
            let own = (!points.is_empty()).then(|| {
                let own = Moments::new(points, scale, &noise);
                Moments { mean: [0, 1].map(|i| own.mean[i] - origins[member][i]), ..own }
            });
            if let Some(own) = &own {
                self.options.see_scan(&prior, own, row);
            }
            moments.push((own, prior.motion.place));
        }
        (moments, rows)
    }
}
