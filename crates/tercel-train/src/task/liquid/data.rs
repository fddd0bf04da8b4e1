//! Trajectories that change how they move, measured as positions.

use std::sync::Arc;

use nalgebra::{Matrix2, Rotation2, Vector2, Vector4};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;
use tercel_core::filter::{Extended, Filter};
use tercel_core::motion::ConstantVelocity;
use tercel_core::sensor::{Measurement, Position};

use crate::TrainError;
use crate::check::{at_least, positive, refused, size};
use crate::task::gaussians::{GAUSSIAN, Reading, push};
use crate::trainer::{Draw, Split};

/// The section `[data]`: trajectories of objects that move straight, accelerate and turn by turns.
///
/// Each is drawn once, from the seed of the recipe. In each epoch it is rotated by any angle, reflected or not, and measured
/// anew. No scene of a study is among them.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LiquidData {
    /// Trajectories to train on.
    pub training: usize,
    /// Trajectories to judge by.
    pub validation: usize,
    /// Steps of a trajectory, with the first.
    pub steps: usize,
    /// Time between steps, s.
    pub interval: f64,
    /// Least and greatest time between changes of the motion, s.
    pub hold: [f64; 2],
    /// Greatest turn rate, degrees/s.
    pub turn: f64,
    /// Greatest acceleration, m/s².
    pub acceleration: f64,
    /// Greatest speed, m/s.
    pub speed: f64,
    /// Half the width of the square in which trajectories begin, m.
    pub region: f64,
    /// Least and greatest standard deviation of a measured position, m per axis.
    pub deviation: [f64; 2],
    /// Least and greatest probability that a step is measured.
    pub detection: [f64; 2],
    /// Probability that measurements stop after a step.
    pub gap: f64,
    /// Greatest number of steps for which they do: how far the filter is rolled out.
    pub roll_out: usize,
}

impl Default for LiquidData {
    fn default() -> Self {
        Self {
            training: 6400,
            validation: 1280,
            steps: 100,
            interval: 1.0,
            hold: [5.0, 30.0],
            turn: 12.0,
            acceleration: 1.5,
            speed: 50.0,
            region: 1000.0,
            deviation: [3.0, 15.0],
            detection: [0.8, 1.0],
            gap: 0.04,
            roll_out: 5,
        }
    }
}

impl LiquidData {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    ///
    /// Names the key.
    pub fn check(&self) -> Result<(), TrainError> {
        size("data.training", self.training, [1, 1 << 30])?;
        size("data.validation", self.validation, [1, 1 << 30])?;
        size("data.steps", self.steps, [2, 1 << 20])?;
        size("data.roll_out", self.roll_out, [1, 1 << 20])?;
        positive("data.interval", self.interval)?;
        positive("data.speed", self.speed)?;
        for (key, value) in
            [("turn", self.turn), ("acceleration", self.acceleration), ("region", self.region)]
        {
            at_least(&format!("data.{key}"), value, 0.0)?;
        }
        positive("data.hold", self.hold[0])?;
        positive("data.deviation", self.deviation[0])?;
        for (key, range) in
            [("hold", self.hold), ("deviation", self.deviation), ("detection", self.detection)]
        {
            if !(range[1].is_finite() && range[0] <= range[1]) {
                return Err(refused(
                    &format!("data.{key}"),
                    format!("{range:?}"),
                    "the second must be the greater",
                ));
            }
        }
        let probabilities =
            [("detection", self.detection[0]), ("detection", self.detection[1]), ("gap", self.gap)];
        match probabilities.iter().find(|(_, value)| !(0.0..=1.0).contains(value)) {
            Some((key, value)) => Err(refused(&format!("data.{key}"), value, "it is a probability")),
            None => Ok(()),
        }
    }

    /// The number of trajectories.
    pub fn samples(&self, split: Split) -> usize {
        match split {
            Split::Training => self.training,
            Split::Validation => self.validation,
        }
    }

