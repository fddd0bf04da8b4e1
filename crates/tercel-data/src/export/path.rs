//! Tracks as lines on the Earth.

use std::collections::HashMap;
use std::sync::Arc;

use super::Clock;
use crate::earth::{Fix, Navigator};
use crate::error::{DataError, Place};
use crate::layout::TrackColumns;
use crate::table::{Status, Track, Tracks};

/// One track.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Path {
    pub track: u64,
    /// What the object was called last.
    pub identity: Option<Arc<str>>,
    /// Where the track was in its life in its last row.
    pub status: Status,
    /// At least one.
    pub points: Vec<Point>,
    /// Points up to the last one that was not coasted, and at least the first.
    seen: usize,
}

/// Where a track was at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Point {
    pub time: f64,
    /// Degrees north and east, the latter in [-180, 180].
    pub place: [f64; 2],
    /// m above the ellipsoid.
    pub altitude: Option<f64>,
    /// m/s.
    pub speed: Option<f64>,
    /// Degrees from north.
    pub course: Option<f64>,
}

impl Path {
    /// What the track is called.
    pub fn name(&self) -> String {
        self.identity.as_ref().map_or_else(|| format!("Track {}", self.track), |name| name.to_string())
    }

    /// The points as far as the object was seen.
    pub fn points(&self) -> &[Point] {
        &self.points[..self.seen]
    }

    /// True when every point has an altitude.
    pub fn is_in_space(&self) -> bool {
        self.points().iter().all(|point| point.altitude.is_some())
    }

    /// The parts of the line between its crossings of the antimeridian. With `cut`, they end and begin on it.
    pub fn parts(&self, cut: bool) -> Vec<Vec<Point>> {
        let mut parts: Vec<Vec<Point>> = vec![Vec::new()];
        for (number, point) in self.points().iter().enumerate() {
            if let Some(before) = number.checked_sub(1).map(|before| self.points[before])
                && (before.place[1] - point.place[1]).abs() > 180.0
            {
                let mut next = Vec::new();
                if let (true, Some(part)) = (cut, parts.last_mut()) {
                    let [end, begin] = crossing(&before, point);
                    part.push(end);
                    next.push(begin);
                }
                parts.push(next);
            }
            if let Some(part) = parts.last_mut() {
                part.push(*point);
            }
        }
        parts
    }
}

/// The two faces of the point in which the line between two points crosses the antimeridian.
fn crossing(before: &Point, after: &Point) -> [Point; 2] {
    let side = 180.0_f64.copysign(before.place[1]);
    let (way, rest) = ((side - before.place[1]).abs(), (after.place[1] + side).abs());
    let share = if way + rest > 0.0 { way / (way + rest) } else { 0.0 };
    let between = |a: f64, b: f64| a + share * (b - a);
    let both = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| between(a, b));
    let at = |longitude| Point {
        time: between(before.time, after.time),
        place: [between(before.place[0], after.place[0]), longitude],
        altitude: both(before.altitude, after.altitude),
        ..*before
    };
    [at(side), at(-side)]
}

/// All tracks, in the order in which they began.
pub(super) struct Paths {
    columns: TrackColumns,
    navigator: Navigator,
    paths: Vec<Path>,
    numbers: HashMap<u64, usize>,
    span: Option<[f64; 2]>,
    /// Rows that have no place on the Earth.
    pub out_of_reach: usize,
}

impl Paths {
    /// For tracks like those of `head`; nothing when these have no place on the Earth.
    pub fn new(head: &Tracks) -> Option<Self> {
        let navigator = Navigator::new(head.origin, &head.labels);
        navigator.knows_the_earth().then(|| Paths {
            columns: TrackColumns::new(head.origin, &head.labels, &head.modes),
            navigator,
            paths: Vec::new(),
            numbers: HashMap::new(),
            span: None,
            out_of_reach: 0,
        })
    }

    /// Adds a row. The one with which a track is given up tells its end only.
    pub fn add(&mut self, row: &Track, file: &Arc<str>) -> Result<(), DataError> {
        self.columns.check(row, || Place::whole(file))?;
        let known = self.numbers.get(&row.track).copied();
        let Fix { position, altitude, speed, course } = self.navigator.fix(row);
        let point = match position {
            Some(place) => Point { time: row.time, place, altitude, speed, course },
            None => {
                self.out_of_reach += 1;
                return Ok(());
            }
        };
        let path = match known {
            Some(number) => &mut self.paths[number],
            None if row.status == Status::Deleted => return Ok(()),
            None => {
                self.numbers.insert(row.track, self.paths.len());
                self.paths.push(Path {
                    track: row.track,
                    identity: None,
                    status: row.status,
                    points: Vec::new(),
                    seen: 0,
                });
                let last = self.paths.len() - 1;
                &mut self.paths[last]
            }
        };
        path.status = row.status;
        if row.identity.is_some() {
            path.identity.clone_from(&row.identity);
        }
        if row.status == Status::Deleted {
            return Ok(());
        }
        path.points.push(point);
        if row.status != Status::Coasted || path.seen == 0 {
            path.seen = path.points.len();
        }
        let [first, last] = self.span.unwrap_or([row.time; 2]);
        self.span = Some([first.min(row.time), last.max(row.time)]);
        Ok(())
    }

    /// The tracks so far.
    pub fn complete(&self) -> &[Path] {
        &self.paths
    }

    /// What the times are.
    pub fn clock(&self) -> Clock {
        self.span.map_or(Clock::Unix, |[first, last]| Clock::of(first, last))
    }
}
