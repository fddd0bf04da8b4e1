//! Models with random weights, for tests and benchmarks that need none in particular.

#![allow(dead_code, clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector4;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tercel_core::motion::{Motion, Turn};
use tercel_core::sensor::{ConvertedPolar, Measurement};
use tercel_neural::filter::extent_net::{self, Frame};
use tercel_neural::filter::rmm_net::{self, Aligned, Identification};
use tercel_neural::filter::{
    Architecture, Attention, BankNetwork, BranchHyper, Covariance, DeepMttHyper, EnsKNetsHyper,
    EnsembleNetwork, ExtentNetHyper, ExtentNetwork, Feature, Form, GainNetwork, KalmanNetHyper, LiquidHyper,
    LiquidNetwork, MnemonicHyper, MnemonicNetwork, NeuralImmHyper, Normalisation, Residual, ResidualNetwork,
    RmmNetHyper, RmmNetwork, Sign, TrMttHyper, TransformerNetwork,
};
use tercel_neural::layer::{CellShape, Solver};
use tercel_neural::{Card, Model, ModelError, Tensor};

/// The state of all filters here.
pub const STATE: [&str; 4] = ["x", "y", "vx", "vy"];

/// Gains of an alpha-beta filter for the objects of the conformance suite.
pub const ALPHA_BETA: [[f32; 2]; 4] = [[0.4, 0.0], [0.0, 0.4], [0.1, 0.0], [0.0, 0.1]];

/// Weights that are uniform within `size`, times the inverse root of what each output sums.
fn weights(tensors: Vec<(String, Vec<usize>)>, size: f32, seed: u64) -> BTreeMap<String, Tensor> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut tensor = |(name, shape): (String, Vec<usize>)| {
        let count: usize = shape.iter().product();
        let bound = size / (shape[0] as f32).sqrt();
        let values = (0..count).map(|_| bound * (2.0 * random.random::<f32>() - 1.0)).collect();
        (name, Tensor { shape, values })
    };
    tensors.into_iter().map(&mut tensor).collect()
}

/// A KalmanNet with random weights.
pub fn kalman_net(hyper: &KalmanNetHyper, size: f32, seed: u64) -> Model {
    let mut card = Card::new("untrained", "kalman-net", &STATE);
    card.hyper = hyper.to_table().unwrap();
    card.scales = KalmanNetHyper::default_scales();
    Model::new(card, weights(hyper.tensors(), size, seed)).unwrap()
}

/// A neural IMM with random weights.
pub fn neural_imm(hyper: &NeuralImmHyper, size: f32, seed: u64) -> Arc<BankNetwork> {
    let mut card = Card::new("untrained", "neural-imm", &STATE);
    card.hyper = hyper.to_table().unwrap();
    Arc::new(
        BankNetwork::from_model(&Model::new(card, weights(hyper.tensors(), size, seed)).unwrap()).unwrap(),
    )
}

/// A small bank for slow objects.
pub fn small_bank() -> NeuralImmHyper {
    NeuralImmHyper {
        rates: vec![0.0, 0.05, -0.05],
        accelerations: vec![0.5, 2.0],
        speed: 20.0,
        input: 6,
        hidden: 5,
        layers: 2,
        ..NeuralImmHyper::default()
    }
}

/// An ensemble with random weights.
pub fn ensemble_model(hyper: &EnsKNetsHyper, size: f32, seed: u64) -> Model {
    let mut card = Card::new("untrained", "ens-knets", &STATE);
    card.hyper = hyper.to_table().unwrap();
    card.scales = EnsKNetsHyper::default_scales();
    for index in 0..hyper.modes() {
        let scales = KalmanNetHyper::default_scales().into_iter();
        card.scales.extend(scales.map(|(name, scale)| (format!("net.{index}.{name}"), scale)));
    }
    Model::new(card, weights(hyper.tensors(), size, seed)).unwrap()
}

pub fn ensemble(hyper: &EnsKNetsHyper, size: f32) -> Arc<EnsembleNetwork> {
    Arc::new(EnsembleNetwork::from_model(&ensemble_model(hyper, size, 1)).unwrap())
}

/// Two KalmanNets that differ and small branches that differ, without attention, for slow objects.
pub fn tiny_ensemble() -> EnsKNetsHyper {
    EnsKNetsHyper {
        rates: vec![0.02, -0.03],
        acceleration: 1.0,
        speed: 20.0,
        normalisation: Normalisation::Running,
        attention: None,
        correction: Some(BranchHyper { hidden: 6, layers: 2 }),
        classification: Some(BranchHyper { hidden: 5, layers: 1 }),
        nets: [TINY_ONE, TINY_TWO].map(|a| tiny(a, Covariance::Joseph)).into(),
    }
}

