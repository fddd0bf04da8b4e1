use proptest::prelude::*;

use super::*;

type Points = Vec<[f64; 2]>;

/// Points on a coarse grid, so that ties and equal points are common, and anywhere else.
fn points() -> impl Strategy<Value = Points> {
    let point = prop_oneof![
        (0i32..6, 0i32..6).prop_map(|(x, y)| [2.0 * f64::from(x), 2.0 * f64::from(y)]),
        prop::array::uniform2(0.0..12.0f64),
    ];
    prop::collection::vec(point, 0..6)
}

fn setting() -> impl Strategy<Value = (Gospa, Ospa)> {
    let order = prop_oneof![Just(1.0), Just(2.0), 1.0..4.0];
    (0.5..15.0, order).prop_map(|(c, p)| (Gospa::new(c, p).unwrap(), Ospa::new(c, p).unwrap()))
}

/// GOSPA to the power `p` as the minimum over every assignment.
fn gospa_by_enumeration(gospa: &Gospa, truth: &[[f64; 2]], estimates: &mut Points) -> f64 {
    let half = 0.5 * gospa.cutoff().powf(gospa.order());
    let Some((first, rest)) = truth.split_first() else { return half * estimates.len() as f64 };
    let mut best = half + gospa_by_enumeration(gospa, rest, estimates);
    for j in 0..estimates.len() {
        let taken = estimates.swap_remove(j);
        let distance = f64::hypot(first[0] - taken[0], first[1] - taken[1]);
        best = best.min(distance.powf(gospa.order()) + gospa_by_enumeration(gospa, rest, estimates));
        estimates.push(taken);
        let last = estimates.len() - 1;
        estimates.swap(j, last);
    }
    best
}

fn moved(points: &[[f64; 2]], turn: f64, shift: f64) -> Points {
    let (sine, cosine) = turn.sin_cos();
    points
        .iter()
        .rev()
        .map(|x| [cosine * x[0] - sine * x[1] + shift, sine * x[0] + cosine * x[1] - shift])
        .collect()
}

