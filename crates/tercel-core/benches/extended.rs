//! Time of one step of the filters of extended objects with 20 points a scan, and of the comparison of two
//! ellipses: `cargo bench -p tercel-core --bench extended`.

#![allow(clippy::unwrap_used)]

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use nalgebra::{Matrix2, Matrix3, vector};
use tercel_core::belief::Gaussian;
use tercel_core::extended::{
    Aligned, AlignedAutoRegressive, Ellipse, Evolution, InverseWishart, KnownSize, MemEkf, MemRbpf, Pointing,
    Points, RandomMatrix, Rule, Scattering,
};
use tercel_core::filter::Filter;
use tercel_core::metric::intersection_over_union;
use tercel_core::motion::ConstantVelocity;

fn main() {
    divan::main();
}

/// Steps timed together, so that the clock does not count.
const STEPS: u32 = 100;

fn steps<const N: usize>(bencher: Bencher, filter: impl Filter<N, Measurement = Points>) {
    let scan: Points =
        (0..20).map(|i| [5.0 * (f64::from(i) * 1.7).cos(), 1.5 * (f64::from(i) * 2.9).sin()]).collect();
    let mut belief = filter.birth(&scan).unwrap();
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        for _ in 0..STEPS {
            filter.predict(black_box(&mut belief), black_box(1.0));
            black_box(filter.update(&mut belief, black_box(&scan))).unwrap();
        }
    });
}

fn straight() -> ConstantVelocity {
    ConstantVelocity::new(1.0)
}

fn sensor() -> Scattering {
    Scattering::uniform(Matrix2::new(1.0, 0.0, 0.0, 0.64)).unwrap()
}

fn matrix(rule: Rule) -> RandomMatrix<ConstantVelocity> {
    let prior = InverseWishart::new(Matrix2::new(36.0, 0.0, 0.0, 1.5), 5.0).unwrap();
    RandomMatrix::new(straight(), sensor(), prior, Evolution::forget(1.0).unwrap(), rule)
}

#[divan::bench]
fn random_matrix(bencher: Bencher) {
    steps::<4>(bencher, matrix(Rule::Distorted));
}

#[divan::bench]
fn variational_5_sweeps(bencher: Bencher) {
    steps::<4>(bencher, matrix(Rule::Variational { sweeps: 5, tolerance: 0.0 }));
}

#[divan::bench]
fn mem_ekf(bencher: Bencher) {
    let shape =
        Gaussian::new(vector![0.0, 6.0, 1.25], Matrix3::from_diagonal(&vector![0.3, 0.4, 0.1])).unwrap();
    steps::<4>(bencher, MemEkf::new(straight(), sensor(), shape, vector![0.6, 1e-3, 1e-3]).unwrap());
}

#[divan::bench]
fn mem_rbpf_10_particles(bencher: Bencher) {
    let filter = MemRbpf::new(straight(), sensor(), vector![6.0, 1.25], 10, 1).unwrap();
    steps::<4>(bencher, filter.with_axes_variance(vector![0.4, 0.1]).unwrap());
}

#[divan::bench]
fn known_size(bencher: Bencher) {
    steps::<4>(bencher, KnownSize::new(straight(), sensor(), vector![6.0, 1.25], Pointing::Scan).unwrap());
}

#[divan::bench]
fn aligned(bencher: Bencher) {
    steps::<4>(bencher, Aligned::new(straight(), sensor(), vector![6.0, 1.25]).unwrap());
}

#[divan::bench]
fn aligned_auto_regressive_10(bencher: Bencher) {
    steps::<22>(bencher, AlignedAutoRegressive::<10>::new(sensor(), vector![6.0, 1.25], 1.0, 1.0).unwrap());
}

#[divan::bench]
fn intersection_over_union_of_two(bencher: Bencher) {
    let pairs: Vec<(Ellipse, Ellipse)> = (0..STEPS)
        .map(|i| {
            let turn = 0.37 * f64::from(i);
            let first = Ellipse::new(vector![0.0, 0.0], vector![6.0, 1.25], turn).unwrap();
            let center = vector![turn.sin(), 0.5 * turn.cos()];
            (first, Ellipse::new(center, vector![5.0, 1.5], 1.3 * turn).unwrap())
        })
        .collect();
    bencher.counter(ItemsCount::new(STEPS)).bench_local(|| {
        black_box(&pairs).iter().map(|(first, second)| intersection_over_union(first, second)).sum::<f64>()
    });
}
