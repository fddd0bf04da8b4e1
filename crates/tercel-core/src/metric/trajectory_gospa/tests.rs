use std::ops::Range;

use proptest::prelude::*;

use super::chain::{Chain, NONE, Near};
use super::relaxation::{Relaxation, Solution};
use super::*;
use crate::metric::Gospa;

type Track = Trajectory<2>;

fn line(y: f64, steps: Range<usize>) -> Track {
    Trajectory::new(steps.start, steps.map(move |t| [t as f64, y]))
}

fn metric(cutoff: f64, order: f64, switch: f64) -> TrajectoryGospa {
    TrajectoryGospa::new(cutoff, order, switch).unwrap()
}

/// The minimum over all sequences of assignments, by dynamic programming over every assignment of a step: the
/// multi-dimensional assignment metric, to the power `p`.
fn by_enumeration(metric: &TrajectoryGospa, truth: &[Track], tracks: &[Track], steps: usize) -> f64 {
    let states = assignments(truth.len(), tracks.len());
    let half = 0.5 * metric.scale.highest();
    let change = 0.5 * metric.scale.power(metric.switch);
    let mut values = vec![0.0; states.len()];
    for step in 0..steps {
        let at = |state: &Vec<Option<usize>>| {
            let mut cost = half
                * truth.iter().chain(tracks).filter(|trajectory| trajectory.at(step).is_some()).count()
                    as f64;
            for (i, j) in state.iter().enumerate().filter_map(|(i, j)| Some((i, (*j)?))) {
                if let (Some(x), Some(y)) = (truth[i].at(step), tracks[j].at(step)) {
                    let distance = f64::hypot(x[0] - y[0], x[1] - y[1]).min(metric.scale.cutoff);
                    cost += metric.scale.power(distance) - 2.0 * half;
                }
            }
            cost
        };
        let moved = |to: &Vec<Option<usize>>| {
            let from = states.iter().zip(&values).map(|(from, value)| value + change * changes(from, to));
            from.fold(f64::INFINITY, f64::min)
        };
        values = states
            .iter()
            .enumerate()
            .map(|(k, state)| at(state) + if step == 0 { values[k] } else { moved(state) })
            .collect();
    }
    values.into_iter().fold(f64::INFINITY, f64::min)
}

fn changes(from: &[Option<usize>], to: &[Option<usize>]) -> f64 {
    let pairs = from.iter().zip(to).filter(|(a, b)| a != b);
    pairs.map(|(a, b)| f64::from(u8::from(a.is_some()) + u8::from(b.is_some()))).sum()
}

fn assignments(rows: usize, columns: usize) -> Vec<Vec<Option<usize>>> {
    let mut all = vec![Vec::new()];
    for _ in 0..rows {
        let mut longer = Vec::new();
        for one in &all {
            for choice in std::iter::once(None).chain((0..columns).map(Some)) {
                if choice.is_none() || !one.contains(&choice) {
                    longer.push(one.iter().copied().chain([choice]).collect());
                }
            }
        }
        all = longer;
    }
    all
}

/// Up to `most` trajectories of `steps` steps on a coarse grid, with gaps, so that ties are common.
fn set(most: usize, steps: usize) -> impl Strategy<Value = Vec<Track>> {
    let point = prop_oneof![
        1 => Just(None),
        4 => (0i32..8, 0i32..3).prop_map(|(x, y)| Some([f64::from(x), f64::from(y)])),
        4 => (0.0..8.0, 0.0..3.0f64).prop_map(|(x, y)| Some([x, y])),
    ];
    let track = (0..steps, prop::collection::vec(point, 0..steps)).prop_map(move |(start, mut positions)| {
        positions.truncate(steps - start);
        Trajectory { start, positions }
    });
    prop::collection::vec(track, 0..=most)
}

