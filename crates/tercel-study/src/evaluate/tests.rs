use proptest::prelude::*;
use tercel_core::metric::Trajectory;
use tercel_core::multi::Status;
use tercel_data::table::{Track, Truth};

use super::*;

/// Time, number and place of a row of the tracks, and of the truth.
type Told = (f64, u64, [f64; 2]);
type Known = (f64, usize, [f64; 2]);

fn tracks(rows: impl IntoIterator<Item = Told>) -> Tracks {
    let row = |(time, track, [x, y]): Told| Track {
        time,
        sensor: "radar".into(),
        track,
        status: Status::Confirmed,
        existence: 1.0,
        state: vec![x, y],
        covariance: vec![],
        modes: vec![],
        extent: None,
        altitude: None,
        identity: None,
        detection: None,
    };
    let rows = rows.into_iter().map(row).collect();
    Tracks { labels: vec!["x".into(), "y".into()], rows, ..Tracks::default() }
}

fn truths(rows: impl IntoIterator<Item = Known>) -> Truths {
    let row = |(time, object, position): Known| Truth {
        time,
        object: format!("object {object:04}").into(),
        position,
        z: None,
        velocity: None,
        extent: None,
    };
    Truths { rows: rows.into_iter().map(row).collect(), ..Truths::default() }
}

/// An object that goes east, 10 m each second.
fn east(times: impl IntoIterator<Item = f64>) -> Vec<Known> {
    times.into_iter().map(|time| (time, 0, [10.0 * time, 0.0])).collect()
}

/// A track of it that is `off` metres aside.
fn follow(times: impl IntoIterator<Item = f64>, off: f64) -> Vec<Told> {
    times.into_iter().map(|time| (time, 1, [10.0 * time, off])).collect()
}

fn seconds(from: u32, to: u32) -> impl Iterator<Item = f64> + Clone {
    (from..=to).map(f64::from)
}

fn score(tracks: Vec<Told>, truths_rows: Vec<Known>) -> Evaluation {
    evaluate(&self::tracks(tracks), &truths(truths_rows), &EvaluateOptions::default()).unwrap()
}

#[track_caller]
fn assert_mean(evaluation: &Evaluation, name: &str, expected: f64) {
    let found = evaluation.mean(name).unwrap();
    assert!((found - expected).abs() < 1e-9 || (found.is_nan() && expected.is_nan()), "{name}: {found}");
}

#[test]
fn no_track_at_all_is_everything_missed() {
    let evaluation = score(vec![], east(seconds(1, 5)));
    assert_eq!(evaluation.instants.len(), 5);
    for (name, expected) in
        [("covered", 0.0), ("gospa", 10.0), ("ospa", 20.0), ("tgospa", 10.0), ("false_tracks", 0.0)]
    {
        assert_mean(&evaluation, name, expected);
    }
    assert!(evaluation.mean("gospa_localisation").unwrap().is_sign_positive());
}

#[test]
fn times_of_the_truth_without_a_track_are_missed() {
    let evaluation = score(follow([1.0, 5.0], 0.0), east(seconds(1, 5)));
    assert_mean(&evaluation, "covered", 0.4);
    assert_mean(&evaluation, "gospa", 6.0);
}

#[test]
fn no_truth_at_all_is_everything_false() {
    let evaluation = score(follow(seconds(1, 4), 0.0), vec![]);
    for (name, expected) in
        [("covered", f64::NAN), ("gospa", 10.0), ("false_tracks", 1.0), ("gospa_near", 0.0)]
    {
        assert_mean(&evaluation, name, expected);
    }
}

#[test]
fn a_tracker_that_says_less_does_not_score_better() {
    let all = score(follow(seconds(0, 30), 3.0), east(seconds(0, 30)));
    let ends: [Vec<f64>; 4] = [
        seconds(0, 12).collect(),
        seconds(20, 30).collect(),
        vec![4.0, 29.0],
        seconds(0, 5).chain(seconds(25, 30)).collect(),
    ];
    for times in ends {
        let less = score(follow(times, 3.0), east(seconds(0, 30)));
        assert!(less.mean("covered") < all.mean("covered") && less.mean("gospa") > all.mean("gospa"));
        assert!(less.mean("tgospa") > all.mean("tgospa"));
    }
}

