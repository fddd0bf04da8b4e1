//! Runs the program as a user does.

#![allow(dead_code, reason = "each test file uses a part of this")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What a run of the program left.
#[derive(Debug)]
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// Exit code and both streams, as they are stored in snapshots.
    pub fn transcript(&self) -> String {
        format!("exit code {}\n--- stdout ---\n{}--- stderr ---\n{}", self.code, self.stdout, self.stderr)
    }

    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {}", self.transcript()))
    }

    pub fn succeeded(self) -> Run {
        assert_eq!(self.code, 0, "{}", self.transcript());
        self
    }
}

pub fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// The program in the folder of the fixtures, without what the environment may say about terminals.
pub fn command() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tercel"));
    command.current_dir(fixtures()).env_remove("COLUMNS").env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE");
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

pub fn run<I: AsRef<OsStr>>(arguments: impl IntoIterator<Item = I>) -> Run {
    finish(command().args(arguments).output().unwrap())
}

/// Runs with a text on standard input.
pub fn run_with_input<I: AsRef<OsStr>>(arguments: impl IntoIterator<Item = I>, input: &str) -> Run {
    use std::io::Write;
    let mut child = command().args(arguments).stdin(Stdio::piped()).spawn().unwrap();
    // A program that stops early closes its input; what matters then is its exit code.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    finish(child.wait_with_output().unwrap())
}

pub fn finish(output: std::process::Output) -> Run {
    Run {
        code: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Names of the files in a folder.
pub fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = folder
        .read_dir()
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Six scans with one object that moves straight on, as lines.
pub fn lines() -> Vec<String> {
    let line = |step: i32| {
        format!(
            "{{\"time\":{step}.0,\"sensor\":\"radar\",\"detections\":[{{\"x\":{}.0,\"y\":0.0}}]}}\n",
            5 * step
        )
    };
    (0..6).map(line).collect()
}

/// Five scans as lines: one of two detections comes too late, and one is of a sensor that `tracker.toml` ignores.
pub fn late_and_ignored() -> String {
    let rows = [
        (0, "radar", 0),
        (2, "radar", 1),
        (1, "radar", 1),
        (1, "radar", 9),
        (3, "camera", 1),
        (3, "radar", 1),
    ];
    let line = |(time, sensor, x)| format!("{{\"time\":{time},\"sensor\":\"{sensor}\",\"x\":{x},\"y\":0}}\n");
    rows.into_iter().map(line).collect()
}
