//! Extended objects to learn from: simulated vehicles, or recorded tracks.

use nalgebra::{Matrix2, Rotation2, Vector2, Vector4};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use tercel_core::extended::{Points, Scattering};
use tercel_neural::filter::rmm_net::{Kinematics, Symmetric, begin};
use tercel_sim::extended::{Crossing, Generator, Heading, Ride, Scatterers, Sizes, Vehicle};

use super::cost::Truth;
use super::imitation::imitation;
use crate::TrainError;
use crate::check::{positive, refused, size, within};
use crate::recipe::TestTracks;
use crate::trainer::{Draw, Split, Tracks};

/// The section `[data]`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RmmNetData {
    /// Where the motion comes from.
    pub source: Source,
    /// Objects to train on; with tracks, how many an epoch takes.
    pub training: usize,
    /// Objects to judge by; at most the tracks of the fold.
    pub validation: usize,
    /// Steps of an object, with the first.
    pub steps: usize,
    /// Time between steps, s.
    pub interval: f64,
    /// Mean number of points in a scan.
    pub points: f64,
    /// Variances of the sensor noise along the axes of the plane, m².
    pub noise: [f64; 2],
    /// Probability that a scan is empty, in training.
    #[serde(default)]
    pub empty: f64,
    /// Share of the objects that begin at their first scan, in training; the others begin at the true state.
    #[serde(default)]
    pub born: f64,
}

/// Where the motion comes from.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Source {
    /// Simulated vehicles.
    Vehicles {
        /// Populations, of which each object is of one.
        generators: Vec<Population>,
        /// Share of the objects with sizes of their own; the others have the published one.
        #[serde(default)]
        mixed: f64,
        /// Whether each epoch draws new vehicles and scans. Otherwise all epochs learn from one set.
        #[serde(default)]
        fresh: bool,
    },
    /// The objects of simulated crossings, which go straight but for small disturbances.
    Crossings,
    /// Recorded tracks, which the program is given.
    Tracks {
        /// Semi-axes, along the course and across, m.
        axes: [f64; 2],
        /// Into how many parts the tracks are cut.
        folds: usize,
        /// The part that is held out to judge by, from 0.
        fold: usize,
        /// Learns from simulated tracks instead, each of which moves as a recorded one with so many past velocities.
        #[serde(default)]
        imitated: Option<usize>,
        /// Those that the program keeps back for a study.
        #[serde(default)]
        test: TestTracks,
        /// Takes the tracks where they are, neither moved to the origin nor turned: for what knows its way by heart.
        #[serde(default)]
        fixed: bool,
    },
}

/// How the weights of a vehicle are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Population {
    /// [`Generator::Reject`].
    Reject,
    /// [`Generator::L1`].
    L1,
    /// [`Generator::Smooth`].
    Smooth,
}

impl Population {
    fn generator(self) -> Generator {
        match self {
            Population::Reject => Generator::Reject,
            Population::L1 => Generator::L1,
            Population::Smooth => Generator::Smooth,
        }
    }
}

/// The seed of the published tables: nothing is trained on its vehicles.
const RESERVED: u64 = 7919;

/// Variance of the state of an object that begins at the truth, m² and m²/s²: as in the studies.
const START: f64 = 10.0;

impl RmmNetData {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    ///
    /// Names the key.
    pub fn check(&self) -> Result<(), TrainError> {
        size("data.training", self.training, [1, 1 << 30])?;
        size("data.validation", self.validation, [1, 1 << 30])?;
        size("data.steps", self.steps, [2, 1 << 20])?;
        positive("data.interval", self.interval)?;
        positive("data.points", self.points)?;
        positive("data.noise[0]", self.noise[0])?;
        positive("data.noise[1]", self.noise[1])?;
        within("data.empty", self.empty, 0.0..1.0)?;
        within("data.born", self.born, 0.0..1.0 + f64::EPSILON)?;
        match &self.source {
            Source::Vehicles { generators, mixed, .. } => {
                if generators.is_empty() {
                    return Err(refused("data.source.generators", "[]", "it must name at least one"));
                }
                if self.interval != 1.0 {
                    return Err(refused("data.interval", self.interval, "vehicles have a step of 1 s"));
                }
                within("data.source.mixed", *mixed, 0.0..1.0 + f64::EPSILON)
            }
            Source::Crossings => {
                if self.interval != 1.0 {
                    return Err(refused("data.interval", self.interval, "crossings have a step of 1 s"));
                }
                Ok(())
            }
            Source::Tracks { axes, folds, fold, imitated, .. } => {
                size("data.source.imitated", imitated.unwrap_or(1), [1, 64])?;
                positive("data.source.axes[0]", axes[0])?;
                positive("data.source.axes[1]", axes[1])?;
                size("data.source.folds", *folds, [2, 1 << 20])?;
                size("data.source.fold", *fold, [0, folds - 1])
            }
        }
    }

