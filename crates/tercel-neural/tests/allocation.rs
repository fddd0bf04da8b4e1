//! No learned filter allocates memory in a step once it has warmed up.

#![allow(clippy::unwrap_used)]

mod untrained;

use allocation_counter::measure;
use tercel_core::association::Search;
use tercel_core::extended::{Points, Scattering};
use tercel_core::filter::Filter;
use tercel_core::motion::ConstantVelocity;
use tercel_core::sensor::{ConvertedPolar, Measurement, RangeBearing};
use tercel_neural::filter::extent_net::Frame;
use tercel_neural::filter::{
    Architecture, Covariance, DeepMtt, DeepMttHyper, EnsKNets, EnsKNetsHyper, ExtentNet, KalmanNet,
    KalmanNetHyper, LiquidKalman, MnemonicHyper, MnemonicKalman, NeuralImm, NeuralImmHyper, RmmNet, TrMtt,
    TrMttHyper,
};
use untrained::{TINY_ONE, network, tiny};

/// Allocations in 100 steps after ten, in their comparisons and states, and in copies over a belief of the same sizes.
fn allocations<F: Filter<4, Measurement = Measurement<2>>>(filter: &F) -> u64 {
    let seen: Measurement<2> = [10_000.0, 0.5].into();
    let mut belief = filter.birth(&seen).unwrap();
    let mut copy = belief.clone();
    let mut step = || {
        filter.predict(&mut belief, 1.0);
        filter.innovation(&belief, &seen).unwrap();
        filter.update(&mut belief, &seen).unwrap();
        copy.clone_from(&belief);
        filter.merge(&mut copy, 0.5, &belief, 0.5);
        filter.reach(&belief, &Search::default());
        filter.state(&belief)
    };
    (0..10).for_each(|_| {
        step();
    });
    measure(|| (0..100).for_each(|_| assert!(step().mean[0].is_finite()))).count_total
}

#[test]
fn the_counter_counts() {
    assert_eq!(measure(|| drop(std::hint::black_box(vec![1_u8]))).count_total, 1);
}

#[test]
fn kalman_nets_do_not_allocate() {
    let hypers = [
        KalmanNetHyper::paper(Architecture::one()),
        KalmanNetHyper::paper(Architecture::two()),
        tiny(TINY_ONE, Covariance::Joseph),
        tiny(Architecture::two(), Covariance::Joseph),
    ];
    for hyper in hypers {
        let radar = ConvertedPolar::new(50.0, 0.005).unwrap();
        let filter = KalmanNet::new(network(&hyper, 0.1), ConstantVelocity::new(1.0), radar);
        assert_eq!(allocations(&filter), 0, "{hyper:?}");
    }
}

#[test]
fn neural_imms_do_not_allocate() {
    let network = untrained::neural_imm(&NeuralImmHyper::default(), 0.1, 1);
    let radars = [0.003, 0.01].map(|bearing| RangeBearing::new(50.0, bearing).unwrap());
    assert_eq!(allocations(&NeuralImm::new(network.clone(), &radars).unwrap()), 0);
    assert_eq!(allocations(&NeuralImm::new(network, &radars[..1]).unwrap()), 0);
}

#[test]
fn ensembles_do_not_allocate() {
    let nets = vec![KalmanNetHyper::paper(Architecture::two()); 3];
    let hypers = [
        EnsKNetsHyper::ens_knets(nets.clone()),
        EnsKNetsHyper::att_ens_knets(nets),
        untrained::tiny_ensemble(),
        untrained::tiny_attention(),
    ];
    for hyper in hypers {
        let radar = ConvertedPolar::new(50.0, 0.005).unwrap();
        let filter = EnsKNets::new(untrained::ensemble(&hyper, 0.1), radar).unwrap();
        assert_eq!(allocations(&filter), 0, "{hyper:?}");
    }
}

#[test]
fn filters_that_learn_the_prediction_or_see_windows_do_not_allocate() {
    let radar = RangeBearing::new(50.0, 0.005).unwrap();
    for hyper in [MnemonicHyper::default(), MnemonicHyper::paper()] {
        assert_eq!(
            allocations(&MnemonicKalman::new(untrained::mnemonic(&hyper, 0.1), radar)),
            0,
            "{hyper:?}"
        );
    }
    for hyper in [untrained::small_deep_mtt(), DeepMttHyper { layers: vec![8], ..DeepMttHyper::paper() }] {
        assert_eq!(allocations(&DeepMtt::new(untrained::deep_mtt(&hyper, 0.1), radar)), 0, "{hyper:?}");
    }
    for hyper in [untrained::small_tr_mtt(), TrMttHyper { encoder: 1, decoder: 1, ..TrMttHyper::paper() }] {
        assert_eq!(allocations(&TrMtt::new(untrained::tr_mtt(&hyper, 0.1), radar)), 0, "{hyper:?}");
    }
}

#[test]
fn liquid_filters_do_not_allocate() {
    let radar = RangeBearing::new(50.0, 0.005).unwrap();
    let hypers = untrained::CELLS.map(untrained::small_liquid).into_iter().chain([untrained::paper_liquid()]);
    for hyper in hypers {
        assert_eq!(allocations(&LiquidKalman::new(untrained::liquid(&hyper, 1.0), radar)), 0, "{hyper:?}");
    }
}

/// Allocations in 100 rounds of twenty points, one and none, after ten.
fn allocations_with_points<F: Filter<4, Measurement = Points>>(filter: &F) -> u64 {
    let seen: Points = (0..20).map(|i| [100.0 + f64::from(i % 5), 50.0 + f64::from(i % 7)]).collect();
    let scans = [seen, Points::from_iter([[101.0, 51.0]]), Points::default()];
    let mut belief = filter.birth(&scans[1]).unwrap();
    let mut step = || {
        for scan in &scans {
            filter.predict(&mut belief, 1.0);
            filter.update(&mut belief, scan).unwrap();
            filter.reach(&belief, &Search::default());
        }
        filter.state(&belief)
    };
    (0..10).for_each(|_| {
        step();
    });
    measure(|| (0..100).for_each(|_| assert!(step().mean[0].is_finite()))).count_total
}

#[test]
fn rmm_nets_do_not_allocate_with_twenty_points_one_or_none() {
    let points = Scattering::uniform(nalgebra::Matrix2::identity()).unwrap();
    let network = untrained::rmm_net(&untrained::small_rmm_net(), 0.5);
    assert_eq!(allocations_with_points(&RmmNet::new(network, points)), 0);
}

#[test]
fn extent_nets_do_not_allocate_with_twenty_points_one_or_none() {
    let points = Scattering::uniform(nalgebra::Matrix2::identity()).unwrap();
    for hyper in [Frame::Absolute, Frame::Residual].into_iter().flat_map(untrained::small_extent_nets) {
        let network = untrained::extent_net(&hyper, 0.5);
        assert_eq!(allocations_with_points(&ExtentNet::new(network, points)), 0, "{hyper:?}");
    }
}
