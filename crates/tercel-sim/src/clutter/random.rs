//! Scenes in which everything is drawn.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;

use nalgebra::{Vector2, Vector4};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{Manoeuvre, Object, Scene, Sensor};
use crate::{Interval, SimulationError, Stream};

/// Scenes of many objects of which nothing can be known by heart: how many there are, when they come and go, what they do,
/// how well they are seen and how much clutter there is.
///
/// ## Definition
/// Each object is there from the first scan with probability 1/2, or else appears at a random scan of the first three
/// quarters; it stays for at least 30 scans, and to the end with probability 1/2. It begins anywhere in the region with a random
/// speed and heading. Its motion changes after each stretch of 5 to 30 s: straight (with probability 0.4), a turn to either side (0.35) or
/// an acceleration in any direction (0.25), of a random size. Motions that leave the region or exceed the largest speed are drawn
/// again.
///
/// ## Use it when
/// a method is to be judged beyond the two published scenes, or trained: other seeds are other scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct RandomScenes {
    steps: usize,
    objects: RangeInclusive<usize>,
    region: [Interval; 2],
    speed: Interval,
    fastest: f64,
    turn_rate: Interval,
    acceleration: Interval,
    deviation: Interval,
    detection: Interval,
    clutter: Interval,
}

/// Shortest and longest stretch with one manoeuvre, s.
const STRETCH: RangeInclusive<usize> = 5..=30;

/// Scans that an object stays at least.
const STAY: usize = 30;

impl Default for RandomScenes {
    /// 5 to 12 objects in 3 by 2.5 km over 100 scans; speeds of 5 to 25 m/s at first and 50 m/s at most; turns to 12 °/s and
    /// accelerations to 1.5 m/s²; errors of 5 m, a detection probability of 0.7 to 0.98 and 5 to 60 false measurements a scan.
    fn default() -> Self {
        RandomScenes {
            steps: 100,
            objects: 5..=12,
            region: [Interval::fixed(-1500.0, 1500.0), Interval::fixed(-1250.0, 1250.0)],
            speed: Interval::fixed(5.0, 25.0),
            fastest: 50.0,
            turn_rate: Interval::fixed(1.0 * PI / 180.0, 12.0 * PI / 180.0),
            acceleration: Interval::fixed(0.1, 1.5),
            deviation: Interval::fixed(5.0, 5.0),
            detection: Interval::fixed(0.7, 0.98),
            clutter: Interval::fixed(5.0, 60.0),
        }
    }
}

impl RandomScenes {
    /// Sets from what the detection probability of a scene is drawn.
    ///
    /// # Errors
    /// Unless it lies between 0 and 1.
    pub fn with_detection(self, detection: Interval) -> Result<Self, SimulationError> {
        let inside = detection.low() >= 0.0 && detection.high() <= 1.0;
        let expected = "it must lie between 0 and 1";
        SimulationError::unless(inside, "detection probability", detection.high(), expected)?;
        Ok(RandomScenes { detection, ..self })
    }

    /// Sets from what the mean number of false measurements a scan is drawn.
    ///
    /// # Errors
    /// When it may be negative.
    pub fn with_clutter(self, clutter: Interval) -> Result<Self, SimulationError> {
        let expected = "it must not be negative";
        SimulationError::unless(clutter.low() >= 0.0, "false measurements a scan", clutter.low(), expected)?;
        Ok(RandomScenes { clutter, ..self })
    }

    /// Sets how many objects a scene has.
    ///
    /// # Errors
    /// When the most are fewer than the fewest.
    pub fn with_objects(self, objects: RangeInclusive<usize>) -> Result<Self, SimulationError> {
        let (fewest, most) = (*objects.start() as f64, *objects.end() as f64);
        SimulationError::unless(fewest <= most, "fewest objects", fewest, "it must not exceed the most")?;
        Ok(RandomScenes { objects, ..self })
    }

    /// Number of scans of a scene.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The scene of this seed and run.
    pub fn scene(&self, seed: u64, run: u64) -> Scene {
        let mut random = Stream::Truth.of(seed, run);
        let sensor = Sensor {
            deviation: self.deviation.draw(&mut random),
            detection: self.detection.draw(&mut random),
            clutter: self.clutter.draw(&mut random),
        };
        let count = random.random_range(self.objects.clone());
        let objects = (0..count).map(|_| self.object(&mut random)).collect();
        Scene::new(objects, self.region, sensor, self.steps)
    }

    fn object(&self, random: &mut ChaCha8Rng) -> Object {
        let latest = (self.steps * 3 / 4).min(self.steps.saturating_sub(STAY));
        let first = if random.random::<bool>() { 0 } else { random.random_range(0..=latest) };
        let longest = self.steps - first;
        let stays = random.random::<bool>();
        let length = if stays { longest } else { random.random_range(STAY.min(longest)..=longest) };
        loop {
            let start = self.start(random);
            let manoeuvres = self.manoeuvres(length - 1, random);
            let object = Object::moving(start, manoeuvres.into_iter(), first);
            if object.states().iter().all(|state| self.allows(state)) {
                return object;
            }
        }
    }

    fn start(&self, random: &mut ChaCha8Rng) -> Vector4<f64> {
        let (x, y) = (self.region[0].draw(random), self.region[1].draw(random));
        let velocity = direction(random) * self.speed.draw(random);
        Vector4::new(x, y, velocity.x, velocity.y)
    }

    /// What an object does at each of `count` steps.
    fn manoeuvres(&self, count: usize, random: &mut ChaCha8Rng) -> Vec<Manoeuvre> {
        let mut all = Vec::with_capacity(count + STRETCH.end());
        while all.len() < count {
            let chance: f64 = random.random();
            let manoeuvre = if chance < 0.4 {
                Manoeuvre::Straight
            } else if chance < 0.75 {
                let rate = self.turn_rate.draw(random);
                Manoeuvre::Turn(if random.random::<bool>() { rate } else { -rate })
            } else {
                Manoeuvre::Accelerate(direction(random) * self.acceleration.draw(random))
            };
            let stretch = random.random_range(STRETCH);
            all.extend(std::iter::repeat_n(manoeuvre, stretch));
        }
        all.truncate(count);
        all
    }

    fn allows(&self, state: &Vector4<f64>) -> bool {
        let inside =
            |axis: usize| (self.region[axis].low()..=self.region[axis].high()).contains(&state[axis]);
        inside(0) && inside(1) && state[2].hypot(state[3]) <= self.fastest
    }
}

fn direction(random: &mut ChaCha8Rng) -> Vector2<f64> {
    let (sine, cosine) = (TAU * random.random::<f64>()).sin_cos();
    Vector2::new(cosine, sine)
}
