//! Tells the program the git revision that it is built from, for the cards of the models that it trains.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    String::from_utf8(output.stdout).ok().map(|text| text.trim().to_owned())
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_TRAIN").is_none() {
        return;
    }
    // A package from a registry has no repository; the card then names no revision.
    let Some(revision) = git(&["rev-parse", "HEAD"]) else { return };
    println!("cargo::rustc-env=TERCEL_REVISION={revision}");
    // The log of the head changes with every commit and checkout.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
}
