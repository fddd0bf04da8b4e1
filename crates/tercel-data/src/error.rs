//! What can be wrong with a file, and what helps.

use std::fmt;
use std::sync::Arc;

/// Where in a file something was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Name of the file as it was given, or what stands for it: `standard input`.
    pub file: Arc<str>,
    /// Where in the file.
    pub spot: Spot,
}

/// Where in a file, in the way its format counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spot {
    /// The file as a whole.
    Whole,
    /// A line of a text file, from 1.
    Line(u64),
    /// A row of a table that has no lines, from 0.
    Row(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.spot {
            Spot::Whole => write!(f, "{}", self.file),
            Spot::Line(line) => write!(f, "{}:{line}", self.file),
            Spot::Row(row) => write!(f, "{}, row {row}", self.file),
        }
    }
}

/// A table that could not be read or written.
///
/// The message says what is wrong and where; [`help`](DataError::help) says what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The operating system refused.
    #[error("{file}: cannot {action}: {source}")]
    Io {
        /// The file.
        file: Arc<str>,
        /// What was tried: `open`, `read`, `write`.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// There is nothing in the file.
    #[error("{file}: the file is empty")]
    Empty {
        /// The file.
        file: Arc<str>,
    },
    /// The file is not, or not wholly, what it should be: truncated, corrupt, or of another format.
    #[error("{place}: {problem}")]
    Corrupt {
        /// Where.
        place: Place,
        /// What is wrong, as far as it is known.
        problem: String,
        /// What to do.
        help: &'static str,
    },
    /// What is there cannot be used as it is, but an option or another program settles it.
    #[error("{place}: {problem}")]
    Unsettled {
        /// Where.
        place: Place,
        /// What stands in the way.
        problem: String,
        /// What to do.
        help: String,
    },
    /// The name of a file does not tell its format.
    #[error("{file}: the name does not tell the format; known are {known}")]
    UnknownFormat {
        /// The file.
        file: Arc<str>,
        /// The endings that are known here.
        known: &'static str,
    },
    /// Columns that are needed are not there.
    #[error("{place}: no column {}; the columns are {}", quoted(missing), quoted(found))]
    MissingColumns {
        /// Where: the file, or a line of a stream.
        place: Place,
        /// The columns that are needed and missing.
        missing: Vec<String>,
        /// The columns that are there.
        found: Vec<String>,
        /// Which column may have been meant.
        help: String,
    },
    /// A column that is there twice, or whose name is almost a known one.
    #[error("{place}: column `{column}` {problem}")]
    Column {
        /// Where: the file, or a line of a stream.
        place: Place,
        /// Name of the column.
        column: String,
        /// What is wrong with it.
        problem: &'static str,
        /// What to do.
        help: String,
    },
    /// The description of the file says that a column has another unit.
    #[error("{file}: column `{column}` is in `{unit}`; expected `{expected}`")]
    Unit {
        /// The file.
        file: Arc<str>,
        /// Name of the column.
        column: String,
        /// The unit that the file names.
        unit: String,
        /// The unit that the column must have.
        expected: String,
        /// What to do.
        help: String,
    },
    /// The description of the file (schema version, kind of table, labels) does not fit.
    #[error("{file}: in the description of the table, {problem}")]
    Metadata {
        /// The file.
        file: Arc<str>,
        /// What does not fit.
        problem: String,
        /// What to do.
        help: String,
    },
    /// One cell of the table is not what its column holds.
    #[error("{place}: column `{column}` is {value}; expected {expected}")]
    Value {
        /// Where.
        place: Place,
        /// Name of the column.
        column: Box<str>,
        /// The value, as it stands in the file; `empty` when there is none.
        value: Box<str>,
        /// What was expected.
        expected: Box<str>,
        /// What to do, when that is known.
        help: Option<Box<str>>,
    },
    /// The cells of a row are fine one by one, but do not fit each other or the rows before.
    #[error("{place}: {problem}")]
    Row {
        /// Where.
        place: Place,
        /// What does not fit.
        problem: String,
        /// What to do.
        help: &'static str,
    },
}

