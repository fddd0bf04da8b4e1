//! `tercel models`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use support::{Run, command, finish};
use tercel_neural::filter::{Architecture, KalmanNetHyper};
use tercel_neural::{Card, Model, Tensor};

/// A network that gives zero.
fn model(name: &str) -> Model {
    let hyper = KalmanNetHyper::paper(Architecture::Branched { in_mult: 1, out_mult: 1 });
    let mut card = Card::new(name, "kalman-net", &["x", "y", "vx", "vy"]);
    card.hyper = hyper.to_table().unwrap();
    card.trained = "2026-01-31".into();
    card.metrics.insert("validation_loss".into(), 0.25);
    let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
    let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
    Model::new(card, tensors).unwrap()
}

/// A folder with two good models, and one that is cut short if it is asked for.
fn folder(broken: bool) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let models = folder.path().join("models");
    std::fs::create_dir(&models).unwrap();
    model("alpha").save(&models.join("alpha.safetensors")).unwrap();
    model("beta").save(&models.join("beta.safetensors")).unwrap();
    if broken {
        let bytes = model("cut").to_bytes().unwrap();
        std::fs::write(models.join("cut.safetensors"), &bytes[..bytes.len() - 9]).unwrap();
    }
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> Run {
    finish(command().current_dir(folder).arg("models").args(arguments).output().unwrap())
}

#[test]
fn models_are_listed_from_their_folder() {
    let folder = folder(false);
    let listed = run(folder.path(), &["list", "models"]).succeeded();
    insta::assert_snapshot!("models_list", listed.transcript());
    let json = run(folder.path(), &["list", "models/beta.safetensors", "--json"]).succeeded().json();
    assert_eq!((&json["card"]["name"], &json["file"]), (&"beta".into(), &"models/beta.safetensors".into()));
}

#[test]
fn without_a_path_the_models_that_come_with_the_program_are_meant() {
    let folder = tempfile::tempdir().unwrap();
    let verified = run(folder.path(), &["verify"]).succeeded();
    assert!(verified.stdout.contains("neural-imm: ok (neural-imm, "), "{}", verified.stdout);
    let one = run(folder.path(), &["show", "neural-imm"]).succeeded();
    assert!(one.stdout.starts_with("# neural-imm: "), "{}", one.stdout);
    let shown = run(folder.path(), &["list", "--json"]).succeeded();
    assert!(shown.stdout.lines().any(|line| line.contains(r#""shipped":"neural-imm""#)), "{}", shown.stdout);
}

#[test]
fn a_card_is_shown_as_toml_that_can_be_read() {
    let folder = folder(false);
    let shown = run(folder.path(), &["show", "models/alpha.safetensors"]).succeeded();
    assert_eq!(Card::from_toml(&shown.stdout).unwrap(), *model("alpha").card());
    assert!(shown.stdout.contains("#   fc1.weight [16, 4]\n"), "{}", shown.stdout);
}

#[test]
fn good_models_are_verified() {
    insta::assert_snapshot!(
        "models_verify",
        run(folder(false).path(), &["verify", "models"]).succeeded().transcript()
    );
}

#[test]
fn a_broken_model_is_named_and_the_others_are_still_read() {
    let folder = folder(true);
    let verified = run(folder.path(), &["verify", "models"]);
    assert_eq!(verified.code, 3);
    insta::assert_snapshot!("models_broken", verified.transcript());
    assert_eq!(run(folder.path(), &["list", "models"]).code, 3);
}

#[test]
fn what_no_filter_can_be_made_of_is_not_verified() {
    let folder = folder(false);
    let path = folder.path().join("models/alpha.safetensors");
    let refused = |change: &dyn Fn(&mut Card)| {
        let mut card = model("alpha").card().clone();
        change(&mut card);
        Model::new(card, model("alpha").tensors().clone()).unwrap().save(&path).unwrap();
        let verified = run(folder.path(), &["verify", "models/alpha.safetensors"]);
        assert_eq!((verified.code, verified.stdout.as_str()), (3, ""));
        verified.stderr
    };
    assert!(refused(&|card| card.kind = "oracle".into()).contains("a model of kind `oracle`; expected `"));
    assert!(refused(&|card| card.state.reverse()).contains("made for the state [vy, vx, y, x]"));
    assert!(refused(&|card| drop(card.hyper.remove("features"))).contains("features"));
}

#[test]
fn a_card_beside_a_model_that_says_something_else_is_refused() {
    let folder = folder(false);
    let other = model("other").card().to_toml().unwrap();
    std::fs::write(folder.path().join("models/alpha.toml"), other).unwrap();
    let verified = run(folder.path(), &["verify", "models"]);
    assert_eq!(verified.code, 3);
    assert!(verified.stderr.contains("models/alpha.toml: differs from the card in models/alpha.safetensors"));
}

#[test]
fn a_folder_without_models_is_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    assert!(run(folder.path(), &["list", "models"]).stderr.contains("models: cannot read"));
    let empty = run(folder.path(), &["verify", "."]);
    assert_eq!(empty.code, 3);
    assert!(empty.stderr.contains("there is no model in this folder"), "{}", empty.stderr);
}
