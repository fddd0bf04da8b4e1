//! The card of a model: what it is, where it comes from and how good it was.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The version of the card's layout that this library reads and writes.
pub const SCHEMA: u32 = 1;

/// All that is known of a model beside its weights.
///
/// It travels as JSON in the metadata of the model file, under the key `card`, and as a TOML file beside it, for people. The
/// one in the model file counts. An unknown key is an error: a model that says more than is understood could mean something
/// else.
///
/// ```
/// let card = tercel_neural::Card::new("example", "kalman-net", &["x", "y", "vx", "vy"]);
/// let text = card.to_toml().unwrap();
/// assert_eq!(tercel_neural::Card::from_toml(&text).unwrap(), card);
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Version of this layout: [`SCHEMA`].
    pub schema: u32,
    /// Name of the model.
    pub name: String,
    /// The architecture: "kalman-net", ...
    pub kind: String,
    /// Version of the model.
    pub version: String,
    /// Components of the state, in order.
    pub state: Vec<String>,
    /// The recipe that it was trained by: its text, or its name.
    pub recipe: String,
    /// Hash of the recipe.
    pub recipe_hash: String,
    /// Seed of the training. TOML ends at 2⁶³ - 1.
    pub seed: u64,
    /// How much data it was trained with.
    pub data: DataSizes,
    /// Epochs of the training.
    pub epochs: u32,
    /// Git revision of the code that trained it.
    pub revision: String,
    /// Day of the training: `2026-01-31`.
    pub trained: String,
    /// Sizes and options of the architecture.
    pub hyper: toml::Table,
    /// The scales by which inputs and outputs are divided.
    pub scales: BTreeMap<String, Scale>,
    /// Metrics at training time.
    pub metrics: BTreeMap<String, f64>,
    /// Licence of the weights.
    pub licence: String,
    /// What else a user should know.
    pub note: String,
}

/// Numbers of trajectories.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataSizes {
    /// Trajectories trained on.
    pub training: u64,
    /// Trajectories by which the training was judged.
    pub validation: u64,
}

/// A number with its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// The number.
    pub value: f64,
    /// Its unit: "m", "m/s", ...
    pub unit: String,
}

/// Why the text of a card is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum CardError {
    #[error("schema {0}")]
    Schema(String),
    #[error("{0}")]
    Content(String),
}

impl Card {
    /// A card with these entries, the schema of today, and everything else empty.
    pub fn new(name: &str, kind: &str, state: &[&str]) -> Self {
        Card {
            schema: SCHEMA,
            name: name.to_owned(),
            kind: kind.to_owned(),
            version: "1".to_owned(),
            state: state.iter().map(|label| (*label).to_owned()).collect(),
            recipe: String::new(),
            recipe_hash: String::new(),
            seed: 0,
            data: DataSizes::default(),
            epochs: 0,
            revision: String::new(),
            trained: String::new(),
            hyper: toml::Table::new(),
            scales: BTreeMap::new(),
            metrics: BTreeMap::new(),
            licence: String::new(),
            note: String::new(),
        }
    }

    /// The card as TOML, as it stands beside the model.
    ///
    /// # Errors
    /// When a number does not fit: TOML has none above 2⁶³ - 1.
    pub fn to_toml(&self) -> Result<String, String> {
        toml::to_string_pretty(self).map_err(|error| error.to_string())
    }

    /// Reads a card from TOML.
    ///
    /// # Errors
    /// Says what is wrong and where: an unknown or missing key, a value of another type, another schema.
    pub fn from_toml(text: &str) -> Result<Self, String> {
        let card: Card = toml::from_str(text).map_err(|error| error.to_string())?;
        card.checked().map_err(|error| error.to_string())
    }

    pub(crate) fn to_json(&self) -> Result<String, String> {
        serde_json::to_string(self).map_err(|error| error.to_string())
    }

    pub(crate) fn from_json(text: &str) -> Result<Self, CardError> {
        let content = |error: serde_json::Error| CardError::Content(error.to_string());
        // A card of another schema may have other keys, so the schema is looked at first.
        let value: serde_json::Value = serde_json::from_str(text).map_err(content)?;
        match value.get("schema") {
            Some(schema) if schema.as_u64() != Some(u64::from(SCHEMA)) => {
                return Err(CardError::Schema(schema.to_string()));
            }
            _ => {}
        }
        serde_json::from_value::<Card>(value).map_err(content)?.checked()
    }

    /// The card, if its entries make sense.
    pub(crate) fn checked(self) -> Result<Self, CardError> {
        if self.schema != SCHEMA {
            return Err(CardError::Schema(self.schema.to_string()));
        }
        for (key, text) in [("name", &self.name), ("kind", &self.kind), ("version", &self.version)] {
            if text.trim().is_empty() {
                return Err(CardError::Content(format!("`{key}` is empty")));
            }
        }
        if self.state.is_empty() {
            return Err(CardError::Content("`state` is empty; expected the components of the state".into()));
        }
        let scales = self.scales.iter().map(|(name, scale)| ("scales", name, scale.value));
        let metrics = self.metrics.iter().map(|(name, value)| ("metrics", name, *value));
        for (table, name, value) in scales.chain(metrics) {
            if !value.is_finite() {
                let reason = format!("`{table}.{name}` is {value}; expected a finite number");
                return Err(CardError::Content(reason));
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> Card {
        let mut card = Card::new("example", "kalman-net", &["x", "y", "vx", "vy"]);
        card.hyper = toml::from_str("sizes = [4, 8]\nnested = { on = true, rate = 0.5 }").unwrap();
        card.scales.insert("f1".into(), Scale { value: 100.0, unit: "m".into() });
        card.metrics.insert("rmse_all".into(), 12.5);
        card.data = DataSizes { training: 50_000, validation: 5_000 };
        card.note = "lines\nand \"quotes\"".into();
        card
    }

    #[test]
    fn a_card_survives_json_and_toml() {
        let card = full();
        assert_eq!(Card::from_json(&card.to_json().unwrap()).unwrap(), card);
        assert_eq!(Card::from_toml(&card.to_toml().unwrap()).unwrap(), card);
    }

    #[test]
    fn another_schema_is_refused_before_its_keys_are_read() {
        let error = Card::from_json(r#"{"schema": 2, "weights": "elsewhere"}"#).unwrap_err();
        assert_eq!(error, CardError::Schema("2".into()));
    }

    #[test]
    fn unknown_missing_and_senseless_entries_are_refused_by_name() {
        let reason = |change: &dyn Fn(&mut serde_json::Value)| {
            let mut value: serde_json::Value = serde_json::from_str(&full().to_json().unwrap()).unwrap();
            change(&mut value);
            Card::from_json(&value.to_string()).unwrap_err().to_string()
        };
        assert!(reason(&|card| card["colour"] = "red".into()).contains("colour"));
        assert!(reason(&|card| drop(card.as_object_mut().unwrap().remove("seed"))).contains("seed"));
        assert!(reason(&|card| card["name"] = " ".into()).contains("name"));
        assert!(reason(&|card| card["state"] = serde_json::json!([])).contains("state"));
        assert!(reason(&|card| card["seed"] = (-1).into()).contains("-1"));
        assert!(Card::from_json("{").is_err() && Card::from_json("[]").is_err());
        let mut card = full();
        card.metrics.insert("nees".into(), f64::NAN);
        assert!(card.checked().unwrap_err().to_string().contains("metrics.nees"));
    }
}
