//! Points in time, as programs write them.

/// Which number of a date such as `03/05/2024` is the month.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DateOrder {
    /// The third of May: the day comes first.
    DayFirst,
    /// The fifth of March: the month comes first.
    MonthFirst,
}

/// What a text says about a time, in Unix seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Moment {
    /// A number: of seconds, or of a unit that its size tells.
    Number(f64),
    /// A date whose order is known.
    Date(f64),
    /// A date that begins with the day or the month: both readings, as far as there is such a date.
    Either { day_first: Option<f64>, month_first: Option<f64> },
}

impl Moment {
    /// Reads a text: a number, or a date with or without a zone, which is universal time unless it says otherwise.
    pub fn read(text: &str) -> Option<Moment> {
        let bytes = text.as_bytes();
        let digits = bytes.iter().take_while(|byte| byte.is_ascii_digit()).count();
        match (digits, bytes.get(digits)) {
            // Numbers of 14 digits are dates: as milliseconds they would lie beyond the year 2300.
            (14, None) => compact(text).or_else(|| number(text)),
            (1.., Some(b'-' | b'/' | b':' | b' ' | b'T' | b'_' | b'Z')) => date(text),
            // 5.3.2024, in contrast to 5.3.
            (1.., Some(b'.')) if bytes[digits + 1..].contains(&b'.') => date(text),
            _ => number(text),
        }
    }
}

fn number(text: &str) -> Option<Moment> {
    text.parse().ok().filter(|number: &f64| number.is_finite()).map(Moment::Number)
}

/// Unix seconds of a number whose unit its size tells: seconds up to the year 5138, and from 1973 on milli-, micro- and
/// nanoseconds.
pub(super) fn seconds(number: f64) -> f64 {
    match number.abs() {
        size if size < 1e11 => number,
        size if size < 1e14 => number / 1e3,
        size if size < 1e17 => number / 1e6,
        _ => number / 1e9,
    }
}

/// `20240305100000`.
fn compact(text: &str) -> Option<Moment> {
    let (date, time) = text.split_at(8);
    let part = |from: usize, to: usize| date[from..to].parse().ok();
    let day = days(part(0, 4)?, part(4, 6)?, part(6, 8)?)?;
    let (time, rest) = time_of_day(time)?;
    rest.is_empty().then_some(Moment::Date(unix(day, time)))
}

/// Seconds and nanoseconds of a day.
type Time = (i64, i64);

/// Unix seconds of a day since 1970 and a time of it.
fn unix(day: i64, (seconds, nanoseconds): Time) -> f64 {
    (day * 86_400 + seconds) as f64 + nanoseconds as f64 * 1e-9
}

/// A date and, mostly, a time of the day.
fn date(text: &str) -> Option<Moment> {
    let (first, rest) = digits(text)?;
    if text.len() - rest.len() == 8 {
        let day = days(first / 10_000, first / 100 % 100, first % 100)?;
        return Some(Moment::Date(unix(day, clock(rest)?)));
    }
    let separator = rest.chars().next().filter(|separator| "-/.".contains(*separator))?;
    let rest = &rest[1..];
    if text.len() - rest.len() == 5 {
        let (month, rest) = digits(rest)?;
        let (day, rest) = digits(rest.strip_prefix(separator)?)?;
        return Some(Moment::Date(unix(days(first, month, day)?, clock(rest)?)));
    }
    if let Some((month, rest)) = month_name(rest) {
        let (year, rest) = digits(rest.strip_prefix(separator)?)?;
        return Some(Moment::Date(unix(days(full(year), month, first)?, clock(rest)?)));
    }
    let (second, rest) = digits(rest)?;
    let (year, rest) = digits(rest.strip_prefix(separator)?)?;
    let (year, time) = (full(year), clock(rest)?);
    let at = |month, day| days(year, month, day).map(|day| unix(day, time));
    let (day_first, month_first) = (at(second, first), at(first, second));
    match separator {
        // Nobody puts points behind a month that comes first.
        '.' => day_first.map(Moment::Date),
        _ if day_first.is_none() && month_first.is_none() => None,
        _ => Some(Moment::Either { day_first, month_first }),
    }
}

