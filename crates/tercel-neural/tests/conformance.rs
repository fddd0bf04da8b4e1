//! Learned filters keep the promises of every filter.

// The suite of core has helpers that only the filters of core use.
#[path = "../../tercel-core/tests/conformance/extended.rs"]
#[allow(dead_code, clippy::unwrap_used)]
mod extended;
mod untrained;

use tercel_core::conformance;
use tercel_core::conformance::{Expectations, Problem, positions};
use tercel_core::filter::{Imm, Transition};
use tercel_core::motion::ConstantVelocity;
use tercel_core::sensor::Position;
use tercel_neural::filter::extent_net::Frame;
use tercel_neural::filter::{
    Architecture, Covariance, DeepMtt, Derivative, EnsKNets, EnsKNetsHyper, ExtentNet, KalmanNet,
    KalmanNetHyper, LiquidHyper, LiquidKalman, MnemonicKalman, NeuralImm, Normalisation, RmmNet, TrMtt,
};
use untrained::{TINY_ONE, TINY_TWO, network, tiny};

fn net(hyper: &KalmanNetHyper, problem: &Problem) -> KalmanNet<ConstantVelocity, Position<2>> {
    KalmanNet::new(network(hyper, 0.05), problem.motion(), problem.sensor())
}

/// A gain for steps of a second makes no sense for steps of a quarter of an hour, and this covariance says so.
const ORDINARY_TIMES: Expectations = Expectations { extremes: false, ..Expectations::own_models() };

conformance!(
    kalman_net_one,
    positions::<4, _, _>(ORDINARY_TIMES, |p| net(&tiny(TINY_ONE, Covariance::Riccati), p))
);
conformance!(
    kalman_net_two,
    positions::<4, _, _>(ORDINARY_TIMES, |p| net(&tiny(TINY_TWO, Covariance::Riccati), p))
);
// The covariance of the publication does not depend on the network: the smallest one shows that it survives.
conformance!(
    kalman_net_at_extreme_noises,
    positions::<4, _, _>(Expectations::own_models(), |p| {
        let smallest = Architecture::Stacked { input: 1, hidden: 1, layers: 1, head: 0 };
        let gain_offset = Some(untrained::ALPHA_BETA);
        net(&KalmanNetHyper { gain_offset, ..KalmanNetHyper::paper(smallest) }, p)
    })
);
conformance!(
    kalman_net_with_the_covariance_of_its_gain,
    positions::<4, _, _>(ORDINARY_TIMES, |p| net(&tiny(TINY_TWO, Covariance::Joseph), p))
);
conformance!(
    kalman_net_of_the_publication,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        let gain_offset = Some(untrained::ALPHA_BETA);
        net(&KalmanNetHyper { gain_offset, ..KalmanNetHyper::paper(Architecture::two()) }, p)
    })
);
conformance!(
    imm_of_kalman_nets,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        let modes = [TINY_ONE, TINY_TWO].map(|a| net(&tiny(a, Covariance::Joseph), p));
        Imm::new(modes, Transition::sticky(0.95)).unwrap()
    })
);
#[allow(clippy::unwrap_used)]
fn ensemble(hyper: &EnsKNetsHyper, problem: &Problem) -> EnsKNets<Position<2>> {
    EnsKNets::new(untrained::ensemble(hyper, 0.02), problem.sensor()).unwrap()
}

