//! One time as it stands in a file.

/// A time before it is known what the numbers of its column mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Moment {
    /// A number in a unit that is not known yet.
    Number(f64),
    /// Unix seconds: a date with its zone.
    Instant(f64),
    /// A date without a zone, as Unix seconds if it were in universal time.
    Civil(f64),
    /// A date whose first two parts may be day and month or month and day, with the second of the day.
    Slashed { first: u8, second: u8, year: i32, seconds: f64 },
    /// A time of day, s.
    OfDay(f64),
}

const DAY: f64 = 86_400.0;

impl Moment {
    /// Reads a number, a date or a time of day.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        if let Some(usual) = usual(text.as_bytes()) {
            return Some(usual);
        }
        if let Some(compact) = compact(text) {
            return Some(compact);
        }
        if let Ok(number) = text.parse() {
            return Some(Moment::Number(number));
        }
        let (date, rest) = match text.find(['T', 't', ' ', ',']) {
            // `5 Mar 2024 10:00` has blanks in its date.
            _ if text.bytes().any(|byte| byte.is_ascii_alphabetic()) && month_name(text).is_some() => {
                month_name(text)?
            }
            Some(at) => (date(&text[..at]), text[at + 1..].trim_start_matches([' ', ','])),
            None => (date(text), ""),
        };
        let Some(date) = date else { return time_of_day(text).map(|(seconds, _)| Moment::OfDay(seconds)) };
        if rest.is_empty() {
            return date.at(0.0, None);
        }
        let (seconds, zone) = time_of_day_with_zone(rest)?;
        date.at(seconds, zone)
    }

    /// Unix seconds of a date in universal time.
    pub fn civil(year: i32, month: u8, day: u8, seconds: f64) -> Option<f64> {
        let date =
            jiff::civil::Date::new(year.try_into().ok()?, month.try_into().ok()?, day.try_into().ok()?)
                .ok()?;
        let days = days_since_1970(date);
        Some(days as f64 * DAY + seconds)
    }
}

/// The forms of most rows of long files, quickly: `2024-03-05T10:00:00.25Z` and `05/03/2024 10:00:00`, `Z` and fraction or not.
fn usual(text: &[u8]) -> Option<Moment> {
    let number = |from: usize, to: usize| {
        text.get(from..to)?.iter().try_fold(0_u32, |number, byte| {
            byte.is_ascii_digit().then(|| number * 10 + u32::from(byte - b'0'))
        })
    };
    let is = |at: usize, byte: u8| text.get(at) == Some(&byte);
    if text.len() < 19 || !is(13, b':') || !is(16, b':') || !matches!(text[10], b'T' | b' ') {
        return None;
    }
    let (hour, minute, second) = (number(11, 13)?, number(14, 16)?, number(17, 19)?);
    let (fraction, ended) = match &text[19..] {
        [] => (0.0, false),
        [b'Z'] => (0.0, true),
        [b'.', digits @ ..] => {
            let (digits, ended) = digits.strip_suffix(b"Z").map_or((digits, false), |digits| (digits, true));
            let end = 20 + digits.len();
            if !(1..=9).contains(&digits.len()) {
                return None;
            }
            (f64::from(number(20, end)?) / 10_f64.powi(digits.len() as i32), ended)
        }
        _ => return None,
    };
    if hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    let whole = hour * 3600 + minute * 60 + second;
    if is(4, b'-') && is(7, b'-') {
        let (year, month, day) = (number(0, 4)?, number(5, 7)?, number(8, 10)?);
        let date = jiff::civil::Date::new(year as i16, month as i8, day as i8).ok()?;
        // Whole seconds first, so that nothing but the fraction is rounded.
        let seconds = (days_since_1970(date) * 86_400 + i64::from(whole)) as f64 + fraction;
        return Some(if ended { Moment::Instant(seconds) } else { Moment::Civil(seconds) });
    }
    if is(2, b'/') && is(5, b'/') && !ended {
        let (first, second, year) = (number(0, 2)? as u8, number(3, 5)? as u8, number(6, 10)? as i32);
        return Some(Moment::Slashed { first, second, year, seconds: f64::from(whole) + fraction });
    }
    None
}

fn days_since_1970(date: jiff::civil::Date) -> i64 {
    let (year, month, day) = (i64::from(date.year()), i64::from(date.month()), i64::from(date.day()));
    // Years that begin in March have their leap day at the end.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let era = year.div_euclid(400);
    let of_era = year.rem_euclid(400);
    let of_year = (153 * month + 2) / 5 + day - 1;
    era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468
}

/// A date without its time.
enum Date {
    Known { year: i32, month: u8, day: u8 },
    Slashed { first: u8, second: u8, year: i32 },
}

impl Date {
    fn at(self, seconds: f64, zone: Option<f64>) -> Option<Moment> {
        match self {
            Date::Known { year, month, day } => {
                let civil = Moment::civil(year, month, day, seconds)?;
                Some(zone.map_or(Moment::Civil(civil), |zone| Moment::Instant(civil - zone)))
            }
            Date::Slashed { first, second, year } => {
                Some(Moment::Slashed { first, second, year, seconds: seconds - zone.unwrap_or(0.0) })
            }
        }
    }
}

