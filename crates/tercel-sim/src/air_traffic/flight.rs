//! One flight: its truth, and what a radar sees of it.

use nalgebra::{Vector2, Vector4};
use rand::seq::index;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_core::motion::{Motion, Turn};

use super::{AirTraffic, Radar};
use crate::Stream;

/// What an aircraft does on a leg.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Manoeuvre {
    /// Flies straight on.
    Straight,
    /// Turns to the left, counter-clockwise: a positive turn rate.
    Left,
    /// Turns to the right, clockwise: a negative turn rate.
    Right,
}

impl Manoeuvre {
    /// All manoeuvres, in the order of their [`index`](Manoeuvre::index).
    pub const ALL: [Manoeuvre; 3] = [Manoeuvre::Straight, Manoeuvre::Left, Manoeuvre::Right];

    /// Number of the manoeuvre: 0 straight, 1 left, 2 right.
    pub fn index(self) -> usize {
        self as usize
    }

    /// What a turn rate (rad/s) belongs to.
    pub fn of_rate(rate: f64) -> Self {
        if rate > 0.0 {
            Manoeuvre::Left
        } else if rate < 0.0 {
            Manoeuvre::Right
        } else {
            Manoeuvre::Straight
        }
    }
}

/// The truth of one flight, and the accuracy of the radar that follows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    interval: f64,
    states: Vec<Vector4<f64>>,
    rates: Vec<f64>,
    manoeuvres: Vec<Manoeuvre>,
    acceleration: f64,
    radar: Radar,
}

/// A stretch of a flight with one manoeuvre.
#[derive(Debug, Clone, Copy)]
struct Leg {
    first: usize,
    manoeuvre: Manoeuvre,
    rate: f64,
}

impl AirTraffic {
    /// The flight of this seed and run.
    pub fn flight(&self, seed: u64, run: u64) -> Flight {
        let mut random = Stream::Truth.of(seed, run);
        let legs = self.legs(&mut random);
        let acceleration = self.acceleration.draw(&mut random);
        let radar = Radar::stated(one_of(&self.ranges, &mut random), one_of(&self.bearings, &mut random));
        let first = self.first_state(&mut random);
        let mut flight = Flight {
            interval: self.interval,
            states: Vec::with_capacity(self.steps),
            rates: Vec::with_capacity(self.steps),
            manoeuvres: Vec::with_capacity(self.steps),
            acceleration,
            radar,
        };
        let ends = legs.iter().skip(1).map(|leg| leg.first).chain([self.steps]);
        for (leg, end) in legs.iter().zip(ends) {
            flight.fly(leg, end, &first, &mut random);
        }
        flight
    }

    fn legs(&self, random: &mut ChaCha8Rng) -> Vec<Leg> {
        let switches = random.random_range(self.switches.clone());
        // A switch can fall on any step after the first state.
        let mut starts: Vec<usize> = index::sample(random, self.steps - 1, switches).into_iter().collect();
        starts.sort_unstable();
        let starts = [0].into_iter().chain(starts.into_iter().map(|step| step + 1));
        starts
            .map(|first| {
                let manoeuvre = Manoeuvre::ALL[random.random_range(0..Manoeuvre::ALL.len())];
                // Drawn for straight legs too: what follows then does not depend on the manoeuvre.
                let rate = self.turn_rate.high() - (self.turn_rate.draw(random) - self.turn_rate.low());
                let rate = match manoeuvre {
                    Manoeuvre::Straight => 0.0,
                    Manoeuvre::Left => rate,
                    Manoeuvre::Right => -rate,
                };
                Leg { first, manoeuvre, rate }
            })
            .collect()
    }

    fn first_state(&self, random: &mut ChaCha8Rng) -> Vector4<f64> {
        let mut direction = || {
            let (sine, cosine) = (std::f64::consts::TAU * random.random::<f64>()).sin_cos();
            Vector2::new(cosine, sine)
        };
        let (place, heading) = (direction(), direction());
        let (place, velocity) = (place * self.distance.draw(random), heading * self.speed.draw(random));
        Vector4::new(place.x, place.y, velocity.x, velocity.y)
    }
}

impl Flight {
    /// Flies a leg up to the step `end`.
    fn fly(&mut self, leg: &Leg, end: usize, first: &Vector4<f64>, random: &mut ChaCha8Rng) {
        let dt = self.interval;
        let turn = Turn::new(leg.rate, 0.0).jacobian(first, dt);
        for _ in leg.first..end {
            let state = match self.states.last() {
                None => *first,
                Some(last) => {
                    let a = normal(random) * self.acceleration;
                    let (p, v) = (a * (0.5 * dt * dt), a * dt);
                    turn * last + Vector4::new(p.x, p.y, v.x, v.y)
                }
            };
            self.states.push(state);
            self.rates.push(leg.rate);
            self.manoeuvres.push(leg.manoeuvre);
        }
    }

    /// Time between steps, s.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// True states `x, y, vx, vy` in m and m/s, one per step.
    pub fn states(&self) -> &[Vector4<f64>] {
        &self.states
    }

    /// Turn rate (rad/s, positive to the left) of the motion that led to each state; at the first, that of the first leg.
    pub fn rates(&self) -> &[f64] {
        &self.rates
    }

    /// Manoeuvre that led to each state; at the first, that of the first leg.
    pub fn manoeuvres(&self) -> &[Manoeuvre] {
        &self.manoeuvres
    }

    /// Speed at each step, m/s.
    pub fn speeds(&self) -> impl ExactSizeIterator<Item = f64> {
        self.states.iter().map(|state| state[2].hypot(state[3]))
    }

    /// Standard deviation of the acceleration, m/s² per axis.
    pub fn acceleration(&self) -> f64 {
        self.acceleration
    }

    /// The radar that follows this flight.
    pub fn radar(&self) -> Radar {
        self.radar
    }

    /// What a radar at the origin measures at each step: range (m) and bearing (rad, between -π and π), or nothing when it
    /// misses. The flight's own radar is [`radar`](Flight::radar); any other measures the same truth.
    ///
    /// With the same seed and run, radars of other accuracy err by the same multiples of their deviations, and a lower
    /// detection probability only takes plots away: differences between sweeps are then due to the radar, not to luck.
    pub fn observe(&self, radar: &Radar, seed: u64, run: u64) -> Vec<Option<Vector2<f64>>> {
        let realisation = radar.realisation();
        let mut noise = Stream::Noise { realisation }.of(seed, run);
        let mut chance = Stream::Detection { realisation }.of(seed, run);
        let plot = |(step, state): (usize, &Vector4<f64>)| {
            let error = normal(&mut noise);
            let detected = chance.random::<f64>() < radar.detection() || step == 0;
            let range = state[0].hypot(state[1]) + radar.range() * error.x;
            let bearing = state[1].atan2(state[0]) + radar.bearing() * error.y;
            detected.then(|| polar(range, bearing))
        };
        self.states.iter().enumerate().map(plot).collect()
    }
}

/// Range and bearing in their usual intervals. An error may carry a plot close to the radar across it.
fn polar(range: f64, bearing: f64) -> Vector2<f64> {
    use std::f64::consts::{PI, TAU};
    let bearing = if range < 0.0 { bearing + PI } else { bearing };
    Vector2::new(range.abs(), bearing - TAU * ((bearing + PI) / TAU).floor())
}

fn normal(random: &mut impl Rng) -> Vector2<f64> {
    Vector2::new(StandardNormal.sample(random), StandardNormal.sample(random))
}

fn one_of(values: &[f64], random: &mut impl Rng) -> f64 {
    values[random.random_range(0..values.len())]
}
