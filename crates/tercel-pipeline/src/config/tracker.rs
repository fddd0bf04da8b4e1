//! The tracker section.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tercel_core::association::Gate;
use tercel_core::error::FilterError;
use tercel_core::multi;

use super::{Count, NonNegative, Positive, Probability};

/// How objects are found among the detections.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TrackerConfig {
    /// Each detection goes to at most one track, jointly at the least cost.
    NearestNeighbour(NearestNeighbourConfig),
    /// The intensity of objects is estimated, without deciding which detection is whose.
    Phd(PhdConfig),
    /// The set of objects is estimated, each with a probability of existence, without deciding which detection is whose.
    MultiBernoulli(MultiBernoulliConfig),
    /// Each track takes all detections near it, by their joint probabilities.
    Jpda(JpdaConfig),
    /// The most probable hypotheses on which detection is whose are kept.
    Pmbm(PmbmConfig),
}

impl Default for TrackerConfig {
    fn default() -> Self {
        TrackerConfig::NearestNeighbour(NearestNeighbourConfig::default())
    }
}

/// Settings of the nearest neighbour tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NearestNeighbourConfig {
    /// Probability that an object's own detection falls inside its gate; above 0, below 1.
    #[schemars(extend("x-unit" = "1"))]
    pub gate: Probability,
    /// Probability that an object survives one second.
    #[schemars(extend("x-unit" = "1"))]
    pub survival: Probability,
    /// Probability that an unassigned detection comes from a new object, where clutter is at its background level.
    #[schemars(extend("x-unit" = "1"))]
    pub birth: Probability,
    /// Of two tracks closer than this squared Mahalanobis distance the weaker is dropped; 0 keeps both.
    #[schemars(extend("x-unit" = "1"))]
    pub merge: NonNegative,
    /// Largest number of tracks; beyond, those that hardly exist are given up.
    #[schemars(extend("x-unit" = "1"))]
    pub cap: Count,
    /// When tracks are confirmed and given up.
    pub management: ManagementConfig,
}

impl Default for NearestNeighbourConfig {
    fn default() -> Self {
        NearestNeighbourConfig {
            gate: Probability::constant(0.999),
            survival: Probability::constant(0.99),
            birth: Probability::constant(0.1),
            merge: NonNegative::constant(0.5),
            cap: Count::constant(100_000),
            management: ManagementConfig::default(),
        }
    }
}

impl NearestNeighbourConfig {
    pub(crate) fn build(&self) -> Result<multi::NearestNeighbourConfig, FilterError> {
        Ok(multi::NearestNeighbourConfig {
            gate: Gate::new(self.gate.get())?,
            survival: self.survival.get(),
            birth: self.birth.get(),
            merge: self.merge.get(),
            cap: self.cap.get() as usize,
            management: self.management.build(),
        })
    }
}

/// Settings of the probability hypothesis density tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PhdConfig {
    /// Probability that an object's own detection falls inside the gate of its component; above 0, below 1.
    #[schemars(extend("x-unit" = "1"))]
    pub gate: Probability,
    /// Probability that an object survives one second.
    #[schemars(extend("x-unit" = "1"))]
    pub survival: Probability,
    /// Expected new objects per unexplained detection, where clutter is at its background level.
    #[schemars(extend("x-unit" = "1"))]
    pub birth: Probability,
    /// Components of lower weight are dropped.
    #[schemars(extend("x-unit" = "1"))]
    pub prune: Probability,
    /// Components closer than this squared Mahalanobis distance are merged.
    #[schemars(extend("x-unit" = "1"))]
    pub merge: NonNegative,
    /// Largest number of components.
    #[schemars(extend("x-unit" = "1"))]
    pub cap: Count,
    /// Weight above which a component counts as an object.
    #[schemars(extend("x-unit" = "1"))]
    pub extract: Positive,
    /// When tracks are confirmed and given up.
    pub management: ManagementConfig,
}

impl Default for PhdConfig {
    fn default() -> Self {
        PhdConfig {
            gate: Probability::constant(0.999),
            survival: Probability::constant(0.99),
            birth: Probability::constant(0.05),
            prune: Probability::constant(1e-5),
            merge: NonNegative::constant(4.0),
            cap: Count::constant(500),
            extract: Positive::constant(0.5),
            management: ManagementConfig {
                confirm: ConfirmConfig::Hits(HitsConfig {
                    hits: Count::constant(3),
                    scans: Count::constant(4),
                }),
                min_existence: Probability::constant(1e-3),
                max_misses: 2,
                ..ManagementConfig::default()
            },
        }
    }
}

