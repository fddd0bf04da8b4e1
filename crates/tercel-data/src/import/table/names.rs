//! Names under which programs write a thing, and the units that names tell.

/// Metres in a foot.
pub(in crate::import) const FOOT: f64 = 0.3048;
/// Metres per second in a knot.
pub(in crate::import) const KNOT: f64 = 1852.0 / 3600.0;

type Units = &'static [(&'static str, f64)];

const LENGTHS: Units = &[("m", 1.0), ("meters", 1.0), ("metres", 1.0), ("ft", FOOT), ("feet", FOOT)];
const SPEEDS: Units = &[
    ("ms", 1.0),
    ("mps", 1.0),
    ("kn", KNOT),
    ("kt", KNOT),
    ("kts", KNOT),
    ("knots", KNOT),
    ("kmh", 1.0 / 3.6),
    ("kph", 1.0 / 3.6),
    ("mph", 0.447_04),
];
const ANGLES: Units =
    &[("deg", 1.0), ("degs", 1.0), ("degrees", 1.0), ("degree", 1.0), ("dd", 1.0), ("wgs84", 1.0)];

/// What a column without a unit in its name is in, and the units that a name may end in.
#[derive(Debug, Clone, Copy)]
pub(in crate::import) struct Unit {
    factor: f64,
    named: Units,
}

pub(in crate::import) const METRES: Unit = Unit { factor: 1.0, named: LENGTHS };
pub(in crate::import) const FEET: Unit = Unit { factor: FOOT, named: LENGTHS };
pub(in crate::import) const METRES_PER_SECOND: Unit = Unit { factor: 1.0, named: SPEEDS };
pub(in crate::import) const KNOTS: Unit = Unit { factor: KNOT, named: SPEEDS };
pub(in crate::import) const DEGREES: Unit = Unit { factor: 1.0, named: ANGLES };
pub(in crate::import) const PLAIN: Unit = Unit { factor: 1.0, named: &[] };

/// Names of one thing, each with the unit that it means where it names none; the best name first.
#[derive(Debug, Clone, Copy)]
pub(in crate::import) struct Names(pub &'static [(Unit, &'static [&'static str])]);

/// A column that has one of the names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub column: usize,
    pub factor: f64,
    pub unit_named: bool,
}

impl Names {
    /// The columns with one of the names, the best name first. `columns` are plain.
    pub(super) fn found_in(&self, columns: &[String]) -> impl Iterator<Item = Found> {
        self.0.iter().flat_map(|(unit, names)| names.iter().map(move |name| (unit, *name))).flat_map(
            move |(unit, name)| {
                columns.iter().enumerate().filter_map(move |(column, plain)| {
                    let ending = plain.strip_prefix(name)?;
                    if ending.is_empty() {
                        return Some(Found { column, factor: unit.factor, unit_named: false });
                    }
                    let (_, factor) = unit.named.iter().find(|(known, _)| *known == ending)?;
                    Some(Found { column, factor: *factor, unit_named: true })
                })
            },
        )
    }

    /// True when a column of this name may be meant.
    pub(super) fn has(&self, column: &str) -> bool {
        self.found_in(&[plain(column)]).next().is_some()
    }

    /// The first names, for a message.
    pub(super) fn usual(&self) -> Vec<&'static str> {
        self.0.iter().flat_map(|(_, names)| names.iter().copied()).take(4).collect()
    }
}

/// Names are compared by their letters and digits: `# Base Date-Time` is `base_date_time` and `BaseDateTime`.
pub(in crate::import) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALTITUDE: Names = Names(&[(FEET, &["altitude", "alt"]), (METRES, &["geoaltitude"])]);

    fn found(columns: &[&str]) -> Vec<(usize, f64)> {
        let plain: Vec<String> = columns.iter().map(|name| plain(name)).collect();
        ALTITUDE.found_in(&plain).map(|found| (found.column, found.factor)).collect()
    }

    #[test]
    fn names_are_compared_without_decoration() {
        assert_eq!(plain("# Timestamp"), "timestamp");
        assert_eq!(plain("\u{feff}base_date_time"), plain("BaseDateTime"));
        assert_eq!(plain("altitude (m)"), "altitudem");
    }

    #[test]
    fn units_are_those_that_the_name_tells() {
        assert_eq!(found(&["x", "alt_ft"]), [(1, FOOT)]);
        assert_eq!(found(&["altitude (m)"]), [(0, 1.0)]);
        assert_eq!(found(&["geo_altitude", "Altitude"]), [(1, FOOT), (0, 1.0)]);
        assert_eq!(found(&["altimeter"]), []);
    }
}