conformance!(
    ensemble_of_kalman_nets,
    positions::<4, _, _>(ORDINARY_TIMES, |p| ensemble(&untrained::tiny_ensemble(), p))
);
conformance!(
    ensemble_with_attention,
    positions::<4, _, _>(ORDINARY_TIMES, |p| ensemble(&untrained::tiny_attention(), p))
);
conformance!(
    average_of_kalman_nets,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        let plain = EnsKNetsHyper {
            correction: None,
            classification: None,
            normalisation: Normalisation::Relative,
            ..untrained::tiny_ensemble()
        };
        ensemble(&plain, p)
    })
);
// Its bank merges to the moments of the two; what the network adds to the merged bank is not the mean of what it added.
conformance!(
    neural_imm,
    positions::<4, _, _>(Expectations { moments: None, ..ORDINARY_TIMES }, |p| {
        NeuralImm::new(untrained::neural_imm(&untrained::small_bank(), 0.3, 1), &[p.sensor()]).unwrap()
    })
);
conformance!(
    mnemonic_kalman,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        MnemonicKalman::new(untrained::mnemonic(&untrained::small_mnemonic(), 0.3), p.sensor())
    })
);
conformance!(
    imm_of_mnemonic_kalman_filters,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        let filter =
            |size| MnemonicKalman::new(untrained::mnemonic(&untrained::small_mnemonic(), size), p.sensor());
        Imm::new([filter(0.1), filter(0.3)], Transition::sticky(0.95)).unwrap()
    })
);
// Merging takes the mean of what the networks add, which is not what they would add to the merged front end.
conformance!(
    deep_mtt,
    positions::<4, _, _>(Expectations { moments: None, ..ORDINARY_TIMES }, |p| {
        DeepMtt::new(untrained::deep_mtt(&untrained::small_deep_mtt(), 0.3), p.sensor())
    })
);
conformance!(
    tr_mtt,
    positions::<4, _, _>(Expectations { moments: None, ..ORDINARY_TIMES }, |p| {
        TrMtt::new(untrained::tr_mtt(&untrained::small_tr_mtt(), 0.3), p.sensor())
    })
);

fn liquid(hyper: &LiquidHyper, problem: &Problem) -> LiquidKalman<Position<2>> {
    LiquidKalman::new(untrained::liquid(hyper, 1.0), problem.sensor())
}

conformance!(
    liquid_kalman,
    positions::<4, _, _>(ORDINARY_TIMES, |p| liquid(&untrained::small_liquid(untrained::CELLS[0]), p))
);
conformance!(
    liquid_kalman_with_a_closed_form_and_differences,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        let jacobian = Derivative::Difference { step: 0.1 };
        liquid(&LiquidHyper { jacobian, ..untrained::small_liquid(untrained::CELLS[3]) }, p)
    })
);
conformance!(
    gated_kalman,
    positions::<4, _, _>(ORDINARY_TIMES, |p| liquid(&untrained::small_liquid(untrained::CELLS[4]), p))
);
conformance!(
    imm_of_liquid_kalman_filters,
    positions::<4, _, _>(ORDINARY_TIMES, |p| {
        let filters = [0, 5].map(|cell| liquid(&untrained::small_liquid(untrained::CELLS[cell]), p));
        Imm::new(filters, Transition::sticky(0.95)).unwrap()
    })
);

#[allow(clippy::unwrap_used)]
fn rmm_net(problem: &Problem) -> RmmNet {
    let scattering = tercel_core::extended::Scattering::uniform(problem.noise() * 0.5).unwrap();
    RmmNet::new(untrained::rmm_net(&untrained::small_rmm_net(), 0.3), scattering)
}

conformance!(rmm_net_on_single_points, extended::own::<4, _, _>(rmm_net));
conformance!(
    imm_of_rmm_nets,
    extended::own::<4, _, _>(|p| Imm::new([rmm_net(p), rmm_net(p)], Transition::sticky(0.95)).unwrap())
);

#[allow(clippy::unwrap_used)]
fn extent_net(problem: &Problem, frame: Frame, memory: usize) -> ExtentNet {
    let scattering = tercel_core::extended::Scattering::uniform(problem.noise() * 0.5).unwrap();
    // Networks that were not trained do not know how far off they are; small weights keep them near.
    let size = if frame == Frame::Absolute { 0.05 } else { 0.1 };
    let hyper = &untrained::small_extent_nets(frame)[memory];
    ExtentNet::new(untrained::extent_net(hyper, size), scattering)
}

conformance!(lstm_alone, extended::own::<4, _, _>(|p| extent_net(p, Frame::Residual, 0)));
conformance!(transformer_alone, extended::own::<4, _, _>(|p| extent_net(p, Frame::Residual, 1)));
conformance!(lstm_of_the_publication, extended::own::<4, _, _>(|p| extent_net(p, Frame::Absolute, 0)));
conformance!(transformer_of_the_publication, extended::own::<4, _, _>(|p| extent_net(p, Frame::Absolute, 1)));
conformance!(
    imm_of_transformers,
    extended::own::<4, _, _>(|p| {
        let modes = [0, 1].map(|_| extent_net(p, Frame::Residual, 1));
        Imm::new(modes, Transition::sticky(0.95)).unwrap()
    })
);
