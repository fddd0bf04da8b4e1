use nalgebra::{Vector2, matrix};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::extended::symmetric::root;

/// A sum of squares of `count` normal vectors with this covariance.
fn wishart(covariance: &Matrix2<f64>, count: usize, random: &mut ChaCha8Rng) -> Matrix2<f64> {
    let root = root(covariance);
    let mut sum = Matrix2::zeros();
    for _ in 0..count {
        let vector = root * Vector2::from_fn(|_, _| -> f64 { StandardNormal.sample(random) });
        sum += vector * vector.transpose();
    }
    sum
}

/// An extent of the belief, whose weight must be a whole number.
fn drawn(belief: &InverseWishart, random: &mut ChaCha8Rng) -> Matrix2<f64> {
    let count = belief.weight() as usize + 3;
    inverse(&wishart(&inverse(&belief.scale()), count, random))
}

/// The weight of a belief whose first element has this mean and this mean square.
fn weight_of(mean: f64, square: f64) -> f64 {
    2.0 + 2.0 * mean * mean / (square - mean * mean)
}

#[test]
fn the_moments_are_those_of_drawn_extents() {
    let belief = InverseWishart::new(matrix![9.0, 1.0; 1.0, 2.0], 24.0).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut mean, mut inverses, mut square) = (Matrix2::zeros(), Matrix2::zeros(), 0.0);
    const COUNT: usize = 60_000;
    for _ in 0..COUNT {
        let extent = drawn(&belief, &mut random);
        mean += extent / COUNT as f64;
        inverses += inverse(&extent) / COUNT as f64;
        square += (extent * extent).trace() / COUNT as f64;
    }
    assert!((mean - belief.mean()).norm() < 0.01 * belief.mean().norm(), "{mean}");
    assert!((inverses - belief.mean_inverse()).norm() < 0.01 * belief.mean_inverse().norm());
    assert!((square / belief.mean_square() - 1.0).abs() < 0.01, "{square}");
}

#[test]
fn the_exact_prediction_has_the_variance_of_drawn_extents() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for (weight, delta) in [(30.0, 20), (40.0, 8), (26.0, 60)] {
        let mut belief = InverseWishart::new(matrix![4.0, 0.5; 0.5, 1.0], weight).unwrap();
        const COUNT: usize = 200_000;
        let (mut mean, mut square) = (0.0, 0.0);
        for _ in 0..COUNT {
            let next = wishart(&(drawn(&belief, &mut random) / delta as f64), delta, &mut random).m11;
            mean += next / COUNT as f64;
            square += next * next / COUNT as f64;
        }
        belief.diffuse(delta as f64, Freedom::Exact);
        let expected = weight_of(mean, square);
        assert!((belief.weight() / expected - 1.0).abs() < 0.01, "{} against {expected}", belief.weight());
    }
}

#[test]
fn the_printed_prediction_is_the_formula_of_the_paper() {
    let mut belief = InverseWishart::gupta_nagar(7.0, matrix![1.0, 0.0; 0.0, 1.0]).unwrap();
    belief.diffuse(5.0, Freedom::Printed);
    assert_eq!(belief.freedom(), 8.0);
    let mut belief = InverseWishart::new(matrix![1.0, 0.0; 0.0, 1.0], 13.0).unwrap();
    belief.diffuse(13.0, Freedom::Printed);
    assert!((belief.weight() - (2.0 + 26.0 * 14.0 * 12.0 * 11.0 / (169.0 * 26.0))).abs() < 1e-12);
    for weight in [1e-6, 0.5, 1.5, 2.0, 1e9] {
        for freedom in [Freedom::Printed, Freedom::Exact] {
            let mut belief = InverseWishart::new(Matrix2::identity(), weight).unwrap();
            belief.diffuse(5.0, freedom);
            assert!(belief.is_sound(), "{weight}, {freedom:?}: {belief:?}");
        }
    }
}

#[test]
fn a_merged_belief_has_the_two_moments_of_the_mixture() {
    let parts = [
        (0.2, InverseWishart::new(matrix![9.0, 1.0; 1.0, 2.0], 12.0).unwrap()),
        (0.5, InverseWishart::new(matrix![4.0, -1.0; -1.0, 3.0], 5.0).unwrap()),
        (0.3, InverseWishart::new(matrix![1.0, 0.0; 0.0, 30.0], 40.0).unwrap()),
    ];
    let mean: Matrix2<f64> = parts.iter().map(|(w, part)| part.mean() * *w).sum();
    let square: f64 = parts.iter().map(|(w, part)| part.mean_square() * w).sum();
    let (mut weight, mut merged) = parts[0];
    for (other_weight, other) in &parts[1..] {
        merged.merge(weight, other, *other_weight);
        weight += other_weight;
    }
    assert!((merged.mean() - mean).norm() < 1e-12);
    assert!((merged.mean_square() / square - 1.0).abs() < 1e-12);
}

#[test]
fn every_parametrisation_refuses_what_has_no_mean() {
    let unit = Matrix2::identity();
    assert!(InverseWishart::gupta_nagar(6.0, unit).is_err() && InverseWishart::classical(3.0, unit).is_err());
    assert!(InverseWishart::feldmann(unit, 2.0).is_err() && InverseWishart::new(unit, f64::NAN).is_err());
    assert!(InverseWishart::new(matrix![1.0, 2.0; 2.0, 1.0], 3.0).is_err());
    let belief = InverseWishart::feldmann(matrix![4.0, 0.0; 0.0, 1.0], 9.0).unwrap();
    assert_eq!((belief.weight(), belief.mean()), (7.0, matrix![4.0, 0.0; 0.0, 1.0]));
}
