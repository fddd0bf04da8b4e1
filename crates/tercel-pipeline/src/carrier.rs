//! What carries a sensor: where it is, and how it moves.

use std::collections::VecDeque;

use nalgebra::Vector2;

/// The last places of a sensor that moves, and the velocity that follows from them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Carrier {
    /// Times (s) and places (m), the newest last.
    fixes: VecDeque<(f64, Vector2<f64>)>,
    /// Standard deviation of a place, m, until the places themselves say better.
    deviation: f64,
}

/// How a carrier moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Velocity {
    /// m/s.
    pub value: Vector2<f64>,
    /// Standard deviation per axis, m/s.
    pub deviation: f64,
}

impl Velocity {
    /// That of a sensor that stands.
    pub const NONE: Velocity = Velocity { value: Vector2::new(0.0, 0.0), deviation: 0.0 };
}

/// Places from which the velocity is taken.
const FIXES: usize = 8;

/// Places that say how accurate they are by their distances from a straight line.
const ENOUGH: usize = 4;

/// Standard deviation of the velocity of something of which one place is known, m/s.
const UNKNOWN: f64 = 100.0;

impl Carrier {
    /// A carrier whose places are known with this standard deviation, m, at first.
    pub fn new(deviation: f64) -> Self {
        Carrier { fixes: VecDeque::new(), deviation }
    }

    /// Takes in where the carrier is. A second place at one time says nothing of the velocity.
    pub fn fix(&mut self, time: f64, place: Vector2<f64>) {
        if self.fixes.back().is_some_and(|last| last.0 >= time) {
            return;
        }
        if self.fixes.len() == FIXES {
            self.fixes.pop_front();
        }
        self.fixes.push_back((time, place));
    }

    /// The slope of the line through the last places, and its standard deviation from their distances to the line.
    pub fn velocity(&self) -> Velocity {
        let count = self.fixes.len() as f64;
        if self.fixes.len() < 2 {
            return Velocity { value: Vector2::zeros(), deviation: UNKNOWN };
        }
        let time = self.fixes.iter().map(|fix| fix.0).sum::<f64>() / count;
        let place = self.fixes.iter().map(|fix| fix.1).sum::<Vector2<f64>>() / count;
        let spread: f64 = self.fixes.iter().map(|fix| (fix.0 - time).powi(2)).sum();
        let value =
            self.fixes.iter().map(|fix| (fix.1 - place) * (fix.0 - time)).sum::<Vector2<f64>>() / spread;
        let variance = if self.fixes.len() < ENOUGH {
            self.deviation * self.deviation
        } else {
            let rest = |fix: &(f64, Vector2<f64>)| (fix.1 - place - value * (fix.0 - time)).norm_squared();
            0.5 * self.fixes.iter().map(rest).sum::<f64>() / (count - 2.0)
        };
        Velocity { value, deviation: (variance / spread).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::vector;

    #[test]
    fn a_ship_on_a_straight_course_has_its_velocity() {
        let mut ship = Carrier::new(5.0);
        assert_eq!(ship.velocity().deviation, UNKNOWN);
        for second in 0..10 {
            ship.fix(f64::from(second), vector![8.0, -3.0] * f64::from(second));
            // A second scan at the same time changes nothing.
            ship.fix(f64::from(second), vector![8.0, -3.0] * f64::from(second));
        }
        let velocity = ship.velocity();
        assert!(
            (velocity.value - vector![8.0, -3.0]).norm() < 1e-9 && velocity.deviation < 1e-6,
            "{velocity:?}"
        );
    }

    #[test]
    fn places_that_jump_about_make_an_uncertain_velocity() {
        let mut ship = Carrier::new(5.0);
        let jitter = [2.0, -3.0, 1.0, 4.0, -2.0, -4.0, 3.0, -1.0];
        for (second, off) in jitter.iter().enumerate() {
            ship.fix(second as f64, vector![8.0 * second as f64 + off, -off]);
        }
        let velocity = ship.velocity();
        assert!((velocity.value - vector![8.0, 0.0]).norm() < 4.0 * velocity.deviation, "{velocity:?}");
        assert!((0.2..2.0).contains(&velocity.deviation), "{velocity:?}");
    }
}