/// `2024-03-05`, `2024/03/05`, `2024.03.05`, `20240305`, `05/03/2024`, `05.03.2024`.
fn date(text: &str) -> Option<Date> {
    if text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_digit()) {
        let [year, month, day] = [&text[..4], &text[4..6], &text[6..]];
        return Some(Date::Known {
            year: year.parse().ok()?,
            month: month.parse().ok()?,
            day: day.parse().ok()?,
        });
    }
    let separator = text.chars().find(|c| !c.is_ascii_digit()).filter(|c| "-/.".contains(*c))?;
    let mut parts = text.split(separator);
    let parts = [parts.next()?, parts.next()?, parts.next().filter(|_| parts.next().is_none())?];
    if parts.iter().any(|part| part.is_empty() || !part.bytes().all(|byte| byte.is_ascii_digit())) {
        return None;
    }
    match parts.map(str::len) {
        [4, 1..=2, 1..=2] => Some(Date::Known {
            year: parts[0].parse().ok()?,
            month: parts[1].parse().ok()?,
            day: parts[2].parse().ok()?,
        }),
        [1..=2, 1..=2, 4] => {
            let (first, second, year) =
                (parts[0].parse().ok()?, parts[1].parse().ok()?, parts[2].parse().ok()?);
            // Points stand in dates of countries that begin with the day.
            if separator == '.' {
                return Some(Date::Known { year, month: second, day: first });
            }
            Some(Date::Slashed { first, second, year })
        }
        _ => None,
    }
}

const MONTHS: [&str; 12] =
    ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];

/// `5 Mar 2024 10:00`, `Mar 5, 2024 10:00`, `05-Mar-2024 10:00`: the date and the rest.
fn month_name(text: &str) -> Option<(Option<Date>, &str)> {
    let mut rest = text;
    let mut parts = Vec::new();
    while parts.len() < 3 {
        rest = rest.trim_start_matches([' ', ',', '-', '/', '.']);
        let end = rest.find([' ', ',', '-', '/', '.', 'T']).filter(|end| *end > 0).unwrap_or(rest.len());
        parts.push(&rest[..end]);
        rest = &rest[end..];
    }
    let month = |part: &str| {
        let part = part.to_lowercase();
        MONTHS.iter().position(|month| part.get(..3) == Some(month)).map(|at| at as u8 + 1)
    };
    let (month, others) = match (month(parts[0]), month(parts[1])) {
        (Some(month), _) => (month, [parts[1], parts[2]]),
        (None, Some(month)) => (month, [parts[0], parts[2]]),
        _ => return None,
    };
    let (day, year) = if others[0].len() == 4 { (others[1], others[0]) } else { (others[0], others[1]) };
    let known = Date::Known { year: year.parse().ok()?, month, day: day.parse().ok()? };
    Some((Some(known), rest.trim_start_matches([' ', ',', 'T'])))
}

/// `20240305100000`, `20240305T100000Z`: digits that are plainly a date and a time.
fn compact(text: &str) -> Option<Moment> {
    let bytes = text.as_bytes();
    let digits =
        |from: usize, to: usize| bytes.get(from..to).is_some_and(|part| part.iter().all(u8::is_ascii_digit));
    let (time, plainly) = match bytes.get(8) {
        Some(b'T' | b't' | b'_') if digits(0, 8) && digits(9, 15) => (9, true),
        Some(_) if digits(0, 14) && (text.starts_with("19") || text.starts_with("20")) => (8, false),
        _ => return None,
    };
    let rest = &text[time + 6..];
    // Of numbers only those of 14 digits are dates.
    if !(plainly || rest.is_empty() || rest.eq_ignore_ascii_case("z")) {
        return None;
    }
    let number = |from: usize, to: usize| text.get(from..to)?.parse::<u32>().ok();
    let (hour, minute, second) =
        (number(time, time + 2)?, number(time + 2, time + 4)?, number(time + 4, time + 6)?);
    if hour > 24 || minute > 59 || second > 60 {
        return None;
    }
    let end = rest.find(|c: char| c != '.' && !c.is_ascii_digit()).unwrap_or(rest.len());
    let fraction = if end == 0 { 0.0 } else { format!("0{}", &rest[..end]).parse::<f64>().ok()? };
    let zone = if rest[end..].is_empty() { None } else { Some(zone(&rest[end..])?) };
    date(text.get(..8)?)?.at(f64::from(hour * 3600 + minute * 60 + second) + fraction, zone)
}

/// Seconds of the day, and the offset from universal time, s.
fn time_of_day_with_zone(text: &str) -> Option<(f64, Option<f64>)> {
    let (seconds, rest) = time_of_day(text)?;
    match rest.trim() {
        "" => Some((seconds, None)),
        rest => Some((seconds, Some(zone(rest)?))),
    }
}

