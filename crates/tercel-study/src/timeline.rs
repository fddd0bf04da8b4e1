//! Where objects and tracks were at any time.

use std::collections::BTreeMap;
use std::sync::Arc;

use tercel_core::multi::Status;
use tercel_data::table::{Tracks, Truths};

/// Two rows at most this far apart in time are one, s.
const SAME: f64 = 1e-3;

/// One object or track: positions at rising times.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    times: Vec<f64>,
    positions: Vec<[f64; 2]>,
}

impl Timeline {
    /// Rows in any order; of two at the same time the later given one counts.
    fn new(mut rows: Vec<(f64, [f64; 2])>) -> Self {
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut line = Timeline { times: Vec::new(), positions: Vec::new() };
        for (time, position) in rows {
            if line.times.last().is_some_and(|last| time - last <= 1e-6) {
                line.times.pop();
                line.positions.pop();
            }
            line.times.push(time);
            line.positions.push(position);
        }
        line
    }

    /// First and last time, s.
    pub fn span(&self) -> (f64, f64) {
        (self.times[0], self.times[self.times.len() - 1])
    }

    /// Position at `time`: linear between neighbours no more than `gap` seconds apart; outside, and in wider gaps, the
    /// nearest row if it is no more than `hold` seconds away.
    pub fn interpolate(&self, time: f64, gap: f64, hold: f64) -> Option<[f64; 2]> {
        let after = self.times.partition_point(|&t| t <= time);
        let before = after.checked_sub(1);
        match before {
            Some(b) if after < self.times.len() && self.times[after] - self.times[b] <= gap => {
                Some(self.between(b, after, time))
            }
            _ => {
                let near = |&i: &usize| (self.times[i] - time).abs() <= hold;
                let candidates = before.into_iter().chain((after < self.times.len()).then_some(after));
                let distance = |&i: &usize| (self.times[i] - time).abs();
                let nearest = candidates.filter(near).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                nearest.map(|i| self.positions[i])
            }
        }
    }

    /// Position at `time` as it was known then: the row at that time, or between rows at most `gap` seconds apart, or for
    /// `hold` seconds after the last row on a straight line through the last two.
    pub fn extrapolate(&self, time: f64, gap: f64, hold: f64) -> Option<[f64; 2]> {
        let last = self.times.partition_point(|&t| t <= time + SAME).checked_sub(1)?;
        if (self.times[last] - time).abs() <= SAME {
            return Some(self.positions[last]);
        }
        if last + 1 < self.times.len() && self.times[last + 1] - self.times[last] <= gap {
            return Some(self.between(last, last + 1, time));
        }
        match last.checked_sub(1) {
            _ if time - self.times[last] > hold => None,
            Some(before) => Some(self.between(before, last, time)),
            None => Some(self.positions[last]),
        }
    }

    fn between(&self, a: usize, b: usize, time: f64) -> [f64; 2] {
        let weight = (time - self.times[a]) / (self.times[b] - self.times[a]);
        let (from, to) = (self.positions[a], self.positions[b]);
        [from[0] + weight * (to[0] - from[0]), from[1] + weight * (to[1] - from[1])]
    }
}

/// The true objects, by identity.
pub fn of_truths(truths: &Truths) -> BTreeMap<Arc<str>, Timeline> {
    let mut rows: BTreeMap<Arc<str>, Vec<(f64, [f64; 2])>> = BTreeMap::new();
    for truth in &truths.rows {
        rows.entry(truth.object.clone()).or_default().push((truth.time, truth.position));
    }
    rows.into_iter().map(|(object, rows)| (object, Timeline::new(rows))).collect()
}

/// The tracks, by number, while they were confirmed.
pub fn of_tracks(tracks: &Tracks) -> BTreeMap<u64, Timeline> {
    let mut rows: BTreeMap<u64, Vec<(f64, [f64; 2])>> = BTreeMap::new();
    for row in &tracks.rows {
        if let (Status::Confirmed | Status::Coasted, [x, y, ..]) = (row.status, &row.state[..]) {
            rows.entry(row.track).or_default().push((row.time, [*x, *y]));
        }
    }
    rows.into_iter().map(|(track, rows)| (track, Timeline::new(rows))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Timeline {
        Timeline::new(vec![(2.0, [20.0, 0.0]), (0.0, [0.0, 0.0]), (1.0, [5.0, 5.0]), (1.0, [10.0, 0.0])])
    }

    #[test]
    fn truth_is_interpolated_and_held_at_its_ends() {
        assert_eq!(line().interpolate(0.5, 2.0, 0.0), Some([5.0, 0.0]));
        assert_eq!(line().interpolate(3.0, 2.0, 0.5), None);
        assert_eq!(line().interpolate(3.0, 2.0, f64::INFINITY), Some([20.0, 0.0]));
        assert_eq!(line().interpolate(-1.0, 2.0, 1.0), Some([0.0, 0.0]));
    }

    #[test]
    fn a_track_goes_straight_on_for_a_moment_and_never_before_its_start() {
        assert_eq!(line().extrapolate(2.4, 2.5, 0.6), Some([24.0, 0.0]));
        assert_eq!(line().extrapolate(2.7, 2.5, 0.6), None);
        assert_eq!(line().extrapolate(-0.5, 2.5, 0.6), None);
        assert_eq!(line().extrapolate(1.0005, 2.5, 0.6), Some([10.0, 0.0]));
    }
}
