//! The part of a tracker section that says when tracks are confirmed and given up.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use tercel_core::multi;

use super::{Count, Positive, Probability};

/// When tracks are confirmed and given up. What a file does not say is as in the default of its tracker.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ManagementConfig {
    /// When a tentative track is confirmed.
    pub confirm: ConfirmConfig,
    /// The least probability of existence.
    pub min_existence: Probability,
    /// The least existence of a confirmed track; without it, misses alone do not end one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_existence: Option<Probability>,
    /// Most misses in a row.
    pub max_misses: u32,
    /// Longest time without an update, s; without it, 15 s or the time of `max_misses` and one more scan, if that is longer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_coast: Option<Positive>,
}

/// When tracks are confirmed and given up. A key that is left out is as in the default of the tracker.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "ManagementConfig")]
pub(super) struct ManagementKeys {
    /// When a tentative track is confirmed.
    confirm: Option<ConfirmConfig>,
    /// The least probability of existence. No track starts with less. With `confirm = existence` a tentative track that has less is
    /// given up; a confirmed one if a detection has just updated it, for misses end it by `max_misses` alone. With `confirm = hits`
    /// no track is confirmed with less.
    #[schemars(extend("x-unit" = "1"))]
    min_existence: Option<Probability>,
    /// A confirmed track that exists less probably is given up, by misses as well. Without it, `max_misses` and `max_coast` alone say
    /// how long a confirmed track may be missed.
    #[schemars(extend("x-unit" = "1"))]
    lost_existence: Option<Probability>,
    /// A track with more misses in a row is given up; only scans that should have seen it count. 0 or more.
    #[schemars(extend("x-unit" = "1", "minimum" = 0))]
    max_misses: Option<u32>,
    /// A track that no scan has updated for longer is given up. Without it, after 15 s or the time of `max_misses` and one more scan,
    /// if that is longer.
    #[schemars(extend("x-unit" = "s"))]
    max_coast: Option<Positive>,
}

/// The settings of a tracker, which bring a default of their management.
pub(super) trait Managed: Default {
    fn management(self) -> ManagementConfig;
}

/// Reads the keys that a file gives, over the default of the tracker `T`.
pub(super) fn over<'de, T: Managed, D: Deserializer<'de>>(source: D) -> Result<ManagementConfig, D::Error> {
    let (given, default) = (ManagementKeys::deserialize(source)?, T::default().management());
    Ok(ManagementConfig {
        confirm: given.confirm.unwrap_or(default.confirm),
        min_existence: given.min_existence.unwrap_or(default.min_existence),
        lost_existence: given.lost_existence.or(default.lost_existence),
        max_misses: given.max_misses.unwrap_or(default.max_misses),
        max_coast: given.max_coast.or(default.max_coast),
    })
}

/// When a tentative track is confirmed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ConfirmConfig {
    /// When its probability of existence reaches this value.
    Existence(#[schemars(extend("x-unit" = "1"))] Probability),
    /// When enough of its last scans updated it.
    Hits(HitsConfig),
}

/// Confirmation by counting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HitsConfig {
    /// Updates needed.
    #[schemars(extend("x-unit" = "1"))]
    pub hits: Count,
    /// Among this many scans, at most 64.
    #[schemars(extend("x-unit" = "1"))]
    pub scans: Count,
}

impl ManagementConfig {
    /// What a default of the library says.
    pub(super) fn of(library: &multi::Management) -> Self {
        ManagementConfig {
            confirm: match library.confirm {
                multi::Confirmation::Existence(threshold) => {
                    ConfirmConfig::Existence(Probability::constant(threshold))
                }
                multi::Confirmation::Hits { hits, scans } => ConfirmConfig::Hits(HitsConfig {
                    hits: Count::constant(hits),
                    scans: Count::constant(scans),
                }),
            },
            min_existence: Probability::constant(library.min_existence),
            lost_existence: library.lost_existence.map(Probability::constant),
            max_misses: library.max_misses,
            max_coast: library.max_coast.map(Positive::constant),
        }
    }

    pub(super) fn build(&self) -> multi::Management {
        multi::Management {
            confirm: match &self.confirm {
                ConfirmConfig::Existence(threshold) => multi::Confirmation::Existence(threshold.get()),
                ConfirmConfig::Hits(rule) => {
                    multi::Confirmation::Hits { hits: rule.hits.get(), scans: rule.scans.get() }
                }
            },
            min_existence: self.min_existence.get(),
            lost_existence: self.lost_existence.map(Probability::get),
            max_misses: self.max_misses,
            max_coast: self.max_coast.map(Positive::get),
        }
    }
}
