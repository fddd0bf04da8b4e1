//! Recipes: everything that a training depends on, in one TOML file.
//!
//! ```toml
//! version = 1
//! kind = "kalman-net"      # chooses the task, and with it the keys of [data], [model] and [loss]
//! name = "kalman-net-straight"
//! seed = 1
//!
//! [data]
//! [model]
//! [loss]
//! [optimiser]              # OptimiserConfig
//! [schedule]               # ScheduleConfig
//! ```
//!
//! A key that is not understood is an error that names it and its line, and values are checked before any
//! training starts.

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::TrainError;
use crate::check::{at_least, refused, size};
use crate::hash::fnv1a;
use crate::optimiser::OptimiserConfig;

/// The version of recipes that this crate reads.
pub const VERSION: u32 = 1;

/// A kind of task: its name and the sections of the recipe that are its own.
pub trait Kind {
    /// The value of the key `kind`.
    const NAME: &'static str;
    /// The section `[data]`.
    type Data: DeserializeOwned;
    /// The section `[model]`.
    type Model: DeserializeOwned;
    /// The section `[loss]`, which may be left out.
    type Loss: DeserializeOwned + Default;
}

/// A recipe for one kind of task.
#[derive(Debug, Clone, Deserialize)]
#[serde(
    deny_unknown_fields,
    bound = "K::Data: DeserializeOwned, K::Model: DeserializeOwned, K::Loss: DeserializeOwned + Default"
)]
pub struct Recipe<K: Kind> {
    /// The version of the format.
    pub version: u32,
    /// The kind of task.
    pub kind: String,
    /// The name of the model.
    pub name: String,
    /// All that is random follows from it.
    #[serde(default)]
    pub seed: u64,
    /// A sentence for the reader and the model card.
    #[serde(default)]
    pub note: String,
    /// The section `[data]`.
    pub data: K::Data,
    /// The section `[model]`.
    pub model: K::Model,
    /// The section `[loss]`.
    #[serde(default)]
    pub loss: K::Loss,
    /// The section `[optimiser]`.
    #[serde(default)]
    pub optimiser: OptimiserConfig,
    /// The section `[schedule]`.
    #[serde(default)]
    pub schedule: ScheduleConfig,
    #[serde(skip)]
    text: String,
}

impl<K: Kind> Recipe<K> {
    /// Reads a recipe and checks what all kinds have in common.
    ///
    /// # Errors
    ///
    /// If it is not TOML, has a key that is not understood, lacks one, is of another kind or version, or a
    /// value is impossible.
    pub fn parse(text: &str) -> Result<Self, TrainError> {
        let kind = kind(text)?;
        if kind != K::NAME {
            return Err(refused("kind", format!("{kind:?}"), format!("this task is {:?}", K::NAME)));
        }
        let recipe: Self = toml::from_str(text).map_err(|error| TrainError::Recipe(error.to_string()))?;
        named(&recipe.name)?;
        recipe.optimiser.validate()?;
        recipe.schedule.validate()?;
        Ok(Self { text: text.to_owned(), ..recipe })
    }

    /// The hash of the text, as 16 hexadecimal digits: tells whether a checkpoint or model belongs to the
    /// recipe.
    pub fn hash(&self) -> String {
        format!("{:016x}", fnv1a(self.text.as_bytes()))
    }

    /// The text that it was read from.
    pub fn text(&self) -> &str {
        &self.text
    }
}

/// The kind of task that a recipe is for.
///
/// # Errors
///
/// If the text is not TOML, or has another version or no kind.
pub fn kind(text: &str) -> Result<String, TrainError> {
    #[derive(Deserialize)]
    struct Header {
        version: u32,
        kind: String,
    }
    let header: Header = toml::from_str(text).map_err(|error| TrainError::Recipe(error.to_string()))?;
    if header.version != VERSION {
        return Err(refused("version", header.version, format!("this program reads version {VERSION}")));
    }
    Ok(header.kind)
}

/// What a program wants to know of a recipe of any kind before it starts.
#[derive(Debug, Clone, Deserialize)]
pub struct Outline {
    /// The kind of task.
    pub kind: String,
    /// The name of the model.
    pub name: String,
    /// When the parameters change.
    #[serde(default)]
    pub schedule: ScheduleConfig,
    #[serde(default)]
    data: OutlineData,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct OutlineData {
    #[serde(default)]
    source: OutlineSource,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct OutlineSource {
    #[serde(default)]
    test: TestTracks,
}

/// Which of the recorded tracks are those of a study, and not to learn from: a fifth of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TestTracks {
    /// The last ones, of the study `aircraft`.
    #[default]
    Last,
    /// Those of the study `aircraft-random`.
    Random,
}

impl Outline {
    /// Which of the recorded tracks must not be given to the training.
    pub fn test_tracks(&self) -> TestTracks {
        self.data.source.test
    }

