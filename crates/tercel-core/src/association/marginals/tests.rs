use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A cluster as trackers meet them: tracks and measurements in a square, scored by Gaussian likelihoods. Many of the tracks have
/// each other's measurements in their gates.
fn cluster(random: &mut ChaCha8Rng) -> (Vec<(usize, usize, f64)>, usize, usize) {
    let (rows, clutter) = (random.random_range(3..=8), random.random_range(0..=6));
    let width = random.random_range(90.0..200.0) * (f64::from(rows as u32) / 5.0).sqrt();
    let detection = random.random_range(0.7..0.98);
    let deviation = 8.0;
    let density = 10.0_f64.powf(random.random_range(-5.5..-4.0));
    let tracks: Vec<[f64; 2]> = (0..rows).map(|_| [0, 1].map(|_| random.random_range(0.0..width))).collect();
    let mut plots: Vec<[f64; 2]> = Vec::new();
    for track in &tracks {
        if random.random::<f64>() < detection {
            let mut normal =
                || deviation * (-12.0_f64).mul_add(0.5, (0..12).map(|_| random.random::<f64>()).sum());
            plots.push([track[0] + normal(), track[1] + normal()]);
        }
    }
    plots.extend((0..clutter).map(|_| [0, 1].map(|_| random.random_range(0.0..width))));
    let mut pairs = Vec::new();
    for (i, track) in tracks.iter().enumerate() {
        for (j, plot) in plots.iter().enumerate() {
            let square =
                ((track[0] - plot[0]).powi(2) + (track[1] - plot[1]).powi(2)) / (deviation * deviation);
            if square < 15.0 {
                let likelihood = -0.5 * square - (std::f64::consts::TAU * deviation * deviation).ln();
                pairs.push((i, j, (detection / (1.0 - detection)).ln() + likelihood - density.ln()));
            }
        }
    }
    (pairs, rows, plots.len())
}

#[test]
fn propagation_meets_enumeration_within_a_hundredth_on_a_thousand_clusters() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let (mut exact, mut loopy) = (Marginals::with_exact(usize::MAX), Marginals::with_exact(0));
    let (mut worst, mut count) = (0.0_f64, 0);
    for _ in 0..1000 {
        let (pairs, rows, columns) = cluster(&mut random);
        exact.solve(&pairs, rows, columns);
        loopy.solve(&pairs, rows, columns);
        count += pairs.len();
        for (a, b) in exact.pairs().iter().zip(loopy.pairs()) {
            worst = worst.max((a - b).abs());
        }
    }
    assert!(count > 5000, "the clusters are too easy: {count} pairs");
    assert!(worst < 1e-2, "{worst}");
}

/// Rows that all want all columns, with weights over e^±8.
fn crowd(random: &mut ChaCha8Rng, size: usize) -> Vec<(usize, usize, f64)> {
    let pairs = (0..size).flat_map(|row| (0..size).map(move |column| (row, column)));
    pairs.map(|(row, column)| (row, column, random.random_range(-8.0..8.0))).collect()
}

#[test]
fn sums_over_sets_of_columns_are_those_over_all_assignments() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    // One assignment would be enumerated; everything else goes by sets.
    let (mut exact, mut by_sets) = (Marginals::with_exact(usize::MAX), Marginals::with_exact(100));
    for round in 0..60 {
        let mut pairs = crowd(&mut random, 5);
        pairs.extend([(0, 5, 1.0), (3, 6, 2.0), (3, 7, -1.0)]);
        pairs.retain(|_| round % 2 == 0 || random.random::<f64>() < 0.8);
        exact.solve(&pairs, 5, 8);
        by_sets.solve(&pairs, 5, 8);
        for (a, b) in exact.pairs().iter().zip(by_sets.pairs()) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }
}

#[test]
fn no_column_is_claimed_by_more_than_one_in_all() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for size in [8, 8, 8, 12, 14, 20] {
        for exact in [0, 4096] {
            let pairs = crowd(&mut random, size);
            let mut marginals = Marginals::with_exact(exact);
            marginals.solve(&pairs, size, size);
            let mut claimed = vec![0.0; size];
            pairs.iter().zip(marginals.pairs()).for_each(|(pair, p)| claimed[pair.1] += p);
            assert!(claimed.iter().all(|sum| *sum <= 1.0 + 1e-9), "{size}, {exact}: {claimed:?}");
            assert!(claimed.iter().sum::<f64>() > 0.8 * size as f64, "{size}, {exact}: {claimed:?}");
        }
    }
}

#[test]
fn conflicts_share_out_what_there_is() {
    // Two equal rows and one column: 1 + w + w.
    let mut marginals = Marginals::default();
    marginals.solve(&[(0, 0, 3.0_f64.ln()), (1, 0, 3.0_f64.ln())], 2, 1);
    assert!(marginals.pairs().iter().all(|p| (p - 3.0 / 7.0).abs() < 1e-12));
    assert!(marginals.misses().iter().all(|p| (p - 4.0 / 7.0).abs() < 1e-12));
}

#[test]
fn rows_without_columns_stay_alone_and_bad_pairs_count_nothing() {
    let mut marginals = Marginals::default();
    marginals.solve(&[(0, 7, 0.0), (9, 0, 0.0), (1, 0, f64::NAN), (1, 1, f64::INFINITY)], 3, 2);
    assert_eq!(marginals.pairs()[..3], [0.0, 0.0, 0.0]);
    assert!(marginals.pairs()[3] > 1.0 - 1e-12);
    assert_eq!((marginals.misses()[0], marginals.misses()[2]), (1.0, 1.0));
    marginals.solve(&[], 0, 0);
    assert!(marginals.pairs().is_empty());
}

proptest! {
    #[test]
    fn probabilities_are_probabilities(
        pairs in prop::collection::vec((0..8_usize, 0..8_usize, -200.0..200.0_f64), 0..40),
        exact in prop::sample::select(vec![0, 100, 100_000]),
    ) {
        let mut pairs = pairs;
        pairs.sort_by_key(|pair| (pair.0, pair.1));
        pairs.dedup_by_key(|pair| (pair.0, pair.1));
        let mut marginals = Marginals::with_exact(exact);
        marginals.solve(&pairs, 8, 8);
        for row in 0..8 {
            let parts = pairs.iter().zip(marginals.pairs()).filter(|(pair, _)| pair.0 == row);
            let sum: f64 = parts.map(|(_, p)| *p).sum::<f64>() + marginals.misses()[row];
            prop_assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        }
        prop_assert!(marginals.pairs().iter().all(|p| (0.0..=1.0 + 1e-9).contains(p)));
    }
}
