//! Results in files: one per shard, joined again by a merge.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tercel_data::AtomicFile;

use super::{Cell, Plan, Results, Shard};
use crate::StudyError;

/// What the files say they are.
const FORMAT: &str = "tercel study shard";

/// Version of their layout.
const VERSION: u32 = 1;

/// How their names end.
const ENDING: &str = ".shard.json";

/// A file. The head comes first, so that a file of another version is told from a damaged one.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ShardFile {
    format: String,
    version: u32,
    tercel: String,
    plan: Plan,
    shard: Shard,
    cells: Vec<Cell>,
}

/// What every version of the layout begins with.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: u32,
    tercel: String,
}

impl Results {
    /// Name of the file of a shard: `atc-test_2-of-4.shard.json`.
    pub fn file_name(plan: &Plan, shard: Shard) -> String {
        format!("{}_{}-of-{}{ENDING}", plan.study, shard.index(), shard.count())
    }

    /// Writes the results to a file, whole or not at all.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), StudyError> {
        let file = ShardFile {
            format: FORMAT.to_owned(),
            version: VERSION,
            tercel: env!("CARGO_PKG_VERSION").to_owned(),
            plan: self.plan.clone(),
            shard: self.shard,
            cells: self.cells.clone(),
        };
        let failed = |source| StudyError::Output { path: path.to_path_buf(), source };
        let json = serde_json::to_vec(&file).map_err(|error| failed(error.into()))?;
        let mut file = AtomicFile::create(path)?;
        file.write_all(&json).map_err(failed)?;
        Ok(file.finish()?)
    }

    /// Reads the results of a shard.
    ///
    /// # Errors
    /// When the file is not there, is none of these files or damaged, or is of another version of Tercel, whose figures may
    /// differ.
    pub fn read(path: &Path) -> Result<Self, StudyError> {
        let refused = |problem: String| StudyError::Shard { path: path.to_path_buf(), problem };
        let bytes = std::fs::read(path).map_err(|error| refused(format!("cannot read: {error}")))?;
        let head: Head = serde_json::from_slice(&bytes)
            .map_err(|error| refused(format!("this is no shard of a study, or it is damaged: {error}")))?;
        if head.format != FORMAT {
            return Err(refused(format!("this is no shard of a study: its format is `{}`", head.format)));
        }
        let ours = env!("CARGO_PKG_VERSION");
        if (head.version, head.tercel.as_str()) != (VERSION, ours) {
            return Err(refused(format!(
                "the shard was made by Tercel {} (layout {}), and this is Tercel {ours} (layout {VERSION}); \
                 figures of different versions cannot be joined",
                head.tercel, head.version
            )));
        }
        let file: ShardFile = serde_json::from_slice(&bytes)
            .map_err(|error| refused(format!("the shard is damaged: {error}")))?;
        let results = Results { plan: file.plan, shard: file.shard, cells: file.cells };
        match results.damage() {
            None => Ok(results),
            Some(problem) => Err(refused(format!("the shard is damaged: {problem}"))),
        }
    }

    /// What does not fit together, if anything.
    fn damage(&self) -> Option<&'static str> {
        let plan = &self.plan;
        if !self.shard.is_valid() {
            return Some("its number is not among the shards");
        }
        if self.cells.len() != plan.conditions() * plan.methods.len() {
            return Some("methods or conditions are missing");
        }
        for cell in &self.cells {
            if !self.shard.runs(plan.runs).eq(cell.runs.iter().copied()) {
                return Some("runs are missing, or not those of the shard");
            }
            let failed = |run: &u64| cell.failures.binary_search_by_key(run, |failure| failure.run).is_ok();
            let complete = |(run, values): (&u64, &Vec<Option<f64>>)| {
                values.len() == if failed(run) { 0 } else { plan.metrics.len() }
            };
            if cell.values.len() != cell.runs.len() || !cell.runs.iter().zip(&cell.values).all(complete) {
                return Some("a run does not have one value per metric");
            }
            if !cell.curves.iter().map(Vec::len).eq(plan.curves.iter().map(|curve| curve.x.len())) {
                return Some("a curve does not have one sum per point");
            }
        }
        None
    }

    /// Joins the shards of a study, in any order.
    ///
    /// # Errors
    /// When there are none, when they belong to different studies (seed, runs, methods, options), or when one is missing or
    /// there twice. The message names files and reason.
    pub fn merge(shards: Vec<(PathBuf, Results)>) -> Result<Results, StudyError> {
        let mut shards = shards.into_iter();
        let Some((first, mut whole)) = shards.next() else { return Err(StudyError::NoShards) };
        let mut there = BTreeMap::from([(whole.shard.index(), first.clone())]);
        for (path, results) in shards {
            if let Some(difference) = difference(&whole, &results) {
                return Err(StudyError::DifferentShards { first, second: path, difference });
            }
            if let Some(twin) = there.insert(results.shard.index(), path.clone()) {
                return Err(StudyError::ShardTwice {
                    first: twin,
                    second: path,
                    shard: results.shard.to_string(),
                });
            }
            whole.cells.iter_mut().zip(results.cells).for_each(|(cell, other)| cell.merge(other));
        }
        let count = whole.shard.count();
        let missing: Vec<u64> = (1..=count).filter(|index| !there.contains_key(index)).take(20).collect();
        if !missing.is_empty() {
            let missing: Vec<String> = missing.iter().map(|index| format!("{index}/{count}")).collect();
            return Err(StudyError::MissingShards { study: whole.plan.study, missing: missing.join(", ") });
        }
        whole.cells.iter_mut().for_each(Cell::sort);
        Ok(Results { shard: Shard::WHOLE, ..whole })
    }
}

/// In what two shards differ that must be equal.
fn difference(first: &Results, second: &Results) -> Option<String> {
    let (a, b) = (&first.plan, &second.plan);
    let list = |options: &BTreeMap<String, String>| {
        options.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
    };
    let pairs = [
        ("studies", a.study.clone(), b.study.clone()),
        ("seeds", a.seed.to_string(), b.seed.to_string()),
        ("numbers of runs", a.runs.to_string(), b.runs.to_string()),
        ("methods", a.methods.join(", "), b.methods.join(", ")),
        ("options", list(&a.options), list(&b.options)),
        ("numbers of shards", first.shard.count().to_string(), second.shard.count().to_string()),
    ];
    let named = pairs.into_iter().find(|(_, a, b)| a != b);
    let named = named.map(|(what, a, b)| format!("their {what} differ: `{a}` and `{b}`"));
    named.or_else(|| (a != b).then(|| "their conditions, metrics or curves differ".to_owned()))
}

/// The files of shards that are named, or lie in folders that are named, by name.
///
/// # Errors
/// When a folder cannot be listed or holds no such file.
pub fn find(paths: &[PathBuf]) -> Result<Vec<PathBuf>, StudyError> {
    let mut found = Vec::new();
    for path in paths {
        if !path.is_dir() {
            found.push(path.clone());
            continue;
        }
        let failed =
            |error| StudyError::Shard { path: path.clone(), problem: format!("cannot list: {error}") };
        let mut inside = Vec::new();
        for entry in std::fs::read_dir(path).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if entry.file_name().to_string_lossy().ends_with(ENDING) {
                inside.push(entry.path());
            }
        }
        if inside.is_empty() {
            return Err(StudyError::Shard {
                path: path.clone(),
                problem: format!("the folder holds no shard of a study, a file named NAME_1-of-4{ENDING}"),
            });
        }
        inside.sort();
        found.extend(inside);
    }
    Ok(found)
}
