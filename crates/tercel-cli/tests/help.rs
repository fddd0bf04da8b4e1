//! What the program says about itself. `INSTA_UPDATE=always` accepts a change.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use support::{files, fixtures, run};

const COMMANDS: [&[&str]; 19] = [
    &[],
    &["track"],
    &["evaluate"],
    &["convert"],
    &["config"],
    &["config", "init"],
    &["config", "check"],
    &["config", "schema"],
    &["config", "presets"],
    &["simulate"],
    &["study"],
    &["study", "merge"],
    &["study", "list"],
    &["models"],
    &["models", "list"],
    &["models", "show"],
    &["models", "verify"],
    &["train"],
    &["completions"],
];

#[test]
fn every_command_explains_itself() {
    for command in COMMANDS {
        let help = run(command.iter().copied().chain(["--help"])).succeeded();
        assert_eq!(help.stderr, "");
        let name = std::iter::once("help").chain(command.iter().copied()).collect::<Vec<_>>().join("_");
        insta::assert_snapshot!(name, help.stdout);
    }
}

#[test]
fn every_long_help_ends_with_examples() {
    for command in COMMANDS {
        let help = run(command.iter().copied().chain(["--help"])).succeeded().stdout;
        let (_, examples) = help.rsplit_once("\n\n").unwrap();
        assert!(examples.starts_with("Examples:\n  "), "{command:?}: {examples}");
        let name = command.join(" ");
        assert!(examples.contains(&format!("tercel {name}")), "{command:?}: {examples}");
    }
}

#[test]
fn the_help_names_every_exit_code() {
    let help = run(["--help"]).succeeded().stdout;
    for code in ["  0  ", "  1  ", "  2  ", "  3  "] {
        assert!(help.contains(code), "{code}");
    }
}

#[test]
fn nothing_to_do_is_bad_usage() {
    let bare = run::<&str>([]);
    assert_eq!((bare.code, bare.stdout.as_str()), (2, ""));
    assert!(bare.stderr.contains("Usage: tercel"));
}

#[test]
fn every_shell_has_completions() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = run(["completions", shell]).succeeded().stdout;
        assert!(script.contains("tercel") && script.contains("evaluate"), "{shell}");
    }
    assert_eq!(run(["completions", "cobol"]).code, 2);
}

#[test]
fn help_in_colour_comes_only_when_asked_for() {
    assert!(!run(["track", "--help"]).stdout.contains('\u{1b}'));
    assert!(run(["track", "--help", "--color", "always"]).stdout.contains('\u{1b}'));
    assert!(run(["track", "nope.csv", "--color=always"]).stderr.contains("\u{1b}[1;31merror\u{1b}[0m"));
    assert!(!run(["track", "nope.csv"]).stderr.contains('\u{1b}'));
}

#[test]
fn no_test_leaves_anything_beside_the_fixtures() {
    let known = ["csv", "toml"];
    assert!(files(&fixtures()).iter().all(|name| known.iter().any(|ending| name.ends_with(ending))));
}
