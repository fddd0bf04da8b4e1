//! RMMNet: a random-matrix filter with a learned memory, trained by rolling it out over whole trajectories.
//!
//! ## Definition
//!
//! The filter of [`tercel_neural::filter::RmmNet`], differentiable, with the costs of [`Costs`]. Its step is written once, over
//! numbers that are plain at run time and record themselves here ([`crate::tape`]). Gradients flow through the recursion of the
//! filter and the memory of the network, within windows of truncated back-propagation; what the network sees counts as given. The
//! untrained network says nothing, so training starts from a random-matrix filter in straight motion.
//!
//! ## Use it when
//!
//! extended objects of one kind are to be tracked, of which there is a simulator or there are recorded tracks.
//!
//! ## Reference
//!
//! RMMNet paper, sections III-C and III-D, eq. 37. The likelihood in the loss is ours.

mod cost;
mod data;
mod operations;
mod rows;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::sync::Arc;

use tercel_core::extended::Scattering;
use tercel_neural::filter::rmm_net::{
    Aligned, Before, Length, Past, Regression, RmmNetHyper, Track, View, heading,
};
use tercel_neural::{Card, Model, Scale};

pub use cost::Costs;
pub use data::{Population, RmmNetData, Source};

use cost::Truth;
use data::Rides;
use operations::{Given, Judge, Pool, Step};
use rows::{STEP, TRACK, numbers, plain};

use crate::backend::{Tensor, apply, constant, detached, values};
use crate::check::refused;
use crate::layer::{Activation, Linear, Lstm, LstmState};
use crate::recipe::{Kind, Recipe};
use crate::trainer::{self, Draw, Loss, Progress, Run, Split, Summary, Task, Tracks};
use crate::{Initial, ParameterSet, TrainError, Weights};

/// The kind `rmmnet` of recipes.
#[derive(Debug, Clone, Copy)]
pub struct RmmNetKind;

impl Kind for RmmNetKind {
    const NAME: &'static str = "rmmnet";
    type Data = RmmNetData;
    type Model = RmmNetHyper;
    type Loss = Costs;
}

/// An RMMNet in training.
#[derive(Debug)]
pub struct RmmNetTask {
    hyper: RmmNetHyper,
    options: Arc<Aligned>,
    costs: Costs,
    data: RmmNetData,
    tracks: Tracks,
    scattering: Scattering,
    memory: Lstm,
    motion: Head,
    points: [Linear; 2],
    scan: Head,
    extent: Head,
}

/// A layer with the hyperbolic tangent, and a linear one that starts at zero.
#[derive(Debug)]
struct Head {
    hidden: Linear,
    output: Linear,
}

impl Head {
    fn new(set: &mut ParameterSet, name: &str, [seen, hidden, said]: [usize; 3]) -> Result<Self, TrainError> {
        let zero = || Initial::Constant(0.0);
        Ok(Head {
            hidden: Linear::new(set, &format!("{name}.hidden"), seen, hidden, Activation::Tanh)?,
            output: Linear::with_initial(
                set,
                &format!("{name}.output"),
                [hidden, said],
                Activation::Identity,
                [zero(), zero()],
            )?,
        })
    }

    fn say(&self, weights: &Weights, seen: Vec<Tensor>) -> (Tensor, Tensor) {
        let hidden = self.hidden.forward(weights, Tensor::cat(seen, 1));
        (hidden.clone(), self.output.forward(weights, hidden))
    }
}

/// What is known of one object apart from its track, and counts as given.
#[derive(Debug, Clone)]
struct Known {
    angle: f64,
    correction: [f64; 4],
    measured: bool,
    regression: Regression,
}

/// A batch of filters between two steps.
#[derive(Debug, Clone)]
pub struct State {
    tracks: Tensor,
    memory: LstmState,
    known: Vec<Known>,
}

impl RmmNetTask {
    /// The task of a recipe, and the parameters with which it starts.
    ///
    /// # Errors
    ///
    /// If a value makes no sense; before anything is trained.
    pub fn new(
        recipe: &Recipe<RmmNetKind>,
        tracks: Option<Tracks>,
    ) -> Result<(Self, ParameterSet), TrainError> {
        let (hyper, costs, data) = (recipe.model.clone(), recipe.loss, recipe.data.clone());
        hyper.check().map_err(|reason| TrainError::Recipe(format!("[model]: {reason}")))?;
        costs.check()?;
        data.check()?;
        if hyper.interval != data.interval {
            let expected = format!("the trajectories have a step of {} s", data.interval);
            return Err(refused("model.interval", hyper.interval, expected));
        }
        let tracks = match (&data.source, tracks) {
            (Source::Tracks { .. }, None) => {
                return Err(TrainError::Data(
                    "this recipe learns from recorded tracks; name them with --data".to_owned(),
                ));
            }
            (Source::Tracks { .. }, Some(tracks)) => tracks,
            (Source::Vehicles { .. }, _) => Tracks::default(),
        };
        let window = if costs.window == 0 { data.steps } else { costs.window };
        let mut set = ParameterSet::new(recipe.seed);
        let Aligned { hidden, encoder, .. } = *hyper.aligned();
        let sizes = hyper.sizes();
        let task = Self {
            memory: Lstm::new(&mut set, "memory", sizes.motion_seen, hyper.memory)?,
            motion: Head::new(
                &mut set,
                "motion",
                [hyper.memory + sizes.motion_seen, hidden, sizes.motion_said],
            )?,
            points: [
                Linear::new(&mut set, "points.first", sizes.point, encoder, Activation::Relu)?,
                Linear::new(&mut set, "points.second", encoder, encoder, Activation::Relu)?,
            ],
            scan: Head::new(
                &mut set,
                "scan",
                [2 * encoder + sizes.scan_seen + hyper.memory, hidden, sizes.scan_said],
            )?,
            extent: Head::new(&mut set, "extent", [hidden + sizes.extent_seen, hidden, sizes.extent_said])?,
            options: Arc::new(hyper.aligned().clone()),
            scattering: data.scattering()?,
            costs: Costs { window, ..costs },
            hyper,
            data,
            tracks,
        };
        tercel_neural::filter::check(&Model::new(task.card(), set.tensors())?)?;
        Ok((task, set))
    }

