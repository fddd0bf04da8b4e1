//! Whether times are dates.

/// What the times of a recording are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Clock {
    /// Seconds since 1970.
    Unix,
    /// Seconds of another epoch.
    Seconds,
}

impl Clock {
    /// Times between 1990 and 2100 are taken for Unix times: simulations and lone sensors count from 0 or from a start.
    pub fn of(first: f64, last: f64) -> Clock {
        const SINCE: f64 = 631_152_000.0;
        const BEFORE: f64 = 4_102_444_800.0;
        if first >= SINCE && last < BEFORE { Clock::Unix } else { Clock::Seconds }
    }

    /// Date and time in universal time, to the millisecond; nothing when the times are no dates.
    pub fn date(self, time: f64) -> Option<String> {
        if self == Clock::Seconds {
            return None;
        }
        let milliseconds = (time * 1e3).round() as i64;
        let date = jiff::Timestamp::from_millisecond(milliseconds).ok()?;
        Some(if milliseconds % 1000 == 0 { format!("{date:.0}") } else { format!("{date:.3}") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_have_milliseconds_where_they_need_them() {
        let clock = Clock::of(1_709_632_800.0, 1_709_640_000.0);
        assert_eq!(clock.date(1_709_632_800.0).unwrap(), "2024-03-05T10:00:00Z");
        assert_eq!(clock.date(1_709_632_800.25).unwrap(), "2024-03-05T10:00:00.250Z");
        assert_eq!(clock.date(1_709_632_799.999_9).unwrap(), "2024-03-05T10:00:00Z");
    }

    #[test]
    fn seconds_from_a_start_are_no_dates() {
        assert_eq!(Clock::of(0.0, 3600.0), Clock::Seconds);
        assert_eq!(Clock::of(1_709_632_800.0, 1_709_632_800_000.0), Clock::Seconds);
        assert_eq!(Clock::Seconds.date(1.0), None);
    }
}
