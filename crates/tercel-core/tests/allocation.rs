//! No filter allocates memory in a step once it has warmed up.

#![allow(clippy::unwrap_used)]

use allocation_counter::measure;
use nalgebra::{Matrix2, vector};
use tercel_core::association::Search;
use tercel_core::belief::Gaussian;
use tercel_core::extended::{
    Aligned, AlignedAutoRegressive, Centroid, Evolution, InverseWishart, KnownSize, MemEkf, MemRbpf,
    Pointing, Points, RandomMatrix, Rule, Scattering,
};
use tercel_core::filter::{
    Extended, Filter, Imm, Kalman, Padded, Particle, RandomTurns, RaoBlackwellised, Transition, Unscented,
};
use tercel_core::motion::{ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Turn};
use tercel_core::sensor::{Measurement, Position, RangeBearing};

/// Allocations in 100 steps after ten, and in the comparison and the state of each.
fn allocations<const N: usize, F>(filter: &F, seen: [f64; 2]) -> u64
where
    F: Filter<N, Measurement = Measurement<2>>,
{
    let seen: Measurement<2> = seen.into();
    let mut belief = filter.birth(&seen).unwrap();
    let mut step = || {
        filter.predict(&mut belief, 1.0);
        filter.innovation(&belief, &seen).unwrap();
        filter.update(&mut belief, &seen).unwrap();
        filter.reach(&belief, &Search::default());
        filter.state(&belief)
    };
    (0..10).for_each(|_| {
        step();
    });
    measure(|| (0..100).for_each(|_| assert!(step().mean[0].is_finite()))).count_total
}

fn radar() -> Position<2> {
    Position::new(5.0).unwrap()
}

fn polar() -> RangeBearing {
    RangeBearing::new(5.0, 0.01).unwrap()
}

#[test]
fn the_counter_counts() {
    assert_eq!(measure(|| drop(std::hint::black_box(vec![1_u8]))).count_total, 1);
}

#[test]
fn filters_with_one_model_do_not_allocate() {
    let straight = ConstantVelocity::new(0.5);
    assert_eq!(allocations::<4, _>(&Kalman::new(straight, radar()), [100.0, 50.0]), 0);
    assert_eq!(allocations::<4, _>(&Extended::new(straight, polar()), [1000.0, 0.5]), 0);
    assert_eq!(
        allocations::<5, _>(&Unscented::new(CoordinatedTurn::new(0.5, 1e-4), polar()), [1000.0, 0.5]),
        0
    );
    let padded = Padded::<_, 4>::new(Kalman::new(straight, radar()), 2.0).unwrap();
    assert_eq!(allocations::<6, _>(&padded, [100.0, 50.0]), 0);
}

#[test]
fn interacting_models_do_not_allocate() {
    let modes = [0.0, 0.1, -0.1].map(|rate| Kalman::new(Turn::new(rate, 0.5), radar()));
    for transition in [Transition::sticky(0.9), Transition::sticky(0.9).per(3.0)] {
        let imm = Imm::new(modes, transition).unwrap();
        assert_eq!(allocations::<4, _>(&imm, [100.0, 50.0]), 0);
    }
    // With parts in continuous time, the matrix is computed anew at every step.
    let noise = Transition::sticky(1.0);
    let joint = Transition::joint([(Transition::sticky(0.9).per(3.0), 3), (noise, 2)]);
    let grid = modes.into_iter().flat_map(|mode| [mode, mode]);
    assert_eq!(allocations::<4, _>(&Imm::new(grid, joint).unwrap(), [100.0, 50.0]), 0);
    type Boxed = Box<dyn Filter<6, Belief = Gaussian<6>, Measurement = Measurement<2>>>;
    let boxes: [Boxed; 2] = [
        Box::new(Padded::<_, 4>::new(Kalman::new(ConstantVelocity::new(0.5), radar()), 2.0).unwrap()),
        Box::new(Unscented::new(ConstantAcceleration::new(0.5), radar())),
    ];
    let imm = Imm::new(boxes, Transition::sticky(0.9)).unwrap();
    assert_eq!(allocations::<6, _>(&imm, [100.0, 50.0]), 0);
}

#[test]
fn particles_do_not_allocate_even_when_they_are_resampled() {
    let straight = ConstantVelocity::new(0.5);
    let filter = Particle::new(straight, radar(), 200, 1).unwrap().with_threshold(1.0).unwrap();
    assert_eq!(allocations::<4, _>(&filter, [100.0, 50.0]), 0);
    let modes = [1, 2].map(|seed| Particle::new(straight, radar(), 200, seed).unwrap());
    let imm = Imm::new(modes, Transition::sticky(0.9)).unwrap();
    assert_eq!(allocations::<4, _>(&imm, [100.0, 50.0]), 0);
}

#[test]
fn rao_blackwellised_particles_do_not_allocate_even_when_they_are_resampled() {
    let turns = RandomTurns::new(0.05, 0.2, 0.5..=5.0).unwrap();
    let filter = RaoBlackwellised::new(turns, radar(), 200, 1).unwrap().with_threshold(1.0).unwrap();
    assert_eq!(allocations::<4, _>(&filter, [100.0, 50.0]), 0);
}

/// The same for filters of extended objects, with scans of twenty points, of one and of none.
fn scans_allocate<const N: usize, F>(filter: &F) -> u64
where
    F: Filter<N, Measurement = Points>,
{
    let seen: Points = (0..20).map(|i| [100.0 + f64::from(i % 5), 50.0 + f64::from(i % 7)]).collect();
    let scans = [seen, Points::from_iter([[101.0, 51.0]]), Points::default()];
    let mut belief = filter.birth(&scans[0]).unwrap();
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
fn filters_of_extended_objects_do_not_allocate() {
    let straight = ConstantVelocity::new(0.5);
    let points = Scattering::uniform(Matrix2::identity()).unwrap();
    let size = InverseWishart::new(Matrix2::identity() * 9.0, 5.0).unwrap();
    let evolution = Evolution::forget(10.0).unwrap();
    let axes = vector![3.0, 2.0];
    let modes = [Rule::Direct, Rule::Distorted, Rule::Variational { sweeps: 5, tolerance: 0.0 }]
        .map(|rule| RandomMatrix::new(straight, points, size, evolution, rule));
    for filter in &modes {
        assert_eq!(scans_allocate::<4, _>(filter), 0);
    }
    assert_eq!(scans_allocate::<4, _>(&Imm::new(modes, Transition::sticky(0.9)).unwrap()), 0);
    assert_eq!(scans_allocate::<4, _>(&Centroid::new(straight, points, size.mean()).unwrap()), 0);
    assert_eq!(scans_allocate::<4, _>(&KnownSize::new(straight, points, axes, Pointing::Scan).unwrap()), 0);
    assert_eq!(scans_allocate::<4, _>(&Aligned::new(straight, points, axes).unwrap()), 0);
    assert_eq!(scans_allocate::<8, _>(&AlignedAutoRegressive::<3>::new(points, axes, 1.0, 1.0).unwrap()), 0);
    let shape = Gaussian::new(vector![0.0, 3.0, 2.0], nalgebra::Matrix3::identity() * 0.1).unwrap();
    let growth = vector![0.1, 0.01, 0.01];
    assert_eq!(scans_allocate::<4, _>(&MemEkf::new(straight, points, shape, growth).unwrap()), 0);
    let particles = MemRbpf::new(straight, points, axes, 10, 1).unwrap().with_axes_variance(axes).unwrap();
    assert_eq!(scans_allocate::<4, _>(&particles), 0);
}