proptest! {
    #[test]
    fn gospa_is_the_minimum_over_all_assignments((gospa, _) in setting(), a in points(), b in points()) {
        let score = gospa.score(&a, &b).unwrap();
        let expected = gospa_by_enumeration(&gospa, &a, &mut b.clone());
        prop_assert!((score.parts.sum() - expected).abs() < 1e-9 * (1.0 + expected));
        prop_assert!((score.total.powf(gospa.order()) - score.parts.sum()).abs() < 1e-9 * (1.0 + expected));
        prop_assert_eq!(score.missed + score.pairs.len(), a.len());
        prop_assert_eq!(score.false_alarms + score.pairs.len(), b.len());
    }

    #[test]
    fn distances_are_symmetric_and_zero_from_itself((gospa, ospa) in setting(), a in points(), b in points()) {
        let (there, back) = (gospa.score(&a, &b).unwrap(), gospa.score(&b, &a).unwrap());
        prop_assert!((there.total - back.total).abs() < 1e-9);
        prop_assert!((there.parts.missed - back.parts.false_alarm).abs() < 1e-9);
        prop_assert!((ospa.score(&a, &b).unwrap().total - ospa.score(&b, &a).unwrap().total).abs() < 1e-9);
        prop_assert_eq!(gospa.score(&a, &a).unwrap().total, 0.0);
        prop_assert_eq!(ospa.score(&a, &a).unwrap().total, 0.0);
    }

    #[test]
    fn different_sets_are_apart((gospa, ospa) in setting(), a in points(), b in points()) {
        let sorted = |points: &Points| {
            let mut points = points.clone();
            points.sort_by(|x, y| x[0].total_cmp(&y[0]).then(x[1].total_cmp(&y[1])));
            points
        };
        prop_assume!(sorted(&a) != sorted(&b));
        prop_assert!(gospa.score(&a, &b).unwrap().total > 0.0);
        prop_assert!(ospa.score(&a, &b).unwrap().total > 0.0);
    }

    #[test]
    fn a_way_round_is_not_shorter((gospa, ospa) in setting(), a in points(), b in points(), c in points()) {
        let g = |x: &Points, y: &Points| gospa.score(x, y).unwrap().total;
        let o = |x: &Points, y: &Points| ospa.score(x, y).unwrap().total;
        prop_assert!(g(&a, &c) <= g(&a, &b) + g(&b, &c) + 1e-9);
        prop_assert!(o(&a, &c) <= o(&a, &b) + o(&b, &c) + 1e-9);
    }

    #[test]
    fn order_origin_and_direction_do_not_matter(
        (gospa, ospa) in setting(), a in points(), b in points(), turn in -3.0..3.0f64, shift in -100.0..100.0f64,
    ) {
        let (c, d) = (moved(&a, turn, shift), moved(&b, turn, shift));
        let scale = 1.0 + gospa.cutoff().powf(gospa.order());
        let difference = gospa.score(&a, &b).unwrap().parts.sum() - gospa.score(&c, &d).unwrap().parts.sum();
        prop_assert!(difference.abs() < 1e-10 * scale);
        let difference = ospa.score(&a, &b).unwrap().parts.sum() - ospa.score(&c, &d).unwrap().parts.sum();
        prop_assert!(difference.abs() < 1e-10 * scale);
    }

    #[test]
    fn ospa_stays_below_the_cut_off_and_its_parts_add_up((gospa, ospa) in setting(), a in points(), b in points()) {
        let score = ospa.score(&a, &b).unwrap();
        prop_assert!(score.total <= gospa.cutoff() * (1.0 + 1e-12));
        prop_assert!((score.total.powf(gospa.order()) - score.parts.sum()).abs() < 1e-9 * (1.0 + score.parts.sum()));
        prop_assert_eq!(score.pairs.len(), a.len().min(b.len()));
    }

    #[test]
    fn ospa2_of_one_step_is_ospa_and_obeys_the_axioms(
        (gospa, ospa) in setting(), a in points(), b in points(), c in points(),
    ) {
        let ospa2 = Ospa2::new(gospa.cutoff(), gospa.order()).unwrap();
        let tracks = |points: &Points| -> Vec<_> {
            points.iter().enumerate().map(|(k, x)| Trajectory::new(k % 3, vec![*x; 1 + k])).collect()
        };
        let single = |points: &Points| -> Vec<_> { points.iter().map(|x| Trajectory::new(7, [*x])).collect() };
        let one = ospa2.score(&single(&a), &single(&b), 7..8).unwrap();
        prop_assert!((one.total - ospa.score(&a, &b).unwrap().total).abs() < 1e-9);
        let d = |x: &Points, y: &Points| ospa2.score(&tracks(x), &tracks(y), 1..5).unwrap().total;
        prop_assert!((d(&a, &b) - d(&b, &a)).abs() < 1e-9);
        prop_assert_eq!(d(&a, &a), 0.0);
        prop_assert!(d(&a, &c) <= d(&a, &b) + d(&b, &c) + 1e-9);
    }
}

#[test]
fn a_hand_made_case_has_the_parts_that_paper_and_pencil_give() {
    let truth = [[0.0, 0.0], [100.0, 0.0], [200.0, 0.0]];
    let estimates = [[100.0, 6.0], [0.0, 3.0], [500.0, 0.0], [600.0, 0.0]];
    let gospa = Gospa::new(10.0, 2.0).unwrap().score(&truth, &estimates).unwrap();
    assert_eq!(gospa.pairs, [(0, 1), (1, 0)]);
    assert_eq!(gospa.parts, GospaParts { localisation: 45.0, missed: 50.0, false_alarm: 100.0 });
    assert_eq!((gospa.total, gospa.missed, gospa.false_alarms), (195f64.sqrt(), 1, 2));
    assert_eq!(gospa.parts.figures(2.0).false_alarm, 10.0);
    // OSPA pairs the third object with an estimate beyond the cut-off.
    let ospa = Ospa::new(10.0, 2.0).unwrap().score(&truth, &estimates).unwrap();
    assert_eq!(ospa.parts, OspaParts { localisation: 36.25, cardinality: 25.0 });
    assert_eq!(ospa.total, 61.25f64.sqrt());
    assert_eq!(ospa.parts.figures(2.0).cardinality, 5.0);
}

