//! The tracker section. Every default is that of the library.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tercel_core::association::Gate;
use tercel_core::error::FilterError;
use tercel_core::multi;

use super::management::{Managed, ManagementConfig, ManagementKeys, over};
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

impl TrackerConfig {
    /// Name of the tracker, as in the file.
    pub fn name(&self) -> &'static str {
        match self {
            TrackerConfig::NearestNeighbour(_) => "nearest_neighbour",
            TrackerConfig::Phd(_) => "phd",
            TrackerConfig::MultiBernoulli(_) => "multi_bernoulli",
            TrackerConfig::Jpda(_) => "jpda",
            TrackerConfig::Pmbm(_) => "pmbm",
        }
    }

    /// When its tracks are confirmed and given up.
    pub fn management(&self) -> &ManagementConfig {
        match self {
            TrackerConfig::NearestNeighbour(settings) => &settings.management,
            TrackerConfig::Phd(settings) => &settings.management,
            TrackerConfig::MultiBernoulli(settings) => &settings.management,
            TrackerConfig::Jpda(settings) => &settings.management,
            TrackerConfig::Pmbm(settings) => &settings.management,
        }
    }
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
    #[serde(deserialize_with = "over::<NearestNeighbourConfig, _>")]
    #[schemars(with = "ManagementKeys")]
    pub management: ManagementConfig,
}

impl Default for NearestNeighbourConfig {
    fn default() -> Self {
        let library = multi::NearestNeighbourConfig::default();
        NearestNeighbourConfig {
            gate: Probability::constant(library.gate.probability()),
            survival: Probability::constant(library.survival),
            birth: Probability::constant(library.birth),
            merge: NonNegative::constant(library.merge),
            cap: Count::of(library.cap),
            management: ManagementConfig::of(&library.management),
        }
    }
}

impl Managed for NearestNeighbourConfig {
    fn management(self) -> ManagementConfig {
        self.management
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
    #[serde(deserialize_with = "over::<PhdConfig, _>")]
    #[schemars(with = "ManagementKeys")]
    pub management: ManagementConfig,
}

impl Default for PhdConfig {
    fn default() -> Self {
        let library = multi::PhdConfig::default();
        PhdConfig {
            gate: Probability::constant(library.gate.probability()),
            survival: Probability::constant(library.survival),
            birth: Probability::constant(library.birth),
            prune: Probability::constant(library.prune),
            merge: NonNegative::constant(library.merge),
            cap: Count::of(library.cap),
            extract: Positive::constant(library.extract),
            management: ManagementConfig::of(&library.management),
        }
    }
}

impl Managed for PhdConfig {
    fn management(self) -> ManagementConfig {
        self.management
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
    #[serde(deserialize_with = "over::<MultiBernoulliConfig, _>")]
    #[schemars(with = "ManagementKeys")]
    pub management: ManagementConfig,
}

impl Default for MultiBernoulliConfig {
    fn default() -> Self {
        let library = multi::MultiBernoulliConfig::default();
        MultiBernoulliConfig {
            gate: Probability::constant(library.gate.probability()),
            survival: Probability::constant(library.survival),
            birth: Probability::constant(library.birth),
            prune: Probability::constant(library.prune),
            merge: NonNegative::constant(library.merge),
            cap: Count::of(library.cap),
            beliefs: Count::of(library.beliefs),
            extract: Positive::constant(library.extract),
            management: ManagementConfig::of(&library.management),
        }
    }
}

impl Managed for MultiBernoulliConfig {
    fn management(self) -> ManagementConfig {
        self.management
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
    #[serde(deserialize_with = "over::<JpdaConfig, _>")]
    #[schemars(with = "ManagementKeys")]
    pub management: ManagementConfig,
}

impl Default for JpdaConfig {
    fn default() -> Self {
        let library = multi::JpdaConfig::default();
        JpdaConfig {
            gate: Probability::constant(library.gate.probability()),
            survival: Probability::constant(library.survival),
            birth: Probability::constant(library.birth),
            merge: NonNegative::constant(library.merge),
            cap: Count::of(library.cap),
            management: ManagementConfig::of(&library.management),
        }
    }
}

impl Managed for JpdaConfig {
    fn management(self) -> ManagementConfig {
        self.management
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
    /// Expected objects per area before the first scan. Without it, as many as false detections, and no fewer than 1e-6.
    #[schemars(extend("x-unit" = "1/m^2"))]
    pub undetected: Option<NonNegative>,
    /// Expected new objects per area and time. Without it, one to a thousand false detections, and no fewer than 1e-8.
    #[schemars(extend("x-unit" = "1/(m^2 s)"))]
    pub birth: Option<NonNegative>,
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
    #[serde(deserialize_with = "over::<PmbmConfig, _>")]
    #[schemars(with = "ManagementKeys")]
    pub management: ManagementConfig,
}

impl Default for PmbmConfig {
    fn default() -> Self {
        let library = multi::PmbmConfig::default();
        PmbmConfig {
            gate: Probability::constant(library.gate.probability()),
            survival: Probability::constant(library.survival),
            undetected: library.undetected.map(NonNegative::constant),
            birth: library.birth.map(NonNegative::constant),
            hypotheses: Count::of(library.hypotheses),
            prune: Probability::constant(library.prune),
            merge: NonNegative::constant(library.merge),
            cap: Count::of(library.cap),
            management: ManagementConfig::of(&library.management),
        }
    }
}

impl Managed for PmbmConfig {
    fn management(self) -> ManagementConfig {
        self.management
    }
}

impl PmbmConfig {
    pub(crate) fn build(&self) -> Result<multi::PmbmConfig, FilterError> {
        Ok(multi::PmbmConfig {
            gate: Gate::new(self.gate.get())?,
            survival: self.survival.get(),
            undetected: self.undetected.map(NonNegative::get),
            birth: self.birth.map(NonNegative::get),
            hypotheses: self.hypotheses.get() as usize,
            prune: self.prune.get(),
            merge: self.merge.get(),
            cap: self.cap.get() as usize,
            management: self.management.build(),
        })
    }
}
