//! Extended objects that cross among false points.

use nalgebra::{Vector2, Vector4};
use rand::RngExt;
use rand_distr::{Distribution, Poisson, StandardNormal};

use super::{Ride, Scatterers};
use crate::{SimulationError, Stream};

/// A scene in which ellipses on straight courses with small disturbances cross in the middle of a square,
/// among false points.
///
/// ## Definition
/// Object `i` of `n` begins on a circle of 150 m radius, at an angle that is drawn around `2π i/n`, and heads
/// for a point near the centre at 8 to 12 m/s, so that all pass within some ten metres of each other about
/// half-way. Its velocity gathers white noise of density 0.05 m²/s³; its semi-axes are drawn from 6 m to 12 m
/// by 2 m to 4 m, and it points where it goes. Each is detected with probability 0.95 and then gives points
/// as its [`Scatterers`] say. False points are spread evenly over the square of 400 m.
///
/// ## Use it when
/// trackers of several extended objects are compared: association, cells that two objects share, and false
/// points.
///
/// ```
/// use nalgebra::Matrix2;
/// use tercel_sim::extended::{Crossing, Scatterers};
///
/// let scene = Crossing::new(Scatterers::new(12.0, Matrix2::identity() * 0.25)?).draw(1, 0);
/// assert_eq!((scene.rides.len(), scene.scans.len()), (3, 40));
/// # Ok::<(), tercel_sim::SimulationError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    scatterers: Scatterers,
    objects: usize,
    steps: usize,
    clutter: f64,
}

/// What happened in a [`Crossing`], and what was seen.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossingScene {
    /// The objects, all there from the first step to the last.
    pub rides: Vec<Ride>,
    /// All points of each step, in random order.
    pub scans: Vec<Vec<Vector2<f64>>>,
}

/// Half the side of the square, m.
const HALF_SIDE: f64 = 200.0;

/// Distance of the objects from the centre at the start, m.
const START: f64 = 150.0;

/// Probability that an object is detected in a scan.
const DETECTION: f64 = 0.95;

/// Density of the white acceleration, m²/s³.
const DENSITY: f64 = 0.05;

impl Crossing {
    /// Three objects of these scatterers over 40 steps of 1 s, with 30 false points a scan.
    pub fn new(scatterers: Scatterers) -> Self {
        Crossing { scatterers, objects: 3, steps: 40, clutter: 30.0 }
    }

    /// Sets the number of objects.
    pub fn with_objects(self, objects: usize) -> Self {
        Crossing { objects, ..self }
    }

    /// Sets the mean number of false points in a scan.
    ///
    /// # Errors
    /// When it is negative or above 10⁶.
    pub fn with_clutter(self, clutter: f64) -> Result<Self, SimulationError> {
        let expected = "it must be between 0 and a million";
        SimulationError::unless(
            (0.0..=1e6).contains(&clutter),
            "mean number of false points",
            clutter,
            expected,
        )?;
        Ok(Crossing { clutter, ..self })
    }

    /// Mean number of false points per m².
    pub fn clutter_density(&self) -> f64 {
        self.clutter / (4.0 * HALF_SIDE * HALF_SIDE)
    }

    /// Area in which false points lie, m².
    pub fn area(&self) -> f64 {
        4.0 * HALF_SIDE * HALF_SIDE
    }

    /// Probability that an object is detected in a scan.
    pub fn detection(&self) -> f64 {
        DETECTION
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// How points spread.
    pub fn scatterers(&self) -> Scatterers {
        self.scatterers
    }

    /// Scene number `run`.
    pub fn draw(&self, seed: u64, run: u64) -> CrossingScene {
        let rides: Vec<Ride> = self.rides(seed, run);
        let mut noise = Stream::Noise { realisation: 0 }.of(seed, run);
        let mut chance = Stream::Detection { realisation: 0 }.of(seed, run);
        let clutter = Poisson::new(self.clutter).ok();
        let scans = (0..self.steps)
            .map(|step| {
                let mut points = Vec::new();
                for ride in &rides {
                    let seen = chance.random::<f64>() < DETECTION;
                    let count = self.scatterers.count(&mut chance);
                    if seen {
                        points.extend(self.scatterers.points(&ride.ellipse(step), count, &mut noise));
                    }
                }
                let count = clutter.map_or(0.0, |clutter| clutter.sample(&mut chance)) as usize;
                points.extend(
                    (0..count)
                        .map(|_| Vector2::from_fn(|_, _| HALF_SIDE * (2.0 * noise.random::<f64>() - 1.0))),
                );
                shuffle(&mut points, &mut noise);
                points
            })
            .collect();
        CrossingScene { rides, scans }
    }

    fn rides(&self, seed: u64, run: u64) -> Vec<Ride> {
        let mut random = Stream::Truth.of(seed, run);
        let mut uniform = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let starts: Vec<_> = (0..self.objects)
            .map(|object| {
                let angle =
                    (object as f64 + uniform(-0.25, 0.25)) * std::f64::consts::TAU / self.objects as f64;
                let from = Vector2::new(angle.cos(), angle.sin()) * START;
                let aim = Vector2::new(uniform(-8.0, 8.0), uniform(-8.0, 8.0));
                let velocity = (aim - from).normalize() * uniform(7.0, 9.0);
                (from, velocity, Vector2::new(uniform(6.0, 12.0), uniform(2.0, 4.0)))
            })
            .collect();
        let rides = starts.into_iter().map(|(mut place, mut velocity, axes)| {
            let mut states = Vec::with_capacity(self.steps);
            for _ in 0..self.steps {
                states.push(Vector4::new(place.x, place.y, velocity.x, velocity.y));
                velocity +=
                    Vector2::from_fn(|_, _| -> f64 { StandardNormal.sample(&mut random) }) * DENSITY.sqrt();
                place += velocity;
            }
            let angles = states.iter().map(|state| state.w.atan2(state.z)).collect();
            Ride { interval: 1.0, states, angles, axes, coefficients: Vec::new() }
        });
        rides.collect()
    }
}

/// The order in which points come must not tell where they came from.
fn shuffle(points: &mut [Vector2<f64>], random: &mut impl rand::Rng) {
    for place in (1..points.len()).rev() {
        points.swap(place, random.random_range(0..=place));
    }
}