impl PhdConfig {
    pub(crate) fn build(&self) -> Result<multi::PhdConfig, FilterError> {
        Ok(multi::PhdConfig {
            gate: Gate::new(self.gate.get())?,
            survival: self.survival.get(),
            birth: self.birth.get(),
            prune: self.prune.get(),
            merge: self.merge.get(),
            cap: self.cap.get() as usize,
            extract: self.extract.get(),
            management: self.management.build(),
        })
    }
}

/// Settings of the multi-Bernoulli tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MultiBernoulliConfig {
    /// Probability that an object's own detection falls inside the gate of its belief; above 0, below 1.
    #[schemars(extend("x-unit" = "1"))]
    pub gate: Probability,
    /// Probability that an object survives one second.
    #[schemars(extend("x-unit" = "1"))]
    pub survival: Probability,
    /// Probability that an unexplained detection comes from a new object, where clutter is at its background level.
    #[schemars(extend("x-unit" = "1"))]
    pub birth: Probability,
    /// Objects of lower existence are dropped.
    #[schemars(extend("x-unit" = "1"))]
    pub prune: Probability,
    /// Beliefs of one object closer than this squared Mahalanobis distance are merged.
    #[schemars(extend("x-unit" = "1"))]
    pub merge: NonNegative,
    /// Largest number of objects.
    #[schemars(extend("x-unit" = "1"))]
    pub cap: Count,
    /// Largest number of beliefs of an object.
    #[schemars(extend("x-unit" = "1"))]
    pub beliefs: Count,
    /// Existence above which an object counts as seen.
    #[schemars(extend("x-unit" = "1"))]
    pub extract: Positive,
    /// When tracks are confirmed and given up.
    pub management: ManagementConfig,
}

impl Default for MultiBernoulliConfig {
    fn default() -> Self {
        let phd = PhdConfig::default();
        MultiBernoulliConfig {
            gate: phd.gate,
            survival: phd.survival,
            birth: phd.birth,
            prune: Probability::constant(1e-3),
            merge: phd.merge,
            cap: phd.cap,
            beliefs: Count::constant(20),
            extract: phd.extract,
            management: phd.management,
        }
    }
}

impl MultiBernoulliConfig {
    pub(crate) fn build(&self) -> Result<multi::MultiBernoulliConfig, FilterError> {
        Ok(multi::MultiBernoulliConfig {
            gate: Gate::new(self.gate.get())?,
            survival: self.survival.get(),
            birth: self.birth.get(),
            prune: self.prune.get(),
            merge: self.merge.get(),
            cap: self.cap.get() as usize,
            beliefs: self.beliefs.get() as usize,
            extract: self.extract.get(),
            management: self.management.build(),
        })
    }
}

/// Settings of the joint probabilistic data association tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JpdaConfig {
    /// Probability that an object's own detection falls inside its gate; above 0, below 1.
    #[schemars(extend("x-unit" = "1"))]
    pub gate: Probability,
    /// Probability that an object survives one second.
    #[schemars(extend("x-unit" = "1"))]
    pub survival: Probability,
    /// Probability that a detection that no track claims comes from a new object, where clutter is at its background level.
    #[schemars(extend("x-unit" = "1"))]
    pub birth: Probability,
    /// Of two tracks closer than this squared Mahalanobis distance the weaker is dropped; 0 keeps both.
    #[schemars(extend("x-unit" = "1"))]
    pub merge: NonNegative,
    /// Largest number of tracks; beyond, those that hardly exist are given up.
    #[schemars(extend("x-unit" = "1"))]
    pub cap: Count,
    /// When tracks are confirmed and given up.
    pub management: ManagementConfig,
}

impl Default for JpdaConfig {
    fn default() -> Self {
        let nearest = NearestNeighbourConfig::default();
        JpdaConfig {
            gate: nearest.gate,
            survival: nearest.survival,
            birth: nearest.birth,
            merge: nearest.merge,
            cap: Count::constant(10_000),
            management: nearest.management,
        }
    }
}