    fn length(&self) -> Length {
        Length { dt: self.data.interval, share: self.data.interval / self.hyper.interval }
    }

    fn first(&self, rides: &Rides) -> State {
        let rows = rides.births.iter().flat_map(|(track, _)| numbers(track)).map(|x| x as f32).collect();
        let known = |(_, angle): &(Track<f64>, f64)| Known {
            angle: *angle,
            correction: [0.0; 4],
            measured: true,
            regression: Regression::new(&self.options.identification),
        };
        State {
            tracks: constant(rows, [rides.members, TRACK]),
            memory: LstmState::zero(rides.members, self.hyper.memory),
            known: rides.births.iter().map(known).collect(),
        }
    }

    /// One step of the batch: the state after it, and its row for the costs.
    fn step(&self, weights: &Weights, rides: &Rides, state: State, step: usize) -> (State, Tensor) {
        let (options, members, sizes) = (&self.options, rides.members, self.hyper.sizes());
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
            let prior = before[member].predict(options, &past, &said[member], self.length());
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
        let operation = Step { options: Arc::clone(options), length: self.length(), given: Arc::new(given) };
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

/// Mean squares of errors per component, of the shape, and the consistency, for the curve.
fn parts(rows: &[f32], truth: &[Truth]) -> Vec<(&'static str, f64)> {
    let mut sums = [0.0; 4];
    for (row, truth) in rows.chunks_exact(STEP).zip(truth) {
        let track = plain(row);
        let e = [0, 1, 2, 3].map(|i| f64::from(row[i]) - truth.state[i]);
        sums[0] += 0.5 * (e[0] * e[0] + e[1] * e[1]);
        sums[1] += 0.5 * (e[2] * e[2] + e[3] * e[3]);
        let (angle, t) = (f64::from(row[TRACK]), &truth.extent);
        let axes = track.axes.map(|axis| (2.0 * axis).exp());
        let own = tercel_neural::filter::rmm_net::Symmetric { xx: axes[0], xy: 0.0, yy: axes[1] };
        let own = own.turned([angle.cos(), angle.sin()]);
        let product = own.xx * t.xx + 2.0 * own.xy * t.xy + own.yy * t.yy;
        let root = (own.determinant() * t.determinant()).max(0.0).sqrt();
        sums[2] += own.xx + own.yy + t.xx + t.yy - 2.0 * (product + 2.0 * root).max(0.0).sqrt();
        let inverse = track.motion.place_covariance.inverse();
        sums[3] += inverse.form([e[0], e[1]], [e[0], e[1]]);
    }
    let count = truth.len() as f64;
    ["position", "velocity", "shape", "nees"].into_iter().zip(sums.map(|sum| sum / count)).collect()
}

impl Task for RmmNetTask {
    type Batch = Rides;
    type Memory = State;

    fn card(&self) -> Card {
        let mut card = Card::new("untrained", RmmNetKind::NAME, &["x", "y", "vx", "vy"]);
        // Options that came from TOML fit into it.
        card.hyper = self.hyper.to_table().unwrap_or_default();
        let interval = Scale { value: self.data.interval, unit: "s".to_owned() };
        card.scales.insert("interval".to_owned(), interval);
        card
    }

    fn samples(&self, split: Split) -> usize {
        self.data.samples(split, &self.tracks)
    }

    fn batch(&self, draw: Draw<'_>) -> Result<Rides, TrainError> {
        Rides::new(&self.data, &self.options, &self.tracks, draw)
    }

    fn windows(&self, rides: &Rides) -> usize {
        (rides.scans.len() - 1).div_ceil(self.costs.window)
    }

    fn loss(
        &self,
        weights: &Weights,
        rides: &Rides,
        window: usize,
        memory: &mut Option<State>,
    ) -> Result<Loss, TrainError> {
        let first = 1 + window * self.costs.window;
        let last = (first + self.costs.window).min(rides.scans.len());
        let mut state = memory.take().unwrap_or_else(|| self.first(rides));
        let mut rows = Vec::with_capacity(last - first);
        for step in first..last {
            let (next, row) = self.step(weights, rides, state, step);
            state = next;
            rows.push(row);
        }
        *memory = Some(State {
            tracks: detached(state.tracks),
            memory: state.memory.detached(),
            known: state.known,
        });
        let truth: Vec<Truth> = rides.truth[first..last].concat();
        let rows = Tensor::cat(rows, 0);
        let parts = parts(&values(&rows), &truth);
        let terms = truth.len() as f64;
        let value = apply(Judge { costs: self.costs, truth: Arc::new(truth) }, [rows]).mean().reshape([1, 1]);
        Ok(Loss { value, terms, parts })
    }
}

/// Trains an RMMNet as a recipe says.
///
/// # Errors
///
/// If the recipe is refused, or the training fails.
pub fn train(
    text: &str,
    run: &Run,
    observer: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Summary, TrainError> {
    let recipe = Recipe::<RmmNetKind>::parse(text)?;
    let (task, set) = RmmNetTask::new(&recipe, run.tracks.clone())?;
    trainer::train(&recipe, &task, set, run, observer)
}
