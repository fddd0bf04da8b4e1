//! Time of one step (predict and update) of each learned filter: `cargo bench -p tercel-neural --bench filters`.

#![allow(clippy::unwrap_used)]

#[path = "../tests/untrained/mod.rs"]
mod untrained;

use std::sync::Arc;

use divan::{Bencher, black_box};
use tercel_core::extended::{Points, Scattering};
use tercel_core::filter::Filter;
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{Clutter, Detection, Phd, PhdConfig, Scan, Tracker};
use tercel_core::sensor::{ConvertedPolar, Measurement, Position, RangeBearing};
use tercel_neural::filter::{
    Architecture, Attention, BankNetwork, Covariance, Derivative, EnsKNets, EnsKNetsHyper, KalmanNet,
    KalmanNetHyper, LiquidBelief, LiquidHyper, LiquidKalman, LiquidNetwork, NeuralImm, Normalisation, RmmNet,
    RmmNetwork, Sign,
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

/// A scan of ten objects among 40 false detections, of a mixture at its cap of 500 components: hardly any is pruned.
#[divan::bench]
fn lnn_phd_at_cap_500_clutter_40(bencher: Bencher) {
    let network = LiquidNetwork::from_model(&shipped::model("liquid").unwrap()).unwrap();
    let filter = LiquidKalman::new(Arc::new(network), Position::new(5.0).unwrap());
    let mut tracker =
        Phd::new(PhdConfig { prune: 1e-60, merge: 0.1, cap: 500, ..PhdConfig::default() }).unwrap();
    // Spread evenly without a pattern: multiples of irrational numbers.
    let share = |number: u32, root: f64| (f64::from(number) * root).fract();
    let measurements = |scan: u32| -> Vec<Measurement<2>> {
        let object = |i: u32| {
            let time = f64::from(scan);
            let noise = |root| 10.0 * share(scan * 10 + i, root) - 5.0;
            [270.0 * f64::from(i) + 10.0 * time + noise(0.732), 270.0 * f64::from(i) + noise(0.236)].into()
        };
        let clutter = |i: u32| {
            let number = scan * 40 + i;
            [2_738.0 * share(number, 0.414_213_56), 2_738.0 * share(number, 0.618_033_99)].into()
        };
        (0..10).map(object).chain((0..40).map(clutter)).collect()
    };
    let (detection, clutter) =
        (Detection::uniform(0.95).unwrap(), Clutter::per_scan(40.0, 2_738.0 * 2_738.0).unwrap());
    let step = |tracker: &mut Phd<LiquidBelief>, number: u32| {
        let measurements = &measurements(number);
        let time = f64::from(number);
        let scan = Scan { time, measurements, detection: &detection, clutter: &clutter };
        tracker.step(&filter, &scan).unwrap();
    };
    (0..40).for_each(|number| step(&mut tracker, number));
    bencher.with_inputs(|| tracker.clone()).bench_local_values(|mut tracker| {
        step(&mut tracker, 40);
        tracker
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