fn setting() -> impl Strategy<Value = TrajectoryGospa> {
    (2.0..8.0, prop_oneof![Just(1.0), Just(2.0), 1.0..3.0], 0.1..6.0).prop_map(|(c, p, g)| metric(c, p, g))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn the_minimum_is_at_most_that_over_all_assignments_and_equal_when_weights_are_whole(
        metric in setting(), truth in set(3, 6), tracks in set(3, 6),
    ) {
        let score = metric.score(&truth, &tracks).unwrap();
        let whole = by_enumeration(&metric, &truth, &tracks, 6);
        let sum = score.parts.sum();
        let trajectories = (truth.len() + tracks.len()) as f64;
        prop_assert!(score.gap <= 0.51e-10 * metric.scale.highest() * 6.0 * trajectories, "gap {}", score.gap);
        prop_assert!(sum <= whole + 1e-7, "{} above {}", sum, whole);
        if score.pairs.iter().all(|pair| pair.2.fract() == 0.0) {
            prop_assert!((sum - whole).abs() < 1e-7, "{} instead of {}", sum, whole);
        }
    }

    #[test]
    fn two_sets_are_as_far_apart_as_one_and_the_other(metric in setting(), a in set(4, 7), b in set(4, 7)) {
        let (there, back) = (metric.score(&a, &b).unwrap(), metric.score(&b, &a).unwrap());
        prop_assert!((there.parts.sum() - back.parts.sum()).abs() < 1e-7);
        prop_assert!(metric.score(&a, &a).unwrap().total == 0.0);
    }

    #[test]
    fn a_way_round_is_not_shorter(
        metric in setting(), a in set(3, 6), b in set(3, 6), c in set(3, 6),
    ) {
        let distance = |x: &[Track], y: &[Track]| metric.score(x, y).unwrap().total;
        prop_assert!(distance(&a, &c) <= distance(&a, &b) + distance(&b, &c) + 1e-7);
    }

    #[test]
    fn one_step_is_gospa(
        metric in setting(),
        truth in prop::collection::vec(prop::array::uniform2(0.0..10.0f64), 0..8),
        tracks in prop::collection::vec(prop::array::uniform2(0.0..10.0f64), 0..8),
    ) {
        let points = |set: &[[f64; 2]]| -> Vec<Track> { set.iter().map(|x| Trajectory::new(5, [*x])).collect() };
        let score = metric.score(&points(&truth), &points(&tracks)).unwrap();
        let gospa = Gospa::new(metric.scale.cutoff, metric.scale.order).unwrap().score(&truth, &tracks).unwrap();
        prop_assert!((score.total - gospa.total).abs() < 1e-9);
        prop_assert!((score.parts.missed - gospa.parts.missed).abs() < 1e-9);
        prop_assert!((score.parts.false_alarm - gospa.parts.false_alarm).abs() < 1e-9);
        prop_assert_eq!(score.switches, 0.0);
    }

    #[test]
    fn the_order_of_trajectories_and_the_origin_do_not_matter(
        metric in setting(), truth in set(4, 6), tracks in set(4, 6), shift in -50.0..50.0f64, turn in -3.0..3.0f64,
    ) {
        let moved = |set: &[Track]| -> Vec<Track> {
            let place = |x: &[f64; 2]| [
                turn.cos() * x[0] - turn.sin() * x[1] + shift, turn.sin() * x[0] + turn.cos() * x[1] - shift,
            ];
            let one = |track: &Track| Trajectory {
                start: track.start + 3,
                positions: track.positions.iter().map(|x| x.as_ref().map(place)).collect(),
            };
            set.iter().rev().map(one).collect()
        };
        let (here, there) = (metric.score(&truth, &tracks).unwrap(), metric.score(&moved(&truth), &moved(&tracks)).unwrap());
        prop_assert!((here.parts.sum() - there.parts.sum()).abs() < 1e-6);
    }

    #[test]
    fn parts_of_steps_sum_to_the_total_and_none_is_negative(
        metric in setting(), truth in set(5, 8), tracks in set(5, 8),
    ) {
        let score = metric.score(&truth, &tracks).unwrap();
        prop_assert!((metric.scale.power(score.total) - score.parts.sum()).abs() < 1e-7);
        for step in &score.steps {
            prop_assert!(step.localisation > -1e-9 && step.missed > -1e-9);
            prop_assert!(step.false_alarm > -1e-9 && step.switches >= 0.0);
        }
    }
}

#[test]
fn a_swap_of_two_tracks_is_two_switches() {
    let truth = [line(0.0, 0..20), line(30.0, 0..20)];
    let cross = |from: f64, to: f64| {
        Trajectory::new(0, (0..20).map(move |t| [t as f64, if t < 12 { from } else { to }]))
    };
    let score = metric(10.0, 1.0, 3.0).score(&truth, &[cross(0.0, 30.0), cross(30.0, 0.0)]).unwrap();
    assert_eq!((score.switches, score.total), (2.0, 6.0));
    assert_eq!(score.steps[12].switches, 6.0);
    assert_eq!(score.pairs, [(0, 0, 12.0), (0, 1, 8.0), (1, 0, 8.0), (1, 1, 12.0)]);
}

