//! Finding the columns of a table in the header of a file.

use std::collections::HashSet;
use std::sync::Arc;

use crate::column::Column;
use crate::error::{DataError, Place};
use crate::names::{Choice, Naming};

/// Refuses a file in which columns are missing, or have names that are almost known.
pub(crate) fn check_names(
    naming: &Naming,
    choice: &Choice,
    found: &[String],
    file: &Arc<str>,
) -> Result<(), DataError> {
    let present: HashSet<usize> = choice.used.iter().map(|(_, meaning)| meaning.column).collect();
    let absent = || {
        naming.columns().iter().enumerate().filter(|(at, _)| !present.contains(at)).map(|(_, column)| column)
    };
    let missing: Vec<&str> =
        absent().filter(|column| column.needed).map(|column| column.name.as_ref()).collect();
    if !missing.is_empty() {
        return Err(missing_columns(&Place::whole(file), &missing, found));
    }
    // Names that mean something else are no slips.
    let strangers = choice.unused.iter().filter(|name| matches!(naming.meaning(name), Ok(None)));
    let absent: Vec<Column> = absent()
        .filter(|column| !["latitude", "longitude"].contains(&column.name.as_ref()))
        .cloned()
        .collect();
    match strangers
        .into_iter()
        .filter(|name| !naming.ignores(name))
        .find_map(|stranger| near_miss(stranger, &absent, || Place::whole(file)))
    {
        Some(slip) => Err(slip),
        None => Ok(()),
    }
}

/// The error for a column that is not known but almost one of these, if it is.
pub(crate) fn near_miss(
    stranger: &str,
    columns: &[Column],
    place: impl FnOnce() -> Place,
) -> Option<DataError> {
    let meant = columns.iter().find(|column| nearest(&column.name, &[stranger]).is_some())?;
    Some(DataError::Column {
        place: place(),
        column: stranger.to_owned(),
        problem: "is not known",
        help: format!(
            "did you mean `{0}`? --column {0}={stranger} says so, --ignore {stranger} that it is something else",
            meant.name
        ),
    })
}

/// The error for columns that are not there, with the found ones that come nearest.
pub(crate) fn missing_columns(place: &Place, missing: &[&str], found: &[String]) -> DataError {
    let candidates: Vec<&str> = found.iter().map(String::as_str).collect();
    let renames: Vec<String> = missing
        .iter()
        .filter_map(|name| {
            nearest(name, &candidates).map(|near| format!("--column {name}={near} if `{near}` is meant"))
        })
        .collect();
    let help = if !renames.is_empty() {
        renames.join(", ")
    } else {
        let name = missing.first().copied().unwrap_or("time");
        format!("say which columns hold them: --column {name}=NAME")
    };
    DataError::MissingColumns {
        place: place.clone(),
        missing: missing.iter().map(|&name| name.to_owned()).collect(),
        found: found.to_vec(),
        help,
    }
}

/// The candidate whose name differs least from `name`, if it is near enough for a slip.
fn nearest<'a>(name: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // Names of one or two letters are all near to each other, so only their case may differ.
    let allowed = match name.len() {
        0..=2 => 0,
        3..=9 => 1,
        _ => 2,
    };
    candidates
        .iter()
        .map(|candidate| (distance(&name.to_lowercase(), &candidate.trim().to_lowercase()), *candidate))
        .filter(|(distance, _)| *distance <= allowed)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Insertions, deletions, replacements and swaps of neighbours that turn one text into the other (optimal string
/// alignment).
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(before[j - 2] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_counts_single_edits() {
        assert_eq!(distance("bearing", "bearing"), 0);
        assert_eq!(distance("bearing", "baering"), 1);
        assert_eq!(distance("bearing", "barings"), 2);
        assert_eq!(distance("sensor", "sensors"), 1);
        assert_eq!(distance("", "abc"), 3);
    }

    #[test]
    fn short_names_differ_in_case_only() {
        assert_eq!(nearest("x", &["y", "X"]), Some("X"));
        assert_eq!(nearest("x", &["y", "z"]), None);
        assert_eq!(nearest("vx", &["vy"]), None);
        assert_eq!(nearest("sensor_x", &["sensor_id"]), None);
    }
}
