//! Where objects and tracks were at any time.

use std::collections::BTreeMap;
use std::sync::Arc;

use tercel_core::metric::Trajectory;
use tercel_core::multi::Status;
use tercel_data::table::{Tracks, Truths};

/// Two rows at most this far apart in time are one, s.
pub const SAME: f64 = 1e-3;

/// One object or track: positions at rising times.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    times: Vec<f64>,
    positions: Vec<[f64; 2]>,
}

/// How far a timeline reaches beyond its rows, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Widest gap between two rows that is bridged.
    pub gap: f64,
    /// How long the end holds.
    pub hold: f64,
}

/// How places between rows are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// [`Timeline::interpolate`]: for the truth.
    Interpolate,
    /// [`Timeline::extrapolate`]: for tracks.
    Extrapolate,
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

    /// Position at `time`: linear between neighbours no farther apart than the gap; outside, and in wider gaps, that of
    /// the nearest row while it holds.
    pub fn interpolate(&self, time: f64, reach: Reach) -> Option<[f64; 2]> {
        let after = self.times.partition_point(|&t| t <= time);
        let before = after.checked_sub(1);
        match before {
            Some(b) if after < self.times.len() && self.times[after] - self.times[b] <= reach.gap => {
                Some(self.between(b, after, time))
            }
            _ => {
                let distance = |&i: &usize| (self.times[i] - time).abs();
                let candidates = before.into_iter().chain((after < self.times.len()).then_some(after));
                let near = candidates.filter(|i| distance(i) <= reach.hold.max(SAME));
                near.min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|i| self.positions[i])
            }
        }
    }

    /// Position at `time` as it was known then: the row at that time, or between rows no farther apart than the gap, or
    /// while the last row holds on a straight line through the last two. Never before the first row.
    pub fn extrapolate(&self, time: f64, reach: Reach) -> Option<[f64; 2]> {
        let last = self.times.partition_point(|&t| t <= time + SAME).checked_sub(1)?;
        if (self.times[last] - time).abs() <= SAME {
            return Some(self.positions[last]);
        }
        if last + 1 < self.times.len() && self.times[last + 1] - self.times[last] <= reach.gap {
            return Some(self.between(last, last + 1, time));
        }
        match last.checked_sub(1) {
            _ if time - self.times[last] > reach.hold => None,
            Some(before) => Some(self.between(before, last, time)),
            None => Some(self.positions[last]),
        }
    }

    /// The unbroken pieces at these rising times, with steps that count the times. Only times within the reach of the
    /// line are looked at.
    pub fn pieces(&self, times: &[f64], rule: Rule, reach: Reach) -> Vec<Trajectory<2>> {
        let (first, last) = self.span();
        let hold = reach.hold.max(SAME);
        let start = times.partition_point(|&time| time < first - hold);
        let mut pieces: Vec<Trajectory<2>> = Vec::new();
        let mut broken = true;
        for (step, &time) in
            times.iter().enumerate().skip(start).take_while(|(_, time)| **time <= last + hold)
        {
            let place = match rule {
                Rule::Interpolate => self.interpolate(time, reach),
                Rule::Extrapolate => self.extrapolate(time, reach),
            };
            match (place, pieces.last_mut()) {
                (Some(_), Some(piece)) if !broken => piece.positions.push(place),
                (Some(place), _) => pieces.push(Trajectory::new(step, [place])),
                (None, _) => {}
            }
            broken = place.is_none();
        }
        pieces
    }

    fn between(&self, a: usize, b: usize, time: f64) -> [f64; 2] {
        let weight = (time - self.times[a]) / (self.times[b] - self.times[a]);
        let (from, to) = (self.positions[a], self.positions[b]);
        [from[0] + weight * (to[0] - from[0]), from[1] + weight * (to[1] - from[1])]
    }
}

/// The usual time between rows of one line, s: the median over all lines, if there are at least `least` such intervals.
pub fn usual_interval<'a>(lines: impl Iterator<Item = &'a Timeline>, least: usize) -> Option<f64> {
    let mut intervals: Vec<f64> =
        lines.flat_map(|line| line.times.windows(2).map(|pair| pair[1] - pair[0])).collect();
    if intervals.len() < least.max(1) {
        return None;
    }
    let middle = intervals.len() / 2;
    Some(*intervals.select_nth_unstable_by(middle, f64::total_cmp).1)
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

    fn reach(gap: f64, hold: f64) -> Reach {
        Reach { gap, hold }
    }

    #[test]
    fn truth_is_interpolated_and_held_at_its_ends() {
        assert_eq!(line().interpolate(0.5, reach(2.0, 0.0)), Some([5.0, 0.0]));
        assert_eq!(line().interpolate(3.0, reach(2.0, 0.5)), None);
        assert_eq!(line().interpolate(3.0, reach(2.0, f64::INFINITY)), Some([20.0, 0.0]));
        assert_eq!(line().interpolate(-1.0, reach(2.0, 1.0)), Some([0.0, 0.0]));
        assert_eq!(line().interpolate(2.0005, reach(2.0, 0.0)), Some([20.0, 0.0]));
    }

    #[test]
    fn a_track_goes_straight_on_for_a_moment_and_never_before_its_start() {
        assert_eq!(line().extrapolate(2.4, reach(2.5, 0.6)), Some([24.0, 0.0]));
        assert_eq!(line().extrapolate(2.7, reach(2.5, 0.6)), None);
        assert_eq!(line().extrapolate(-0.5, reach(2.5, 0.6)), None);
        assert_eq!(line().extrapolate(1.0005, reach(2.5, 0.6)), Some([10.0, 0.0]));
    }

    #[test]
    fn pieces_are_where_the_line_is_and_a_gap_breaks_them() {
        let line = Timeline::new(vec![(0.0, [0.0; 2]), (1.0, [1.0; 2]), (9.0, [9.0; 2])]);
        let times = [-5.0, 0.0, 0.5, 1.5, 4.0, 9.0, 9.5, 20.0];
        let starts = |rule, reach| -> Vec<(usize, usize)> {
            let pieces = line.pieces(&times, rule, reach);
            pieces.iter().map(|piece| (piece.start, piece.positions.len())).collect()
        };
        assert_eq!(starts(Rule::Interpolate, reach(2.0, 0.0)), [(1, 2), (5, 1)]);
        assert_eq!(starts(Rule::Extrapolate, reach(2.0, 0.6)), [(1, 3), (5, 2)]);
        assert_eq!(starts(Rule::Interpolate, reach(8.0, f64::INFINITY)), [(0, 8)]);
    }

    #[test]
    fn the_usual_interval_is_that_of_most_rows_once_there_are_enough() {
        let lines = [line(), Timeline::new(vec![(0.0, [0.0; 2]), (1.0, [0.0; 2]), (50.0, [0.0; 2])])];
        assert_eq!(usual_interval(lines.iter(), 4), Some(1.0));
        assert_eq!(usual_interval(lines.iter(), 5), None);
        assert_eq!(usual_interval([].iter(), 0), None);
    }
}