    /// A trajectory as it was drawn.
    fn base(&self, draw: Draw<'_>, sample: u64) -> Vec<Vector4<f64>> {
        // Apart from the random numbers of any epoch.
        let mut random = Draw { seed: draw.seed ^ 0x7472_616a, epoch: 0, ..draw }.random(sample);
        let heading = random.random_range(0.0..std::f64::consts::TAU);
        let speed = random.random_range(0.0..=self.speed);
        let mut place = || random.random_range(-self.region..=self.region);
        let (x, y) = (place(), place());
        let mut states = vec![Vector4::new(x, y, speed * heading.cos(), speed * heading.sin())];
        while states.len() < self.steps {
            let hold = random.random_range(self.hold[0]..=self.hold[1]);
            let count = ((hold / self.interval).round().max(1.0) as usize).min(self.steps - states.len());
            let last = states[states.len() - 1];
            states.extend(self.leg(&mut random, last, count));
        }
        states
    }

    /// Some steps in which the motion does not change and the object does not get too fast.
    fn leg(&self, random: &mut ChaCha8Rng, start: Vector4<f64>, count: usize) -> Vec<Vector4<f64>> {
        for _ in 0..20 {
            let motion = match random.random_range(0..3) {
                0 => Motion::Straight,
                1 => Motion::Turning(random.random_range(-self.turn..=self.turn).to_radians()),
                _ => {
                    let direction = random.random_range(0.0..std::f64::consts::TAU);
                    let size = random.random_range(0.0..=self.acceleration);
                    Motion::Accelerating(Vector2::new(size * direction.cos(), size * direction.sin()))
                }
            };
            let states: Vec<_> =
                (1..=count).map(|step| motion.after(&start, step as f64 * self.interval)).collect();
            // The speed is largest at one of the ends.
            if states.last().is_none_or(|last| last[2].hypot(last[3]) <= self.speed) {
                return states;
            }
        }
        (1..=count).map(|step| Motion::Straight.after(&start, step as f64 * self.interval)).collect()
    }

    /// A trajectory as this epoch has it, and random numbers to measure it with.
    pub fn states(&self, draw: Draw<'_>, sample: u64) -> (Vec<Vector4<f64>>, ChaCha8Rng) {
        let mut random = draw.random(sample);
        let turn = Rotation2::new(random.random_range(0.0..std::f64::consts::TAU));
        let mirror = if random.random::<bool>() { -1.0 } else { 1.0 };
        let changed = |state: Vector4<f64>| {
            let [place, velocity] = [0, 2].map(|i| turn * Vector2::new(state[i], mirror * state[i + 1]));
            Vector4::new(place.x, place.y, velocity.x, velocity.y)
        };
        (self.base(draw, sample).into_iter().map(changed).collect(), random)
    }

    /// What a sensor of this accuracy says of the states: `None` where it says nothing. The first is always there.
    fn plots(
        &self,
        states: &[Vector4<f64>],
        random: &mut ChaCha8Rng,
        deviation: f64,
    ) -> Vec<Option<Vector2<f64>>> {
        let detection = random.random_range(self.detection[0]..=self.detection[1]);
        let mut silent = 0;
        let mut plot = |(step, state): (usize, &Vector4<f64>)| {
            let mut error = || deviation * Distribution::<f64>::sample(&StandardNormal, random);
            let place = Vector2::new(state[0] + error(), state[1] + error());
            let (seen, gap) = (random.random_bool(detection), random.random_bool(self.gap));
            if silent > 0 {
                silent -= 1;
                return None;
            }
            if gap {
                silent = random.random_range(1..=self.roll_out);
            }
            (seen || step == 0).then_some(place)
        };
        states.iter().enumerate().map(&mut plot).collect()
    }
}

impl LiquidData {
    /// A trajectory as this epoch has it, and what a sensor says of it at each step, with its accuracy.
    pub(in crate::task) fn measured(
        &self,
        draw: Draw<'_>,
        sample: u64,
    ) -> (Vec<Vector4<f64>>, Vec<Option<Measurement<2>>>) {
        let (states, mut random) = self.states(draw, sample);
        let deviation = random.random_range(self.deviation[0]..=self.deviation[1]);
        let noise = Matrix2::from_diagonal_element(deviation * deviation);
        let plots = self.plots(&states, &mut random, deviation);
        let measurement = |plot: Vector2<f64>| Measurement::from(plot).with_noise(noise);
        (states, plots.into_iter().map(|plot| plot.map(measurement)).collect())
    }
}