    /// The recorded tracks to learn from, of those that were given: none where the objects are simulated.
    ///
    /// # Errors
    ///
    /// When the network is made for another interval, or there are no tracks to learn from.
    pub fn fit(&self, interval: f64, tracks: Option<Tracks>) -> Result<Tracks, TrainError> {
        if interval != self.interval {
            let expected = format!("the trajectories have a step of {} s", self.interval);
            return Err(refused("model.interval", interval, expected));
        }
        match (&self.source, tracks) {
            (Source::Tracks { .. }, Some(tracks)) => Ok(tracks),
            (Source::Tracks { .. }, None) => Err(TrainError::Data(
                "this recipe learns from recorded tracks; name them with --data".to_owned(),
            )),
            (Source::Vehicles { .. } | Source::Crossings, _) => Ok(Tracks::default()),
        }
    }

    fn scatterers(&self) -> Result<Scatterers, TrainError> {
        let failed = |error: tercel_sim::SimulationError| TrainError::Data(error.to_string());
        let scatterers = Scatterers::new(self.points, self.covariance()).map_err(failed)?;
        Ok(scatterers.without_empty_scans())
    }

    fn covariance(&self) -> Matrix2<f64> {
        Matrix2::new(self.noise[0], 0.0, 0.0, self.noise[1])
    }

    /// How points spread over an object.
    pub fn scattering(&self) -> Result<Scattering, TrainError> {
        Scattering::uniform(self.covariance()).map_err(|error| TrainError::Data(error.to_string()))
    }

    /// The number of objects.
    pub fn samples(&self, split: Split, tracks: &Tracks) -> usize {
        match (split, &self.source) {
            (Split::Training, _) => self.training,
            (Split::Validation, Source::Tracks { folds, .. }) => self.validation.min(tracks.len() / folds),
            (Split::Validation, _) => self.validation,
        }
    }

    /// An object of a draw as it moves.
    fn ride(
        &self,
        draw: Draw<'_>,
        sample: u64,
        tracks: &Tracks,
        random: &mut ChaCha8Rng,
    ) -> Result<Ride, TrainError> {
        let failed = |error: tercel_sim::SimulationError| TrainError::Data(error.to_string());
        let split = if draw.split == Split::Training { 0x7472 } else { 0x7661 };
        let seed = draw.seed ^ (split << 16);
        let seed = if seed == RESERVED { !seed } else { seed };
        match &self.source {
            Source::Crossings => {
                let objects = 3;
                let number = sample / objects + ((draw.epoch as u64) << 32);
                let crossing = Crossing::new(self.scatterers()?).with_objects(objects as usize);
                let mut rides = crossing.draw(seed, number).rides;
                Ok(rides.swap_remove((sample % objects) as usize))
            }
            Source::Vehicles { generators, mixed, .. } => {
                let number = sample + ((draw.epoch as u64) << 32);
                let generator = generators[sample as usize % generators.len()].generator();
                let vehicle = Vehicle::new(generator).with_steps(self.steps).map_err(failed)?;
                // Apart from the random numbers of an epoch: the size belongs to the vehicle.
                let share = (sample / generators.len() as u64) as f64 * 0.618_033_988_749_895;
                let own = share.fract() < *mixed;
                let sizes = if own { Sizes::MIXED } else { Sizes::PUBLISHED };
                Ok(vehicle.with_sizes(sizes).map_err(failed)?.ride(seed, number))
            }
            Source::Tracks { axes, folds, fold, imitated, fixed, .. } => {
                let here = |(number, _): &(usize, &Vec<Vector4<f64>>)| {
                    (number % folds == *fold) == (draw.split == Split::Validation)
                };
                let own: Vec<_> = tracks.iter().enumerate().filter(here).map(|(_, track)| track).collect();
                let Some(track) = own.get(sample as usize % own.len().max(1)) else {
                    return Err(TrainError::Data("there are fewer tracks than folds".to_owned()));
                };
                let own = match imitated {
                    Some(order) => &imitation(track, *order, self.interval, random)?,
                    None => *track,
                };
                let states = self.cut(own, (draw.split, *fixed), random);
                let angles = Heading::Course.angles(&states, draw.seed, sample);
                Ride::new(self.interval, states, angles, Vector2::from(*axes)).map_err(failed)
            }
        }
    }

