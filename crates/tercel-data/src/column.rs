//! What a column of a table holds, and which values it takes.

use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};

use crate::error::Refusal;

/// One column of a table: the same in every format.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Column {
    pub name: Cow<'static, str>,
    pub kind: Kind,
    /// SI unit; empty for what has none.
    pub unit: Cow<'static, str>,
    /// Every row has a value, and so every file has the column.
    pub needed: bool,
    /// How its numbers are written where people read them.
    pub written: Written,
}

/// How the numbers of a column are written in CSV. The other formats keep every bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Written {
    /// So that reading gives the same bits.
    Exactly,
    /// With so many digits from the first that is not zero, and at least so many decimals.
    Digits { digits: usize, decimals: usize },
    /// With so many decimals.
    Decimals(usize),
}

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A name.
    Text,
    /// A whole number from 0.
    Count,
    /// A point in time, s. In CSV also a date and time with an offset (RFC 3339).
    Time,
    /// A number within limits.
    Real(Limits),
}

/// Which numbers a column takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Limits {
    /// Every number, infinite ones and "not a number" too.
    None,
    Finite,
    NotNegative,
    Positive,
    /// In [-π, π].
    Angle,
    /// In [0, 1].
    Probability,
}

/// The unit in which a file holds its angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Angles {
    /// Radians, bearings in [-π, π].
    #[default]
    Radians,
    /// Degrees; a bearing may have any number of turns.
    Degrees,
}

impl Column {
    const fn new(name: &'static str, kind: Kind, unit: &'static str) -> Self {
        Column {
            name: Cow::Borrowed(name),
            kind,
            unit: Cow::Borrowed(unit),
            needed: false,
            written: Written::Exactly,
        }
    }

    pub const fn text(name: &'static str) -> Self {
        Column::new(name, Kind::Text, "")
    }

    pub const fn count(name: &'static str) -> Self {
        Column::new(name, Kind::Count, "")
    }

    pub const fn time() -> Self {
        Column::new("time", Kind::Time, "s").needed()
    }

    pub const fn real(name: &'static str, unit: &'static str, limits: Limits) -> Self {
        Column::new(name, Kind::Real(limits), unit)
    }

    /// A finite number whose name or unit is known at run time only.
    pub fn named(name: String, unit: String) -> Self {
        Column { name: Cow::Owned(name), unit: Cow::Owned(unit), ..Column::real("", "", Limits::Finite) }
    }

    pub const fn written(mut self, written: Written) -> Self {
        self.written = written;
        self
    }

    pub const fn needed(mut self) -> Self {
        self.needed = true;
        self
    }

    /// The unit in which a file with such angles holds the column.
    pub fn unit_in(&self, angles: Angles) -> &str {
        if angles == Angles::Degrees && self.unit == "rad" { "deg" } else { &self.unit }
    }

    /// What an empty cell should have held.
    pub fn expected(&self) -> &'static str {
        match self.kind {
            Kind::Text => "a name",
            Kind::Count => "a whole number from 0",
            Kind::Time => "a time in seconds, or a date and time such as 2024-03-05T10:00:00Z",
            Kind::Real(limits) => limits.expected(),
        }
    }

    /// The number from a file, in the unit of the column.
    pub fn real_from(&self, value: f64, conversion: Conversion) -> Result<f64, Refusal> {
        let Kind::Real(limits) = self.kind else {
            return Limits::Finite.check(value);
        };
        if limits != Limits::Angle {
            return limits.check(value * conversion.factor);
        }
        let value = Limits::Finite.check(value)?;
        // More than a turn in radians is a sign of degrees.
        if conversion.factor == 1.0 && value.abs() > 2.0 * PI {
            return limits.check(value);
        }
        limits.check(wrapped(conversion.turned(value * conversion.factor)))
    }

    /// Refuses a number that no reader would take.
    pub fn check(&self, value: f64) -> Result<(), Refusal> {
        match self.kind {
            Kind::Real(limits) => limits.check(value).map(|_| ()),
            _ => Limits::Finite.check(value).map(|_| ()),
        }
    }
}

/// How the numbers of a column of a file become those of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Conversion {
    /// SI units in the unit of the file.
    pub factor: f64,
    /// Bearings run clockwise from north.
    pub compass: bool,
    /// The file is one of another program, which may say in words that a cell is empty.
    pub foreign: bool,
}

