//! Units in which files hold what the tables hold in SI units.

use std::f64::consts::PI;
use std::str::FromStr;

/// A unit of a column of a file.
///
/// ```
/// use tercel_data::Unit;
///
/// assert_eq!("nm".parse(), Ok(Unit::NauticalMile));
/// assert_eq!("kts".parse(), Ok(Unit::Knot));
/// assert!("parsec".parse::<Unit>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// m
    Metre,
    /// km
    Kilometre,
    /// 1852 m
    NauticalMile,
    /// 0.3048 m
    Foot,
    /// 1609.344 m
    Mile,
    /// 100 ft, the unit of flight levels
    FlightLevel,
    /// m/s
    MetrePerSecond,
    /// km/h
    KilometrePerHour,
    /// 1852 m/h
    Knot,
    /// 1609.344 m/h
    MilePerHour,
    /// 0.3048 m/s
    FootPerSecond,
    /// 0.3048 m/min
    FootPerMinute,
    /// rad
    Radian,
    /// 0.001 rad
    Milliradian,
    /// π/180 rad
    Degree,
    /// s
    Second,
    /// 1e-3 s
    Millisecond,
    /// 1e-6 s
    Microsecond,
    /// 1e-9 s
    Nanosecond,
    /// 60 s
    Minute,
    /// 86 400 s; since 1899-12-30 where a date is meant, as spreadsheets count
    Day,
}

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Dimension {
    Length,
    Speed,
    Angle,
    Time,
}

/// The names of the units, that by which messages call them first.
const NAMES: [(Unit, &[&str]); 21] = [
    (Unit::Metre, &["m", "metre", "metres", "meter", "meters", "mtr"]),
    (Unit::Kilometre, &["km", "kilometre", "kilometres", "kilometer", "kilometers"]),
    (Unit::NauticalMile, &["nm", "nmi", "nautical_miles", "nautical_mile", "naut_mi"]),
    (Unit::Foot, &["ft", "feet", "foot"]),
    (Unit::Mile, &["mi", "mile", "miles"]),
    (Unit::FlightLevel, &["fl", "flight_level"]),
    (
        Unit::MetrePerSecond,
        &["m/s", "ms", "mps", "m_s", "ms-1", "m_per_s", "meters_per_second", "metres_per_second"],
    ),
    (Unit::KilometrePerHour, &["km/h", "kmh", "kph", "km_h", "kmph"]),
    (Unit::Knot, &["kn", "kt", "kts", "knot", "knots"]),
    (Unit::MilePerHour, &["mph", "mi/h"]),
    (Unit::FootPerSecond, &["ft/s", "fps", "ft_s"]),
    (Unit::FootPerMinute, &["ft/min", "fpm", "ft_min"]),
    (Unit::Radian, &["rad", "rads", "radian", "radians"]),
    (Unit::Milliradian, &["mrad", "milliradians"]),
    (Unit::Degree, &["deg", "degs", "degree", "degrees", "°"]),
    (Unit::Second, &["s", "sec", "secs", "second", "seconds"]),
    (Unit::Millisecond, &["ms", "msec", "millis", "millisecond", "milliseconds"]),
    (Unit::Microsecond, &["us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"]),
    (Unit::Nanosecond, &["ns", "nsec", "nanos", "nanosecond", "nanoseconds"]),
    (Unit::Minute, &["min", "mins", "minute", "minutes"]),
    (Unit::Day, &["days", "day", "d"]),
];

impl Unit {
    /// The name by which messages and options call the unit.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(unit, _)| *unit == self).map_or("", |(_, names)| names[0])
    }

    /// The unit of a measure that goes by this name.
    pub(crate) fn of(name: &str, dimension: Dimension) -> Option<Unit> {
        let name = name.trim().to_lowercase();
        NAMES
            .iter()
            .find(|(unit, names)| unit.dimension() == dimension && names.contains(&name.as_str()))
            .map(|(unit, _)| *unit)
    }

    pub(crate) fn dimension(self) -> Dimension {
        use Unit::*;
        match self {
            Metre | Kilometre | NauticalMile | Foot | Mile | FlightLevel => Dimension::Length,
            MetrePerSecond | KilometrePerHour | Knot | MilePerHour | FootPerSecond | FootPerMinute => {
                Dimension::Speed
            }
            Radian | Milliradian | Degree => Dimension::Angle,
            Second | Millisecond | Microsecond | Nanosecond | Minute | Day => Dimension::Time,
        }
    }

    /// How many SI units it is.
    pub(crate) fn factor(self) -> f64 {
        match self {
            Unit::Metre | Unit::MetrePerSecond | Unit::Radian | Unit::Second => 1.0,
            Unit::Kilometre => 1000.0,
            Unit::NauticalMile => 1852.0,
            Unit::Foot | Unit::FootPerSecond => 0.3048,
            Unit::Mile => 1609.344,
            Unit::FlightLevel => 30.48,
            Unit::KilometrePerHour => 1.0 / 3.6,
            Unit::Knot => 1852.0 / 3600.0,
            Unit::MilePerHour => 1609.344 / 3600.0,
            Unit::FootPerMinute => 0.3048 / 60.0,
            Unit::Milliradian | Unit::Millisecond => 1e-3,
            Unit::Degree => PI / 180.0,
            Unit::Microsecond => 1e-6,
            Unit::Nanosecond => 1e-9,
            Unit::Minute => 60.0,
            Unit::Day => 86_400.0,
        }
    }
}

impl Dimension {
    /// What a column in this SI unit measures.
    pub fn of_si(unit: &str) -> Option<Self> {
        match unit {
            "m" => Some(Dimension::Length),
            "m/s" => Some(Dimension::Speed),
            "rad" => Some(Dimension::Angle),
            "s" => Some(Dimension::Time),
            _ => None,
        }
    }

    /// Names of its units, for a message.
    pub fn units(self) -> String {
        let names = NAMES.iter().filter(|(unit, _)| unit.dimension() == self).map(|(_, names)| names[0]);
        names.collect::<Vec<_>>().join(", ")
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        use Dimension::*;
        [Length, Time, Angle, Speed].into_iter().find_map(|dimension| Unit::of(text, dimension)).ok_or_else(
            || {
                let known = NAMES.map(|(_, names)| names[0]).join(", ");
                format!("`{text}` is no unit; known are {known}")
            },
        )
    }
}