#[test]
fn a_track_that_passes_from_one_object_to_another_is_one_switch() {
    // Half a switch for the object that loses it and half for the one that gets it.
    let truth = [line(0.0, 0..10), line(30.0, 10..20)];
    let track = Trajectory::new(0, (0..20).map(|t| [t as f64, if t < 10 { 0.0 } else { 30.0 }]));
    let score = metric(10.0, 1.0, 3.0).score(&truth, &[track]).unwrap();
    assert_eq!((score.switches, score.total), (1.0, 3.0));
}

#[test]
fn a_switch_that_costs_more_than_it_gains_is_not_made() {
    let truth = [line(0.0, 0..10)];
    let tracks = [line(1.0, 0..10), line(0.0, 5..7)];
    let score = metric(10.0, 1.0, 3.0).score(&truth, &tracks).unwrap();
    assert_eq!((score.switches, score.parts.localisation, score.parts.false_alarm), (0.0, 10.0, 10.0));
}

#[test]
fn nothing_against_nothing_is_zero_and_against_something_its_price() {
    let metric = metric(10.0, 2.0, 3.0);
    assert_eq!(metric.score::<2>(&[], &[]).unwrap().total, 0.0);
    let missed = metric.score(&[line(0.0, 4..8)], &[]).unwrap();
    assert_eq!((missed.parts.missed, missed.start, missed.steps.len()), (200.0, 4, 4));
    assert_eq!(missed.total, 200f64.sqrt());
}

#[test]
fn totals_are_right_for_orders_and_cut_offs_whose_powers_overflow_or_vanish() {
    let off = |y: f64| [line(0.0, 0..5), line(y, 0..5)];
    for (cutoff, order) in
        [(100.0, 8.0), (1000.0, 150.0), (1e5, 1000.0), (1e-3, 150.0), (1e200, 2.0), (1e-200, 2.0)]
    {
        let metric = metric(cutoff, order, 0.5 * cutoff);
        let close = |score: TrajectoryGospaScore, expected: f64| {
            let share = score.total / expected;
            assert!(
                (share - 1.0).abs() < 1e-9,
                "{share} of {expected:e} at cut-off {cutoff:e}, order {order}"
            );
            assert!(score.gap <= 1e-9 * score.parts.sum(), "gap {:e} of {:e}", score.gap, score.parts.sum());
        };
        let error = 1e-3 * cutoff;
        let [truth, track] = off(error);
        assert_eq!(metric.score::<2>(&[], &[]).unwrap().parts.sum(), 0.0);
        close(
            metric.score(std::slice::from_ref(&truth), std::slice::from_ref(&track)).unwrap(),
            error * 5f64.powf(order.recip()),
        );
        close(metric.score(std::slice::from_ref(&truth), &[]).unwrap(), cutoff * 2.5f64.powf(order.recip()));
        // Of two tracks for two objects each takes the nearer, however small the power of both.
        let pair =
            metric.score(&[truth.clone(), line(error, 0..5)], &[line(2.0 * error, 0..5), truth]).unwrap();
        close(pair, error * 5f64.powf(order.recip()));
    }
}

#[test]
fn a_switch_that_no_gain_can_pay_is_never_made() {
    let score =
        metric(10.0, 150.0, 1e9).score(&[line(0.0, 0..10)], &[line(1.0, 0..6), line(1.0, 6..10)]).unwrap();
    assert_eq!((score.switches, score.parts.switches), (0.0, 0.0));
    assert!((score.total - 10.0 * 4f64.powf(1.0 / 150.0)).abs() < 1e-9, "{}", score.total);
}

#[test]
fn a_track_that_is_kept_before_or_beyond_its_meetings_is_free_only_if_nobody_else_has_it_then() {
    // The track meets the first object early and the second one late; a third trajectory never comes near.
    let track = Trajectory::new(0, (0..30).map(|t| [t as f64, 0.0]));
    let early = Trajectory::new(5, (5..8).map(|t| [t as f64, 1.0]));
    let late = Trajectory::new(20, (20..24).map(|t| [t as f64, 1.0]));
    let metric = metric(10.0, 1.0, 3.0);
    let alone = metric.score(std::slice::from_ref(&early), std::slice::from_ref(&track)).unwrap();
    assert_eq!((alone.switches, alone.parts.localisation), (0.0, 3.0));
    let both = metric.score(&[early, late, line(500.0, 0..30)], &[track]).unwrap();
    assert_eq!((both.switches, both.parts.localisation), (1.0, 7.0));
}