#[test]
fn truth_told_more_often_or_less_often_than_tracks_are_reported_changes_nothing_for_a_straight_course() {
    let fine = || (0..=480).map(|k| 0.25 * f64::from(k));
    let coarse = || (0..=30).map(|k| 4.0 * f64::from(k));
    for (reported, told) in [
        (fine().collect::<Vec<_>>(), coarse().collect::<Vec<_>>()),
        (coarse().collect(), fine().collect()),
        (coarse().collect(), vec![0.0, 60.0, 120.0]),
        (seconds(0, 120).map(|time| time + 1e-4).collect(), seconds(0, 120).collect()),
    ] {
        let evaluation = score(follow(reported, 1.0), east(told));
        assert_mean(&evaluation, "covered", 1.0);
        assert!((evaluation.mean("gospa").unwrap() - 1.0).abs() < 1e-3);
        assert_mean(&evaluation, "cardinality_error", 0.0);
    }
}

#[test]
fn an_object_counts_only_while_it_lives_and_times_beyond_the_truth_do_not() {
    let other = seconds(3, 4).map(|time| (time, 1, [500.0, 500.0]));
    let evaluation =
        score(follow(seconds(0, 9), 0.0), east(seconds(1, 6)).into_iter().chain(other).collect());
    let objects: Vec<usize> = evaluation.instants.iter().map(|instant| instant.objects).collect();
    assert_eq!(objects, [1, 1, 2, 2, 1, 1]);
}

#[test]
fn one_metre_off_is_one_metre_at_any_order_and_cut_off() {
    for (order, cutoff) in [(1.0, 20.0), (8.0, 100.0), (150.0, 1000.0), (1000.0, 1e5)] {
        let options = EvaluateOptions { order, cutoff, ..EvaluateOptions::default() };
        let (tracks, truths) = (tracks(follow(seconds(1, 5), 1.0)), truths(east(seconds(1, 5))));
        let evaluation = evaluate(&tracks, &truths, &options).unwrap();
        for name in ["gospa", "gospa_near", "ospa", "tgospa"] {
            assert_mean(&evaluation, name, 1.0);
        }
    }
}

#[test]
fn a_pair_at_the_cut_off_is_missed_and_false_in_every_figure() {
    let evaluation = score(follow(seconds(1, 5), 20.0), east(seconds(1, 5)));
    for (name, expected) in [
        ("covered", 0.0),
        ("false_tracks", 1.0),
        ("false_tracks_near", 1.0),
        ("gospa_localisation", 0.0),
        ("gospa_missed", 10.0),
        ("gospa_false", 10.0),
        ("rmse_pos_norm", f64::NAN),
        ("tgospa", 20.0),
    ] {
        assert_mean(&evaluation, name, expected);
    }
}

/// The figures of one time by looking at every pair: covered, false, near, rmse terms.
struct Plain {
    options: EvaluateOptions,
    last: Vec<Option<u64>>,
    when: Vec<usize>,
}

type Here<I> = Vec<(I, [f64; 2])>;

impl Plain {
    fn instant(&mut self, step: usize, objects: &Here<usize>, tracks: &Here<u64>) -> (Instant, Vec<f64>) {
        let c = self.options.cutoff;
        let apart = |i: usize, j: usize| {
            f64::hypot(objects[i].1[0] - tracks[j].1[0], objects[i].1[1] - tracks[j].1[1])
        };
        let nearest = |j: usize| (0..objects.len()).map(|i| apart(i, j)).fold(f64::INFINITY, f64::min);
        let far: Vec<f64> = (0..tracks.len()).map(nearest).collect();
        let gospa = Gospa::new(c, self.options.order).unwrap();
        let ospa = Ospa::new(c, self.options.order).unwrap();
        let near: Vec<usize> =
            (0..tracks.len()).filter(|&j| far[j] < c || far[j] <= self.options.near).collect();
        let score = gospa.score_by(objects.len(), tracks.len(), apart).unwrap();
        let (switches, covered) = self.joined(step, objects, tracks, &apart);
        let found = (0..objects.len())
            .map(|i| (0..tracks.len()).map(|j| apart(i, j)).fold(f64::INFINITY, f64::min))
            .filter(|distance| *distance < c);
        let instant = Instant {
            gospa: score.total,
            gospa_near: gospa.score_by(objects.len(), near.len(), |i, j| apart(i, near[j])).unwrap().total,
            ospa: ospa.score_by(objects.len(), tracks.len(), apart).unwrap().total,
            false_tracks: far.iter().filter(|distance| **distance >= c).count(),
            false_tracks_near: far.iter().filter(|d| **d >= c && **d <= self.options.near).count(),
            switches,
            covered,
            ..Instant::default()
        };
        (instant, found.collect())
    }

