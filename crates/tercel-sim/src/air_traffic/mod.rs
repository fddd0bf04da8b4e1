//! One aircraft that flies straight and turns, seen by a radar.

mod flight;
mod radar;

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use crate::{Interval, SimulationError};

pub use flight::{Flight, Manoeuvre};
pub use radar::Radar;

/// A population of flights: an aircraft switches at random times between straight flight and turns to either side.
///
/// ## Definition
/// The state is `x, y, vx, vy` (m, m/s) around the radar. Each flight draws a number of switches `K` and `K` distinct
/// steps among `1..T`. Each of the `K + 1` legs draws its manoeuvre with equal chance from straight flight, a left turn and
/// a right turn, and each turn its rate. With the leg's rate `ω`, and one acceleration deviation `σ` per flight:
/// ```text
/// x(t) = F(ω) x(t-1) + G a(t),    a(t) ~ N(0, σ² I₂),    G = (dt²/2, dt)ᵀ on each axis
/// ```
/// `F` is that of [`Turn`](tercel_core::motion::Turn). The aircraft begins at a random distance and bearing, with a random
/// speed and an independent heading. The speed walks at random with `a`, so flights leave the interval of first speeds.
///
/// The manoeuvre at `t` is that of the motion from `t-1` to `t`; at `t = 0` it is that of the first leg.
///
/// ## Use it when
/// one manoeuvring target is to be filtered and the truth must be known: these are the populations on which ensembles of
/// KalmanNets were published.
///
/// ## Reference
/// Tables 1 and 4 of the AttEnsKNets paper, with the choices that it leaves open made so that its figures come out:
/// manoeuvres may repeat from leg to leg (its accuracies of constant guesses need that), headings are uniform, and the range
/// and bearing deviations are drawn independently. The element (1,4) of its Eq. 26 is a misprint; `F` here is the turn.
///
/// ```
/// use tercel_sim::air_traffic::AirTraffic;
///
/// let fast = AirTraffic::high_speed().with_steps(100)?;
/// let flight = fast.flight(1, 0);
/// assert_eq!(flight.states().len(), 100);
/// assert!(flight.speeds().next().is_some_and(|speed| (400.0..=600.0).contains(&speed)));
/// # Ok::<(), tercel_sim::SimulationError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct AirTraffic {
    steps: usize,
    interval: f64,
    switches: RangeInclusive<usize>,
    turn_rate: Interval,
    acceleration: Interval,
    distance: Interval,
    speed: Interval,
    ranges: Vec<f64>,
    bearings: Vec<f64>,
}

/// Names of the published populations.
pub const NAMES: [&str; 4] = ["atc-train", "atc-validation", "atc-test", "atc-hshm"];

const DEGREE: f64 = PI / 180.0;

