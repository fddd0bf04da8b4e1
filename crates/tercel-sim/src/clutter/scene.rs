//! One scene: its truth, and what a sensor sees of it.

use nalgebra::{Vector2, Vector4};
use rand::RngExt;
use rand_distr::{Distribution, Poisson, StandardNormal};

use super::Manoeuvre;
use crate::{Interval, Stream};

/// Time between scans, s.
const INTERVAL: f64 = 1.0;

/// The truth of a scene, and the sensor that watches it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    objects: Vec<Object>,
    region: [Interval; 2],
    sensor: Sensor,
    steps: usize,
    interval: f64,
}

/// What one object does.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    first: usize,
    states: Vec<Vector4<f64>>,
    manoeuvres: Vec<Manoeuvre>,
}

/// How well a scene is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    /// Standard deviation of a measured position, m per axis.
    pub deviation: f64,
    /// Probability that an object is measured in a scan.
    pub detection: f64,
    /// Mean number of false measurements in a scan, over the whole region.
    pub clutter: f64,
}

/// A measured position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plot {
    /// Where, m.
    pub position: Vector2<f64>,
    /// Number of the object that caused it; none for a false one.
    pub object: Option<usize>,
}

impl Object {
    /// An object that starts at a step and moves by one manoeuvre after the other.
    pub(super) fn moving(
        start: Vector4<f64>,
        manoeuvres: impl Iterator<Item = Manoeuvre>,
        first: usize,
    ) -> Self {
        let manoeuvres: Vec<Manoeuvre> = manoeuvres.collect();
        let mut states = Vec::with_capacity(manoeuvres.len() + 1);
        states.push(start);
        let mut state = start;
        for manoeuvre in &manoeuvres {
            state = manoeuvre.step(&state, INTERVAL);
            states.push(state);
        }
        Object { first, states, manoeuvres }
    }

    /// An object that was recorded: the scan in which it appears, and its states from then on.
    pub fn recorded(first: usize, states: impl IntoIterator<Item = Vector4<f64>>) -> Self {
        Object { first, states: states.into_iter().collect(), manoeuvres: Vec::new() }
    }

    /// The scan in which it appears.
    pub fn first(&self) -> usize {
        self.first
    }

    /// Its states `x, y, vx, vy` (m, m/s), one per scan from the first.
    pub fn states(&self) -> &[Vector4<f64>] {
        &self.states
    }

    /// What led from each state to the next; one less than the states. Of a recorded object nothing is known.
    pub fn manoeuvres(&self) -> &[Manoeuvre] {
        &self.manoeuvres
    }

    /// Its state in a scan, if it is there.
    pub fn at(&self, step: usize) -> Option<&Vector4<f64>> {
        self.states.get(step.checked_sub(self.first)?)
    }
}

impl Scene {
    pub(super) fn new(objects: Vec<Object>, region: [Interval; 2], sensor: Sensor, steps: usize) -> Self {
        Scene { objects, region, sensor, steps, interval: INTERVAL }
    }

    /// A scene of recorded objects, with `interval` seconds between scans.
    pub fn recorded(
        objects: Vec<Object>,
        region: [Interval; 2],
        sensor: Sensor,
        steps: usize,
        interval: f64,
    ) -> Self {
        Scene { objects, region, sensor, steps, interval }
    }

    /// The objects.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// The sides of the region that the sensor watches, m along x and y.
    pub fn region(&self) -> [Interval; 2] {
        self.region
    }

    /// Area of the region, m².
    pub fn area(&self) -> f64 {
        self.region.iter().map(|side| side.high() - side.low()).product()
    }

    /// The sensor.
    pub fn sensor(&self) -> Sensor {
        self.sensor
    }

    /// Number of scans.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Time between scans, s.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// The objects that are there in a scan, with their numbers.
    pub fn present(&self, step: usize) -> impl Iterator<Item = (usize, &Vector4<f64>)> {
        let objects = self.objects.iter().enumerate();
        objects.filter_map(move |(number, object)| Some((number, object.at(step)?)))
    }

    /// What the sensor measures in each scan of this seed and run, from left to right: the order says nothing of what is true.
    ///
    /// Errors, detections and clutter come from streams of their own, so that less clutter or a lower detection probability
    /// does not change the rest.
    pub fn observe(&self, seed: u64, run: u64) -> Vec<Vec<Plot>> {
        let mut noise = Stream::Noise { realisation: 0 }.of(seed, run);
        let mut chance = Stream::Detection { realisation: 0 }.of(seed, run);
        let mut clutter = Stream::Clutter { realisation: 0 }.of(seed, run);
        // A mean of zero is no Poisson distribution of the library's, and means none.
        let count = Poisson::new(self.sensor.clutter).ok();
        let mut scan = |step: usize| {
            let mut plots = Vec::new();
            for (number, state) in self.present(step) {
                let error =
                    Vector2::new(StandardNormal.sample(&mut noise), StandardNormal.sample(&mut noise));
                if chance.random::<f64>() < self.sensor.detection {
                    let position = Vector2::new(state[0], state[1]) + error * self.sensor.deviation;
                    plots.push(Plot { position, object: Some(number) });
                }
            }
            let extra = count.as_ref().map_or(0, |count| count.sample(&mut clutter) as usize);
            plots.extend((0..extra).map(|_| {
                let [x, y] = self.region.map(|side| side.draw(&mut clutter));
                Plot { position: Vector2::new(x, y), object: None }
            }));
            plots.sort_by(|a, b| a.position.x.total_cmp(&b.position.x));
            plots
        };
        (0..self.steps).map(&mut scan).collect()
    }
}
