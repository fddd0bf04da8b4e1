//! Which column of a table a column of a file is, and in which unit.

mod plain;
mod vocabulary;

use plain::Plain;
pub(crate) use vocabulary::Rank;
use vocabulary::meanings;

use crate::column::{Angles, Column, Conversion};
use crate::options::{Bearings, ReadOptions};
use crate::unit::{Dimension, Unit};

/// What the names of a file are compared with.
#[derive(Debug, Clone)]
pub(crate) struct Naming {
    table: &'static str,
    /// The file is one of our own, whose names mean what they say.
    ours: bool,
    columns: Vec<Column>,
    options: ReadOptions,
}

/// What a name means.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Meaning {
    /// Place of the column among those of the table.
    pub column: usize,
    rank: Rank,
    pub conversion: Conversion,
    /// The unit of a time.
    pub time_unit: Option<Unit>,
    /// What the user should know if the column is used.
    pub note: Option<String>,
}

/// Why names of a file cannot be used: a problem and what helps.
pub(crate) type Trouble = (String, String);

/// The columns of a file that are used, and the names of the others.
#[derive(Debug, Default)]
pub(crate) struct Choice {
    /// Place in the file and what it means.
    pub used: Vec<(usize, Meaning)>,
    pub unused: Vec<String>,
    /// What the user should know.
    pub notes: Vec<String>,
}

impl Meaning {
    pub fn rank(&self) -> Rank {
        self.rank
    }

    /// True when another name of this rank is one too many.
    pub fn clashes(&self, rank: Rank) -> bool {
        self.rank == rank && rank <= Rank::Sure
    }
}

impl Naming {
    pub fn new(table: &'static str, ours: bool, columns: Vec<Column>, options: &ReadOptions) -> Self {
        Naming { table, ours, columns, options: options.clone() }
    }

    /// True for the names of our own tables.
    pub fn ours(&self) -> bool {
        self.ours
    }

    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// True for a name that the user wants to be passed over.
    pub fn ignores(&self, name: &str) -> bool {
        self.options.ignore.iter().any(|ignored| ignored == name)
    }

    /// The names of a file with those of the table in place of those that mean the same.
    pub fn in_our_words(&self, found: &[String]) -> Vec<String> {
        let ours = |name: &String| {
            let meaning = self.meaning(name).ok().flatten();
            meaning.map_or_else(|| name.clone(), |meaning| self.columns[meaning.column].name.to_string())
        };
        found.iter().map(ours).collect()
    }