#[test]
fn positions_and_parameters_out_of_range_are_refused() {
    assert!(TrajectoryGospa::new(10.0, 1.0, 0.0).is_err());
    assert!(TrajectoryGospa::new(10.0, 0.5, 1.0).is_err());
    assert!(TrajectoryGospa::new(f64::NAN, 1.0, 1.0).is_err());
    let bad = Trajectory::new(0, [[f64::NAN, 0.0]]);
    assert!(metric(10.0, 1.0, 1.0).score(&[bad], &[]).is_err());
}

/// An object that saves this with each track at each step.
fn chain(gains: &[&[f64]], change: f64) -> Chain {
    const ALONE: f64 = 4.0;
    let steps = gains[0].len();
    let near = |(track, gains): (usize, &&[f64])| Near {
        track: track as u32,
        first: 0,
        place: track * steps,
        costs: gains.iter().map(|gain| ALONE - gain).collect(),
    };
    let near = gains.iter().enumerate().map(near).collect();
    Chain { steps: 0..steps, alone: vec![ALONE; steps], near, change }
}

/// Gains of `objects` x `tracks` x `steps`, of which many are zero and many are equal.
fn cluster() -> impl Strategy<Value = (Vec<Chain>, usize, usize)> {
    (1usize..5, 1usize..5, 1usize..8).prop_flat_map(|(objects, tracks, steps)| {
        let gain = prop_oneof![3 => Just(0.0), 2 => (1i32..4).prop_map(f64::from), 1 => 0.0..4.0];
        let gains = prop::collection::vec(gain, objects * tracks * steps);
        (gains, 0.1..3.0).prop_map(move |(gains, change)| {
            let gains_of = |object: usize| gains[object * tracks * steps..][..tracks * steps].chunks(steps);
            let chains = (0..objects).map(|object| chain(&gains_of(object).collect::<Vec<_>>(), change));
            (chains.collect(), tracks, steps)
        })
    })
}

fn cost(chains: &[Chain], solution: &Solution) -> f64 {
    solution.shares.iter().map(|one| one.share * chains[one.object].cost(&one.path)).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn the_linear_programme_alone_finds_what_the_climb_finds((chains, tracks, steps) in cluster()) {
        let solve = |climbs| Relaxation { chains: &chains, tracks, places: tracks * steps, tolerance: 1e-9, climbs }.solve();
        let (climbed, programmed) = (solve(100), solve(0));
        prop_assert!(climbed.gap <= 1e-9 && programmed.gap <= 1e-9, "gaps {} and {}", climbed.gap, programmed.gap);
        prop_assert!((cost(&chains, &climbed) - cost(&chains, &programmed)).abs() <= 2e-9);
        for solution in [&climbed, &programmed] {
            for object in 0..chains.len() {
                let own = solution.shares.iter().filter(|one| one.object == object);
                prop_assert!((own.map(|one| one.share).sum::<f64>() - 1.0).abs() < 1e-9);
            }
            for (step, track) in (0..steps).flat_map(|step| (0..tracks as u32).map(move |track| (step, track))) {
                let users = solution.shares.iter().filter(|one| one.path[step] == track);
                prop_assert!(track != NONE && users.map(|one| one.share).sum::<f64>() < 1.0 + 1e-9);
            }
        }
    }
}

#[test]
fn where_half_weights_are_cheaper_than_any_whole_paths_they_are_taken() {
    let chain = |first: [f64; 3], second: [f64; 3]| chain(&[&first, &second], 0.45);
    let chains = [
        chain([0.0, 0.3, 0.0], [0.0, 2.0, 1.0]),
        chain([0.8, 3.0, 0.0], [1.0, 2.0, 0.0]),
        chain([0.0, 3.2, 0.0], [1.0, 0.0, 2.0]),
    ];
    let solution = Relaxation { chains: &chains, tracks: 2, places: 6, tolerance: 1e-9, climbs: 100 }.solve();
    assert!(solution.shares.iter().all(|one| (one.share - 0.5).abs() < 1e-9) && solution.gap < 1e-9);
    let paths: Vec<Vec<u32>> =
        (0..27).map(|k| [k % 3, k / 3 % 3, k / 9].map(|t| [NONE, 0, 1][t]).to_vec()).collect();
    let mut whole = f64::INFINITY;
    for (a, b, c) in (0..27 * 27 * 27).map(|k| (&paths[k % 27], &paths[k / 27 % 27], &paths[k / 729])) {
        let meet = |x: &[u32], y: &[u32]| x.iter().zip(y).any(|(x, y)| x == y && *x != NONE);
        if !(meet(a, b) || meet(b, c) || meet(a, c)) {
            whole = whole.min(chains[0].cost(a) + chains[1].cost(b) + chains[2].cost(c));
        }
    }
    assert!(cost(&chains, &solution) < whole - 0.05);
}
