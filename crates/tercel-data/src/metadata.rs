//! What a file says about itself: kind of table, schema version, units, labels, origin.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::column::{Angles, Column};
use crate::error::DataError;
use crate::table::{Description, Origin};

/// Version of the tables that this library writes. A reader refuses later ones.
pub const SCHEMA_VERSION: u32 = 1;

/// The description that travels with a table: in Parquet the JSON value of the key `tercel`, in CSV the first
/// line (`# tercel: {...}`), in NDJSON the first object (`{"tercel": {...}}`).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Metadata {
    pub schema: u32,
    pub table: String,
    #[serde(default)]
    pub units: BTreeMap<String, String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub labels: Vec<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<String>,
    #[serde(default, skip_serializing_if = "Description::is_empty")]
    pub description: Description,
}

impl Metadata {
    /// The description of a table that this library makes.
    pub fn new(table: &str, origin: Option<Origin>) -> Self {
        Metadata { schema: SCHEMA_VERSION, table: table.to_owned(), origin, ..Metadata::default() }
    }

    /// The same with the units of `columns`.
    pub fn with_units(mut self, columns: &[Column]) -> Self {
        self.units = columns
            .iter()
            .filter(|column| !column.unit.is_empty())
            .map(|column| (column.name.to_string(), column.unit.to_string()))
            .collect();
        self
    }

    pub fn to_json(&self) -> String {
        // Strings, numbers and maps with text keys always have a JSON form.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads the description and checks that it is one of `table`.
    pub fn parse(json: &str, table: &str, file: &Arc<str>) -> Result<Self, DataError> {
        let bad =
            |problem: String, help: String| DataError::Metadata { file: Arc::clone(file), problem, help };
        let value: serde_json::Value = serde_json::from_str(json).map_err(|error| {
            bad(
                format!("there is what is not JSON: {error}"),
                "remove the line if the file was made by hand".to_owned(),
            )
        })?;
        // The version comes first: a later one may have fields that are unknown here.
        if let Some(version) = value.get("schema").and_then(serde_json::Value::as_u64)
            && version > u64::from(SCHEMA_VERSION)
        {
            return Err(bad(
                format!(
                    "the schema version is {version}; this program reads versions up to {SCHEMA_VERSION}"
                ),
                "update Tercel, or write the file with this version".to_owned(),
            ));
        }
        let metadata: Metadata = serde_json::from_value(value).map_err(|error| {
            bad(error.to_string(), "expected the keys schema, table and units".to_owned())
        })?;
        if metadata.table != table {
            return Err(bad(
                format!("the table is `{}`; expected `{table}`", metadata.table),
                format!("give the {table} file here"),
            ));
        }
        match metadata.origin {
            Some(origin) if !plausible(origin) => Err(bad(
                format!("the origin is at latitude {} and longitude {}", origin.latitude, origin.longitude),
                "latitude and longitude of the origin are radians, the altitude is m".to_owned(),
            )),
            _ => Ok(metadata),
        }
    }

    /// Checks the units that the file names against those of the columns.
    pub fn check_units(&self, columns: &[Column], angles: Angles, file: &Arc<str>) -> Result<(), DataError> {
        for column in columns {
            let Some(unit) = self.units.get(column.name.as_ref()) else { continue };
            let expected = column.unit_in(angles);
            if unit == expected {
                continue;
            }
            let help = match (unit.as_str(), expected) {
                ("deg", "rad") => "pass --angles degrees".to_owned(),
                ("rad", "deg") => "the file says radians: leave out --angles degrees".to_owned(),
                _ => "convert the column and correct its unit in the first line".to_owned(),
            };
            return Err(DataError::Unit {
                file: Arc::clone(file),
                column: column.name.to_string(),
                unit: unit.clone(),
                expected: expected.to_owned(),
                help,
            });
        }
        Ok(())
    }
}

fn plausible(origin: Origin) -> bool {
    use std::f64::consts::{FRAC_PI_2, PI};
    origin.latitude.abs() <= FRAC_PI_2 && origin.longitude.abs() <= PI && origin.altitude.is_finite()
}
