//! The form in the frame of the object.

use std::sync::Arc;

use tercel_core::extended::{Points, Scattering};
use tercel_neural::filter::rmm_net::{
    Aligned, Before, EXTENT_SEEN, Kinematics, Length, Past, Regression, Track, View, heading,
};

use super::State;
use super::data::Rides;
use super::head::Head;
use super::operations::{Given, Pool, Step};
use super::rows::{STEP, TRACK, numbers, plain, shifted, wide};
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
        let row = |(motion, _): &(Kinematics<f64>, f64)| {
            let track = Track { motion: *motion, axes: options.axes.map(f64::ln), worth: options.worth };
            shifted(numbers(&track), motion.place).map(|x| x as f32)
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
            origins: rides.births.iter().map(|(motion, _)| motion.place).collect(),
            known: rides.births.iter().map(known).collect(),
        }
    }

    /// One step of the batch: the state after it, and its row for the costs.
    pub fn step(&self, weights: &Weights, rides: &Rides, state: State, step: usize) -> (State, Tensor) {
        let (members, scans) = (rides.members, &rides.scans[step]);
        let State { tracks, memory, mut origins, mut known } = state;
        let before: Vec<Track<f64>> = values(&tracks).chunks_exact(TRACK).map(plain).collect();
        let seen = self.see_motion(&before, &mut known);
        let memory = self.memory.step(weights, seen.clone(), memory);
        let (_, motion) = self.motion.say(weights, vec![memory.hidden.clone(), seen]);
        let Predicted { priors, given, points, moments } =
            self.predict(&before, (&known, &origins), &wide(&motion), scans);
        let pooled = self.encode(weights, points, scans.iter().map(Points::count).collect());
        let (hidden, scan) = self.scan.say(weights, vec![pooled, moments, memory.hidden.clone()]);
        let extents = self.see_extents(&priors, &given, &wide(&scan));
        let (_, extent) = self.extent.say(weights, vec![hidden, constant(extents, [members, EXTENT_SEEN])]);
        let (options, given) = (Arc::clone(&self.options), Arc::new(given));
        for (origin, given) in origins.iter_mut().zip(given.iter()) {
            (0..2).for_each(|i| origin[i] += given.shift[i]);
        }
        let operation = Step { options, length: self.length, given };
        let row = apply(operation, [tracks, motion, scan, extent]);
        for ((known, prior), (row, scan)) in
            known.iter_mut().zip(&priors).zip(values(&row).chunks_exact(STEP).zip(scans))
        {
            known.go_on(prior, row, !scan.is_empty());
        }
        (State { tracks: row.clone().narrow(1, 0, TRACK), memory, origins, known }, row)
    }

    /// What the memory sees of all members, which have learned from the velocity after the last step.
    fn see_motion(&self, before: &[Track<f64>], known: &mut [Known]) -> Tensor {
        let (options, width) = (&self.options, self.options.sizes().motion_seen);
        let mut seen = vec![0.0; before.len() * width];
        for ((track, known), row) in before.iter().zip(known).zip(seen.chunks_exact_mut(width)) {
            let (identification, velocity) = (&options.identification, track.motion.velocity);
            known.regression.take(identification, options.change, velocity, known.measured);
            options.see_motion(track, &known.before(), row);
        }
        constant(seen, [before.len(), width])
    }

    /// The predictions, and what is seen of the scans in their frames.
    fn predict(
        &self,
        before: &[Track<f64>],
        (known, origins): (&[Known], &[[f64; 2]]),
        said: &[Vec<f64>],
        scans: &[Points],
    ) -> Predicted {
        let (options, sizes) = (&self.options, self.options.sizes());
        let noise = (self.scattering.scale(), &self.scattering.noise());
        let total: usize = scans.iter().map(Points::count).sum();
        // Without any point there is a row of zeros that no member takes.
        let mut rows = vec![0.0; total.max(1) * sizes.point];
        let mut moments = vec![0.0; scans.len() * sizes.scan_seen];
        let (mut priors, mut given, mut rest) = (Vec::new(), Vec::new(), rows.as_mut_slice());
        for (member, row) in moments.chunks_exact_mut(sizes.scan_seen).enumerate() {
            let (before, known, points) = (&before[member], &known[member], &scans[member]);
            let axis = heading(options, before.motion.velocity, known.angle);
            let (velocities, expected) = (known.regression.past().to_vec(), known.regression.expected());
            let past = Past { heading: axis, velocities: &velocities, expected };
            let prior = before.predict(options, &past, &said[member], self.length);
            let view = (!points.is_empty()).then(|| {
                let view = View::new(options, &prior, known.angle, points, noise);
                View { mean: [0, 1].map(|i| view.mean[i] - origins[member][i]), ..view }
            });
            if let Some(view) = &view {
                let (own, others) = rest.split_at_mut(points.count() * sizes.point);
                view.see_points(&prior, points, own);
                options.see_scan(&prior, view, row);
                rest = others;
            }
            let shift = prior.motion.place;
            priors.push(prior);
            given.push(Given { heading: axis, velocities, expected, held: known.angle, view, shift });
        }
        let points = constant(rows, [total.max(1), sizes.point]);
        Predicted { priors, given, points, moments: constant(moments, [scans.len(), sizes.scan_seen]) }
    }

    /// What the encoder makes of the points of each member.
    fn encode(&self, weights: &Weights, points: Tensor, counts: Vec<usize>) -> Tensor {
        let points = self.points[0].forward(weights, points);
        let points = self.points[1].forward(weights, points);
        apply(Pool { counts: Arc::new(counts) }, [points])
    }

    /// What is seen of the extents after the updates; zeros where there was none.
    fn see_extents(&self, priors: &[Track<f64>], given: &[Given], said: &[Vec<f64>]) -> Vec<f32> {
        let mut seen = vec![0.0; priors.len() * EXTENT_SEEN];
        for (member, row) in seen.chunks_exact_mut(EXTENT_SEEN).enumerate() {
            if let Some(view) = &given[member].view {
                let after = priors[member].update(&self.options, view, &said[member]);
                self.options.see_extent(&after, view, row);
            }
        }
        seen
    }
}

/// Predictions of a batch.
struct Predicted {
    priors: Vec<Track<f64>>,
    given: Vec<Given>,
    /// Points of all members, as the encoder sees them.
    points: Tensor,
    /// What is seen of each scan besides.
    moments: Tensor,
}

impl Known {
    /// After a step from this prediction to this row.
    fn go_on(&mut self, prior: &Track<f64>, row: &[f32], measured: bool) {
        // The position of the row is relative to the predicted one.
        let prior = shifted(prior.motion.numbers(), prior.motion.place);
        self.angle = f64::from(row[TRACK]);
        self.correction = std::array::from_fn(|i| if measured { f64::from(row[i]) - prior[i] } else { 0.0 });
        self.measured = measured;
    }

    fn before(&self) -> Before<'_> {
        Before {
            angle: self.angle,
            correction: self.correction,
            measured: self.measured,
            regression: &self.regression,
        }
    }
}
