//! Scans that no sensor should give, for every filter of extended objects: each ends in a sound belief or in an error that
//! leaves the belief as it was.

#![allow(clippy::unwrap_used)]

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, vector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tercel_core::belief::Gaussian;
use tercel_core::extended::{
    Aligned, AlignedAutoRegressive, Centroid, Evolution, Freedom, InverseWishart, KnownSize, MemEkf, MemRbpf,
    Pointing, Points, RandomMatrix, Rule, Scattering,
};
use tercel_core::filter::{Estimate, Filter, Imm, Transition};
use tercel_core::motion::ConstantVelocity;

fn motion() -> ConstantVelocity {
    ConstantVelocity::new(0.5).with_speed(20.0)
}

fn scattering() -> Scattering {
    Scattering::uniform(Matrix2::new(1.0, 0.2, 0.2, 0.64)).unwrap()
}

fn matrix(evolution: Evolution, rule: Rule) -> RandomMatrix<ConstantVelocity> {
    let prior = InverseWishart::new(Matrix2::identity() * 9.0, 5.0).unwrap();
    RandomMatrix::new(motion(), scattering(), prior, evolution, rule)
}

/// Scans without points, with one, with all on one place or on a line, with a thousand, with the axes swapped, with objects
/// that shrink to nothing, and with points far away.
fn scans() -> Vec<Points> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut cloud = |count: usize, axes: [f64; 2]| -> Points {
        let mut coordinate = |axis: f64| axis * (random.random::<f64>() - 0.5);
        (0..count).map(|_| vector![coordinate(axes[0]), coordinate(axes[1])]).collect()
    };
    vec![
        Points::default(),
        Points::from_iter([[0.5, -0.5]]),
        Points::from(vec![vector![3.0, 1.0]; 20]),
        (0..20).map(|i| vector![f64::from(i), 2.0 * f64::from(i)]).collect(),
        cloud(1000, [8.0, 2.0]),
        cloud(20, [2.0, 8.0]),
        cloud(20, [1e-9, 1e-9]),
        cloud(20, [1e-12, 30.0]),
        Points::from_iter([[1e7, -1e7], [1e7, 1e7]]),
        Points::from_iter([[1e-300, 0.0], [0.0, -1e-300]]),
        cloud(20, [8.0, 2.0]),
    ]
}

fn sound<const N: usize>(name: &str, scan: usize, Estimate { mean, covariance, extent, .. }: Estimate<N>) {
    assert!(mean.iter().all(|value| value.is_finite()), "{name}, scan {scan}: {mean}");
    assert_eq!(covariance, covariance.transpose(), "{name}, scan {scan}");
    assert!(covariance.cholesky().is_some(), "{name}, scan {scan}: {covariance}");
    let extent = extent.unwrap();
    assert!(
        extent.m11 > 0.0 && extent.m22 > 0.0 && extent.determinant() > 0.0,
        "{name}, scan {scan}: {extent}"
    );
}

/// What a filter says, without the room in which it computes.
fn known<const N: usize, F: Filter<N>>(
    filter: &F,
    belief: &F::Belief,
) -> (SVector<f64, N>, SMatrix<f64, N, N>, Vec<f64>, Option<Matrix2<f64>>) {
    let Estimate { mean, covariance, modes, extent } = filter.estimate(belief);
    (mean, covariance, modes, extent)
}

fn survives<const N: usize, F>(name: &str, filter: F)
where
    F: Filter<N, Measurement = Points>,
{
    assert!(filter.birth(&Points::default()).is_err(), "{name}: an object without a point");
    let mut belief = filter.birth(&Points::from_iter([[0.0, 0.0]])).unwrap();
    for (number, scan) in scans().iter().cycle().take(200).enumerate() {
        filter.predict(&mut belief, if number % 7 == 0 { 0.0 } else { 1.0 });
        let before = known(&filter, &belief);
        match filter.update(&mut belief, scan) {
            Ok(innovation) => assert!(!innovation.log_likelihood.is_nan(), "{name}, scan {number}"),
            Err(_) => assert_eq!(known(&filter, &belief), before, "{name}, scan {number}"),
        }
        sound(name, number, filter.estimate(&belief));
    }
    let before = known(&filter, &belief);
    for bad in [f64::NAN, f64::INFINITY] {
        let scan = Points::from_iter([[0.0, 0.0], [bad, 1.0], [2.0, 0.0]]);
        assert!(filter.update(&mut belief, &scan).is_err(), "{name}: {bad}");
        assert_eq!(known(&filter, &belief), before, "{name}: {bad}");
    }
}

#[test]
fn random_matrices_survive_them() {
    let forgetting = Evolution::forget(5.0).unwrap();
    let wishart = |freedom| Evolution::wishart(40.0, freedom).unwrap();
    let variational = Rule::Variational { sweeps: 5, tolerance: 0.0 };
    for rule in [Rule::Direct, Rule::Distorted, variational] {
        survives::<4, _>(&format!("{rule:?}, forgetting"), matrix(forgetting, rule));
        for freedom in [Freedom::Exact, Freedom::Printed] {
            survives::<4, _>(&format!("{rule:?}, {freedom:?}"), matrix(wishart(freedom), rule));
        }
    }
    let modes = [0.0, 0.3, -0.3].map(|rate| matrix(forgetting.with_turn_rate(rate), Rule::Distorted));
    survives::<4, _>("interacting", Imm::new(modes, Transition::sticky(0.9)).unwrap());
}

#[test]
fn multiplicative_errors_survive_them() {
    let axes = vector![4.0, 1.0];
    let shape =
        Gaussian::new(vector![0.0, 4.0, 1.0], Matrix3::from_diagonal(&vector![1.0, 0.5, 0.5])).unwrap();
    survives::<4, _>(
        "MEM-EKF*",
        MemEkf::new(motion(), scattering(), shape, vector![0.1, 0.01, 0.01]).unwrap(),
    );
    let particles = MemRbpf::new(motion(), scattering(), axes, 10, 1).unwrap();
    let particles = particles.with_axes_variance(axes).unwrap().with_growth(Vector2::repeat(0.1)).unwrap();
    survives::<4, _>("MEM-RBPF", particles);
    survives::<4, _>("MEM-RBPF with positions", particles.with_position());
}

#[test]
fn centroids_and_objects_of_known_size_survive_them() {
    let axes = vector![4.0, 1.0];
    survives::<4, _>("centroid", Centroid::new(motion(), scattering(), Matrix2::identity() * 9.0).unwrap());
    for pointing in [Pointing::Scan, Pointing::Course] {
        survives::<4, _>(
            &format!("known size, {pointing:?}"),
            KnownSize::new(motion(), scattering(), axes, pointing).unwrap(),
        );
    }
    survives::<4, _>("aligned", Aligned::new(motion(), scattering(), axes).unwrap());
    let coefficients =
        Gaussian { mean: SVector::<f64, 3>::new(1.0, 0.0, 0.0), covariance: Matrix3::identity() };
    let regressive = AlignedAutoRegressive::<3>::new(scattering(), axes, 1.0, 1.0).unwrap();
    survives::<8, _>("aligned, AR", regressive.with_coefficients(coefficients));
}