    /// Reads what all recipes have in common. The sections of the kind are not looked at.
    ///
    /// # Errors
    ///
    /// As [`kind`], and if there is no name, or the schedule is not understood.
    pub fn parse(text: &str) -> Result<Self, TrainError> {
        kind(text)?;
        let outline: Self = toml::from_str(text).map_err(|error| TrainError::Recipe(error.to_string()))?;
        named(&outline.name)?;
        outline.schedule.validate()?;
        Ok(outline)
    }
}

/// Refuses a name that cannot be that of a file.
fn named(name: &str) -> Result<(), TrainError> {
    if name.is_empty() || name.contains(['/', '\\']) {
        return Err(refused("name", format!("{name:?}"), "it must be a name without slashes"));
    }
    Ok(())
}

/// When the parameters change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateEach {
    /// After each batch, with the mean gradient of its windows.
    #[default]
    Batch,
    /// After each window of truncated back-propagation.
    Window,
}

/// The section `[schedule]` of a recipe.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScheduleConfig {
    /// Passes over the training set.
    pub epochs: usize,
    /// Samples in a batch.
    pub batch: usize,
    /// Parts into which a batch is split, each with a graph of its own. The result depends on it by rounding;
    /// it does not depend on the number of threads, of which there is use for as many.
    pub shards: usize,
    /// When the parameters change.
    pub update: UpdateEach,
    /// Updates over which the learning rate rises.
    pub warm_up: usize,
    /// The last learning rate, as a share of the highest.
    pub floor: f64,
    /// Epochs without a better validation loss after which the training stops; 0 never stops it.
    pub patience: usize,
}

impl Default for ScheduleConfig {
    fn default() -> Self {
        Self {
            epochs: 10,
            batch: 128,
            shards: 2,
            update: UpdateEach::Batch,
            warm_up: 0,
            floor: 0.01,
            patience: 0,
        }
    }
}

impl ScheduleConfig {
    fn validate(&self) -> Result<(), TrainError> {
        size("schedule.epochs", self.epochs, [1, 1_000_000])?;
        size("schedule.batch", self.batch, [1, 1 << 20])?;
        size("schedule.shards", self.shards, [1, self.batch.min(1024)])?;
        at_least("schedule.floor", self.floor, 0.0)?;
        if self.floor > 1.0 {
            return Err(refused("schedule.floor", self.floor, "it is a share of the rate, so at most 1"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Line;

    #[derive(Debug, Default, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Section {
        points: Option<usize>,
    }

    impl Kind for Line {
        const NAME: &'static str = "line";
        type Data = Section;
        type Model = Section;
        type Loss = Section;
    }

    const MINIMAL: &str = "version = 1\nkind = \"line\"\nname = \"a\"\n[data]\npoints = 3\n[model]\n";

    #[test]
    fn a_minimal_recipe_has_defaults_and_a_hash_of_its_text() {
        let recipe = Recipe::<Line>::parse(MINIMAL).unwrap();
        assert_eq!((recipe.data.points, recipe.schedule.shards), (Some(3), 2));
        let other = Recipe::<Line>::parse(&format!("{MINIMAL}points = 4\n")).unwrap();
        assert_ne!(recipe.hash(), other.hash());
        assert_eq!(recipe.hash().len(), 16);
    }

    #[test]
    fn an_outline_is_what_all_kinds_have_in_common() {
        let outline = Outline::parse(&format!("{MINIMAL}[schedule]\nepochs = 3\n")).unwrap();
        assert_eq!((outline.kind.as_str(), outline.name.as_str(), outline.schedule.epochs), ("line", "a", 3));
        for (text, key) in
            [("[schedule]\nepochs = 0\n", "schedule.epochs"), ("[schedule]\nepoch = 1\n", "epoch")]
        {
            assert!(Outline::parse(&format!("{MINIMAL}{text}")).unwrap_err().to_string().contains(key));
        }
    }

    #[test]
    fn a_key_that_is_not_understood_is_named_with_its_line() {
        for (text, key, line) in [
            (format!("{MINIMAL}pionts = 4\n"), "pionts", "line 7"),
            (format!("{MINIMAL}[optimiser]\nlearning = 1\n"), "learning", "line 8"),
            (format!("{MINIMAL}[schedule]\nepoch = 1\n"), "epoch", "line 8"),
            (format!("speed = 1\n{MINIMAL}"), "speed", "line 1"),
        ] {
            let error = Recipe::<Line>::parse(&text).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains(line), "{error}");
        }
    }

    #[test]
    fn impossible_values_are_refused_by_key() {
        for (line, key) in [
            ("[schedule]\nepochs = 0", "schedule.epochs"),
            ("[schedule]\nbatch = 4\nshards = 5", "schedule.shards"),
            ("[schedule]\nfloor = 2.0", "schedule.floor"),
            ("[optimiser]\nrate = -1.0", "optimiser.rate"),
            ("[optimiser]\nclip = inf", "optimiser.clip"),
        ] {
            let error = Recipe::<Line>::parse(&format!("{MINIMAL}{line}\n")).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
        for (old, new, key) in
            [("= 1", "= 2", "version"), ("line", "curve", "kind"), ("\"a\"", "\"a/b\"", "name")]
        {
            let error = Recipe::<Line>::parse(&MINIMAL.replacen(old, new, 1)).unwrap_err().to_string();
            assert!(error.contains(key), "{error}");
        }
        assert!(Recipe::<Line>::parse("not toml").is_err());
    }
}
