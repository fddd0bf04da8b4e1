//! The form in the frame of the object.

use std::sync::Arc;

use tercel_core::extended::Scattering;
use tercel_neural::filter::rmm_net::{Aligned, Before, Length, Past, Regression, Track, View, heading};

use super::State;
use super::data::Rides;
use super::head::Head;
use super::operations::{Given, Pool, Step};
use super::rows::{STEP, TRACK, numbers, plain};
use crate::backend::{Tensor, apply, constant, values};
use crate::layer::{Activation, Linear, Lstm, LstmState};
use crate::{ParameterSet, TrainError, Weights};

/// The network, and what counts as given.
#[derive(Debug)]
pub struct AlignedNet {
    pub options: Arc<Aligned>,
    pub length: Length,
    pub scattering: Scattering,
    memory: Lstm,
    motion: Head,
    points: [Linear; 2],
    scan: Head,
    extent: Head,
}

/// What is known of one object apart from its track, and counts as given.
#[derive(Debug, Clone)]
pub struct Known {
    angle: f64,
    correction: [f64; 4],
    measured: bool,
    regression: Regression,
}

impl AlignedNet {
    pub fn new(
        set: &mut ParameterSet,
        options: &Aligned,
        memory: usize,
        (length, scattering): (Length, Scattering),
    ) -> Result<Self, TrainError> {
        let Aligned { hidden, encoder, .. } = *options;
        let sizes = options.sizes();
        let joined = 2 * encoder + sizes.scan_seen + memory;
        Ok(AlignedNet {
            memory: Lstm::new(set, "memory", sizes.motion_seen, memory)?,
            motion: Head::new(set, "motion", [memory + sizes.motion_seen, hidden, sizes.motion_said])?,
            points: [
                Linear::new(set, "points.first", sizes.point, encoder, Activation::Relu)?,
                Linear::new(set, "points.second", encoder, encoder, Activation::Relu)?,
            ],
            scan: Head::new(set, "scan", [joined, hidden, sizes.scan_said])?,
            extent: Head::new(set, "extent", [hidden + sizes.extent_seen, hidden, sizes.extent_said])?,
            options: Arc::new(options.clone()),
            length,
            scattering,
        })
    }

    pub fn first(&self, rides: &Rides) -> State {
        let options = &self.options;
        let row = |(motion, _): &(_, f64)| {
            let track = Track { motion: *motion, axes: options.axes.map(f64::ln), worth: options.worth };
            numbers(&track).map(|x| x as f32)
        };
        let known = |(_, angle): &(_, f64)| Known {
            angle: *angle,
            correction: [0.0; 4],
            measured: true,
            regression: Regression::new(&options.identification),
        };
        State {
            tracks: constant(rides.births.iter().flat_map(row).collect(), [rides.members, TRACK]),
            memory: LstmState::zero(rides.members, self.memory.size()),
            known: rides.births.iter().map(known).collect(),
        }
    }

    /// One step of the batch: the state after it, and its row for the costs.
    pub fn step(&self, weights: &Weights, rides: &Rides, state: State, step: usize) -> (State, Tensor) {
        let (options, members, sizes) = (&self.options, rides.members, self.options.sizes());
        let State { tracks, memory, mut known } = state;
        let before: Vec<Track<f64>> = values(&tracks).chunks_exact(TRACK).map(plain).collect();
        let mut seen = vec![0.0; members * sizes.motion_seen];
        for ((track, known), row) in
            before.iter().zip(&mut known).zip(seen.chunks_exact_mut(sizes.motion_seen))
        {
            known.regression.take(
                &options.identification,
                options.change,
                track.motion.velocity,
                known.measured,
            );
            options.see_motion(track, &known.before(), row);
        }
        let seen = constant(seen, [members, sizes.motion_seen]);
        let memory = self.memory.step(weights, seen.clone(), memory);
        let (_, motion) = self.motion.say(weights, vec![memory.hidden.clone(), seen]);

        let said = values(&motion);
        let said: Vec<Vec<f64>> = said
            .chunks_exact(sizes.motion_said)
            .map(|row| row.iter().map(|x| f64::from(*x)).collect())
            .collect();
        let mut given = Vec::with_capacity(members);
        let mut priors = Vec::with_capacity(members);
        let counts: Vec<usize> = rides.scans[step].iter().map(|scan| scan.count()).collect();
        let total: usize = counts.iter().sum();
        let mut rows = vec![0.0; total.max(1) * sizes.point];
        let mut scans = vec![0.0; members * sizes.scan_seen];
        let mut next = 0;
        for member in 0..members {
            let (known, points) = (&known[member], &rides.scans[step][member]);
            let axis = heading(options, before[member].motion.velocity, known.angle);
            let velocities = known.regression.past().to_vec();
            let expected = known.regression.expected();
            let past = Past { heading: axis, velocities: &velocities, expected };
            let prior = before[member].predict(options, &past, &said[member], self.length);
            let noise = (self.scattering.scale(), &self.scattering.noise());
            let view = (!points.is_empty()).then(|| View::new(options, &prior, known.angle, points, noise));
            if let Some(view) = &view {
                view.see_points(
                    &prior,
                    points,
                    &mut rows[next * sizes.point..][..points.count() * sizes.point],
                );
                options.see_scan(&prior, view, &mut scans[member * sizes.scan_seen..][..sizes.scan_seen]);
                next += points.count();
            }
            priors.push(prior);
            given.push(Given { heading: axis, velocities, expected, held: known.angle, view });
        }
        let rows = constant(rows, [total.max(1), sizes.point]);
        let rows = self.points[0].forward(weights, rows);
        let rows = self.points[1].forward(weights, rows);
        let pooled = apply(Pool { counts: Arc::new(counts) }, [rows]);
        let scans = constant(scans, [members, sizes.scan_seen]);
        let (hidden, scan) = self.scan.say(weights, vec![pooled, scans, memory.hidden.clone()]);

        let said = values(&scan);
        let mut extents = vec![0.0; members * sizes.extent_seen];
        for member in 0..members {
            if let Some(view) = &given[member].view {
                let said: Vec<f64> = said[member * sizes.scan_said..][..sizes.scan_said]
                    .iter()
                    .map(|x| f64::from(*x))
                    .collect();
                let after = priors[member].update(options, view, &said);
                options.see_extent(
                    &after,
                    view,
                    &mut extents[member * sizes.extent_seen..][..sizes.extent_seen],
                );
            }
        }
        let extents = constant(extents, [members, sizes.extent_seen]);
        let (_, extent) = self.extent.say(weights, vec![hidden, extents]);
        let measured: Vec<bool> = given.iter().map(|given| given.view.is_some()).collect();
        let operation = Step { options: Arc::clone(options), length: self.length, given: Arc::new(given) };
        let row = apply(operation, [tracks, motion, scan, extent]);
        for (((known, prior), measured), row) in
            known.iter_mut().zip(&priors).zip(measured).zip(values(&row).chunks_exact(STEP))
        {
            known.angle = f64::from(row[TRACK]);
            let prior = prior.motion.numbers();
            known.correction =
                std::array::from_fn(|i| if measured { f64::from(row[i]) - prior[i] } else { 0.0 });
            known.measured = measured;
        }
        (State { tracks: row.clone().narrow(1, 0, TRACK), memory, known }, row)
    }
}

impl Known {
    fn before(&self) -> Before<'_> {
        Before {
            angle: self.angle,
            correction: self.correction,
            measured: self.measured,
            regression: &self.regression,
        }
    }
}
