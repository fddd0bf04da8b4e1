//! Every filter of the crate passes the conformance suite.

#![allow(clippy::unwrap_used)]

#[path = "conformance/extended.rs"]
mod extended;
#[path = "conformance/polar.rs"]
mod polar;
#[path = "conformance/regimes.rs"]
mod regimes;

use tercel_core::belief::Gaussian;
use tercel_core::conformance;
use tercel_core::conformance::{Expectations, Problem, positions};
use tercel_core::filter::{
    Extended, Filter, Imm, Kalman, Padded, Particle, RaoBlackwellised, SigmaPoints, Transition, Unscented,
};
use tercel_core::motion::{ConstantAcceleration, ConstantVelocity, Turn};
use tercel_core::sensor::{Measurement, Position};

type Linear = Kalman<ConstantVelocity, Position<2>>;
type Boxed<const N: usize> = Box<dyn Filter<N, Belief = Gaussian<N>, Measurement = Measurement<2>>>;

fn kalman(problem: &Problem) -> Linear {
    Kalman::new(problem.motion(), problem.sensor())
}

/// Modes that are all the right model, so that the mixture is too.
fn imm_of_equals(problem: &Problem) -> Imm<Linear> {
    Imm::new([0; 3].map(|_| kalman(problem)), Transition::sticky(0.9).per(1.0)).unwrap()
}

fn imm_of_turns(problem: &Problem) -> Imm<Kalman<Turn, Position<2>>> {
    let modes = [0.0, 0.05, -0.05]
        .map(|rate| Kalman::new(Turn::new(rate, problem.density).with_speed(20.0), problem.sensor()));
    Imm::new(modes, Transition::sticky(0.95)).unwrap()
}

/// Filters of different types and state lengths.
fn imm_of_types(problem: &Problem) -> Imm<Boxed<6>> {
    let accelerating = ConstantAcceleration::new(problem.density).with_speed(20.0).with_acceleration(1.0);
    let modes: [Boxed<6>; 3] = [
        Box::new(Padded::<_, 4>::new(kalman(problem), 2.0).unwrap()),
        Box::new(Kalman::new(accelerating, problem.sensor())),
        Box::new(Unscented::new(accelerating, problem.sensor())),
    ];
    Imm::new(modes, Transition::sticky(0.95).per(1.0)).unwrap()
}

fn unscented(problem: &Problem) -> Unscented<ConstantVelocity, Position<2>> {
    Unscented::new(problem.motion(), problem.sensor())
}

conformance!(kalman_filter, positions::<4, _, _>(Expectations::exact(), kalman));
conformance!(
    extended_filter,
    positions::<4, _, _>(Expectations::exact(), |p| Extended::new(p.motion(), p.sensor()))
);
conformance!(unscented_filter, positions::<4, _, _>(Expectations::exact(), unscented));
conformance!(
    unscented_filter_with_close_points,
    positions::<4, _, _>(Expectations::exact(), |p| {
        unscented(p).with_points(SigmaPoints::new(0.01, 2.0, 1.0).unwrap())
    })
);
conformance!(imm_with_equal_modes, positions::<4, _, _>(Expectations::exact(), imm_of_equals));
conformance!(imm_with_turns, positions::<4, _, _>(Expectations::own_models(), imm_of_turns));
conformance!(imm_with_boxes, positions::<6, _, _>(Expectations::own_models(), imm_of_types));
conformance!(
    nested_imm,
    positions::<4, _, _>(Expectations::exact(), |p| {
        Imm::new([imm_of_equals(p), imm_of_equals(p)], Transition::sticky(0.9)).unwrap()
    })
);
conformance!(
    padded_filter,
    positions::<6, _, _>(Expectations::exact(), |p| Padded::<_, 4>::new(kalman(p), 2.0).unwrap())
);
conformance!(
    boxed_filter,
    positions::<4, _, _>(Expectations::exact(), |p| -> Boxed<4> { Box::new(kalman(p)) })
);
conformance!(extended_filter_of_range_and_bearing, polar::Polar(polar::extended));
conformance!(unscented_filter_of_range_and_bearing, polar::Polar(polar::unscented));
fn smoothed(problem: &Problem, count: usize, seed: u64) -> Particle<ConstantVelocity, Position<2>> {
    let filter = Particle::new(problem.motion(), problem.sensor(), count, seed).unwrap();
    filter.with_smoothing(0.35).unwrap()
}