/// The year, where it is written by its last two digits.
fn full(year: i64) -> i64 {
    if year < 100 { 2000 + year } else { year }
}

fn month_name(text: &str) -> Option<(i64, &str)> {
    const NAMES: [&str; 12] =
        ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];
    let name = text.get(..3)?;
    let month = NAMES.iter().position(|known| known.eq_ignore_ascii_case(name))?;
    Some((month as i64 + 1, &text[3..]))
}

/// The time of what follows a date, less the offset of the zone. Nothing is midnight: spreadsheets write it so.
fn clock(text: &str) -> Option<Time> {
    let text = text.trim_end();
    if text.is_empty() {
        return Some((0, 0));
    }
    let time = text.strip_prefix(['T', 't', ' ', '_'])?.trim_start();
    let ((seconds, nanoseconds), rest) = time_of_day(time)?;
    let (seconds, rest) = half_of_day(seconds, rest.trim_start())?;
    Some((seconds - zone(rest.trim())?, nanoseconds))
}

/// `10:00`, `10:00:00.25` or `100000`, and what follows.
fn time_of_day(text: &str) -> Option<(Time, &str)> {
    let (first, rest) = digits(text)?;
    let (hour, minute, second, rest) = match text.len() - rest.len() {
        6 => (first / 10_000, first / 100 % 100, first % 100, rest),
        1 | 2 => {
            let (minute, rest) = digits(rest.strip_prefix(':')?)?;
            match rest.strip_prefix(':') {
                Some(rest) => digits(rest).map(|(second, rest)| (first, minute, second, rest))?,
                None => (first, minute, 0, rest),
            }
        }
        _ => return None,
    };
    let (nanoseconds, rest) = match rest.strip_prefix(['.', ',']) {
        Some(rest) => fraction(rest)?,
        None => (0, rest),
    };
    // A leap second is the 61st of its minute.
    if hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    Some(((hour * 3600 + minute * 60 + second, nanoseconds), rest))
}

/// Nanoseconds of the digits after a point.
fn fraction(text: &str) -> Option<(i64, &str)> {
    let end = text.bytes().take_while(u8::is_ascii_digit).count();
    let kept = &text[..end.min(9)];
    let nanoseconds: i64 = kept.parse().ok()?;
    Some((nanoseconds * 10_i64.pow(9 - kept.len() as u32), &text[end..]))
}

/// Turns hours of a clock of twelve into those of the day.
fn half_of_day(seconds: i64, rest: &str) -> Option<(i64, &str)> {
    const NOON: i64 = 43_200;
    let Some(word) = rest.get(..2) else { return Some((seconds, rest)) };
    let afternoon = word.eq_ignore_ascii_case("pm");
    if !afternoon && !word.eq_ignore_ascii_case("am") {
        return Some((seconds, rest));
    }
    let of_twelve = if (NOON..NOON + 3600).contains(&seconds) { seconds - NOON } else { seconds };
    (of_twelve < NOON).then(|| (of_twelve + if afternoon { NOON } else { 0 }, &rest[2..]))
}

/// Seconds by which a zone is ahead of universal time.
fn zone(text: &str) -> Option<i64> {
    if ["", "z", "utc", "gmt"].iter().any(|name| text.eq_ignore_ascii_case(name)) {
        return Some(0);
    }
    let sign = match text.as_bytes()[0] {
        b'+' => 1,
        b'-' => -1,
        _ => return None,
    };
    let (first, rest) = digits(&text[1..])?;
    let (hours, minutes, rest) = match text.len() - 1 - rest.len() {
        4 => (first / 100, first % 100, rest),
        _ if rest.is_empty() => (first, 0, rest),
        _ => digits(rest.strip_prefix(':')?).map(|(minutes, rest)| (first, minutes, rest))?,
    };
    (rest.is_empty() && hours <= 23 && minutes <= 59).then_some(sign * (hours * 3600 + minutes * 60))
}