    fn joined(
        &mut self,
        step: usize,
        objects: &Here<usize>,
        tracks: &Here<u64>,
        apart: &dyn Fn(usize, usize) -> f64,
    ) -> (usize, usize) {
        let mut joined: Vec<Option<usize>> = vec![None; objects.len()];
        let mut order: Vec<usize> = (0..objects.len()).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(self.when[objects[i].0]));
        for i in order {
            let held = tracks.iter().position(|track| self.last[objects[i].0] == Some(track.0));
            joined[i] = held.filter(|&j| !joined.contains(&Some(j)) && apart(i, j) < self.options.cutoff);
        }
        loop {
            let open = (0..objects.len())
                .filter(|&i| joined[i].is_none())
                .flat_map(|i| (0..tracks.len()).filter(|&j| !joined.contains(&Some(j))).map(move |j| (i, j)));
            let best = open.min_by(|a, b| apart(a.0, a.1).total_cmp(&apart(b.0, b.1)).then(a.cmp(b)));
            match best.filter(|&(i, j)| apart(i, j) < self.options.cutoff) {
                Some((i, j)) => joined[i] = Some(j),
                None => break,
            }
        }
        let mut switches = 0;
        for (i, j) in joined.iter().enumerate().filter_map(|(i, j)| Some((i, (*j)?))) {
            let object = objects[i].0;
            switches += usize::from(self.last[object].is_some_and(|last| last != tracks[j].0));
            self.last[object] = Some(tracks[j].0);
            self.when[object] = step + 1;
        }
        (switches, joined.iter().flatten().count())
    }
}

/// Objects on a walk over a small place, and tracks that follow them, break, and go astray: of each some rows.
fn scene() -> impl Strategy<Value = (Vec<Known>, Vec<Told>)> {
    let walk = prop::collection::vec((0.0..60.0f64, 0.0..60.0f64, 0u8..4), 25);
    let set = prop::collection::vec((walk, 0usize..15, 5usize..25), 0..6);
    (set.clone(), set).prop_map(|(objects, strangers)| {
        let (mut truth, mut told) = (Vec::new(), Vec::new());
        for (number, (walk, from, to)) in objects.iter().enumerate() {
            let mut place = [30.0 + 20.0 * number as f64, 30.0];
            for (step, (x, y, luck)) in walk.iter().enumerate().take(*to).skip(*from) {
                place = [0.8 * place[0] + 0.2 * x, 0.8 * place[1] + 0.2 * y];
                truth.push((step as f64, number, place));
                let track = (2 * number + step / 12) as u64;
                if *luck > 0 {
                    told.push((step as f64, track, [place[0] + 0.05 * x, place[1] - 0.05 * y]));
                }
            }
        }
        for (number, (walk, from, to)) in strangers.iter().enumerate() {
            let rows = walk.iter().enumerate().take(*to).skip(*from);
            told.extend(rows.map(|(step, (x, y, _))| (step as f64, 100 + number as u64, [4.0 * x, *y])));
        }
        (truth, told)
    })
}

/// Objects and tracks as a look at every line finds them at a time.
struct Lines {
    objects: BTreeMap<Arc<str>, Timeline>,
    tracks: BTreeMap<u64, Timeline>,
    truth_reach: Reach,
    track_reach: Reach,
}

impl Lines {
    fn new(truths: &Truths, tracks: &Tracks, options: &EvaluateOptions) -> Lines {
        let (objects, tracks) = (timeline::of_truths(truths), timeline::of_tracks(tracks));
        let (truth_reach, track_reach) = (truth_reach(&objects, options), track_reach(&tracks));
        Lines { objects, tracks, truth_reach, track_reach }
    }