    fn position(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|known| known.name == column)
    }

    /// What a name means, if anything.
    pub fn meaning(&self, name: &str) -> Result<Option<Meaning>, Trouble> {
        let options = &self.options;
        if self.ignores(name) {
            return Ok(None);
        }
        let plain = Plain::of(name);
        if let Some((column, _)) = options.renames.iter().find(|(_, from)| from == name) {
            let Some(at) = self.position(column) else {
                let known: Vec<&str> = self.columns.iter().map(|column| column.name.as_ref()).collect();
                return Err((
                    format!("--column {column}={name}: there is no column `{column}`"),
                    format!("known are {}", known.join(", ")),
                ));
            };
            let unit = plain.readings.iter().find_map(|(_, unit)| self.unit_named(at, unit.as_deref()?));
            return self.converted(at, Rank::Said, name, name, unit, &plain).map(Some);
        }
        if let Some(at) = self.position(name) {
            return self.converted(at, Rank::Sure, name, name, None, &plain).map(Some);
        }
        if self.ours {
            return Ok(None);
        }
        for (word, unit) in &plain.readings {
            let known = meanings(self.table, word);
            let best = known
                .into_iter()
                .filter_map(|(column, rank)| Some((self.position(column)?, rank)))
                .min_by_key(|(_, rank)| *rank);
            let Some((at, rank)) = best else { continue };
            match unit {
                None => return self.converted(at, rank, name, word, None, &plain).map(Some),
                Some(unit) => {
                    if let Some(unit) = self.unit_named(at, unit) {
                        return self.converted(at, rank, name, word, Some(unit), &plain).map(Some);
                    }
                }
            }
        }
        Ok(None)
    }

    fn dimension(&self, column: usize) -> Option<Dimension> {
        Dimension::of_si(&self.columns[column].unit)
    }

    fn unit_named(&self, column: usize, name: &str) -> Option<Unit> {
        Unit::of(name, self.dimension(column)?)
    }

    /// The meaning with its unit: that of an option, of the name, or the usual one.
    fn converted(
        &self,
        column: usize,
        rank: Rank,
        name: &str,
        word: &str,
        unit: Option<Unit>,
        plain: &Plain,
    ) -> Result<Meaning, Trouble> {
        let known = &self.columns[column];
        let dimension = self.dimension(column);
        let mut meaning = Meaning {
            column,
            rank,
            conversion: Conversion { foreign: !self.ours, ..Conversion::NONE },
            time_unit: None,
            note: None,
        };
        let plainly = ["identity", "mmsi", "icao24", "icao", "hex", "mode_s"];
        if known.name == "identity" && rank != Rank::Said && !plainly.contains(&word) {
            meaning.note = Some(identity_note(name));
        }
        let Some(dimension) = dimension.filter(|_| !self.ours || known.unit == "rad") else {
            return Ok(meaning);
        };
        let unit = match (self.unit_said(known, name, dimension)?, unit, plain.bracketed.as_deref()) {
            (Some(said), ..) => Some(said),
            (None, Some(unit), _) => Some(unit),
            (None, None, Some(text)) => match Unit::of(text, dimension) {
                Some(unit) => Some(unit),
                None if dimension == Dimension::Time || self.ours => None,
                None => {
                    let help = format!("name it: --units {}=UNIT, one of {}", known.name, dimension.units());
                    return Err((format!("column `{name}`: the unit `{text}` is not known"), help));
                }
            },
            (None, None, None) => usual_unit(word, &known.name, self.options.angles),
        };
        if dimension == Dimension::Time {
            meaning.time_unit = unit;
            return Ok(meaning);
        }
        meaning.conversion.factor = unit.map_or(1.0, Unit::factor);
        if known.name == "bearing" && !self.ours {
            self.turn(&mut meaning, name, word, unit);
        }
        Ok(meaning)
    }

    /// The unit that the user names for the column, by its name in the table or in the file, or by what it measures.
    fn unit_said(&self, column: &Column, name: &str, dimension: Dimension) -> Result<Option<Unit>, Trouble> {
        let group = match dimension {
            Dimension::Length => "length",
            Dimension::Speed => "speed",
            Dimension::Angle => "angle",
            Dimension::Time => "time",
        };
        let said = |key: &str| self.options.units.iter().find(|(known, _)| known == key);
        match said(name).or_else(|| said(&column.name)).or_else(|| said(group)) {
            None => Ok(self.options.time_unit.filter(|_| dimension == Dimension::Time)),
            Some((_, unit)) if unit.dimension() == dimension => Ok(Some(*unit)),
            Some((key, unit)) => Err((
                format!("--units {key}={}: `{}` is no such quantity", unit.name(), column.name),
                format!("its unit is one of {}", dimension.units()),
            )),
        }
    }

    /// Decides from where and which way round a bearing runs.
    fn turn(&self, meaning: &mut Meaning, name: &str, word: &str, unit: Option<Unit>) {
        let compass = !["bearing", "theta"].contains(&word);
        meaning.conversion.compass = match self.options.bearings {
            Some(bearings) => bearings == Bearings::Compass,
            None => compass,
        };
        let degrees = unit == Some(Unit::Degree);
        if self.options.bearings.is_none() && compass {
            meaning.note = Some(format!(
                "`{name}` is read as a compass bearing, clockwise from north; \
                 --bearings math if it runs from east towards north"
            ));
        } else if self.options.bearings.is_none() && (degrees || word == "theta") {
            meaning.note = Some(format!(
                "`{name}` is read from east towards north; --bearings compass if it runs clockwise from north"
            ));
        }
    }

    /// Chooses among the columns of a file.
    pub fn choose(&self, found: &[String]) -> Result<Choice, Trouble> {
        let meanings: Vec<Option<Meaning>> =
            found.iter().map(|name| self.meaning(name)).collect::<Result<_, _>>()?;
        self.check_said(found)?;
        let mut choice = Choice::default();
        for (at, meaning) in meanings.iter().enumerate() {
            let rivals = || meanings.iter().enumerate().filter_map(|(at, other)| Some((at, other.as_ref()?)));
            let Some(meaning) = meaning else {
                choice.unused.push(found[at].clone());
                continue;
            };
            let rivals = rivals().filter(|(other, rival)| *other != at && rival.column == meaning.column);
            let (mut better, mut equal) = (false, None);
            for (other, rival) in rivals {
                better |= rival.rank < meaning.rank
                    || (rival.rank == meaning.rank && rival.rank > Rank::Sure && other < at);
                equal = equal.or((rival.rank == meaning.rank && rival.rank <= Rank::Sure).then_some(other));
            }
            if better {
                choice.unused.push(found[at].clone());
                continue;
            }
            if let Some(other) = equal {
                return Err(self.twice(&found[at.min(other)], &found[at.max(other)], meaning.column));
            }
            choice.notes.extend(meaning.note.clone());
            choice.used.push((at, meaning.clone()));
        }
        if !self.ours {
            self.prefer_local(found, &mut choice);
        }
        Ok(choice)
    }

    /// What is wrong when two names of a file mean one column.
    pub fn twice(&self, one: &str, other: &str, column: usize) -> Trouble {
        let column = &self.columns[column].name;
        if one == other {
            return (format!("column `{one}` is there twice"), "rename or remove one of them".to_owned());
        }
        (
            format!("the columns `{one}` and `{other}` both mean `{column}`"),
            format!("choose one: --column {column}={one} or --column {column}={other}"),
        )
    }

    /// Refuses a name of `--column` that the file does not have.
    fn check_said(&self, found: &[String]) -> Result<(), Trouble> {
        match self.options.renames.iter().find(|(_, from)| !found.contains(from)) {
            None => Ok(()),
            Some((column, from)) => Err((
                format!("--column {column}={from}: the file has no column `{from}`"),
                format!("its columns are {}", found.join(", ")),
            )),
        }
    }

    /// Of what the sensor measured in its own frame and a position on the Earth the first is taken.
    fn prefer_local(&self, found: &[String], choice: &mut Choice) {
        let has = |choice: &Choice, name| {
            choice.used.iter().any(|(_, meaning)| self.columns[meaning.column].name == name)
        };
        let local = (has(choice, "x") && has(choice, "y")) || has(choice, "bearing");
        if !(local && has(choice, "latitude") && has(choice, "longitude")) {
            return;
        }
        choice.used.retain(|(at, meaning)| {
            let geographic = GEOGRAPHIC.contains(&self.columns[meaning.column].name.as_ref());
            if geographic {
                choice.unused.push(found[*at].clone());
            }
            !geographic
        });
        choice.notes.push(BOTH_PLACES.to_owned());
    }
}

/// Columns of a position on the Earth.
pub(crate) const GEOGRAPHIC: [&str; 2] = ["latitude", "longitude"];

/// What is said when a file has positions of both kinds.
pub(crate) const BOTH_PLACES: &str = "latitude and longitude are not used, since the file has a local position or a \
     bearing as well; --ignore NAME passes over those";

/// The unit in which a column comes when nothing says otherwise, where that is not the SI unit.
fn usual_unit(word: &str, column: &str, angles: Angles) -> Option<Unit> {
    match (word, column) {
        ("alt_baro" | "alt_geom", _) => Some(Unit::Foot),
        ("flight_level" | "fl", _) => Some(Unit::FlightLevel),
        (_, "latitude" | "longitude") => Some(Unit::Degree),
        (_, "bearing" | "sigma_bearing" | "orientation") => {
            Some(if angles == Angles::Degrees { Unit::Degree } else { Unit::Radian })
        }
        _ => None,
    }
}

fn identity_note(name: &str) -> String {
    format!("`{name}` is taken for the identity of the object; --ignore {name} if it is not")
}