impl DataError {
    /// What to do about it, when that is known: a sentence part that follows "help:".
    pub fn help(&self) -> Option<&str> {
        match self {
            DataError::Io { .. } => None,
            DataError::Empty { .. } => Some("check that the program that wrote it came to its end"),
            DataError::UnknownFormat { .. } => Some("rename the file, or name the format: --from csv"),
            DataError::Corrupt { help, .. } | DataError::Row { help, .. } => Some(*help),
            DataError::MissingColumns { help, .. }
            | DataError::Column { help, .. }
            | DataError::Unit { help, .. }
            | DataError::Unsettled { help, .. }
            | DataError::Metadata { help, .. } => Some(help.as_str()),
            DataError::Value { help, .. } => help.as_deref(),
        }
        .filter(|help| !help.is_empty())
    }

    /// Why a single row cannot be used, without its place; nothing when the error is one of the whole file.
    pub(crate) fn reason(&self) -> Option<String> {
        match self {
            DataError::Value { column, value, .. } if value.as_ref() == "empty" => {
                Some(format!("`{column}` is empty"))
            }
            DataError::Value { column, expected, .. } => Some(format!("`{column}` is not {expected}")),
            DataError::Row { problem, .. } => Some(problem.clone()),
            DataError::Corrupt { place, problem, .. } if matches!(place.spot, Spot::Line(_)) => {
                Some(problem.split(": ").next().unwrap_or_default().to_owned())
            }
            DataError::Unsettled { place, problem, .. } if place.spot != Spot::Whole => Some(problem.clone()),
            _ => None,
        }
    }

    /// True when the operating system refused, as opposed to content that is wrong.
    pub fn is_io(&self) -> bool {
        matches!(self, DataError::Io { .. })
    }

    pub(crate) fn unsettled(place: Place, problem: impl Into<String>, help: impl Into<String>) -> Self {
        DataError::Unsettled { place, problem: problem.into(), help: help.into() }
    }

    pub(crate) fn io(file: &Arc<str>, action: &'static str, source: std::io::Error) -> Self {
        DataError::Io { file: Arc::clone(file), action, source }
    }
}

/// `` `a`, `b` `` in a message; long lists are cut, since a reader needs the first few only.
fn quoted(names: &[String]) -> String {
    const SHOWN: usize = 24;
    let mut text = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        text.push_str(&format!(" and {} more", names.len() - SHOWN));
    }
    if text.is_empty() { "(none)".to_owned() } else { text }
}

/// A value that a column refuses, before it is known where it stood.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub value: String,
    pub expected: String,
    pub help: Option<String>,
}

impl Refusal {
    pub fn new(value: impl fmt::Display, expected: impl Into<String>) -> Self {
        // A binary file read as text has "values" of any length.
        let mut value = value.to_string();
        if value.chars().count() > 60 {
            value = value.chars().take(57).chain("...".chars()).collect();
        }
        Refusal { value, expected: expected.into(), help: None }
    }

    pub fn helped(self, help: impl Into<String>) -> Self {
        Refusal { help: Some(help.into()), ..self }
    }

    pub fn at(self, place: Place, column: &str) -> DataError {
        let Refusal { value, expected, help } = self;
        DataError::Value {
            place,
            column: column.into(),
            value: value.into(),
            expected: expected.into(),
            help: help.map(String::into),
        }
    }
}

impl Place {
    pub(crate) fn whole(file: &Arc<str>) -> Self {
        Place { file: Arc::clone(file), spot: Spot::Whole }
    }

    pub(crate) fn line(file: &Arc<str>, line: u64) -> Self {
        Place { file: Arc::clone(file), spot: Spot::Line(line) }
    }
}