/// The same with all that is ours.
pub fn tiny_attention() -> EnsKNetsHyper {
    EnsKNetsHyper {
        normalisation: Normalisation::Relative,
        attention: Some(Attention { sign: Sign::Minus, temperature: Some(0.9), stay: Some(0.95) }),
        ..tiny_ensemble()
    }
}

pub fn network(hyper: &KalmanNetHyper, size: f32) -> Arc<GainNetwork> {
    Arc::new(GainNetwork::from_model(&kalman_net(hyper, size, 1)).unwrap())
}

/// Small networks with everything that differs from the publication, beside an alpha-beta filter.
pub fn tiny(architecture: Architecture, covariance: Covariance) -> KalmanNetHyper {
    KalmanNetHyper {
        features: Feature::ALL.to_vec(),
        magnitudes: true,
        sensor_frame: true,
        covariance,
        gain_offset: Some(ALPHA_BETA),
        ..KalmanNetHyper::paper(architecture)
    }
}

pub const TINY_ONE: Architecture = Architecture::Stacked { input: 12, hidden: 9, layers: 2, head: 5 };
pub const TINY_TWO: Architecture = Architecture::Branched { in_mult: 2, out_mult: 3 };

/// An aircraft that turns at this rate, 40 km from the radar, which misses every fifth plot.
pub fn plots(rate: f64) -> Vec<Option<Measurement<2>>> {
    let turn = Turn::new(rate, 0.0);
    let mut state = Vector4::new(40e3, 9e3, -120.0, 150.0);
    (0..50)
        .map(|second| {
            let error = f64::from(second * 7 % 11 - 5);
            let plot = [state.xy().norm() + 8.0 * error, f64::atan2(state[1], state[0]) - 4e-4 * error];
            state = turn.transition(&state, 1.0);
            (second % 5 != 3).then(|| plot.into())
        })
        .collect()
}

pub fn radar() -> ConvertedPolar {
    ConvertedPolar::new(50.0, 0.003).unwrap()
}

/// A model with random weights of any kind.
pub fn model(kind: &str, hyper: toml::Table, tensors: Vec<(String, Vec<usize>)>, size: f32) -> Model {
    let mut card = Card::new("untrained", kind, &STATE);
    card.hyper = hyper;
    Model::new(card, weights(tensors, size, 1)).unwrap()
}

/// A mnemonic network with random weights.
pub fn mnemonic(hyper: &MnemonicHyper, size: f32) -> Arc<MnemonicNetwork> {
    let model = model("mnemonic", hyper.to_table().unwrap(), hyper.tensors(), size);
    Arc::new(MnemonicNetwork::from_model(&model).unwrap())
}

/// A residual network with random weights.
pub fn deep_mtt(hyper: &DeepMttHyper, size: f32) -> Arc<ResidualNetwork> {
    let model = model("deep-mtt", hyper.to_table().unwrap(), hyper.tensors(), size);
    Arc::new(ResidualNetwork::from_model(&model).unwrap())
}

/// A transformer with random weights.
pub fn tr_mtt(hyper: &TrMttHyper, size: f32) -> Arc<TransformerNetwork> {
    let model = model("tr-mtt", hyper.to_table().unwrap(), hyper.tensors(), size);
    Arc::new(TransformerNetwork::from_model(&model).unwrap())
}

/// Sizes for the objects of the conformance suite.
pub fn small_mnemonic() -> MnemonicHyper {
    MnemonicHyper { hidden: 5, acceleration: 1.0, speed: 20.0, ..MnemonicHyper::default() }
}

pub fn small_deep_mtt() -> DeepMttHyper {
    DeepMttHyper { layers: vec![5, 4], dense: 3, acceleration: 1.0, speed: 20.0, ..DeepMttHyper::default() }
}

pub fn small_tr_mtt() -> TrMttHyper {
    let sizes =
        TrMttHyper { window: 6, size: 8, heads: 2, encoder: 1, decoder: 1, feed: 9, ..TrMttHyper::default() };
    TrMttHyper { acceleration: 1.0, speed: 20.0, ..sizes }
}

/// A liquid network with random weights.
pub fn liquid(hyper: &LiquidHyper, size: f32) -> Arc<LiquidNetwork> {
    let model = model("liquid", hyper.to_table().unwrap(), hyper.tensors(), size);
    Arc::new(LiquidNetwork::from_model(&model).unwrap())
}

