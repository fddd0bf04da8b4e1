//! What is wrong with a model file is refused with its place, and files appear whole or not at all.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::collections::BTreeMap;
use std::path::Path;

use tercel_neural::filter::{Architecture, Feature, GainNetwork, KalmanNetHyper};
use tercel_neural::{Card, Model, ModelError, Tensor};
use untrained::{STATE, TINY_ONE, TINY_TWO, kalman_net};

fn good() -> Model {
    kalman_net(&KalmanNetHyper::paper(TINY_TWO), 0.5, 1)
}

/// The model of a changed card and changed tensors.
fn changed(change: impl FnOnce(&mut Card, &mut BTreeMap<String, Tensor>)) -> Result<Model, ModelError> {
    let (mut card, mut tensors) = (good().card().clone(), good().tensors().clone());
    change(&mut card, &mut tensors);
    Model::new(card, tensors)
}

fn refusal(change: impl FnOnce(&mut Card, &mut BTreeMap<String, Tensor>)) -> String {
    changed(change).and_then(|model| GainNetwork::from_model(&model)).unwrap_err().to_string()
}

/// A safetensors file with this header and this many bytes of content.
fn file(header: &str, content: &[u8]) -> Vec<u8> {
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend_from_slice(content);
    bytes
}

fn card_text(card: &Card) -> String {
    serde_json::to_string(&serde_json::to_string(card).unwrap()).unwrap()
}

fn unreadable(bytes: &[u8]) -> String {
    Model::from_bytes("bad.safetensors", bytes).unwrap_err().to_string()
}

#[test]
fn a_model_survives_its_file() {
    let model = good();
    let read = Model::from_bytes("model", &model.to_bytes().unwrap()).unwrap();
    assert_eq!((read.card(), read.tensors()), (model.card(), model.tensors()));
    GainNetwork::from_model(&read).unwrap();
}

#[test]
fn a_file_that_is_cut_short_or_too_long_is_refused_wherever_it_is_cut() {
    let bytes = good().to_bytes().unwrap();
    for length in (0..bytes.len()).step_by(97).chain(bytes.len() - 5..bytes.len()) {
        let message = unreadable(&bytes[..length]);
        assert!(message.contains("bad.safetensors: not a whole safetensors file"), "{length}: {message}");
    }
    let longer = [bytes, vec![0; 4]].concat();
    assert!(unreadable(&longer).contains("not a whole safetensors file"));
}