impl Conversion {
    pub const NONE: Conversion = Conversion { factor: 1.0, compass: false, foreign: false };

    fn turned(self, angle: f64) -> f64 {
        if self.compass { FRAC_PI_2 - angle } else { angle }
    }
}

impl Limits {
    fn expected(self) -> &'static str {
        match self {
            Limits::None => "a number",
            Limits::Finite => "a finite number",
            Limits::NotNegative => "a finite number that is not negative",
            Limits::Positive => "a finite number above 0",
            Limits::Angle => "radians in [-pi, pi]",
            Limits::Probability => "a probability, 0 to 1",
        }
    }

    fn check(self, value: f64) -> Result<f64, Refusal> {
        // Probabilities are sums of rounded parts, so they may exceed 1 by a little.
        const SLACK: f64 = 1e-9;
        let fits = match self {
            Limits::None => true,
            Limits::Finite => value.is_finite(),
            Limits::NotNegative => value.is_finite() && value >= 0.0,
            Limits::Positive => value.is_finite() && value > 0.0,
            Limits::Angle => (-PI..=PI).contains(&value),
            Limits::Probability => (-SLACK..=1.0 + SLACK).contains(&value),
        };
        if fits {
            return Ok(value);
        }
        let refusal = Refusal::new(value, self.expected());
        Err(match self {
            Limits::Angle if (-720.0..=720.0).contains(&value) && value.abs() > 2.0 * PI => {
                refusal.helped("the file looks like degrees: pass --angles degrees, with --bearings compass if they run clockwise \
                 from north")
            }
            Limits::Angle if value.is_finite() => {
                refusal.helped("bearings run from -pi to pi: subtract 2 pi from the larger ones")
            }
            Limits::Finite | Limits::NotNegative | Limits::Positive if !value.is_finite() => {
                refusal.helped("what is not known is an empty cell, or no row at all")
            }
            _ => refusal,
        })
    }
}

/// The same angle in [-π, π].
pub(crate) fn wrapped(angle: f64) -> f64 {
    if (-PI..=PI).contains(&angle) {
        return angle;
    }
    let turned = angle.rem_euclid(2.0 * PI);
    if turned > PI { turned - 2.0 * PI } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEARING: Column = Column::real("bearing", "rad", Limits::Angle);
    const DEGREES: Conversion = Conversion { factor: PI / 180.0, ..Conversion::NONE };

    #[test]
    fn degrees_of_any_turn_become_radians_within_half_a_turn() {
        for (degrees, radians) in
            [(0.0, 0.0), (180.0, PI), (271.4, -1.546_362), (-190.0, 2.967_060), (725.0, 0.087_266)]
        {
            let bearing = BEARING.real_from(degrees, DEGREES).unwrap();
            assert!((bearing - radians).abs() < 1e-5, "{degrees} deg gave {bearing}");
        }
    }

    #[test]
    fn compass_bearings_turn_the_other_way_from_north() {
        let compass = Conversion { compass: true, ..DEGREES };
        for (degrees, radians) in
            [(0.0, FRAC_PI_2), (90.0, 0.0), (180.0, -FRAC_PI_2), (270.0, PI), (300.0, 5.0 * PI / 6.0)]
        {
            let bearing = BEARING.real_from(degrees, compass).unwrap();
            assert!(wrapped(bearing - radians).abs() < 1e-12, "{degrees} deg gave {bearing}");
        }
    }

    #[test]
    fn a_bearing_in_degrees_read_as_radians_is_refused_with_the_fix() {
        let refusal = BEARING.real_from(271.4, Conversion::NONE).unwrap_err();
        assert!(refusal.help.unwrap().contains("--angles degrees"));
        assert!((BEARING.real_from(6.0, Conversion::NONE).unwrap() - (6.0 - 2.0 * PI)).abs() < 1e-15);
        let compass = Conversion { compass: true, ..Conversion::NONE };
        assert!(BEARING.real_from(359.0, compass).unwrap_err().help.unwrap().contains("--angles degrees"));
    }

    #[test]
    fn a_deviation_must_be_positive_and_finite() {
        let sigma = Column::real("sigma_x", "m", Limits::Positive);
        assert!(sigma.real_from(1e-300, Conversion::NONE).is_ok());
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(sigma.real_from(value, Conversion::NONE).is_err());
        }
    }
}
