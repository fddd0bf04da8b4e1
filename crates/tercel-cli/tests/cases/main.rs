//! Inputs as people bring them, with what is right for each.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod files;
mod formats;
mod live;
mod ships;
mod simulated;
mod sorts;
#[path = "../support/mod.rs"]
mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;
use support::{Run, run};

/// A run of `tercel track` and what it wrote.
struct Tracked {
    summary: Value,
    stderr: String,
    rows: Vec<Value>,
}

impl Tracked {
    /// Tracks files; the table of tracks is read back.
    fn of(files: &[&Path], arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let table = folder.path().join("tracks.ndjson");
        let mut all: Vec<&str> = vec!["track"];
        all.extend(files.iter().map(|file| file.to_str().unwrap()));
        all.extend(arguments);
        all.extend(["--json", "-o", table.to_str().unwrap()]);
        let run = run(all).succeeded();
        let rows = std::fs::read_to_string(&table).unwrap();
        let rows = rows.lines().skip(1).map(|line| serde_json::from_str(line).unwrap()).collect();
        Tracked { summary: run.json(), stderr: run.stderr, rows }
    }

    /// Tracks a text that is written to a file of this name.
    fn of_text(name: &str, text: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        Tracked::of(&[&file], arguments)
    }

    /// Tracks a text with a configuration.
    fn of_text_with(name: &str, text: &str, config: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("tracker.toml");
        std::fs::write(&file, config).unwrap();
        Tracked::of_text(name, text, &["--config", file.to_str().unwrap()])
    }

    /// Confirmed tracks.
    fn tracks(&self) -> u64 {
        self.summary["confirmed_tracks"].as_u64().unwrap()
    }

    /// Detections that the tracker took in.
    fn detections(&self) -> u64 {
        self.summary["detections"]["tracked"].as_u64().unwrap()
    }

    /// Detections that continued a track.
    fn updated(&self) -> u64 {
        self.summary["detections"]["updated"].as_u64().unwrap()
    }

    /// Rows that were left out, by reason.
    fn left_out(&self) -> Vec<(String, u64)> {
        let reason = |left: &Value| (text(left, "reason"), left["rows"].as_u64().unwrap());
        self.summary["left_out"].as_array().unwrap().iter().map(reason).collect()
    }

    /// A score against the truth.
    fn score(&self, name: &str) -> f64 {
        self.summary["scores"]["metrics"][name].as_f64().unwrap()
    }

    /// The last row of each track in which it was believed.
    fn ends(&self) -> BTreeMap<u64, &Value> {
        let believed = self.rows.iter().filter(|row| row["status"] == "confirmed");
        believed.map(|row| (row["track"].as_u64().unwrap(), row)).collect()
    }

    /// The names of the objects that the rows of each track have.
    fn identities(&self) -> BTreeMap<u64, BTreeSet<String>> {
        let mut names: BTreeMap<u64, BTreeSet<String>> = BTreeMap::new();
        for row in self.rows.iter().filter(|row| row["identity"].is_string()) {
            names.entry(row["track"].as_u64().unwrap()).or_default().insert(text(row, "identity"));
        }
        names
    }

    /// Checks that every track has one name and every name one track.
    fn assert_names(&self, case: &str) {
        let names = self.identities();
        assert!(names.values().all(|names| names.len() == 1), "{case}: {names:?}");
        let distinct: BTreeSet<_> = names.values().flatten().collect();
        assert_eq!(distinct.len(), names.len(), "{case}: {names:?}");
        assert_eq!(names.len() as u64, self.tracks(), "{case}: {names:?}");
    }
}

/// What is right for a file.
struct Case {
    file: &'static str,
    arguments: &'static [&'static str],
    tracks: u64,
    detections: u64,
    /// Parts of the reasons for which rows are left out, and how many there are.
    left_out: &'static [(&'static str, u64)],
    /// What must stand on standard error.
    says: &'static [&'static str],
}

impl Case {
    const fn new(file: &'static str, tracks: u64, detections: u64) -> Self {
        Case { file, arguments: &[], tracks, detections, left_out: &[], says: &[] }
    }

    const fn with(self, arguments: &'static [&'static str]) -> Self {
        Case { arguments, ..self }
    }

    const fn leaves_out(self, left_out: &'static [(&'static str, u64)]) -> Self {
        Case { left_out, ..self }
    }

    const fn says(self, says: &'static [&'static str]) -> Self {
        Case { says, ..self }
    }

    /// Runs it and checks all that is said of it.
    fn check(&self) -> Tracked {
        let tracked = Tracked::of(&[&recording(self.file)], self.arguments);
        let Tracked { summary, stderr, .. } = &tracked;
        let case = self.file;
        assert_eq!(tracked.tracks(), self.tracks, "{case}: {summary}\n{stderr}");
        assert_eq!(tracked.detections(), self.detections, "{case}: {summary}\n{stderr}");
        let left_out = tracked.left_out();
        assert_eq!(left_out.len(), self.left_out.len(), "{case}: {left_out:?}");
        for ((reason, rows), (expected, number)) in left_out.iter().zip(self.left_out) {
            assert!(reason.contains(expected) && rows == number, "{case}: {left_out:?}");
        }
        for words in self.says {
            assert!(stderr.contains(words), "{case} does not say {words:?}: {stderr}");
        }
        tracked
    }
}

/// A file of the readers' tests.
fn recording(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tercel-data/tests/cases").join(name)
}

/// A file of a simulated case.
fn simulation(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/tracking").join(name)
}

/// A text value of a row.
fn text(row: &Value, key: &str) -> String {
    row[key].as_str().unwrap().to_owned()
}

/// A number of a row.
fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("no `{key}` in {row}"))
}

/// Runs something that must be refused for its input, and returns what it says.
fn refused(file: &Path, arguments: &[&str]) -> String {
    let run: Run = run(["track", file.to_str().unwrap()].iter().chain(arguments));
    assert_eq!(run.code, 3, "{}: {}", file.display(), run.transcript());
    assert!(run.stderr.contains("help: "), "{}", run.stderr);
    run.stderr
}

/// An error of a measurement, between -1 and 1, that is the same on every machine.
fn jitter(number: usize) -> f64 {
    2.0 * (0.618_033_988_749_894_9 * (number * number + 7 * number) as f64).fract() - 1.0
}
