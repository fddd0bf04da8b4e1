use nalgebra::{matrix, vector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::extended::Ellipse;
use crate::motion::ConstantVelocity;

const RULES: [Rule; 3] = [Rule::Direct, Rule::Distorted, Rule::Variational { sweeps: 20, tolerance: 1e-6 }];

fn filter(rule: Rule) -> RandomMatrix<ConstantVelocity> {
    let scattering = Scattering::uniform(matrix![1.0, 0.0; 0.0, 0.64]).unwrap();
    let mean = matrix![16.0, 0.0; 0.0, 4.0];
    let prior = InverseWishart::new(if rule == Rule::Direct { scattering.spread(&mean) } else { mean }, 6.0);
    let motion = ConstantVelocity::new(0.01).with_speed(3.0);
    RandomMatrix::new(motion, scattering, prior.unwrap(), Evolution::forget(f64::INFINITY).unwrap(), rule)
}

/// A scan of an ellipse at `place`: normal points with the covariance of an even spread.
fn scan(place: Vector2<f64>, extent: &Matrix2<f64>, count: usize, random: &mut ChaCha8Rng) -> Points {
    let half = root(&(extent * 0.25 + matrix![1.0, 0.0; 0.0, 0.64]));
    (0..count).map(|_| place + half * Vector2::from_fn(|_, _| StandardNormal.sample(random))).collect()
}

#[test]
fn every_rule_finds_position_velocity_and_extent() {
    let truth = Ellipse::new(vector![0.0, 0.0], vector![6.0, 1.25], 0.7).unwrap().matrix();
    for rule in RULES {
        let (filter, mut random) = (filter(rule), ChaCha8Rng::seed_from_u64(4));
        let mut belief: GaussianInverseWishart<4> =
            filter.birth(&scan(vector![0.0, 0.0], &truth, 20, &mut random)).unwrap();
        for step in 1..=200 {
            filter.predict(&mut belief, 1.0);
            let place = vector![2.0, -1.0] * f64::from(step);
            filter.update(&mut belief, &scan(place, &truth, 20, &mut random)).unwrap();
        }
        let error = belief.state.mean - vector![400.0, -200.0, 2.0, -1.0];
        assert!(error.norm() < 0.6, "{rule:?}: {error}");
        let extent = filter.estimate(&belief).extent.unwrap();
        assert!((extent - truth).norm() < 0.06 * truth.norm(), "{rule:?}: {extent}");
    }
}

#[test]
fn the_likelihood_is_that_of_normal_points_when_the_extent_is_known() {
    let extent = matrix![9.0, 2.0; 2.0, 4.0];
    let (spread, prior) =
        (extent * 0.25 + matrix![1.0, 0.0; 0.0, 0.64], InverseWishart::new(extent, 1e9).unwrap());
    let state = Gaussian::new(vector![1.0, 2.0], matrix![0.5, 0.1; 0.1, 0.3]).unwrap();
    let belief = GaussianInverseWishart { state, extent: prior, rate: None };
    let filter = filter(Rule::Distorted);
    for count in [1, 2, 7, 60, 1000] {
        let points = scan(vector![0.5, 2.2], &extent, count, &mut ChaCha8Rng::seed_from_u64(5));
        let squares = filter.squares(&belief, &points, &spread);
        let found = likelihood::ln_points(&prior, &spread, &squares, &points, &state);
        let n = count as f64;
        let mean = Gaussian { mean: state.mean, covariance: state.covariance + spread / n };
        let expected = mean.ln_density(&points.mean()).unwrap()
            + crate::extended::orientation::ln_scatter(&spread, &points);
        assert!((found - expected).abs() < 1e-5 * expected.abs() + 1e-4, "{count}: {found}, not {expected}");
    }
}

#[test]
fn the_likelihood_integrates_over_the_extent() {
    // With the state known and points at the scale of the extent, the product of predictive densities is the
    // joint one.
    let filter = RandomMatrix::new(
        ConstantVelocity::new(0.0),
        Scattering::direct(),
        InverseWishart::new(matrix![4.0, 1.0; 1.0, 3.0], 5.0).unwrap(),
        Evolution::forget(f64::INFINITY).unwrap(),
        Rule::Distorted,
    );
    let points = [[0.4, 1.0], [-2.0, 0.3], [1.0, -1.4], [0.2, 0.1]];
    let start = GaussianInverseWishart {
        state: Gaussian { mean: vector![0.0, 0.0], covariance: Matrix2::identity() * 1e-14 },
        extent: filter.prior,
        rate: None,
    };
    let mut belief = start;
    let one_by_one: f64 = points
        .iter()
        .map(|point| {
            let innovation = filter.update(&mut belief, &Points::from_iter([*point])).unwrap();
            belief.state = start.state;
            innovation.log_likelihood
        })
        .sum();
    let mut belief = start;
    let at_once = filter.update(&mut belief, &Points::from_iter(points)).unwrap().log_likelihood;
    assert!((one_by_one - at_once).abs() < 1e-6, "{one_by_one} and {at_once}");
}

#[test]
fn every_scan_leaves_a_sound_belief() {
    let coincident = Points::from(vec![vector![3.0, 1.0]; 20]);
    let collinear: Points = (0..20).map(|i| vector![f64::from(i), 2.0 * f64::from(i)]).collect();
    let many = scan(vector![2.0, 2.0], &Matrix2::identity(), 1000, &mut ChaCha8Rng::seed_from_u64(6));
    let far = Points::from_iter([[1e7, -1e7], [1e7, 1e7]]);
    for rule in RULES {
        let filter = filter(rule);
        let mut belief: GaussianInverseWishart<4> = filter.birth(&Points::from_iter([[0.0, 0.0]])).unwrap();
        for points in [&Points::default(), &coincident, &collinear, &many, &far, &coincident].repeat(20) {
            filter.predict(&mut belief, 1.0);
            filter.update(&mut belief, points).unwrap();
            let extent = filter.estimate(&belief).extent.unwrap();
            assert!(extent.m11 > 0.0 && extent.determinant() > 0.0, "{rule:?}: {extent}");
        }
        let before = belief;
        let bad = Points::from_iter([[0.0, 0.0], [f64::NAN, 1.0]]);
        assert!(filter.update(&mut belief, &bad).is_err() && belief == before);
        assert!(Filter::<4>::birth(&filter, &Points::default()).is_err());
    }
}

#[test]
fn an_empty_scan_speaks_against_many_points_only_with_a_rate() {
    let plain = filter(Rule::Distorted);
    let rated = plain.with_rate(Rate::new(20.0, 5.0).unwrap(), 100.0).unwrap();
    let first = Points::from_iter([[0.0, 0.0], [1.0, 1.0]]);
    for (filter, tells) in [(plain, false), (rated, true)] {
        let mut belief: GaussianInverseWishart<4> = filter.birth(&first).unwrap();
        filter.predict(&mut belief, 1.0);
        let innovation = filter.update(&mut belief, &Points::default()).unwrap();
        assert_eq!(innovation.log_likelihood < -5.0, tells);
        assert_eq!(belief.rate.is_some_and(|rate| rate.mean() < 18.0), tells);
    }
}
