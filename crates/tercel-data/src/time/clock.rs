//! From times as they stand in a file to seconds.

use std::collections::HashMap;
use std::sync::Arc;

use jiff::tz::TimeZone;

use super::moment::Moment;
use super::unit::{of_column, of_epoch};
use super::zone::{in_zone, zone};
use crate::error::{DataError, Place, Refusal};
use crate::names::Trouble;
use crate::options::{DateOrder, ReadOptions};
use crate::unit::Unit;

const DAY: f64 = 86_400.0;
/// Spreadsheets count days from here: 1899-12-30.
const SPREADSHEET: f64 = -25_569.0;

/// Turns times into seconds, one after the other.
#[derive(Debug, Clone)]
pub(crate) struct Clock {
    unit: Option<Unit>,
    order: Option<DateOrder>,
    zone: TimeZone,
    zone_said: bool,
    /// The day and the last time of day, for each name.
    days: HashMap<Option<Arc<str>>, (f64, f64)>,
    first_of_day: Option<f64>,
    /// Dates without a zone were there.
    civil: bool,
}

impl Clock {
    /// Times under these options; `unit` is that of the name of the column.
    pub fn new(options: &ReadOptions, unit: Option<Unit>, file: &Arc<str>) -> Result<Self, DataError> {
        let name = options.time_zone.as_deref();
        let zone = zone(name.unwrap_or("UTC")).map_err(|problem| {
            let help = "name it as UTC, +02:00 or Europe/Oslo: --time-zone";
            DataError::unsettled(Place::whole(file), problem, help)
        })?;
        Ok(Clock {
            unit: options.time_unit.or(unit),
            order: options.date_order,
            zone,
            zone_said: name.is_some(),
            days: HashMap::new(),
            first_of_day: None,
            civil: false,
        })
    }

    /// Looks at a whole column, so that what one time leaves open the others tell. Returns what the user should know.
    pub fn look_at(&mut self, times: &[Option<Moment>]) -> Result<Vec<String>, Trouble> {
        let mut notes = Vec::new();
        if self.unit.is_none() {
            /// As many tell as well as all.
            const LOOKED_AT: usize = 20_000;
            let numbers = times.iter().flatten().filter_map(|moment| match moment {
                Moment::Number(number) if number.is_finite() => Some(*number),
                _ => None,
            });
            let numbers: Vec<f64> = numbers.take(LOOKED_AT).collect();
            if !numbers.is_empty() {
                let (unit, note) = of_column(&numbers)?;
                self.unit = Some(unit);
                notes.extend(note);
            }
        }
        if self.order.is_none() {
            self.order = order(times.iter().flatten())?;
        }
        if times.iter().flatten().any(|moment| matches!(moment, Moment::OfDay(_))) {
            notes.push(
                "the times are times of day; where they go back at midnight the next day begins".to_owned(),
            );
        }
        Ok(notes)
    }

    /// Seconds of a time; `name` is that of its sensor or object, whose times of day follow each other.
    pub fn seconds(&mut self, moment: Moment, name: Option<&Arc<str>>) -> Result<f64, Refusal> {
        let seconds = match moment {
            Moment::Number(number) => self.number(number),
            Moment::Instant(seconds) => Some(seconds),
            Moment::Civil(civil) => self.civil(civil),
            Moment::Slashed { first, second, year, seconds } => {
                let Some(order) = self.order else { return Err(ambiguous(first, second, year)) };
                let (day, month) = match order {
                    DateOrder::DayFirst => (first, second),
                    DateOrder::MonthFirst => (second, first),
                };
                let Some(civil) = Moment::civil(year, month, day, seconds) else {
                    let refusal = Refusal::new(format!("{first}/{second}/{year}"), "a date");
                    return Err(
                        refusal.helped("day or month may stand first: --date-order day-first or month-first")
                    );
                };
                self.civil(civil)
            }
            Moment::OfDay(seconds) => Some(self.of_day(seconds, name)),
        };
        seconds.filter(|seconds| seconds.is_finite()).ok_or_else(|| match moment {
            Moment::Number(number) => Refusal::new(number, "a time in seconds"),
            _ => Refusal::new("no date of the calendar", "a date and time"),
        })
    }

    fn number(&self, number: f64) -> Option<f64> {
        let unit = self.unit.or_else(|| of_epoch(number)).unwrap_or(Unit::Second);
        Some(match unit {
            Unit::Second => number,
            // Days of a date are counted from the epoch of spreadsheets; they are exact to a few microseconds.
            Unit::Day if number > 20_000.0 => ((number + SPREADSHEET) * DAY * 1e4).round() / 1e4,
            // Dividing by a whole number is exact where multiplying by its inverse is not.
            Unit::Millisecond => number / 1e3,
            Unit::Microsecond => number / 1e6,
            Unit::Nanosecond => number / 1e9,
            unit => number * unit.factor(),
        })
    }

    fn civil(&mut self, civil: f64) -> Option<f64> {
        self.civil = true;
        in_zone(civil, &self.zone)
    }

    /// Seconds since the midnight before the first time.
    fn of_day(&mut self, seconds: f64, name: Option<&Arc<str>>) -> f64 {
        let first = *self.first_of_day.get_or_insert(seconds);
        let known = self.days.get(&name.cloned());
        let new = known.is_none();
        let (day, last) = match known {
            Some((day, last)) => (*day, *last),
            // Another sensor begins near the first.
            None => (0.0, first),
        };
        let day = match seconds - last {
            back if back < -DAY / 2.0 => day + DAY,
            // The row before was past midnight already.
            ahead if ahead > DAY / 2.0 && (day > 0.0 || new) => day - DAY,
            _ => day,
        };
        self.days.insert(name.cloned(), (day, seconds));
        day + seconds
    }

    /// What the user should know when all times are read.
    pub fn note(&self) -> Option<String> {
        (self.civil && !self.zone_said).then(|| {
            "dates without a time zone are taken for universal time; --time-zone says otherwise".to_owned()
        })
    }
}

/// What stands first in the dates of a column, where they tell.
fn order<'m>(moments: impl Iterator<Item = &'m Moment>) -> Result<Option<DateOrder>, Trouble> {
    let (mut day_first, mut month_first, mut example) = (false, false, None);
    for moment in moments {
        if let Moment::Slashed { first, second, year, .. } = moment {
            day_first |= *first > 12;
            month_first |= *second > 12;
            example.get_or_insert((*first, *second, *year));
        }
    }
    match (day_first, month_first, example) {
        (true, false, _) => Ok(Some(DateOrder::DayFirst)),
        (false, true, _) => Ok(Some(DateOrder::MonthFirst)),
        // Bad rows among good ones are refused one by one.
        (true, true, _) | (_, _, None) => Ok(None),
        (false, false, Some((first, second, year))) => {
            let refusal = ambiguous(first, second, year);
            Err((
                format!("dates such as {} may begin with the day or the month", refusal.value),
                refusal.help.unwrap_or_default(),
            ))
        }
    }
}

fn ambiguous(first: u8, second: u8, year: i32) -> Refusal {
    Refusal::new(format!("{first:02}/{second:02}/{year}"), "a date that says what is the day")
        .helped("say which: --date-order day-first or --date-order month-first")
}
