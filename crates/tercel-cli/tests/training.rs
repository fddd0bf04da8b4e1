//! `tercel train`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on fails")]

mod support;

use std::path::Path;

use support::{Run, command, finish};

/// A training of a second.
const RECIPE: &str = "
version = 1
kind = \"kalman-net\"
name = \"tiny\"
seed = 5
[data]
training = 4
validation = 2
[model]
zero_gain = true
[model.network]
gain_offset = [[0.5, 0.0], [0.0, 0.5], [0.1, 0.0], [0.0, 0.1]]
features = [\"f1\", \"f2\", \"f3\", \"f4\"]
normalise = true
magnitudes = false
sensor_frame = false
covariance = \"joseph\"
[model.network.architecture]
kind = \"architecture-2\"
in_mult = 1
out_mult = 1
[schedule]
epochs = 2
batch = 2
";

/// Runs in a folder that has the recipe.
fn train(folder: &Path, recipe: &str, arguments: &[&str]) -> Run {
    std::fs::write(folder.join("tiny.toml"), recipe).unwrap();
    finish(command().current_dir(folder).args(["train", "tiny.toml"]).args(arguments).output().unwrap())
}

#[cfg(not(feature = "train"))]
#[test]
fn a_program_without_the_feature_says_how_to_get_one_with_it() {
    let run = train(tempfile::tempdir().unwrap().path(), RECIPE, &[]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("--features train"), "{}", run.stderr);
}

#[cfg(feature = "train")]
mod with_the_feature {
    use super::*;
    use support::files;

    #[test]
    fn a_training_leaves_model_card_curve_and_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let run = train(folder.path(), RECIPE, &["--licence", "MIT"]).succeeded();
        assert!(run.stdout.starts_with("models/tiny.safetensors: kalman-net tiny, "), "{}", run.stdout);
        assert!(run.stdout.contains("2 of 2 epochs"), "{}", run.stdout);
        assert!(run.stderr.contains("note: epoch 2/2: loss "), "{}", run.stderr);
        let models = folder.path().join("models");
        let expected = ["tiny.checkpoint", "tiny.curve.ndjson", "tiny.safetensors", "tiny.toml"];
        assert_eq!(files(&models), expected);
        let card = std::fs::read_to_string(models.join("tiny.toml")).unwrap();
        assert!(card.contains("licence = \"MIT\"") && card.contains("trained = \"20"), "{card}");
        let curve = std::fs::read_to_string(models.join("tiny.curve.ndjson")).unwrap();
        assert_eq!(curve.lines().count(), 2);
        let verified = command().current_dir(folder.path()).args(["models", "verify"]).output().unwrap();
        finish(verified).succeeded();
    }

    #[test]
    fn a_training_is_not_replaced_unless_asked_for_and_can_be_gone_on_with() {
        let folder = tempfile::tempdir().unwrap();
        train(folder.path(), RECIPE, &["-o", "net.safetensors"]).succeeded();
        let again = train(folder.path(), RECIPE, &["-o", "net.safetensors"]);
        assert_eq!((again.code, again.stdout.as_str()), (1, ""));
        assert!(again.stderr.contains("--resume") && again.stderr.contains("--force"), "{}", again.stderr);
        let resumed = train(folder.path(), RECIPE, &["-o", "net.safetensors", "--resume"]).succeeded();
        assert!(!resumed.stderr.contains("note: epoch"), "there was nothing left to do: {}", resumed.stderr);
        let other = RECIPE.replace("seed = 5", "seed = 6");
        assert_eq!(train(folder.path(), &other, &["-o", "net.safetensors", "--resume"]).code, 3);
        train(folder.path(), &other, &["-o", "net.safetensors", "--force"]).succeeded();
    }

    #[test]
    fn what_cannot_be_trained_is_refused_before_any_training() {
        let folder = tempfile::tempdir().unwrap();
        for (recipe, arguments, code, says) in [
            (RECIPE.replace("seed", "sead"), &[][..], 3, "tiny.toml: recipe: "),
            (RECIPE.replace("training = 4", "training = 0"), &[], 3, "data.training"),
            (RECIPE.replace("in_mult = 1", "in_mult = 0"), &[], 3, "in_mult"),
            (RECIPE.replace("kalman-net", "oracle"), &[], 3, "kind"),
            (RECIPE.into(), &["-o", "none/net.safetensors"], 1, "none"),
            (RECIPE.into(), &["-o", "net.model"], 2, ".safetensors"),
            (RECIPE.into(), &["--resume"], 3, "checkpoint"),
        ] {
            let run = train(folder.path(), &recipe, arguments);
            assert_eq!((run.code, run.stdout.as_str()), (code, ""), "{}", run.stderr);
            assert!(run.stderr.contains(says) && !run.stderr.contains("epoch"), "{}", run.stderr);
        }
    }
}
