//! Aircraft that fly straight or turn, and change between both at random times.

use std::ops::RangeInclusive;

use rand::{Rng, RngExt};

use super::Regime;
use crate::error::FilterError;
use crate::motion::{AccelerationNoise, Turn};

/// Straight flight, left turns and right turns, with rates and an acceleration noise that are not known.
///
/// ## Definition
/// The object is in one of the modes 0 straight, 1 left and 2 right. Its rate is zero, or uniform up to the largest rate. Both
/// are drawn anew at switches, which come at a constant rate; the next mode may be the last one again. The standard deviation
/// of the acceleration is uniform in its range, and stays for the object's life.
///
/// A switch takes effect at the beginning of the step in which it falls.
///
/// ## Use it when
/// aircraft manoeuvre as in the air-traffic simulations of the literature, in a
/// [`RaoBlackwellised`](super::RaoBlackwellised) filter.
///
/// ## Reference
/// Our own, a jump Markov linear system in the sense of Doucet, Gordon and Krishnamurthy (2001). The turns are those of
/// [`Turn`], the noise is [`AccelerationNoise::Piecewise`].
///
/// ```
/// use tercel_core::filter::RandomTurns;
///
/// let turns = RandomTurns::new(1.0 / 57.0, 12.0_f64.to_radians(), 5.0..=20.0)?.with_speed(300.0)?;
/// assert!(RandomTurns::new(1.0 / 57.0, 0.2, 20.0..=5.0).is_err());
/// # Ok::<(), tercel_core::error::FilterError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RandomTurns {
    hazard: f64,
    largest: f64,
    deviations: RangeInclusive<f64>,
    speed: f64,
}

/// How an object of [`RandomTurns`] flies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turning {
    /// 0 straight, 1 left, 2 right.
    pub mode: usize,
    /// Turn rate, rad/s, counter-clockwise.
    pub rate: f64,
    /// Standard deviation of the acceleration, m/s² per axis.
    pub deviation: f64,
}

/// Straight, left and right.
const MODES: usize = 3;

impl RandomTurns {
    /// Switches at `hazard` per second, turn rates up to `largest` rad/s, and the range of the standard deviation of the
    /// acceleration, m/s² per axis.
    ///
    /// # Errors
    /// When the hazard or a bound of the range is negative or not finite, the range is reversed, or the largest rate is not
    /// positive and finite.
    pub fn new(hazard: f64, largest: f64, deviations: RangeInclusive<f64>) -> Result<Self, FilterError> {
        let (low, high) = (*deviations.start(), *deviations.end());
        let refused = |parameter, value, expected| FilterError::Parameter { parameter, value, expected };
        if !(hazard >= 0.0 && hazard.is_finite()) {
            return Err(refused("hazard of a switch", hazard, "must be finite and not negative, 1/s"));
        }
        if !(low >= 0.0 && low.is_finite()) {
            let expected = "must be finite and not negative, m/s²";
            return Err(refused("smallest deviation of the acceleration", low, expected));
        }
        if !(high >= low && high.is_finite()) {
            let expected = "must be finite and not below the smallest, m/s²";
            return Err(refused("largest deviation of the acceleration", high, expected));
        }
        let largest = FilterError::positive("largest turn rate", largest)?;
        Ok(RandomTurns { hazard, largest, deviations, speed: 30.0 })
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. The default is 30.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn with_speed(self, speed: f64) -> Result<Self, FilterError> {
        Ok(RandomTurns { speed: FilterError::positive("standard deviation of the velocity", speed)?, ..self })
    }

    /// A mode and a rate, as drawn at birth and at switches.
    fn turn(&self, random: &mut impl Rng) -> (usize, f64) {
        let mode = random.random_range(0..MODES);
        let rate = match mode {
            0 => 0.0,
            1 => random.random_range(0.0..=self.largest),
            _ => -random.random_range(0.0..=self.largest),
        };
        (mode, rate)
    }
}

impl Regime<4> for RandomTurns {
    type Parameters = Turning;
    type Motion = Turn;

    fn draw(&self, random: &mut impl Rng) -> Turning {
        let (mode, rate) = self.turn(random);
        Turning { mode, rate, deviation: random.random_range(self.deviations.clone()) }
    }

    #[inline]
    fn jump(&self, flight: &mut Turning, dt: f64, random: &mut impl Rng) {
        let stays = (-self.hazard * dt.abs()).exp();
        if random.random::<f64>() >= stays {
            (flight.mode, flight.rate) = self.turn(random);
        }
    }

    #[inline]
    fn motion(&self, flight: &Turning) -> Turn {
        Turn::with_noise(flight.rate, AccelerationNoise::Piecewise(flight.deviation)).with_speed(self.speed)
    }

    fn modes(&self) -> usize {
        MODES
    }

    fn mode(&self, flight: &Turning) -> usize {
        flight.mode
    }
}