/// Without smoothing few particles survive the first updates of a vague birth, and the filter is too sure of itself.
const PLAIN: Expectations = Expectations { kalman: Some(1.0), consistent: None, ..Expectations::sampled() };

conformance!(
    smoothed_particle_filter,
    positions::<4, _, _>(Expectations::sampled(), |p| smoothed(p, 6000, 1))
);
conformance!(
    particle_filter,
    positions::<4, _, _>(PLAIN, |p| Particle::new(p.motion(), p.sensor(), 3000, 1).unwrap())
);
conformance!(
    imm_with_particles,
    positions::<4, _, _>(Expectations { consistent: None, ..Expectations::sampled() }, |p| {
        Imm::new([1, 2].map(|seed| smoothed(p, 2000, seed)), Transition::sticky(0.9)).unwrap()
    })
);

conformance!(
    rao_blackwellised_filter_of_one_mode,
    positions::<4, _, _>(Expectations::exact(), |p| {
        RaoBlackwellised::new(regimes::Equal::of(p, 1), p.sensor(), 2, 1).unwrap()
    })
);
conformance!(
    rao_blackwellised_filter_of_equal_modes,
    positions::<4, _, _>(Expectations { extremes: false, ..Expectations::exact() }, |p| {
        RaoBlackwellised::new(regimes::Equal::of(p, 3), p.sensor(), 6, 1).unwrap()
    })
);
conformance!(
    rao_blackwellised_filter_of_levels,
    positions::<4, _, _>(Expectations::sampled(), |p| {
        RaoBlackwellised::new(regimes::Levels::of(p), p.sensor(), 20, 1).unwrap()
    })
);
conformance!(
    rao_blackwellised_filter_of_turns,
    positions::<4, _, _>(Expectations { moments: Some(1e-6), ..Expectations::own_models() }, |p| {
        RaoBlackwellised::new(regimes::turns(p), p.sensor(), 5, 1).unwrap()
    })
);

conformance!(random_matrix_direct, extended::exact(|p| extended::matrix(p, extended::Kind::Direct)));
conformance!(random_matrix_distorted, extended::exact(|p| extended::matrix(p, extended::Kind::Distorted)));
conformance!(
    random_matrix_variational,
    extended::exact(|p| extended::matrix(p, extended::Kind::Variational))
);
conformance!(imm_of_random_matrices, extended::exact(extended::interacting));
conformance!(random_matrix_of_unknown_shape, extended::own::<4, _, _>(extended::unknown));
conformance!(mem_ekf, extended::exact(extended::linearised));
conformance!(mem_rbpf, extended::exact(extended::sampled));
conformance!(known_size, extended::exact(extended::known));
conformance!(aligned, extended::exact(extended::aligned));
conformance!(aligned_auto_regressive, extended::own::<8, _, _>(extended::regressive));
conformance!(centroid, extended::own::<4, _, _>(extended::centroid));

#[test]
fn the_bounds_of_the_suite_are_those_of_the_chi_square_distribution() {
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    for (dof, tail, normal) in [(800.0, 0.005, -2.575_829_3), (800.0, 0.995, 2.575_829_3)] {
        let exact = ChiSquared::new(dof).unwrap().inverse_cdf(tail);
        assert!((conformance::chi_square(dof, normal) / exact - 1.0).abs() < 1e-4);
    }
}