/// `10:00`, `10:00:00.25`, `10:00:00,25 PM`: seconds of the day, and what follows.
fn time_of_day(text: &str) -> Option<(f64, &str)> {
    let number = |text: &str| {
        let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
        let number: u32 = (1..=2).contains(&end).then(|| text[..end].parse().ok()).flatten()?;
        Some((number, end))
    };
    let (hour, end) = number(text)?;
    let text = text[end..].strip_prefix(':')?;
    let (minute, end) = number(text)?;
    let mut rest = &text[end..];
    let mut seconds = 0.0;
    if let Some(text) = rest.strip_prefix(':') {
        let end = text.find(|c: char| !c.is_ascii_digit() && c != '.' && c != ',').unwrap_or(text.len());
        seconds = text[..end].replace(',', ".").parse().ok()?;
        rest = &text[end..];
    }
    let hour = match rest.trim_start().get(..2) {
        Some(half) if half.eq_ignore_ascii_case("am") || half.eq_ignore_ascii_case("pm") => {
            rest = &rest.trim_start()[2..];
            hour % 12 + if half.eq_ignore_ascii_case("pm") { 12 } else { 0 }
        }
        _ => hour,
    };
    let whole = hour <= 24 && minute < 60 && (0.0..61.0).contains(&seconds);
    whole.then_some((f64::from(hour * 3600 + minute * 60) + seconds, rest))
}

/// The offset of `Z`, `UTC`, `GMT`, `+02:00`, `+0200` or `+02`, s.
fn zone(text: &str) -> Option<f64> {
    let text = text.trim();
    let text = ["UTC", "GMT"]
        .iter()
        .find_map(|name| text.get(..3).filter(|start| start.eq_ignore_ascii_case(name)).map(|_| &text[3..]))
        .unwrap_or(text);
    if text.is_empty() || text.eq_ignore_ascii_case("z") {
        return Some(0.0);
    }
    // `2024-03-05T10:00:00+02:00[Europe/Oslo]` names the zone as well.
    let text = text.split('[').next()?;
    let sign = if text.starts_with('-') { -1.0 } else { 1.0 };
    let digits: String = text.strip_prefix(['+', '-'])?.chars().filter(|c| *c != ':').collect();
    if !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let (hours, minutes) = match digits.len() {
        2 => (digits.as_str(), "0"),
        4 => digits.split_at(2),
        _ => return None,
    };
    Some(sign * (hours.parse::<f64>().ok()? * 3600.0 + minutes.parse::<f64>().ok()? * 60.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2024-03-05T10:00:00Z
    const T: f64 = 1_709_632_800.0;

    #[test]
    fn usual_forms_of_a_date_mean_the_same() {
        for text in [
            "2024-03-05T10:00:00Z",
            "2024-03-05 10:00:00+00:00",
            "2024-03-05T12:00:00+0200",
            "2024-03-05 10:00:00 UTC",
            "20240305T100000Z",
            "2024-03-05T05:00:00-05",
            "2024-03-05T11:00:00+01:00[Europe/Oslo]",
            "20240305100000Z",
        ] {
            assert_eq!(Moment::parse(text), Some(Moment::Instant(T)), "{text}");
        }
        for text in [
            "2024-03-05 10:00:00",
            "2024-03-05T10:00",
            "2024/03/05 10:00:00.000",
            "05.03.2024 10:00:00",
            "20240305T100000",
            "20240305100000",
            "5 Mar 2024 10:00:00",
            "Mar 5, 2024 10:00:00 AM",
            "05-Mar-2024 10:00:00",
            "March 5 2024, 10:00",
        ] {
            assert_eq!(Moment::parse(text), Some(Moment::Civil(T)), "{text}");
        }
        let slashed = Moment::Slashed { first: 5, second: 3, year: 2024, seconds: 36_000.0 };
        for text in ["05/03/2024 10:00", "5/3/2024 10:00:00 AM", "05-03-2024 10:00:00"] {
            assert_eq!(Moment::parse(text), Some(slashed), "{text}");
        }
    }

    #[test]
    fn times_of_day_and_numbers_are_told_apart() {
        assert_eq!(Moment::parse("10:00:00.25"), Some(Moment::OfDay(36_000.25)));
        assert_eq!(Moment::parse("12:30 PM"), Some(Moment::OfDay(45_000.0)));
        assert_eq!(Moment::parse("45356.4167"), Some(Moment::Number(45356.4167)));
        assert_eq!(Moment::parse("1709632800000"), Some(Moment::Number(1_709_632_800_000.0)));
        for text in ["yesterday", "", "2024-13-05", "10:61", "2024-03-05T25:00:00Z", "32/01/2024x", "Mars 5"]
        {
            assert_eq!(Moment::parse(text), None, "{text}");
        }
    }

    #[test]
    fn days_are_counted_from_1970() {
        assert_eq!(Moment::civil(1970, 1, 1, 0.0), Some(0.0));
        assert_eq!(Moment::civil(2000, 2, 29, 1.5), Some(951_782_401.5));
        assert_eq!(Moment::civil(1969, 12, 31, 0.0), Some(-86_400.0));
        assert_eq!(Moment::civil(2023, 2, 29, 0.0), None);
    }
}