#[test]
fn a_pair_at_the_cut_off_is_one_missed_and_one_false() {
    let score = Gospa::new(5.0, 1.0).unwrap().score(&[[0.0, 0.0]], &[[3.0, 4.0]]).unwrap();
    assert!(score.pairs.is_empty());
    assert_eq!(score.parts, GospaParts { localisation: 0.0, missed: 2.5, false_alarm: 2.5 });
}

#[test]
fn totals_are_right_for_orders_and_cut_offs_whose_powers_overflow_or_vanish() {
    for (cutoff, order) in
        [(1000.0, 150.0), (1e-3, 150.0), (1e300, 2.0), (1e-300, 2.0), (100.0, 1e6), (1e308, 1.0)]
    {
        let (gospa, ospa) = (Gospa::new(cutoff, order).unwrap(), Ospa::new(cutoff, order).unwrap());
        let ospa2 = Ospa2::new(cutoff, order).unwrap();
        let close = |found: f64, expected: f64| {
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "{found:e} for {expected:e}, cut-off {cutoff:e}, order {order}"
            );
        };
        let (here, there) = ([[0.0, 0.0]], [[1e-3 * cutoff, 0.0]]);
        assert_eq!(gospa.score::<2>(&[], &[]).unwrap().parts.sum(), 0.0);
        assert_eq!(
            (gospa.score::<2>(&[], &[]).unwrap().total, ospa.score::<2>(&[], &[]).unwrap().total),
            (0.0, 0.0)
        );
        assert_eq!(
            (gospa.score(&here, &here).unwrap().total, ospa.score(&here, &here).unwrap().total),
            (0.0, 0.0)
        );
        close(gospa.score(&here, &there).unwrap().total, 1e-3 * cutoff);
        close(ospa.score(&here, &there).unwrap().total, 1e-3 * cutoff);
        close(gospa.score(&here, &[]).unwrap().total, cutoff * 0.5f64.powf(order.recip()));
        close(ospa.score(&here, &[]).unwrap().total, cutoff);
        let track = |place: [f64; 2]| [Trajectory::new(0, [place; 3])];
        close(ospa2.score(&track(here[0]), &track(there[0]), 0..3).unwrap().total, 1e-3 * cutoff);
        close(ospa2.score(&track(here[0]), &[], 0..3).unwrap().total, cutoff);
    }
}

#[test]
fn pairs_whose_powers_vanish_are_still_the_nearest_ones() {
    let (truth, estimates) = ([[0.0, 0.0], [6.0, 0.0], [0.0, 900.0]], [[0.0, 901.0], [5.0, 0.0], [1.0, 0.0]]);
    let gospa = Gospa::new(1000.0, 150.0).unwrap().score(&truth, &estimates).unwrap();
    assert_eq!(gospa.pairs, [(0, 2), (1, 1), (2, 0)]);
    assert!((gospa.total - 3f64.powf(1.0 / 150.0)).abs() < 1e-12, "{}", gospa.total);
    let ospa = Ospa::new(1000.0, 150.0).unwrap().score(&truth, &estimates).unwrap();
    assert!((ospa.total - 1.0).abs() < 1e-12 && ospa.pairs == gospa.pairs, "{}", ospa.total);
}

#[test]
fn nothing_found_is_zero_and_not_minus_zero() {
    let score = Gospa::new(5.0, 1.0).unwrap().score(&[[0.0, 0.0]], &[[30.0, 4.0]]).unwrap();
    assert!(
        score.parts.localisation.is_sign_positive()
            && score.parts.figures(1.0).localisation.is_sign_positive()
    );
}

#[test]
fn pairs_that_are_named_score_as_the_points_do_and_strangers_among_them_are_refused() {
    let (gospa, ospa) = (Gospa::new(10.0, 2.0).unwrap(), Ospa::new(10.0, 2.0).unwrap());
    let (truth, estimates) = ([[0.0, 0.0], [8.0, 0.0]], [[3.0, 0.0], [4.0, 0.0], [90.0, 0.0]]);
    // Named twice, in any order, and beyond the cut-off as well.
    let mut near = pairs_within(&truth, &estimates, 100.0);
    near.extend(near.clone().into_iter().rev());
    assert_eq!(gospa.score_pairs(2, 3, &near).unwrap(), gospa.score(&truth, &estimates).unwrap());
    assert_eq!(ospa.score_pairs(2, 3, &near).unwrap(), ospa.score(&truth, &estimates).unwrap());
    for stranger in [(2, 0, 1.0), (0, 3, 1.0), (0, 0, -1.0), (0, 0, f64::NAN)] {
        assert!(
            gospa.score_pairs(2, 3, &[stranger]).is_err() && ospa.score_pairs(2, 3, &[stranger]).is_err()
        );
    }
}

