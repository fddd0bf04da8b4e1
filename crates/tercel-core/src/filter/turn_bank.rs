//! Banks of turns for manoeuvring targets.

use super::{Imm, Kalman, Transition};
use crate::error::FilterError;
use crate::motion::{AccelerationNoise, Turn};

/// How a target in the plane manoeuvres: it turns at one of several rates, and changes between them.
///
/// ## Definition
/// One [`Kalman`] filter of a [`Turn`] for each rate, mixed by an [`Imm`] whose modes stay with the same probability. With
/// several sensors in [`estimating`](TurnBank::estimating), one filter for each pair of rate and sensor: the bank then learns from the
/// innovations which accuracy the sensor has. The modes go through all rates with the first sensor, then all with the next.
///
/// ## Use it when
/// one target manoeuvres and its turns are not known beforehand. The rates must reach as far as the target can turn: a bank that
/// ends at half the rate of a turn loses the target, and rates beyond need cost little. Spaces of 2 to 4 °/s suit radar scans of
/// one second.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 11.6; the choice of rates is a grid as in Li and Bar-Shalom (1993).
///
/// ```
/// use tercel_core::{filter::{Filter, TurnBank}, sensor::ConvertedPolar};
///
/// let bank = TurnBank::evenly(20.0_f64.to_radians(), 10)?; // -20 to 20 °/s in steps of 2
/// assert_eq!(bank.rates().len(), 21);
/// let radar = ConvertedPolar::new(50.0, 0.5_f64.to_radians())?;
/// let filter = bank.filter(radar)?;
/// let mut belief = filter.birth(&[80_000.0, 0.3].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[80_150.0, 0.301].into())?;
/// let [straight, left, right] = bank.directions(filter.mode_probabilities(&belief));
/// assert!((straight + left + right - 1.0).abs() < 1e-12);
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TurnBank {
    rates: Vec<f64>,
    noise: AccelerationNoise,
    speed: f64,
    transition: Transition,
}

impl TurnBank {
    /// A bank of these turn rates, rad/s; positive ones turn left. The rate of straight flight is 0.
    ///
    /// # Errors
    /// When there is none, or one is not finite.
    pub fn new(rates: impl IntoIterator<Item = f64>) -> Result<Self, FilterError> {
        let rates: Vec<f64> = rates.into_iter().collect();
        if rates.is_empty() {
            let (parameter, expected) = ("number of turn rates", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        if let Some(&value) = rates.iter().find(|rate| !rate.is_finite()) {
            let (parameter, expected) = ("turn rate", "must be finite, rad/s");
            return Err(FilterError::Parameter { parameter, value, expected });
        }
        Ok(TurnBank {
            rates,
            noise: AccelerationNoise::Piecewise(11.0),
            speed: 300.0,
            transition: Transition::sticky(0.985).per(1.0),
        })
    }

    /// Straight flight and `each` rates to either side, evenly up to `largest` rad/s.
    ///
    /// # Errors
    /// When `largest` is not positive and finite.
    pub fn evenly(largest: f64, each: usize) -> Result<Self, FilterError> {
        let largest = FilterError::positive("largest turn rate", largest)?;
        let count = each as i64;
        TurnBank::new((-count..=count).map(|i| largest * i as f64 / each.max(1) as f64))
    }

    /// Sets the noise of the acceleration. The default is piecewise constant with 11 m/s².
    pub fn with_noise(self, noise: AccelerationNoise) -> Self {
        TurnBank { noise, ..self }
    }

    /// Sets the standard deviation of a new target's velocity, m/s per axis. The default is 300.
    pub fn with_speed(self, speed: f64) -> Self {
        TurnBank { speed, ..self }
    }

    /// Sets how the target changes between the rates. The default stays with probability 0.985 over each second and changes to
    /// any other alike.
    pub fn with_transition(self, transition: Transition) -> Self {
        TurnBank { transition, ..self }
    }

    /// The turn rates, rad/s.
    pub fn rates(&self) -> &[f64] {
        &self.rates
    }

    /// The filter of this bank for a sensor of known accuracy.
    ///
    /// # Errors
    /// When the transition does not fit the number of rates.
    pub fn filter<S: Clone>(&self, sensor: S) -> Result<Imm<Kalman<Turn, S>>, FilterError> {
        Imm::new(self.modes(&sensor), self.transition.clone())
    }

    /// The filter of this bank for a sensor whose accuracy is one of those of `sensors`, and stays that.
    ///
    /// # Errors
    /// When there is no sensor, or the transition does not fit the number of rates.
    pub fn estimating<S: Clone>(&self, sensors: &[S]) -> Result<Imm<Kalman<Turn, S>>, FilterError> {
        let accuracy = (Transition::sticky(1.0), sensors.len());
        let transition = Transition::joint([accuracy, (self.transition.clone(), self.rates.len())]);
        Imm::new(sensors.iter().flat_map(|sensor| self.modes(sensor)), transition)
    }

    fn modes<S: Clone>(&self, sensor: &S) -> impl Iterator<Item = Kalman<Turn, S>> {
        self.rates.iter().map(|rate| {
            let motion = Turn::with_noise(*rate, self.noise).with_speed(self.speed);
            Kalman::new(motion, sensor.clone())
        })
    }

    /// Probabilities of straight flight, left turns and right turns, from the mode probabilities of a filter of this bank.
    pub fn directions(&self, modes: &[f64]) -> [f64; 3] {
        let mut directions = [0.0; 3];
        for (probability, rate) in modes.iter().zip(self.rates.iter().cycle()) {
            let direction = if *rate == 0.0 { 0 } else { 1 + usize::from(*rate < 0.0) };
            directions[direction] += probability;
        }
        directions
    }
}