impl JpdaConfig {
    pub(crate) fn build(&self) -> Result<multi::JpdaConfig, FilterError> {
        Ok(multi::JpdaConfig {
            gate: Gate::new(self.gate.get())?,
            survival: self.survival.get(),
            birth: self.birth.get(),
            merge: self.merge.get(),
            cap: self.cap.get() as usize,
            management: self.management.build(),
        })
    }
}

/// Settings of the Poisson multi-Bernoulli mixture tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PmbmConfig {
    /// Probability that an object's own detection falls inside its gate; above 0, below 1.
    #[schemars(extend("x-unit" = "1"))]
    pub gate: Probability,
    /// Probability that an object survives one second.
    #[schemars(extend("x-unit" = "1"))]
    pub survival: Probability,
    /// Expected objects per area before the first scan.
    #[schemars(extend("x-unit" = "1/m^2"))]
    pub undetected: NonNegative,
    /// Expected new objects per area and time.
    #[schemars(extend("x-unit" = "1/(m^2 s)"))]
    pub birth: NonNegative,
    /// Largest number of hypotheses about objects that compete for detections.
    #[schemars(extend("x-unit" = "1"))]
    pub hypotheses: Count,
    /// Hypotheses of a lower weight are dropped.
    #[schemars(extend("x-unit" = "1"))]
    pub prune: Probability,
    /// Versions of a track with the same last detection and closer than this squared Mahalanobis distance are merged; 0 keeps all.
    #[schemars(extend("x-unit" = "1"))]
    pub merge: NonNegative,
    /// Largest number of tracks.
    #[schemars(extend("x-unit" = "1"))]
    pub cap: Count,
    /// When tracks are confirmed and given up.
    pub management: ManagementConfig,
}

impl Default for PmbmConfig {
    fn default() -> Self {
        PmbmConfig {
            gate: Probability::constant(0.999),
            survival: Probability::constant(0.99),
            undetected: NonNegative::constant(1e-6),
            birth: NonNegative::constant(1e-8),
            hypotheses: Count::constant(100),
            prune: Probability::constant(1e-4),
            merge: NonNegative::constant(0.5),
            cap: Count::constant(1000),
            management: ManagementConfig {
                min_existence: Probability::constant(1e-4),
                ..ManagementConfig::default()
            },
        }
    }
}

impl PmbmConfig {
    pub(crate) fn build(&self) -> Result<multi::PmbmConfig, FilterError> {
        Ok(multi::PmbmConfig {
            gate: Gate::new(self.gate.get())?,
            survival: self.survival.get(),
            undetected: self.undetected.get(),
            birth: self.birth.get(),
            hypotheses: self.hypotheses.get() as usize,
            prune: self.prune.get(),
            merge: self.merge.get(),
            cap: self.cap.get() as usize,
            management: self.management.build(),
        })
    }
}

/// When tracks are confirmed and given up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ManagementConfig {
    /// When a tentative track is confirmed.
    pub confirm: ConfirmConfig,
    /// A track with a lower probability of existence is given up.
    #[schemars(extend("x-unit" = "1"))]
    pub min_existence: Probability,
    /// A track with more misses in a row is given up; only scans that should have seen it count. 0 or more.
    #[schemars(extend("x-unit" = "1"))]
    pub max_misses: u32,
    /// A track that no scan has updated for longer is given up.
    #[schemars(extend("x-unit" = "s"))]
    pub max_coast: Positive,
}

impl Default for ManagementConfig {
    fn default() -> Self {
        ManagementConfig {
            confirm: ConfirmConfig::Existence(Probability::constant(0.95)),
            min_existence: Probability::constant(0.02),
            max_misses: 5,
            max_coast: Positive::constant(15.0),
        }
    }
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
    fn build(&self) -> multi::Management {
        multi::Management {
            confirm: match &self.confirm {
                ConfirmConfig::Existence(threshold) => multi::Confirmation::Existence(threshold.get()),
                ConfirmConfig::Hits(rule) => {
                    multi::Confirmation::Hits { hits: rule.hits.get(), scans: rule.scans.get() }
                }
            },
            min_existence: self.min_existence.get(),
            max_misses: self.max_misses,
            max_coast: Some(self.max_coast.get()),
        }
    }
}