#[test]
fn a_header_of_other_content_is_refused() {
    assert!(unreadable(b"not a model at all").contains("not a whole"));
    assert!(unreadable(&file("{}", &[])).contains("no model card"));
    assert!(unreadable(&file(r#"{"__metadata__":{"card":"{"}}"#, &[])).contains("model card: "));
    let two = r#"{"__metadata__":{"card":"{\"schema\":2}"}}"#;
    assert!(unreadable(&file(two, &[])).contains("schema 2; this version reads schema 1"));
    let missing = r#"{"__metadata__":{"card":"{\"schema\":1}"}}"#;
    assert!(unreadable(&file(missing, &[])).contains("missing field `name`"));
}

#[test]
fn a_tensor_of_another_type_is_refused_by_name() {
    let card = card_text(good().card());
    let header = format!(
        r#"{{"__metadata__":{{"card":{card}}},"fc1.bias":{{"dtype":"F16","shape":[4],"data_offsets":[0,8]}}}}"#
    );
    let message = unreadable(&file(&header, &[0; 8]));
    assert_eq!(message, "bad.safetensors: tensor `fc1.bias` holds F16; expected F32");
}

#[test]
fn a_number_that_is_not_finite_is_refused_by_place() {
    let message = refusal(|_, tensors| tensors.get_mut("gru_s.hidden").unwrap().values[5] = f32::NAN);
    assert_eq!(message, "untrained: tensor `gru_s.hidden`: number 5 is NaN; expected a finite number");
    let mut bytes = good().to_bytes().unwrap();
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert!(unreadable(&bytes).contains("is inf; expected a finite number"));
}

#[test]
fn missing_unknown_and_misshapen_tensors_are_refused_by_name() {
    let missing = refusal(|_, tensors| drop(tensors.remove("fc2.1.bias")));
    assert_eq!(missing, "untrained: tensor `fc2.1.bias` is missing; expected shape [8]");
    let extra = Tensor { shape: vec![2], values: vec![0.0; 2] };
    let unknown = refusal(|_, tensors| drop(tensors.insert("fc8.bias".into(), extra)));
    assert_eq!(unknown, "untrained: tensor `fc8.bias` of shape [2] does not belong to this architecture");
    let shape = refusal(|_, tensors| tensors.get_mut("fc1.weight").unwrap().shape.reverse());
    assert_eq!(shape, "untrained: tensor `fc1.weight` has shape [4, 16]; expected [16, 4]");
    let short = refusal(|_, tensors| tensors.get_mut("fc1.weight").unwrap().values.truncate(63));
    assert!(short.contains("fc1.weight") && short.contains("[63]"), "{short}");
}

#[test]
fn another_kind_and_another_state_are_refused_by_name() {
    let kind = refusal(|card, _| card.kind = "deep-mtt".into());
    assert_eq!(kind, "untrained: a model of kind `deep-mtt`; expected `kalman-net`");
    let state = refusal(|card, _| card.state = ["x", "vx", "y", "vy"].map(String::from).into());
    assert_eq!(state, "untrained: made for the state [x, vx, y, vy]; expected [x, y, vx, vy]");
    assert!(good().expect("kalman-net", &STATE).is_ok());
}

#[test]
fn impossible_sizes_and_options_are_refused_before_anything_is_made() {
    let hyper = |change: &dyn Fn(&mut KalmanNetHyper)| {
        refusal(|card, _| {
            let mut hyper = KalmanNetHyper::paper(TINY_TWO);
            change(&mut hyper);
            card.hyper = hyper.to_table().unwrap();
        })
    };
    assert!(hyper(&|h| h.features = vec![Feature::F2, Feature::F4]).contains("needs f1, f2, f3, f4"));
    assert!(hyper(&|h| h.features.push(Feature::F1)).contains("F1 twice"));
    assert!(hyper(&|h| h.features.clear()).contains("`features` is empty"));
    let branched = |in_mult, out_mult| Architecture::Branched { in_mult, out_mult };
    assert!(hyper(&|h| h.architecture = branched(0, 3)).contains("`architecture.in_mult` is 0"));
    assert!(hyper(&|h| h.architecture = branched(5, 1 << 40)).contains("at most 65536"));
    let deep = Architecture::Stacked { input: 4, hidden: 4, layers: 60_000, head: 1 << 50 };
    assert!(hyper(&|h| h.architecture = deep).contains("at most 65536"));
    assert!(hyper(&|h| h.gain_offset = Some([[f32::NAN; 2]; 4])).contains("gain_offset"));
    let unknown = refusal(|card, _| drop(card.hyper.insert("colour".into(), "red".into())));
    assert!(unknown.contains("untrained: model card, `hyper`") && unknown.contains("colour"), "{unknown}");
    assert!(refusal(|card, _| drop(card.hyper.remove("covariance"))).contains("covariance"));
    let unknown = refusal(|card, _| {
        card.hyper["architecture"].as_table_mut().unwrap().insert("depth".into(), 3.into());
    });
    assert!(unknown.contains("depth"), "{unknown}");
}

#[test]
fn scales_that_are_needed_are_there_in_their_unit() {
    let scale = |change: &dyn Fn(&mut Card)| {
        let mut card = kalman_net(&KalmanNetHyper::paper(TINY_ONE), 0.5, 1).card().clone();
        let mut hyper = KalmanNetHyper::paper(TINY_ONE);
        hyper.magnitudes = true;
        card.hyper = hyper.to_table().unwrap();
        change(&mut card);
        GainNetwork::from_model(&Model::new(card, BTreeMap::new()).unwrap()).unwrap_err().to_string()
    };
    assert!(scale(&|card| drop(card.scales.remove("range"))).contains("scale `range`: is missing"));
    assert!(
        scale(&|card| card.scales.get_mut("f2").unwrap().unit = "km".into()).contains("`km`; expected `m`")
    );
    assert!(scale(&|card| card.scales.get_mut("f4").unwrap().value = 0.0).contains("scale `f4`: is 0"));
    // F1 is not among its features.
    assert!(scale(&|card| drop(card.scales.remove("f1"))).contains("is missing; expected shape"));
}

#[test]
fn a_saved_model_has_a_twin_for_people_and_can_be_opened() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.safetensors");
    let model = good();
    model.save(&path).unwrap();
    model.save(&path).unwrap();
    let read = Model::open(&path).unwrap();
    assert_eq!((read.card(), read.tensors()), (model.card(), model.tensors()));
    let twin = std::fs::read_to_string(folder.path().join("net.toml")).unwrap();
    assert_eq!(&Card::from_toml(&twin).unwrap(), model.card());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left");
}

#[test]
fn what_cannot_be_written_leaves_the_old_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("net.safetensors");
    good().save(&path).unwrap();
    let before = std::fs::read(&path).unwrap();
    // The twin's place is taken by a folder, so the model must not be replaced either.
    std::fs::remove_file(folder.path().join("net.toml")).unwrap();
    std::fs::create_dir(folder.path().join("net.toml")).unwrap();
    let other = kalman_net(&KalmanNetHyper::paper(TINY_TWO), 0.5, 2);
    let error = other.save(&path).unwrap_err().to_string();
    assert!(error.contains("net.toml: cannot write"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "nothing else is left");
    assert!(good().save(&folder.path().join("none/net.safetensors")).is_err());
    assert!(good().save(&folder.path().join("card.toml")).unwrap_err().to_string().contains(".toml"));
    let mut card = good().card().clone();
    card.seed = u64::MAX;
    assert!(Model::new(card, BTreeMap::new()).unwrap().save(&path).is_err(), "TOML has no such number");
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = Model::open(Path::new("nowhere/net.safetensors")).unwrap_err().to_string();
    assert!(error.starts_with("nowhere/net.safetensors: cannot read: "), "{error}");
}
