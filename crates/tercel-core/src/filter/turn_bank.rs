//! Banks of turns for manoeuvring targets.

use super::{Extended, Imm, Transition};
use crate::error::FilterError;
use crate::motion::{AccelerationNoise, Turn};

/// How a target in the plane manoeuvres: it turns at one of several rates, and changes between them.
///
/// ## Definition
/// One [`Extended`] filter of a [`Turn`] for each rate (with a linear sensor that is the Kalman filter), mixed by an [`Imm`]. With
/// several acceleration noises there is one filter for each pair of rate and noise, and with several sensors in
/// [`estimating`](TurnBank::estimating) one for each triple: the bank then learns from the innovations how calm the target is
/// (which does not change, [unless told](TurnBank::with_noise_transition)) and how accurate the sensor, which does not. The rates are the innermost: the modes go through all rates with the first noise,
/// then all with the next, and so on with the next sensor.
///
/// ## Use it when
/// one target manoeuvres and its turns are not known beforehand. The rates must reach as far as the target can turn: a bank that
/// ends at half the rate of a turn loses the target, and rates beyond need cost little. Spaces of 2 to 4 °/s suit radar scans of
/// one second. A far radar's range and bearing are better taken as they are ([`RangeBearing`](crate::sensor::RangeBearing)) than
/// converted: at 150 km a bearing error of 1 degree bends the plot's position by 23 m, which a conversion can only add to its noise.
///
/// ## Reference
/// Bar-Shalom, Li and Kirubarajan (2001), section 11.6; the choice of rates is a grid as in Li and Bar-Shalom (1993).
///
/// ```
/// use tercel_core::{filter::{Filter, TurnBank}, sensor::RangeBearing};
///
/// let bank = TurnBank::evenly(20.0_f64.to_radians(), 10)?; // -20 to 20 °/s in steps of 2
/// assert_eq!(bank.rates().len(), 21);
/// let radar = RangeBearing::new(50.0, 0.5_f64.to_radians())?;
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
    noises: Vec<AccelerationNoise>,
    speed: f64,
    transition: Transition,
    noise_transition: Transition,
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
            noises: vec![AccelerationNoise::Piecewise(11.0)],
            speed: 300.0,
            transition: Transition::sticky(0.985).per(1.0),
            noise_transition: Transition::sticky(1.0),
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
        TurnBank { noises: vec![noise], ..self }
    }

    /// Sets several noises of the acceleration, of which the target has one.
    ///
    /// # Errors
    /// When there is none.
    pub fn with_noises(
        self,
        noises: impl IntoIterator<Item = AccelerationNoise>,
    ) -> Result<Self, FilterError> {
        let noises: Vec<AccelerationNoise> = noises.into_iter().collect();
        if noises.is_empty() {
            let (parameter, expected) = ("number of acceleration noises", "must be at least 1");
            return Err(FilterError::Parameter { parameter, value: 0.0, expected });
        }
        Ok(TurnBank { noises, ..self })
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

    /// Sets how the target changes between the noises of the acceleration. By default it does not.
    pub fn with_noise_transition(self, noise_transition: Transition) -> Self {
        TurnBank { noise_transition, ..self }
    }

    /// The turn rates, rad/s.
    pub fn rates(&self) -> &[f64] {
        &self.rates
    }

    /// The noises of the acceleration.
    pub fn noises(&self) -> &[AccelerationNoise] {
        &self.noises
    }

    /// The filter of this bank for a sensor of known accuracy.
    ///
    /// # Errors
    /// When the transition does not fit the number of rates.
    pub fn filter<S: Clone, const M: usize>(
        &self,
        sensor: S,
    ) -> Result<Imm<Extended<Turn, S, M>>, FilterError> {
        self.estimating(std::slice::from_ref(&sensor))
    }

    /// The filter of this bank for a sensor whose accuracy is one of those of `sensors`, and stays that.
    ///
    /// # Errors
    /// When there is no sensor, or the transition does not fit the number of rates.
    pub fn estimating<S: Clone, const M: usize>(
        &self,
        sensors: &[S],
    ) -> Result<Imm<Extended<Turn, S, M>>, FilterError> {
        let sensors_stay = (Transition::sticky(1.0), sensors.len());
        let noises = (self.noise_transition.clone(), self.noises.len());
        let rates = (self.transition.clone(), self.rates.len());
        let transition = Transition::joint([sensors_stay, noises, rates]);
        Imm::new(sensors.iter().flat_map(|sensor| self.modes(sensor)), transition)
    }

    fn modes<'a, S: Clone, const M: usize>(
        &'a self,
        sensor: &'a S,
    ) -> impl Iterator<Item = Extended<Turn, S, M>> + 'a {
        self.noises.iter().flat_map(move |noise| {
            let turn = |rate: &f64| Turn::with_noise(*rate, *noise).with_speed(self.speed);
            self.rates.iter().map(move |rate| Extended::new(turn(rate), sensor.clone()))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{Filter, Kalman};
    use crate::sensor::{Measurement, Position};

    fn circle(rate: f64) -> impl Iterator<Item = Measurement<2>> {
        (1..=40).map(move |second| {
            let (sine, cosine) = (rate * f64::from(second)).sin_cos();
            Measurement::from([2_000.0 * cosine, 2_000.0 * sine])
        })
    }

    #[test]
    fn a_bank_is_the_mixture_of_its_turns() {
        let (rates, sensor) = ([0.0, 0.1, -0.1], Position::<2>::new(20.0).unwrap());
        let bank = TurnBank::new(rates).unwrap().with_speed(250.0);
        let turn = |rate| Turn::with_noise(rate, AccelerationNoise::Piecewise(11.0)).with_speed(250.0);
        let stay = Transition::sticky(0.985).per(1.0);
        let plain = Imm::new(rates.map(|rate| Kalman::new(turn(rate), sensor)), stay).unwrap();
        let filter = bank.filter(sensor).unwrap();
        let start = [2_000.0, 0.0].into();
        let (mut ours, mut theirs) = (filter.birth(&start).unwrap(), plain.birth(&start).unwrap());
        for measurement in circle(0.1) {
            filter.predict(&mut ours, 1.0);
            plain.predict(&mut theirs, 1.0);
            filter.update(&mut ours, &measurement).unwrap();
            plain.update(&mut theirs, &measurement).unwrap();
        }
        assert!((filter.state(&ours).mean - plain.state(&theirs).mean).norm() < 1e-6);
        let [straight, left, right] = bank.directions(filter.mode_probabilities(&ours));
        assert!(left > 0.9, "{straight} {left} {right}");
    }

    #[test]
    fn a_bank_finds_the_noise_and_the_accuracy_that_it_is_not_told() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let noises = [1.0, 30.0].map(AccelerationNoise::Piecewise);
        let bank = TurnBank::evenly(0.1, 1).unwrap().with_noises(noises).unwrap();
        let sensors = [5.0, 50.0].map(|deviation| Position::<2>::new(deviation).unwrap());
        let filter = bank.estimating(&sensors).unwrap();
        let mut belief = filter.birth(&[2_000.0, 0.0].into()).unwrap();
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        for measurement in circle(0.1) {
            filter.predict(&mut belief, 1.0);
            let error = nalgebra::Vector2::new(50.0 * normal(), 50.0 * normal());
            filter.update(&mut belief, &(measurement.value + error).into()).unwrap();
        }
        // Second sensor, first noise, turning left: the modes 6 to 8 of 12, of which the last.
        assert!(filter.mode_probabilities(&belief)[8] > 0.9, "{:?}", filter.mode_probabilities(&belief));
    }

    #[test]
    fn banks_of_nothing_are_refused() {
        assert!(TurnBank::new([]).is_err());
        assert!(TurnBank::new([f64::NAN]).is_err());
        assert!(TurnBank::evenly(0.0, 3).is_err());
        let bank = TurnBank::evenly(0.1, 0).unwrap();
        assert_eq!(bank.rates(), [0.0]);
        assert!(bank.clone().with_noises([]).is_err());
        assert!(bank.estimating::<Position<2>, 2>(&[]).is_err());
    }
}
