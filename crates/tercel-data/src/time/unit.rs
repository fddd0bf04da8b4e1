//! The unit of times that are numbers, told from how large they are and how far apart.

use crate::names::Trouble;
use crate::unit::Unit;

/// The unit, and what the user should know about it.
pub(super) type Told = (Unit, Option<String>);

/// The unit of a Unix time of this size, where that is plain: numbers of seconds are not so large.
pub(super) fn of_epoch(time: f64) -> Option<Unit> {
    match time.abs() {
        size if size >= 1e17 => Some(Unit::Nanosecond),
        size if size >= 1e14 => Some(Unit::Microsecond),
        size if size >= 1e11 => Some(Unit::Millisecond),
        _ => None,
    }
}

/// The unit of a column of times.
pub(super) fn of_column(times: &[f64]) -> Result<Told, Trouble> {
    let Some(middle) = median(times.to_vec()) else { return Ok((Unit::Second, None)) };
    // Files of Windows count 100 ns from 1601.
    if (1.16e17..1.6e17).contains(&middle) {
        return Err((
            format!("the times look like those of Windows files (100 ns since 1601): {middle}"),
            "convert them to seconds".to_owned(),
        ));
    }
    if let Some(unit) = of_epoch(middle) {
        let name = match unit {
            Unit::Nanosecond => "nanoseconds",
            Unit::Microsecond => "microseconds",
            _ => "milliseconds",
        };
        let note =
            format!("the times are Unix {name} and were converted to seconds; --time-unit says otherwise");
        return Ok((unit, Some(note)));
    }
    let Some(step) = step(times) else { return Ok((Unit::Second, None)) };
    if times.iter().all(|time| (29_000.0..74_000.0).contains(time)) && step < 0.05 {
        return days(step, middle);
    }
    if middle.abs() < 1e8 || step >= 1e4 {
        return relative(times, step);
    }
    Ok((Unit::Second, None))
}

/// Days of a spreadsheet, or seconds of the day.
fn days(step: f64, middle: f64) -> Result<Told, Trouble> {
    const SURE: f64 = 5e-4;
    if step < SURE {
        let note = "the times are days, as spreadsheets count them, and were converted to seconds; \
                    --time-unit s says otherwise";
        return Ok((Unit::Day, Some(note.to_owned())));
    }
    Err((
        format!("times such as {middle}, {step:.3e} apart, may be seconds or days of a spreadsheet"),
        "say which: --time-unit s or --time-unit days".to_owned(),
    ))
}

/// Whole numbers that lie far apart are more often counts of something smaller than seconds.
fn relative(times: &[f64], step: f64) -> Result<Told, Trouble> {
    const FAR: f64 = 20.0;
    const TOO_FAR: f64 = 100.0;
    let whole = times.iter().all(|time| time.fract() == 0.0);
    if !whole || step < FAR {
        return Ok((Unit::Second, None));
    }
    if step < TOO_FAR {
        let note =
            format!("the times are taken for seconds, {step} apart; --time-unit ms if they are milliseconds");
        return Ok((Unit::Second, Some(note)));
    }
    let smaller = match step {
        step if step >= 1e7 => "ns",
        step if step >= 1e4 => "us",
        _ => "ms",
    };
    Err((
        format!("the times are whole numbers that lie {step} apart: seconds, or something smaller"),
        format!("say what they are: --time-unit {smaller}, or --time-unit s"),
    ))
}

/// The median distance of times that follow each other, the sensors taken together.
fn step(times: &[f64]) -> Option<f64> {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    median(sorted.windows(2).map(|pair| pair[1] - pair[0]).collect())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(first: f64, step: f64) -> Vec<f64> {
        (0..20).map(|i| first + f64::from(i) * step).collect()
    }

    #[test]
    fn units_are_told_by_size_and_spacing() {
        for (first, step, unit) in [
            (0.0, 1.0, Unit::Second),
            (0.0, 0.04, Unit::Second),
            (1_709_632_800.0, 10.0, Unit::Second),
            (1_709_632_800.0, 900.0, Unit::Second),
            (1_709_632_800_000.0, 1000.0, Unit::Millisecond),
            (1_709_632_800_000_000.0, 1e6, Unit::Microsecond),
            (1_709_632_800_000_000_000.0, 1e9, Unit::Nanosecond),
            (45_356.416_67, 1.157e-5, Unit::Day),
            (36_000.0, 1.0, Unit::Second),
            (0.0, 30.0, Unit::Second),
        ] {
            assert_eq!(of_column(&series(first, step)).unwrap().0, unit, "{first} {step}");
        }
    }

    #[test]
    fn what_may_be_either_is_refused_with_the_option() {
        for (first, step, option) in [
            (45_356.0, 0.01, "--time-unit days"),
            (0.0, 1000.0, "--time-unit ms"),
            (0.0, 1e6, "--time-unit us"),
            (0.0, 1e9, "--time-unit ns"),
        ] {
            let (_, help) = of_column(&series(first, step)).unwrap_err();
            assert!(help.contains(option), "{help}");
        }
    }
}
