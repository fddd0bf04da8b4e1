//! The first look at the reports of a recording: where and when they are.

use std::collections::HashMap;
use std::sync::Arc;

use super::report::{Report, Reports};
use super::scans::same_report;
use super::source::Family;
use crate::error::DataError;
use crate::geographic::middle_around;
use crate::table::Origin;

/// What must be known before reports become scans.
#[derive(Debug, Default)]
pub(super) struct Survey {
    positions: Sample<(f64, f64)>,
    /// Time and longitude of the earliest report.
    earliest: Option<(f64, f64)>,
    intervals: Sample<f64>,
    /// How often a report was before the last one of its object.
    back: u64,
    objects: HashMap<Arc<str>, Object>,
}

/// The reports of one object.
#[derive(Debug)]
struct Object {
    last: Report,
    earliest: f64,
    latest: f64,
    count: u64,
}

/// Times of one file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Times {
    /// The earliest one.
    pub first: f64,
    /// How far, at most, a report is behind the latest one before it; 0 in a sorted file.
    pub disorder: f64,
}

impl Survey {
    /// Looks at a file; nothing when it has no reports.
    pub fn look(&mut self, reports: &mut Reports, family: &Family) -> Result<Option<Times>, DataError> {
        let mut times: Option<Times> = None;
        let mut latest = f64::NEG_INFINITY;
        while let Some(report) = reports.next()? {
            let times = times.get_or_insert(Times { first: report.time, disorder: 0.0 });
            times.first = times.first.min(report.time);
            latest = latest.max(report.time);
            times.disorder = times.disorder.max(latest - report.time);
            self.add(report, family);
        }
        Ok(times)
    }

    fn add(&mut self, report: Report, family: &Family) {
        self.positions.add((report.latitude, report.longitude));
        if self.earliest.is_none_or(|(time, _)| report.time < time) {
            self.earliest = Some((report.time, report.longitude));
        }
        let Some(object) = &report.object else { return };
        let time = report.time;
        match self.objects.get_mut(object) {
            Some(known) if same_report(&known.last, &report, family) => {}
            Some(known) => {
                let interval = time - known.last.time;
                if interval > 0.0 {
                    self.intervals.add(interval);
                } else {
                    self.back += 1;
                }
                *known = Object {
                    last: report,
                    earliest: known.earliest.min(time),
                    latest: known.latest.max(time),
                    count: known.count + 1,
                };
            }
            None => {
                let object = Arc::clone(object);
                self.objects.insert(object, Object { last: report, earliest: time, latest: time, count: 1 });
            }
        }
    }

    /// The median position of the reports, on the ellipsoid.
    pub fn middle(&self) -> Option<Origin> {
        let (_, longitude) = self.earliest?;
        middle_around(longitude, self.positions.kept.iter().copied())
    }

    /// Median time between the reports of one object, s, in whole milliseconds.
    pub fn interval(&self) -> Option<f64> {
        // Where rows are in no order, differences between them say nothing, but means do.
        let interval = if self.back * 10 > self.intervals.seen {
            let several = self.objects.values().filter(|object| object.count > 1);
            median(
                several.map(|object| (object.latest - object.earliest) / (object.count - 1) as f64).collect(),
            )
        } else {
            median(self.intervals.kept.clone())
        };
        interval.map(|interval| (interval * 1e3).round() / 1e3)
    }
}

/// Every so many of a sequence, so that memory does not grow with it.
#[derive(Debug)]
struct Sample<T> {
    kept: Vec<T>,
    every: u64,
    seen: u64,
}

impl<T> Default for Sample<T> {
    fn default() -> Self {
        Sample { kept: Vec::new(), every: 1, seen: 0 }
    }
}

impl<T> Sample<T> {
    const MOST: usize = 1 << 18;

    fn add(&mut self, value: T) {
        if self.seen.is_multiple_of(self.every) {
            if self.kept.len() == Self::MOST {
                let mut at = 0;
                self.kept.retain(|_| {
                    at += 1;
                    at % 2 == 1
                });
                self.every *= 2;
            }
            if self.seen.is_multiple_of(self.every) {
                self.kept.push(value);
            }
        }
        self.seen += 1;
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_of_a_long_sequence_is_spread_over_it() {
        let mut sample = Sample::default();
        let length = 5 * Sample::<u64>::MOST as u64 / 2;
        (0..length).for_each(|value| sample.add(value));
        assert!(sample.kept.iter().enumerate().all(|(at, value)| *value == at as u64 * sample.every));
        assert!(sample.kept.len() > Sample::<u64>::MOST / 2 && sample.kept.len() <= Sample::<u64>::MOST);
    }
}