/// One cell of each kind, for the objects of the conformance suite.
pub const CELLS: [CellShape; 6] = [
    CellShape::Ltc { size: 9, unfolds: 6, solver: Solver::Fused },
    CellShape::Ltc { size: 6, unfolds: 24, solver: Solver::Euler },
    CellShape::Ltc { size: 5, unfolds: 12, solver: Solver::RungeKutta },
    CellShape::Cfc { size: 7, backbone: 10 },
    CellShape::Gru { size: 8 },
    CellShape::Mlp { size: 6, hidden: 9 },
];

pub fn small_liquid(cell: CellShape) -> LiquidHyper {
    let form = Residual { acceleration: 1.0, noise: 0.7, ..Residual::default() };
    LiquidHyper { cell, speed: 20.0, form: Form::Residual(form), ..LiquidHyper::default() }
}

/// As published, for objects within two kilometres.
pub fn paper_liquid() -> LiquidHyper {
    let limits = [2000.0, 2000.0, 60.0, 60.0];
    LiquidHyper {
        cell: CELLS[0],
        speed: 20.0,
        ..LiquidHyper::paper(limits.map(|limit| -limit), limits, 1e-2, [10.0, 10.0, 5.0, 5.0])
    }
}

/// An RMMNet with random weights.
pub fn rmm_net(hyper: &RmmNetHyper, size: f32) -> Arc<RmmNetwork> {
    let model = model("rmmnet", hyper.to_table().unwrap(), hyper.tensors(), size);
    Arc::new(RmmNetwork::from_model(&model).unwrap())
}

/// A small one for vehicles.
pub fn small_rmm_net() -> RmmNetHyper {
    let identification = Identification { order: 3, ..Identification::default() };
    let form = Aligned { hidden: 7, encoder: 6, speed: 20.0, identification, ..Aligned::default() };
    RmmNetHyper { interval: 1.0, memory: 8, form: rmm_net::Form::Aligned(form) }
}

/// An ExtentNet with random weights.
pub fn extent_net(hyper: &ExtentNetHyper, size: f32) -> Arc<ExtentNetwork> {
    let model = model("extent-net", hyper.to_table().unwrap(), hyper.tensors(), size);
    Arc::new(ExtentNetwork::from_model(&model).unwrap())
}

/// Small ones for the objects of the conformance suite, with either memory.
pub fn small_extent_nets(frame: Frame) -> [ExtentNetHyper; 2] {
    let architectures = [
        extent_net::Architecture::Lstm { units: 8 },
        extent_net::Architecture::Transformer { size: 12, heads: 3, layers: 2, feed: 10, window: 7 },
    ];
    let position = if frame == Frame::Absolute { 5000.0 } else { 20.0 };
    let units =
        ExtentNetHyper { frame, position, velocity: 20.0, change: 12.0, speed: 20.0, ..Default::default() };
    architectures.map(|architecture| ExtentNetHyper { architecture, ..units.clone() })
}

/// A model of some kind with these tensors.
pub fn of_tensors(
    kind: &str,
    hyper: Result<toml::Table, String>,
    tensors: BTreeMap<String, Tensor>,
) -> Model {
    let mut card = Card::new(kind, kind, &STATE);
    card.hyper = hyper.unwrap();
    Model::new(card, tensors).unwrap()
}

/// Tensors of these shapes.
pub fn tensors(shapes: Vec<(String, Vec<usize>)>) -> BTreeMap<String, Tensor> {
    let values = |shape: Vec<usize>| Tensor { values: vec![0.1; shape.iter().product()], shape };
    shapes.into_iter().map(|(name, shape)| (name, values(shape))).collect()
}

/// Of tensors that make a model, any that is missing, too many or of another shape is refused by its name.
pub fn refuses_other_tensors<N>(
    shapes: &[(String, Vec<usize>)],
    load: impl Fn(BTreeMap<String, Tensor>) -> Result<N, ModelError>,
) {
    let all = || tensors(shapes.to_vec());
    let refusal = |tensors| load(tensors).err().unwrap().to_string();
    for (name, shape) in shapes {
        let longer = shape.iter().map(|length| length + 1).collect();
        let mut wrong = all();
        wrong.extend(tensors(vec![(name.clone(), longer)]));
        assert!(refusal(wrong).contains(&format!("`{name}` has shape")));
        let mut missing = all();
        missing.remove(name);
        assert!(refusal(missing).contains(&format!("`{name}` is missing")));
    }
    let mut more = all();
    more.extend(tensors(vec![("other".into(), vec![1])]));
    assert!(refusal(more).contains("`other`"));
    load(all()).unwrap();
}