impl AirTraffic {
    /// The population of that name, one of [`NAMES`].
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "atc-train" => Some(Self::training()),
            "atc-validation" => Some(Self::validation()),
            "atc-test" => Some(Self::test()),
            "atc-hshm" => Some(Self::high_speed()),
            _ => None,
        }
    }

    /// The published training set: 1 to 4 switches in 200 steps, turns to 10 °/s, accelerations of 8 to 13 m/s².
    pub fn training() -> Self {
        AirTraffic {
            steps: 200,
            interval: 1.0,
            switches: 1..=4,
            turn_rate: Interval::fixed(0.0, 10.0 * DEGREE),
            acceleration: Interval::fixed(8.0, 13.0),
            distance: Interval::fixed(50_000.0, 150_000.0),
            speed: Interval::fixed(50.0, 400.0),
            ranges: (1..=10).map(|tens| 10.0 * f64::from(tens)).collect(),
            bearings: (1..=10).map(|tenths| 0.1 * f64::from(tenths) * DEGREE).collect(),
        }
    }

    /// The published validation set: 1 to 5 switches, turns to 10 °/s, accelerations of 5 to 15 m/s².
    pub fn validation() -> Self {
        AirTraffic { switches: 1..=5, acceleration: Interval::fixed(5.0, 15.0), ..Self::training() }
    }

    /// The published test set: 1 to 6 switches, turns to 12 °/s, accelerations of 5 to 20 m/s².
    pub fn test() -> Self {
        AirTraffic {
            switches: 1..=6,
            turn_rate: Interval::fixed(0.0, 12.0 * DEGREE),
            acceleration: Interval::fixed(5.0, 20.0),
            ..Self::training()
        }
    }

    /// The published high-speed, high-manoeuvre set: 4 to 8 switches in 400 steps, turns to 20 °/s, 400 to 600 m/s.
    pub fn high_speed() -> Self {
        AirTraffic {
            steps: 400,
            switches: 4..=8,
            turn_rate: Interval::fixed(0.0, 20.0 * DEGREE),
            speed: Interval::fixed(400.0, 600.0),
            ..Self::test()
        }
    }

    /// Sets the number of steps of a flight. The published sets have 200, and 400 at high speed.
    ///
    /// # Errors
    /// Unless there is a step for each switch after the first state.
    pub fn with_steps(self, steps: usize) -> Result<Self, SimulationError> {
        AirTraffic { steps, ..self }.checked()
    }

    /// Sets the time between steps, s. The published sets have 1 s.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn with_interval(self, interval: f64) -> Result<Self, SimulationError> {
        AirTraffic { interval, ..self }.checked()
    }

    /// Sets the fewest and the most switches between legs.
    ///
    /// # Errors
    /// When the range is empty, or there are more switches than steps after the first.
    pub fn with_switches(self, switches: RangeInclusive<usize>) -> Result<Self, SimulationError> {
        AirTraffic { switches, ..self }.checked()
    }

    /// Sets the rates of turns, rad/s, to either side. The published sets begin at 0; a turn at a vanishing rate counts as a
    /// turn but looks like straight flight, which bounds the accuracy that a classifier can reach.
    ///
    /// # Errors
    /// When a rate is negative.
    pub fn with_turn_rates(self, turn_rate: Interval) -> Result<Self, SimulationError> {
        AirTraffic { turn_rate, ..self }.checked()
    }

    /// Sets the standard deviations of the acceleration, m/s² per axis, of which each flight draws one.
    ///
    /// # Errors
    /// When one is negative.
    pub fn with_acceleration(self, acceleration: Interval) -> Result<Self, SimulationError> {
        AirTraffic { acceleration, ..self }.checked()
    }

    /// Sets the distances from the radar at which flights begin, m.
    ///
    /// # Errors
    /// When one is negative.
    pub fn with_distance(self, distance: Interval) -> Result<Self, SimulationError> {
        AirTraffic { distance, ..self }.checked()
    }

    /// Sets the first speeds, m/s.
    ///
    /// # Errors
    /// When one is negative.
    pub fn with_speed(self, speed: Interval) -> Result<Self, SimulationError> {
        AirTraffic { speed, ..self }.checked()
    }

    /// Sets the standard deviations of the radar's range (m) and bearing (rad), of which each flight draws one pair.
    ///
    /// # Errors
    /// When a list is empty, or a deviation is not positive and finite.
    pub fn with_radars(self, ranges: Vec<f64>, bearings: Vec<f64>) -> Result<Self, SimulationError> {
        AirTraffic { ranges, bearings, ..self }.checked()
    }

    /// Number of steps of a flight, the first state included.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Time between steps, s.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// Fewest and most switches between legs.
    pub fn switches(&self) -> RangeInclusive<usize> {
        self.switches.clone()
    }

    /// Rates of turns, rad/s, to either side.
    pub fn turn_rate(&self) -> Interval {
        self.turn_rate
    }

    /// Standard deviations of the acceleration, m/s² per axis.
    pub fn acceleration(&self) -> Interval {
        self.acceleration
    }

    /// Speeds at the start, m/s.
    pub fn speed(&self) -> Interval {
        self.speed
    }

    /// The mean number of switches per second.
    pub fn switch_rate(&self) -> f64 {
        let mean = (self.switches.start() + self.switches.end()) as f64 / 2.0;
        mean / ((self.steps.max(2) - 1) as f64 * self.interval)
    }

    fn checked(self) -> Result<Self, SimulationError> {
        let unless = SimulationError::unless;
        unless(self.steps >= 1, "number of steps", self.steps as f64, "there must be at least 1")?;
        let interval = self.interval;
        unless(
            interval > 0.0 && interval.is_finite(),
            "time between steps",
            interval,
            "it must be positive",
        )?;
        let (fewest, most) = (*self.switches.start(), *self.switches.end());
        unless(fewest <= most, "fewest switches", fewest as f64, "it must not exceed the most switches")?;
        let expected = "there must be a step for each switch after the first state";
        unless(most < self.steps, "most switches", most as f64, expected)?;
        let drawn = [
            ("smallest turn rate", self.turn_rate),
            ("smallest deviation of the acceleration", self.acceleration),
            ("smallest distance", self.distance),
            ("smallest speed", self.speed),
        ];
        for (what, interval) in drawn {
            unless(interval.low() >= 0.0, what, interval.low(), "it must not be negative")?;
        }
        for (what, list) in [("range deviation", &self.ranges), ("bearing deviation", &self.bearings)] {
            unless(!list.is_empty(), what, 0.0, "there must be at least one")?;
            for &value in list {
                unless(value > 0.0 && value.is_finite(), what, value, "it must be positive and finite")?;
            }
        }
        Ok(self)
    }
}