    /// A part of a track; in training from any of its steps. Unless it is fixed it begins at the origin, and in training it is
    /// turned and perhaps reflected.
    fn cut(
        &self,
        track: &[Vector4<f64>],
        (split, fixed): (Split, bool),
        random: &mut ChaCha8Rng,
    ) -> Vec<Vector4<f64>> {
        let spare = track.len().saturating_sub(self.steps);
        let first = if split == Split::Training { random.random_range(0..=spare) } else { 0 };
        let turn = Rotation2::new(random.random_range(0.0..std::f64::consts::TAU));
        let mirror = if random.random::<bool>() { -1.0 } else { 1.0 };
        let part = &track[first..(first + self.steps).min(track.len())];
        if fixed {
            return part.to_vec();
        }
        let origin = part.first().map_or(Vector2::zeros(), |state| state.xy());
        let changed = |state: &Vector4<f64>| {
            let [place, velocity] = [state.xy() - origin, Vector2::new(state.z, state.w)];
            if split == Split::Validation {
                return Vector4::new(place.x, place.y, velocity.x, velocity.y);
            }
            let [place, velocity] = [place, velocity].map(|v| turn * Vector2::new(v.x, mirror * v.y));
            Vector4::new(place.x, place.y, velocity.x, velocity.y)
        };
        part.iter().map(changed).collect()
    }
}

/// A batch of objects and what was seen of them.
#[derive(Debug)]
pub struct Rides {
    /// The number of objects.
    pub members: usize,
    /// The first states, and the directions of the first scans.
    pub births: Vec<(Kinematics<f64>, f64)>,
    /// Points, by step and member. Those of the first step are in the births.
    pub scans: Vec<Vec<Points>>,
    /// The truth, by step and member.
    pub truth: Vec<Vec<Truth>>,
}

impl Rides {
    /// The objects of a draw, which begin with these semi-axes (m) and this deviation of the velocity (m/s).
    ///
    /// # Errors
    ///
    /// If one cannot be simulated, or tracks are missing or too short.
    pub fn new(
        data: &RmmNetData,
        (axes, speed): ([f64; 2], f64),
        tracks: &Tracks,
        draw: Draw<'_>,
    ) -> Result<Self, TrainError> {
        let (members, steps) = (draw.samples.len(), data.steps);
        let repeated = matches!(data.source, Source::Vehicles { fresh: false, .. });
        let draw = Draw { epoch: if repeated { 0 } else { draw.epoch }, ..draw };
        let scatterers = data.scatterers()?;
        let scattering = data.scattering()?;
        let mut rides = Rides {
            members,
            births: Vec::with_capacity(members),
            scans: vec![Vec::with_capacity(members); steps],
            truth: vec![Vec::with_capacity(members); steps],
        };
        for sample in draw.samples {
            let mut random = draw.random(*sample);
            let ride = data.ride(draw, *sample, tracks, &mut random)?;
            if ride.states().len() < steps {
                let found = ride.states().len();
                return Err(TrainError::Data(format!("a track has {found} steps; expected {steps} or more")));
            }
            let learning = draw.split == Split::Training;
            for step in 0..steps {
                let ellipse = ride.ellipse(step);
                let empty = learning && step > 0 && random.random::<f64>() < data.empty;
                let count = if empty { 0 } else { scatterers.count(&mut random) };
                rides.scans[step].push(scatterers.points(&ellipse, count, &mut random).collect());
                let extent = ellipse.matrix();
                rides.truth[step].push(Truth {
                    state: ride.states()[step].into(),
                    extent: Symmetric { xx: extent.m11, xy: extent.m12, yy: extent.m22 },
                });
            }
            let first = rides.scans[0].last().map_or_else(Points::default, Points::clone);
            let born = learning && random.random::<f64>() < data.born;
            let (mut motion, angle) = begin(&first, &scattering, axes, speed);
            if !born {
                let state = ride.states()[0];
                let own = Symmetric { xx: START, xy: 0.0, yy: START };
                motion = Kinematics {
                    place: [state.x, state.y],
                    velocity: [state.z, state.w],
                    place_covariance: own,
                    cross: [[0.0; 2]; 2],
                    velocity_covariance: own,
                };
            }
            rides.births.push((motion, angle));
        }
        Ok(rides)
    }
}
