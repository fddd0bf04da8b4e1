//! Time of one step (predict and update) of each learned filter: `cargo bench -p tercel-neural --bench filters`.

#![allow(clippy::unwrap_used)]

#[path = "../tests/untrained/mod.rs"]
mod untrained;

use std::sync::Arc;

use divan::{Bencher, black_box};
use tercel_core::extended::{Points, Scattering};
use tercel_core::filter::Filter;
use tercel_core::motion::ConstantVelocity;
use tercel_core::sensor::{ConvertedPolar, Measurement, Position, RangeBearing};
use tercel_neural::filter::{
    Architecture, Attention, BankNetwork, Covariance, Derivative, EnsKNets, EnsKNetsHyper, KalmanNet,
    KalmanNetHyper, LiquidHyper, LiquidKalman, NeuralImm, Normalisation, RmmNet, RmmNetwork, Sign,
};
use tercel_neural::layer::CellShape;
use tercel_neural::shipped;
use untrained::{network, tiny};

fn main() {
    divan::main();
}

/// Steps timed together, so that the clock does not count.
const STEPS: u32 = 100;

fn radar() -> ConvertedPolar {
    ConvertedPolar::new(50.0, 0.005).unwrap()
}

fn steps(bencher: Bencher, hyper: &KalmanNetHyper) {
    time(bencher, &KalmanNet::new(network(hyper, 0.1), ConstantVelocity::new(1.0), radar()));
}

fn ensemble(bencher: Bencher, hyper: &EnsKNetsHyper) {
    time(bencher, &EnsKNets::new(untrained::ensemble(hyper, 0.1), radar()).unwrap());
}

fn time<F: Filter<4, Measurement = Measurement<2>>>(bencher: Bencher, filter: &F) {
    let seen: Measurement<2> = [10_000.0, 0.5].into();
    let mut belief = filter.birth(&seen).unwrap();
    bencher.counter(divan::counter::ItemsCount::new(STEPS)).bench_local(|| {
        for _ in 0..STEPS {
            filter.predict(black_box(&mut belief), black_box(1.0));
            black_box(filter.update(&mut belief, black_box(&seen))).unwrap();
        }
    });
}

#[divan::bench]
fn kalman_net_one(bencher: Bencher) {
    steps(bencher, &KalmanNetHyper::paper(Architecture::one()));
}

#[divan::bench]
fn kalman_net_two(bencher: Bencher) {
    steps(bencher, &KalmanNetHyper::paper(Architecture::two()));
}

/// With magnitudes, in the frame of the sensor, with Joseph's covariance.
#[divan::bench]
fn kalman_net_two_with_all_options(bencher: Bencher) {
    steps(bencher, &tiny(Architecture::two(), Covariance::Joseph));
}

/// With three KalmanNets of architecture #2 and branches of two layers of 64, as published.
#[divan::bench]
fn att_ens_kalmannets(bencher: Bencher) {
    ensemble(bencher, &EnsKNetsHyper::att_ens_knets(vec![KalmanNetHyper::paper(Architecture::two()); 3]));
}

/// The same with all options.
#[divan::bench]
fn att_ens_kalmannets_with_all_options(bencher: Bencher) {
    let nets = vec![tiny(Architecture::two(), Covariance::Joseph); 3];
    let attention = Attention { sign: Sign::Minus, temperature: Some(0.9), stay: Some(0.97) };
    ensemble(
        bencher,
        &EnsKNetsHyper {
            normalisation: Normalisation::Relative,
            attention: Some(attention),
            ..EnsKNetsHyper::att_ens_knets(nets)
        },
    );
}

/// The model that comes with Tercel, told the accuracy of its radar.
#[divan::bench]
fn neural_imm(bencher: Bencher) {
    let network = BankNetwork::from_model(&shipped::model("neural-imm").unwrap()).unwrap();
    let radar = RangeBearing::new(50.0, 0.009).unwrap();
    time(bencher, &NeuralImm::new(Arc::new(network), &[radar]).unwrap());
}

/// The prediction of 500 components of a mixture, with their covariances, by a cell of 32 units.
#[divan::bench(args = ["ltc", "ltc with differences", "cfc", "gru", "mlp"])]
fn liquid_predictions_of_500(bencher: Bencher, cell: &str) {
    let default = LiquidHyper { warm_up: 0, ..LiquidHyper::default() };
    let hyper = match cell {
        "ltc" => default,
        "ltc with differences" => LiquidHyper { jacobian: Derivative::Difference { step: 1e-2 }, ..default },
        "cfc" => LiquidHyper { cell: CellShape::Cfc { size: 32, backbone: 64 }, ..default },
        "gru" => LiquidHyper { cell: CellShape::Gru { size: 32 }, ..default },
        _ => LiquidHyper { cell: CellShape::Mlp { size: 32, hidden: 64 }, ..default },
    };
    let filter = LiquidKalman::new(untrained::liquid(&hyper, 1.0), Position::new(5.0).unwrap());
    let born = |i: i32| filter.birth(&[f64::from(i), 0.5 * f64::from(i)].into()).unwrap();
    let mut beliefs: Vec<_> = (0..500).map(born).collect();
    bencher.bench_local(|| {
        let mut all: Vec<_> = beliefs.iter_mut().collect();
        filter.predict_all(black_box(&mut all), 1.0);
    });
}

/// Scans of twenty points, with the model that comes with Tercel.
#[divan::bench]
fn rmm_net(bencher: Bencher) {
    let network = RmmNetwork::from_model(&shipped::model("rmmnet-vehicle").unwrap()).unwrap();
    let noise = nalgebra::Matrix2::new(1.0, 0.0, 0.0, 0.64);
    let filter = RmmNet::new(Arc::new(network), Scattering::uniform(noise).unwrap());
    let seen: Points =
        (0..20).map(|i| [100.0 + f64::from(i % 5) * 2.5, 50.0 + f64::from(i % 7) * 0.3]).collect();
    let mut belief = filter.birth(&seen).unwrap();
    bencher.counter(divan::counter::ItemsCount::new(STEPS)).bench_local(|| {
        for _ in 0..STEPS {
            filter.predict(black_box(&mut belief), black_box(1.0));
            black_box(filter.update(&mut belief, black_box(&seen))).unwrap();
        }
    });
}