    fn at(&self, time: f64) -> (Here<usize>, Here<u64>) {
        let objects = self.objects.values().enumerate();
        let tracks = self.tracks.iter();
        (
            objects.filter_map(|(id, line)| Some((id, line.interpolate(time, self.truth_reach)?))).collect(),
            tracks.filter_map(|(id, line)| Some((*id, line.extrapolate(time, self.track_reach)?))).collect(),
        )
    }

    /// Trajectory GOSPA of the pieces that a look at every time finds.
    fn trajectories(&self, times: &[f64], options: &EvaluateOptions) -> f64 {
        let line = |at: &dyn Fn(f64) -> Option<[f64; 2]>| {
            broken(&Trajectory { start: 0, positions: times.iter().map(|&time| at(time)).collect() })
        };
        let there: Vec<Trajectory<2>> = self
            .objects
            .values()
            .flat_map(|one| line(&|time| one.interpolate(time, self.truth_reach)))
            .collect();
        let reported: Vec<Trajectory<2>> = self
            .tracks
            .values()
            .flat_map(|one| line(&|time| one.extrapolate(time, self.track_reach)))
            .collect();
        let metric = TrajectoryGospa::new(options.cutoff, options.order, 0.5 * options.cutoff).unwrap();
        let sum = metric.score(&there, &reported).unwrap().parts.sum();
        (sum / times.len() as f64).powf(options.order.recip())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_figures_are_those_of_a_plain_search_through_all_pairs(
        (truth, told) in scene(),
        cutoff in 3.0..30.0f64,
        near in 1.0..80.0f64,
        order in prop_oneof![Just(1.0), Just(2.0)],
    ) {
        let (truths, tracks) = (truths(truth), tracks(told));
        let options = EvaluateOptions { cutoff, near, order, ..EvaluateOptions::default() };
        let evaluation = evaluate(&tracks, &truths, &options).unwrap();
        let lines = Lines::new(&truths, &tracks, &options);
        let count = lines.objects.len();
        let mut plain = Plain { options: options.clone(), last: vec![None; count], when: vec![0; count] };
        let mut squares = Vec::new();
        for (step, instant) in evaluation.instants.iter().enumerate() {
            let (there, reported) = lines.at(instant.time);
            let (expected, found) = plain.instant(step, &there, &reported);
            prop_assert_eq!((instant.objects, instant.tracks), (there.len(), reported.len()));
            prop_assert_eq!((instant.covered, instant.switches), (expected.covered, expected.switches));
            prop_assert_eq!(instant.false_tracks, expected.false_tracks);
            prop_assert_eq!(instant.false_tracks_near, expected.false_tracks_near);
            let figures = |one: &Instant| [one.gospa, one.gospa_near, one.ospa];
            for (found, expected) in figures(instant).into_iter().zip(figures(&expected)) {
                prop_assert!((found - expected).abs() < 1e-9, "{} instead of {}", found, expected);
            }
            squares.extend(found.iter().map(|distance| distance * distance));
        }
        let rmse = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        prop_assert!(squares.is_empty() || (evaluation.mean("rmse_pos_norm").unwrap() - rmse).abs() < 1e-9);
        let times: Vec<f64> = evaluation.instants.iter().map(|instant| instant.time).collect();
        let (found, expected) = (evaluation.mean("tgospa").unwrap(), lines.trajectories(&times, &options));
        prop_assert!(times.is_empty() || (found - expected).abs() < 1e-7, "{} instead of {}", found, expected);
    }
}

/// The pieces of a trajectory without its gaps.
fn broken(line: &Trajectory<2>) -> Vec<Trajectory<2>> {
    let mut pieces: Vec<Trajectory<2>> = Vec::new();
    for (step, place) in line.positions.iter().enumerate().filter(|(_, place)| place.is_some()) {
        match pieces.last_mut().filter(|piece| piece.steps().end == step) {
            Some(piece) => piece.positions.push(*place),
            None => pieces.push(Trajectory { start: step, positions: vec![*place] }),
        }
    }
    pieces
}