#[test]
fn a_distance_of_ones_own_is_used() {
    let gospa = Gospa::new(10.0, 1.0).unwrap();
    let score = gospa.score_by(2, 2, |i, j| if i == j { f64::INFINITY } else { 1.0 }).unwrap();
    assert_eq!((score.pairs, score.total), (vec![(0, 1), (1, 0)], 2.0));
}

#[test]
fn what_is_no_position_distance_or_parameter_is_refused() {
    for (cutoff, order) in
        [(0.0, 1.0), (-1.0, 1.0), (f64::NAN, 1.0), (f64::INFINITY, 1.0), (1.0, 0.9), (1.0, f64::NAN)]
    {
        assert!(Gospa::new(cutoff, order).is_err() && Ospa::new(cutoff, order).is_err());
        assert!(Ospa2::new(cutoff, order).is_err());
    }
    let (gospa, ospa) = (Gospa::new(10.0, 2.0).unwrap(), Ospa::new(10.0, 2.0).unwrap());
    assert!(gospa.score(&[[f64::NAN, 0.0]], &[]).is_err() && ospa.score(&[], &[[f64::INFINITY]]).is_err());
    assert!(gospa.score_by(1, 1, |_, _| -1.0).is_err() && ospa.score_by(1, 1, |_, _| f64::NAN).is_err());
    let bad = Trajectory::new(0, [[f64::NAN]]);
    assert!(Ospa2::new(1.0, 1.0).unwrap().score(&[bad], &[], 0..1).is_err());
}

#[test]
fn averages_of_parts_of_a_study_are_those_of_all_its_scores() {
    let gospa = Gospa::new(10.0, 2.0).unwrap();
    let scores = [
        gospa.score(&[[0.0]], &[[3.0]]).unwrap(),
        gospa.score(&[[0.0]], &[]).unwrap(),
        gospa.score(&[], &[[1.0], [2.0]]).unwrap(),
    ];
    let (mut whole, mut first, mut rest) =
        (GospaAverage::new(2.0), GospaAverage::new(2.0), GospaAverage::new(2.0));
    assert_eq!((whole.mean(), whole.root_mean(), whole.parts()), (None, None, None));
    scores.iter().for_each(|score| whole.push(score));
    first.push(&scores[0]);
    scores[1..].iter().for_each(|score| rest.push(score));
    first.merge(&rest);
    assert_eq!(first, whole);
    assert_eq!(whole.count(), 3);
    let parts = whole.parts().unwrap();
    assert!((parts.localisation - 3.0).abs() < 1e-12 && (parts.missed - 50.0 / 3.0).abs() < 1e-12);
    assert!((whole.root_mean().unwrap() - (159.0f64 / 3.0).sqrt()).abs() < 1e-12);
    assert!((whole.mean().unwrap() - (3.0 + 50f64.sqrt() + 10.0) / 3.0).abs() < 1e-12);
}

#[test]
fn ospa2_counts_the_steps_of_the_window_at_which_one_of_two_exists() {
    let ospa2 = Ospa2::new(10.0, 1.0).unwrap();
    let truth = [Trajectory::new(0, [[0.0]; 8])];
    // Off by 2 m at steps 0 and 1, a gap at 2, right at 3; the window leaves out step 0.
    let track = Trajectory { start: 0, positions: vec![Some([2.0]), Some([2.0]), None, Some([0.0])] };
    let old = Trajectory::new(0, [[0.0]]);
    let score = ospa2.score(&truth, &[old, track], 1..4).unwrap();
    assert_eq!(score.pairs, [(0, 1)]);
    assert!((score.total - 4.0).abs() < 1e-12);
    assert_eq!(ospa2.score(&truth, &[], 8..12).unwrap().total, 0.0);
}