/// How an object moves for a while.
#[derive(Debug, Clone, Copy)]
enum Motion {
    Straight,
    Turning(f64),
    Accelerating(Vector2<f64>),
}

impl Motion {
    fn after(self, start: &Vector4<f64>, time: f64) -> Vector4<f64> {
        let (place, velocity) = (start.xy(), Vector2::new(start[2], start[3]));
        let (moved, after) = match self {
            Motion::Turning(rate) if rate != 0.0 => {
                let turn = Rotation2::new(rate * time);
                // The chord is the velocity turned by half the angle, and shortened.
                let half = Rotation2::new(0.5 * rate * time);
                (half * velocity * (2.0 * (0.5 * rate * time).sin() / rate), turn * velocity)
            }
            Motion::Accelerating(a) => (velocity * time + a * (0.5 * time * time), velocity + a * time),
            Motion::Straight | Motion::Turning(_) => (velocity * time, velocity),
        };
        let place = place + moved;
        Vector4::new(place.x, place.y, after.x, after.y)
    }
}

/// A batch of measured trajectories. Positions are relative to the first measurement of each.
#[derive(Debug)]
pub struct Watched {
    /// The number of trajectories.
    pub members: usize,
    /// Where they begin, m.
    pub origins: Vec<Vector2<f64>>,
    /// Standard deviations of their measurements, m.
    pub deviations: Vec<f64>,
    /// The first beliefs, `[members, 20]`.
    pub births: Vec<f32>,
    /// For each step, with the first.
    pub readings: Vec<Arc<Reading>>,
    /// True states, row `step * members + member`.
    pub truth: Vec<f32>,
}

impl Watched {
    /// The trajectories of a draw, as a filter begins with and sees them. `speed` is the prior of the velocity, m/s.
    ///
    /// # Errors
    ///
    /// If a filter refuses a measurement.
    pub fn new(data: &LiquidData, speed: f64, draw: Draw<'_>) -> Result<Self, TrainError> {
        let (members, steps) = (draw.samples.len(), data.steps);
        let empty = Reading {
            places: vec![0.0; 2 * members],
            noises: vec![0.0; 4 * members],
            seen: vec![0.0; members],
        };
        let mut readings = vec![empty; steps];
        let mut watched = Self {
            members,
            origins: Vec::with_capacity(members),
            deviations: Vec::with_capacity(members),
            births: Vec::with_capacity(GAUSSIAN * members),
            readings: Vec::new(),
            truth: vec![0.0; 4 * steps * members],
        };
        for (member, sample) in draw.samples.iter().enumerate() {
            let (states, mut random) = data.states(draw, *sample);
            let deviation = random.random_range(data.deviation[0]..=data.deviation[1]);
            let plots = data.plots(&states, &mut random, deviation);
            let origin = plots[0].unwrap_or_default();
            let failed = |error| TrainError::Data(format!("trajectory {sample}: {error}"));
            let starter = Extended::new(
                ConstantVelocity::new(0.0).with_speed(speed),
                Position::<2>::new(deviation).map_err(failed)?,
            );
            let birth = Filter::<4>::birth(&starter, &[0.0, 0.0].into()).map_err(failed)?;
            push(&mut watched.births, &birth.mean, &birth.covariance);
            watched.origins.push(origin);
            watched.deviations.push(deviation);
            for (step, (plot, state)) in plots.iter().zip(&states).enumerate() {
                let place = state.xy() - origin;
                let state = [place.x, place.y, state[2], state[3]].map(|value| value as f32);
                watched.truth[4 * (step * members + member)..][..4].copy_from_slice(&state);
                let (Some(plot), reading) = (plot, &mut readings[step]) else { continue };
                let place = plot - origin;
                reading.seen[member] = 1.0;
                reading.places[2 * member..][..2].copy_from_slice(&[place.x as f32, place.y as f32]);
                let variance = (deviation * deviation) as f32;
                reading.noises[4 * member..][..4].copy_from_slice(&[variance, 0.0, 0.0, variance]);
            }
        }
        watched.readings = readings.into_iter().map(Arc::new).collect();
        Ok(watched)
    }
}
