//! An antenna that turns, as its plots show it.

use std::f64::consts::TAU;

/// An antenna that turns with a constant rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Antenna {
    /// Seconds a turn.
    pub period: f64,
    /// Counter-clockwise turns are positive: 1 or -1.
    pub sense: f64,
    /// Its bearing at time zero, rad.
    phase: f64,
}

/// When one plot was made, and its bearing (rad).
pub(crate) type Glance = (f64, f64);

/// Plots that say how an antenna turns, at least.
const ENOUGH: usize = 12;

/// Bearings agree with a turning antenna when the mean of their directions from it is at least this long: within some 10 degrees.
const AGREE: f64 = 0.98;

/// Turns between the shortest and the longest period that are looked for, s.
const PERIODS: (f64, f64) = (0.4, 60.0);

/// How fast the phase follows the plots.
const FOLLOW: f64 = 0.05;

impl Antenna {
    /// The antenna that turns once in `period` seconds and made these plots; nothing when they do not show one.
    pub fn of_period(period: f64, glances: &[Glance]) -> Option<Antenna> {
        if glances.len() < ENOUGH {
            return None;
        }
        let found = [1.0, -1.0].map(|sense| (sense, agreement(glances, sense / period)));
        let (sense, (length, phase)) = if found[0].1.0 > found[1].1.0 { found[0] } else { found[1] };
        (length >= AGREE).then_some(Antenna { period, sense, phase })
    }

    /// The antenna that made these plots, whatever its period; nothing when they do not show one.
    pub fn of_plots(glances: &[Glance]) -> Option<Antenna> {
        let glances = middle(glances);
        let (first, last) = (glances.first()?.0, glances.last()?.0);
        let span = last - first;
        if glances.len() < ENOUGH || span < 2.0 * PERIODS.0 {
            return None;
        }
        // A period fits only if the bearings of the first turn come back at the end, which sets how fine the search must be.
        let step = 0.1 / span;
        let mut best: Option<(f64, f64)> = None;
        let mut rate = (1.0 / PERIODS.1).max(1.5 / span);
        while rate <= 1.0 / PERIODS.0 {
            for sense in [1.0, -1.0] {
                let (length, _) = agreement(glances, sense * rate);
                // Of rates that agree alike the slowest is meant: an object seen once a turn is seen once in two half turns, too.
                if length > best.map_or(AGREE, |best| best.1 + 0.01) {
                    best = Some((sense * rate, length));
                }
            }
            rate += step;
        }
        let (rate, _) = best?;
        let rate = refined(glances, rate, step);
        let (length, phase) = agreement(glances, rate);
        let antenna = Antenna { period: 1.0 / rate.abs(), sense: rate.signum(), phase };
        (length >= AGREE).then_some(antenna)
    }

    /// Its bearing at a time, rad.
    pub fn bearing(&self, time: f64) -> f64 {
        self.phase + self.sense * TAU * (time / self.period).fract()
    }

    /// Takes in a plot: a period that is a little wrong would turn the sectors away from it.
    pub fn follow(&mut self, (time, bearing): Glance) {
        let ahead = tercel_core::sensor::wrapped(bearing - self.bearing(time));
        if ahead.abs() < 0.5 {
            self.phase += FOLLOW * ahead;
        }
    }
}

/// The plots around the one in the middle: enough turns to see how the antenna turns. The search takes a time that grows with
/// theirs, and one wrong time would make that centuries.
fn middle(glances: &[Glance]) -> &[Glance] {
    let Some(centre) = glances.get(glances.len() / 2).map(|glance| glance.0) else { return glances };
    let near = |glance: &Glance| (glance.0 - centre).abs() <= 5.0 * PERIODS.1;
    let from = glances.iter().position(near).unwrap_or(0);
    let count = glances[from..].iter().take_while(|glance| near(glance)).count();
    &glances[from..from + count]
}

/// Length and direction of the mean of the plots' directions, seen from an antenna that makes `rate` turns a second.
fn agreement(glances: &[Glance], rate: f64) -> (f64, f64) {
    let (mut x, mut y) = (0.0, 0.0);
    for (time, bearing) in glances {
        let (sine, cosine) = (bearing - TAU * (rate * time).fract()).sin_cos();
        (x, y) = (x + cosine, y + sine);
    }
    let count = glances.len() as f64;
    (x.hypot(y) / count, y.atan2(x))
}

/// The rate near `rate` that agrees best, by halving the step.
fn refined(glances: &[Glance], mut rate: f64, mut step: f64) -> f64 {
    for _ in 0..20 {
        step *= 0.5;
        for candidate in [rate - step, rate + step] {
            if agreement(glances, candidate).0 > agreement(glances, rate).0 {
                rate = candidate;
            }
        }
    }
    rate
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Plots of objects at these bearings by an antenna of this period and sense.
    fn plots(bearings: &[f64], period: f64, sense: f64, turns: usize) -> Vec<Glance> {
        let mut glances = Vec::new();
        for turn in 0..turns {
            for (k, bearing) in bearings.iter().enumerate() {
                let bearing = bearing + 0.002 * turn as f64 * if k % 2 == 0 { 1.0 } else { -1.0 };
                let share = (sense * bearing / TAU).rem_euclid(1.0);
                glances.push(((turn as f64 + share) * period, bearing));
            }
        }
        glances.sort_by(|a, b| a.0.total_cmp(&b.0));
        glances
    }

    #[test]
    fn the_turn_of_an_antenna_is_found_in_its_plots() {
        for (period, sense) in [(4.0, -1.0), (2.5, -1.0), (10.0, 1.0), (1.2, -1.0)] {
            let glances = plots(&[0.3, 1.9, -2.4, 2.9, -0.8], period, sense, 16);
            let antenna = Antenna::of_plots(&glances).unwrap();
            assert!((antenna.period / period - 1.0).abs() < 2e-3, "{antenna:?}");
            assert_eq!(antenna.sense, sense);
            let (time, bearing) = glances[40];
            assert!(tercel_core::sensor::wrapped(antenna.bearing(time) - bearing).abs() < 0.1);
        }
    }

    #[test]
    fn one_wrong_time_hides_no_antenna() {
        let mut glances = plots(&[0.3, 1.9, -2.4, 2.9, -0.8], 4.0, -1.0, 16);
        glances.iter_mut().for_each(|glance| glance.0 += 1.7e9);
        glances.insert(0, (0.0, 0.1));
        let antenna = Antenna::of_plots(&glances).unwrap();
        assert!((antenna.period / 4.0 - 1.0).abs() < 2e-3, "{antenna:?}");
    }

    #[test]
    fn plots_at_any_bearing_show_no_antenna() {
        let glances: Vec<Glance> =
            (0..200).map(|i| (f64::from(i) * 0.7, f64::from(i * i % 61) * 0.1)).collect();
        assert_eq!(Antenna::of_plots(&glances), None);
        assert_eq!(Antenna::of_period(4.0, &glances), None);
    }
}
