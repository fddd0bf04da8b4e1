//! Which column of a table of aircraft is the altitude, and its unit.

use super::super::table::{FEET, FOOT, Field, METRES, Names, Table};
use crate::error::DataError;

/// Names of altitudes in the unit that they mostly are in.
pub(super) const NAMES: Names = Names(&[
    (FEET, &["altitude", "alt", "altgeom", "geomalt", "altbaro", "baroalt"]),
    (METRES, &["geoaltitude", "baroaltitude"]),
]);

/// Columns of state vectors of the OpenSky Network, whose altitudes are in metres.
const OPENSKY: Names =
    Names(&[(METRES, &["velocity", "baroaltitude", "lastposupdate", "lastcontact", "timeposition"])]);

/// Columns of tables whose altitudes are in feet.
const TRAFFIC: Names = Names(&[(METRES, &["groundspeed", "gs"])]);

/// Rows that are looked at.
const SAMPLE: usize = 10_000;

/// The column that at least half of the rows with an altitude have, and what is worth saying about its unit.
pub(super) fn settle(mut table: Table) -> Result<(Field, Option<String>), DataError> {
    let fields: Vec<Field> = table.fields(&NAMES).collect();
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); fields.len()];
    let (mut rows, mut with_any) = (0, 0);
    while rows < SAMPLE && !fields.is_empty() {
        match table.advance() {
            Ok(false) => break,
            Ok(true) => {}
            // Such rows are refused or counted later.
            Err(DataError::Row { .. }) => continue,
            Err(error) => return Err(error),
        }
        rows += 1;
        let found: Vec<Option<f64>> = fields.iter().map(|field| table.number_if_any(field)).collect();
        with_any += usize::from(found.iter().any(Option::is_some));
        values.iter_mut().zip(found).for_each(|(values, value)| values.extend(value));
    }
    let chosen = fields.iter().zip(&values).find(|(_, values)| values.len() * 2 >= with_any);
    let Some((field, values)) = chosen else { return Ok((table.field(&NAMES), None)) };
    let (factor, note) = unit(field, values, &table);
    let mut field = field.clone();
    field.factor = factor;
    Ok((field, note))
}

/// The factor to metres, which the values or the other columns may tell better than the name.
fn unit(field: &Field, values: &[f64], table: &Table) -> (f64, Option<String>) {
    /// Aircraft fly below, m.
    const HIGHEST: f64 = 20_000.0;
    let raw = || values.iter().map(|value| value / field.factor);
    let share = |count: usize| count as f64 / values.len().max(1) as f64;
    let said = |unit: &str, why: &str| {
        Some(format!("altitudes in column `{}` are read as {unit}: {why}", field.name))
    };
    if field.unit_named {
        return (field.factor, None);
    }
    if field.factor == 1.0 {
        let traffic = table.field(&TRAFFIC).present() && !others(table, field);
        let high = share(raw().filter(|value| *value > HIGHEST).count()) > 0.1;
        return match (traffic, high) {
            (true, _) => (FOOT, said("feet", "the other columns are those of tables in feet")),
            (_, true) => (FOOT, said("feet", "in metres many would lie above 20 km")),
            _ => (1.0, None),
        };
    }
    let many = values.len() >= 20;
    if many && share(raw().filter(|value| is_converted(*value)).count()) > 0.9 {
        return (1.0, said("metres", "they are steps of 25 feet in metres"));
    }
    (field.factor, None)
}

/// True when a column of the OpenSky Network is there, other than the altitude itself.
fn others(table: &Table, field: &Field) -> bool {
    table.fields(&OPENSKY).any(|other| other.name != field.name)
}

/// True for what a transponder's steps of 25 feet become in metres.
fn is_converted(value: f64) -> bool {
    let steps = value / (25.0 * FOOT);
    let off = (steps - steps.round()).abs() * 25.0 * FOOT;
    off < 0.02 && value != 0.0
}
