//! Time of the metrics on one core: `cargo bench -p tercel-core --bench metrics`.

use std::hint::black_box;

use divan::{Bencher, counter::ItemsCount};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tercel_core::association::AssignmentSolver;
use tercel_core::metric::{Gospa, Ospa, Trajectory, TrajectoryGospa};

fn main() {
    divan::main();
}

fn points(count: usize, random: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    (0..count).map(|_| [random.random_range(0.0..200.0), random.random_range(0.0..200.0)]).collect()
}

/// Ten objects and nine estimates, of which most are near their object.
fn sets() -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let truth = points(10, &mut random);
    let near = |x: &[f64; 2]| [x[0] + 3.0, x[1] - 4.0];
    let estimates = truth.iter().rev().take(7).map(near).chain(points(2, &mut random)).collect();
    (truth, estimates)
}

#[divan::bench]
fn gospa_10_against_9(bencher: Bencher) {
    let (truth, estimates) = sets();
    let Ok(gospa) = Gospa::new(50.0, 2.0) else { return };
    bencher.bench(|| gospa.score(black_box(&truth), black_box(&estimates)));
}

#[divan::bench]
fn ospa_10_against_9(bencher: Bencher) {
    let (truth, estimates) = sets();
    let Ok(ospa) = Ospa::new(50.0, 2.0) else { return };
    bencher.bench(|| ospa.score(black_box(&truth), black_box(&estimates)));
}

/// Each row has ten columns near it: what a scan with a thousand objects looks like before it is split into clusters.
#[divan::bench]
fn sparse_assignment_1000_by_2000(bencher: Bencher) {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut entries = Vec::new();
    for row in 0..1000 {
        for _ in 0..10 {
            entries.push((
                row,
                (2 * row + random.random_range(0..60)) % 2000,
                random.random_range(0.0..10.0),
            ));
        }
    }
    let (misses, mut solver) = (vec![8.0; 1000], AssignmentSolver::new());
    bencher.bench_local(|| solver.solve_sparse(black_box(&entries), 2000, &misses).map(|best| best.cost));
}

fn walk(steps: usize, random: &mut ChaCha8Rng) -> Vec<[f64; 2]> {
    let mut place = [random.random_range(0.0..200.0), random.random_range(0.0..200.0)];
    let mut speed = [random.random_range(-2.0..2.0), random.random_range(-2.0..2.0)];
    let mut places = Vec::with_capacity(steps);
    for _ in 0..steps {
        for axis in 0..2 {
            let push: f64 = StandardNormal.sample(random);
            // Walls keep the objects together, so that they meet often.
            speed[axis] = if (0.0..200.0).contains(&place[axis]) { speed[axis] } else { -speed[axis] };
            place[axis] = (place[axis] + speed[axis] + 0.1 * push).clamp(-2.0, 202.0);
        }
        places.push(place);
    }
    places
}

/// Ten objects in a box, each followed by three tracks one after the other, with errors; cut-off 20 m.
#[divan::bench(args = [100, 500], sample_count = 10)]
fn trajectory_gospa_10_against_30(bencher: Bencher, steps: usize) {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (mut truth, mut tracks) = (Vec::new(), Vec::new());
    for _ in 0..10 {
        let places = walk(steps, &mut random);
        for part in 0..3 {
            let (from, to) = (part * steps / 3, (part + 1) * steps / 3);
            let mut near = |x: &[f64; 2]| {
                let error: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut random));
                [x[0] + 3.0 * error[0], x[1] + 3.0 * error[1]]
            };
            tracks.push(Trajectory::new(from, places[from..to].iter().map(&mut near)));
        }
        truth.push(Trajectory::new(0, places));
    }
    let Ok(metric) = TrajectoryGospa::new(20.0, 1.0, 10.0) else { return };
    bencher
        .counter(ItemsCount::new(steps))
        .bench(|| metric.score(black_box(&truth), black_box(&tracks)).map(|score| score.total));
}

/// Tracks that have nothing to do with the objects but meet them all the time: the worst case for switches. Cut-off 60 m.
#[divan::bench(args = [100, 500], sample_count = 10)]
fn trajectory_gospa_10_against_30_strangers(bencher: Bencher, steps: usize) {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut walks = |count: usize| -> Vec<Trajectory<2>> {
        (0..count).map(|_| Trajectory::new(0, walk(steps, &mut random))).collect()
    };
    let (truth, tracks) = (walks(10), walks(30));
    let Ok(metric) = TrajectoryGospa::new(60.0, 1.0, 40.0) else { return };
    bencher
        .counter(ItemsCount::new(steps))
        .bench(|| metric.score(black_box(&truth), black_box(&tracks)).map(|score| score.total));
}