/// A whole number at the beginning of a text, and what follows.
fn digits(text: &str) -> Option<(i64, &str)> {
    let bytes = text.as_bytes();
    let end = bytes.iter().take_while(|byte| byte.is_ascii_digit()).count();
    if end == 0 || end > 9 {
        return None;
    }
    let number = bytes[..end].iter().fold(0, |number, digit| number * 10 + i64::from(digit - b'0'));
    Some((number, &text[end..]))
}

/// Days from 1970 to a date of the Gregorian calendar, if there is such a date.
fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    const BEFORE: [i64; 13] = [0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334, 365];
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let index = usize::try_from(month).ok().filter(|month| (1..=12).contains(month))?;
    let length = BEFORE[index] - BEFORE[index - 1] + i64::from(leap && month == 2);
    if !(1..=length).contains(&day) || !(1900..=2999).contains(&year) {
        return None;
    }
    let past = year - 1;
    let leap_days = past / 4 - past / 100 + past / 400 - (1969 / 4 - 1969 / 100 + 1969 / 400);
    Some((year - 1970) * 365 + leap_days + BEFORE[index - 1] + i64::from(leap && month > 2) + day - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(text: &str) -> Option<f64> {
        match Moment::read(text)? {
            Moment::Date(seconds) => Some(seconds),
            other => panic!("{text}: {other:?}"),
        }
    }

    #[test]
    fn dates_of_every_form_are_the_same_second() {
        for text in [
            "2024-03-05T10:00:00Z",
            "2024-03-05 10:00:00",
            "2024-03-05 10:00",
            "2024-03-05T10:00:00.000+00:00",
            "2024-03-05 12:00:00+0200",
            "2024-03-05 07:30:00-02:30",
            "2024-03-05 10:00:00 UTC",
            "2024-03-05 10:00:00 GMT",
            "2024-03-05 10:00:00+00",
            "2024/03/05 10:00:00",
            "20240305_100000",
            "20240305T100000Z",
            "20240305100000",
            "05.03.2024 10:00:00",
            "5-Mar-2024 10:00:00",
            "2024-03-05 10:00:00 AM",
        ] {
            assert_eq!(known(text), Some(1_709_632_800.0), "{text}");
        }
        assert_eq!(known("2024-03-05 10:00:00 PM"), Some(1_709_632_800.0 + 43_200.0));
        assert_eq!(known("2024-03-05 12:00:01 AM"), Some(1_709_596_801.0));
        assert_eq!(known("1970-01-02 00:00:00.25"), Some(86_400.25));
        assert_eq!(known("2024-02-29"), Some(1_709_164_800.0));
    }

    #[test]
    fn dates_that_begin_with_the_day_or_the_month_have_both_readings() {
        let read = |text| match Moment::read(text) {
            Some(Moment::Either { day_first, month_first }) => (day_first, month_first),
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(read("02/01/1970 00:00:01"), (Some(86_401.0), Some(31.0 * 86_400.0 + 1.0)));
        assert_eq!(read("31/12/2019 23:59:58"), (Some(1_577_836_798.0), None));
        assert_eq!(read("12-31-2019 23:59:58"), (None, Some(1_577_836_798.0)));
        assert_eq!(read("1/2/24 0:00"), read("01/02/2024 00:00:00"));
    }

    #[test]
    fn what_is_no_date_is_nothing() {
        for text in [
            "yesterday",
            "32/01/1970 00:00:01",
            "2024-02-30 00:00",
            "2024-03-05 25:00:00",
            "2024-03-05 10:00 XYZ",
            "1:2",
        ] {
            assert_eq!(Moment::read(text), None, "{text}");
        }
    }

    #[test]
    fn the_size_of_a_number_tells_its_unit() {
        for number in [1_709_632_800.0, 1.709_632_8e12, 1.709_632_8e15, 1.709_632_8e18] {
            assert_eq!(seconds(number), 1_709_632_800.0);
        }
        assert_eq!(Moment::read("-1.5"), Some(Moment::Number(-1.5)));
        assert_eq!(Moment::read("1709632800"), Some(Moment::Number(1_709_632_800.0)));
    }
}
