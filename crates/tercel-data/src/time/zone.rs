//! The zone of dates without one.

use jiff::tz::{Offset, TimeZone};

/// A zone by name or by offset: `UTC`, `+02:00`, `Europe/Oslo`.
pub(super) fn zone(name: &str) -> Result<TimeZone, String> {
    if name.eq_ignore_ascii_case("utc") || name.eq_ignore_ascii_case("z") {
        return Ok(TimeZone::UTC);
    }
    if let Some(seconds) = offset(name) {
        return Offset::from_seconds(seconds).map(TimeZone::fixed).map_err(|error| error.to_string());
    }
    TimeZone::get(name).map_err(|_| format!("`{name}` is no time zone"))
}

/// Seconds of `+02:00`, `-0530` or `+2`.
fn offset(text: &str) -> Option<i32> {
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let digits = text.strip_prefix(['+', '-'])?;
    let (hours, minutes) = match digits.split_once(':') {
        Some(parts) => parts,
        None if digits.len() == 4 && digits.is_ascii() => digits.split_at(2),
        None => (digits, "0"),
    };
    Some(
        sign * (hours.parse::<i32>().ok()?.checked_mul(3600)?
            + minutes.parse::<i32>().ok()?.checked_mul(60)?),
    )
}

/// Unix seconds of a date in a zone, from those that it would have in universal time.
pub(super) fn in_zone(civil: f64, zone: &TimeZone) -> Option<f64> {
    if *zone == TimeZone::UTC {
        return Some(civil);
    }
    let whole = civil.floor();
    let date = jiff::Timestamp::from_second(whole as i64).ok()?.to_zoned(TimeZone::UTC).datetime();
    let there = date.to_zoned(zone.clone()).ok()?.timestamp();
    Some(there.as_second() as f64 + (civil - whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zones_have_names_and_offsets() {
        let t = 1_709_632_800.0;
        for (name, hours) in
            [("UTC", 0.0), ("+02:00", 2.0), ("-0530", -5.5), ("+2", 2.0), ("Europe/Oslo", 1.0)]
        {
            assert_eq!(in_zone(t + 0.25, &zone(name).unwrap()), Some(t + 0.25 - hours * 3600.0), "{name}");
        }
        // 2024-06-05T10:00:00, when clocks are an hour ahead.
        let summer = 1_717_581_600.0;
        assert_eq!(in_zone(summer, &zone("Europe/Oslo").unwrap()), Some(summer - 7200.0));
        assert!(zone("Europe/Atlantis").is_err());
    }
}
