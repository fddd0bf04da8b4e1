//! What is true of every tracker.

mod reports;

use super::*;
use crate::filter::{Extended, Kalman};
use crate::motion::ConstantVelocity;
use crate::sensor::{BearingOnly, Measurement, Position, RangeBearing};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

type Plots = Vec<Measurement<2>>;
type Plain = Kalman<ConstantVelocity, Position>;

fn filter() -> Plain {
    Kalman::new(ConstantVelocity::new(0.05).with_speed(15.0), Position::new(5.0).unwrap())
}

/// True positions of objects that start at `start` and move with `velocity`.
fn truth(objects: &[[f64; 4]], time: f64) -> Vec<[f64; 2]> {
    objects.iter().map(|o| [o[0] + time * o[2], o[1] + time * o[3]]).collect()
}

/// A scan of these objects, seen with probability `p_d` and 5 m noise, and `clutter` clutter points in a square kilometre.
fn plots(objects: &[[f64; 4]], time: f64, p_d: f64, clutter: usize, random: &mut ChaCha8Rng) -> Plots {
    let mut plots = Plots::new();
    for place in truth(objects, time) {
        if random.random::<f64>() < p_d {
            let [dx, dy]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(random));
            plots.push([place[0] + 5.0 * dx, place[1] + 5.0 * dy].into());
        }
    }
    for _ in 0..clutter {
        plots.push([random.random_range(0.0..1000.0), random.random_range(0.0..1000.0)].into());
    }
    plots
}

const CROSSING: [[f64; 4]; 3] =
    [[100.0, 500.0, 10.0, 0.0], [500.0, 900.0, 0.0, -9.0], [800.0, 100.0, -6.0, 6.0]];

fn confirmed<B>(tracks: &[Track<B>]) -> Vec<&Track<B>> {
    tracks.iter().filter(|t| matches!(t.status, Status::Confirmed | Status::Coasted)).collect()
}

fn scan<'a, Z>(
    time: f64,
    measurements: &'a [Z],
    (detection, clutter): &'a (Detection, Clutter),
) -> Scan<'a, Z> {
    Scan { time, measurements, detection, clutter }
}

fn scene() -> (Detection, Clutter) {
    (Detection::uniform(0.95).unwrap(), Clutter::per_scan(10.0, 1e6).unwrap())
}

/// The tests below, for a tracker made by an expression.
macro_rules! every_tracker {
    ($name:ident, $make:expr) => {
        mod $name {
            use super::*;

            #[test]
            fn crossing_objects_in_clutter_are_found_and_little_else() {
                let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(1));
                let mut tracker = $make;
                let (mut missed, mut extra) = (0, 0);
                for step in 0..60 {
                    let time = f64::from(step);
                    let plots = plots(&CROSSING, time, 0.95, 10, &mut random);
                    tracker.step(&filter, &scan(time, &plots, &scene)).unwrap();
                    let found = confirmed(tracker.tracks());
                    let near = |place: &[f64; 2]| {
                        let far = |m: &nalgebra::Vector4<f64>| (m[0] - place[0]).hypot(m[1] - place[1]);
                        found.iter().any(|track| far(&track.belief.mean) < 25.0)
                    };
                    if step >= 6 {
                        missed += truth(&CROSSING, time).iter().filter(|place| !near(place)).count();
                        extra += found.len().saturating_sub(CROSSING.len());
                    }
                }
                assert!(missed <= 8, "{missed} of 162 object-scans missed");
                assert!(extra <= 12, "{extra} false tracks in 54 scans");
            }

            #[test]
            fn the_order_of_measurements_does_not_matter() {
                let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(2));
                let (mut forward, mut backward) = ($make, $make);
                for step in 0..30 {
                    let mut plots = plots(&CROSSING, f64::from(step), 0.9, 6, &mut random);
                    forward.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
                    plots.reverse();
                    backward.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
                }
                let means = |tracks: &[Track<Gaussian<4>>]| {
                    let mut all: Vec<[f64; 4]> =
                        confirmed(tracks).iter().map(|track| track.belief.mean.into()).collect();
                    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
                    all
                };
                let (a, b) = (means(forward.tracks()), means(backward.tracks()));
                assert_eq!(a.len(), b.len());
                for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
                    assert!((a - b).abs() < 1e-6, "{a} {b}");
                }
            }

            #[test]
            fn every_measurement_is_accounted_for() {
                let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(3));
                let mut tracker = $make;
                for step in 0..20 {
                    let plots = plots(&CROSSING, f64::from(step), 0.9, 15, &mut random);
                    tracker.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
                    let uses = tracker.uses();
                    assert_eq!(uses.len(), plots.len());
                    for track in tracker.tracks() {
                        if let Some(number) = track.measurement {
                            assert!(number < plots.len());
                        }
                    }
                    for used in uses {
                        if let Use::Updated(id) | Use::Started(id) = used {
                            let tracks = tracker.tracks();
                            assert!(tracks.iter().any(|track| track.id == *id));
                        }
                    }
                }
            }

            #[test]
            fn numbers_of_tracks_rise_and_are_never_used_twice() {
                let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(4));
                let mut tracker = $make;
                let mut dead = std::collections::BTreeSet::new();
                for step in 0..40 {
                    let plots = plots(&CROSSING, f64::from(step), 0.6, 10, &mut random);
                    tracker.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
                    let tracks = tracker.tracks();
                    assert!(tracks.windows(2).all(|pair| pair[0].id < pair[1].id));
                    assert!(tracks.iter().all(|track| !dead.contains(&track.id)));
                    dead.extend(tracks.iter().filter(|t| t.status == Status::Deleted).map(|t| t.id));
                }
            }

            #[test]
            fn objects_that_leave_are_given_up_and_empty_scans_are_scans() {
                let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(5));
                let mut tracker = $make;
                for step in 0..15 {
                    let plots = plots(&CROSSING, f64::from(step), 1.0, 0, &mut random);
                    tracker.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
                }
                assert_eq!(confirmed(tracker.tracks()).len(), 3);
                for step in 15..30 {
                    tracker.step(&filter, &scan(f64::from(step), &[], &scene)).unwrap();
                }
                assert!(tracker.tracks().is_empty());
            }

            #[test]
            fn scans_out_of_order_and_broken_numbers_are_refused_without_a_trace() {
                let (filter, scene) = (filter(), scene());
                let mut tracker = $make;
                let plot = [Measurement::from([1.0, 2.0])];
                tracker.step(&filter, &scan(10.0, &plot, &scene)).unwrap();
                let before = tracker.tracks().to_vec();
                let late = tracker.step(&filter, &scan(9.0, &plot, &scene));
                assert_eq!(late, Err(TrackerError::OutOfOrder { time: 9.0, last: 10.0 }));
                assert!(tracker.step(&filter, &scan(f64::NAN, &plot, &scene)).is_err());
                let broken = [plot[0], [f64::NAN, 0.0].into()];
                let error = tracker.step(&filter, &scan(11.0, &broken, &scene));
                assert_eq!(error, Err(TrackerError::Measurement { time: 11.0, measurement: 1 }));
                assert_eq!(tracker.tracks(), before);
                assert_eq!(tracker.time(), Some(10.0));
            }

            #[test]
            fn certain_detection_and_no_clutter_are_allowed() {
                let filter = filter();
                let scene = (Detection::uniform(1.0).unwrap(), Clutter::Uniform(0.0));
                let mut tracker = $make;
                for step in 0..10 {
                    let time = f64::from(step);
                    let seen: Plots = truth(&CROSSING, time).into_iter().map(Into::into).collect();
                    tracker.step(&filter, &scan(time, if step == 6 { &[] } else { &seen }, &scene)).unwrap();
                }
                let tracks = tracker.tracks();
                assert!(tracks.iter().all(|track| track.existence.is_finite()));
            }

            #[test]
            fn ten_thousand_measurements_at_one_place_are_survived() {
                let (filter, scene) = (filter(), scene());
                let mut tracker = $make;
                let plots: Plots = vec![[0.0, 0.0].into(); 10_000];
                tracker.step(&filter, &scan(0.0, &plots, &scene)).unwrap();
                tracker.step(&filter, &scan(1.0, &plots[..10], &scene)).unwrap();
            }

            #[test]
            fn a_polar_sensor_across_the_cut_is_no_special_case() {
                let radar = RangeBearing::new(5.0, 0.01).unwrap();
                let filter = Extended::new(ConstantVelocity::new(0.05).with_speed(15.0), radar);
                let scene = scene();
                let mut tracker = $make;
                for step in 0..20 {
                    let state = nalgebra::vector![-400.0, 50.0 - 5.0 * f64::from(step), 0.0, -5.0];
                    let seen = crate::sensor::Sensor::<4, 2>::expected(&radar, &state);
                    tracker.step(&filter, &scan(f64::from(step), &[seen.into()], &scene)).unwrap();
                }
                let tracks = tracker.tracks();
                assert_eq!(confirmed(tracks).len(), 1);
                assert_eq!(confirmed(tracks)[0].id, 1);
            }

            #[test]
            fn sensors_of_different_kinds_update_the_same_tracks() {
                let (radar, scene) = (filter(), scene());
                let motion = ConstantVelocity::new(0.05).with_speed(15.0);
                let camera = Extended::new(motion, BearingOnly::new(0.002).unwrap());
                let mut tracker = $make;
                for step in 0..10 {
                    let time = f64::from(step);
                    let place = [300.0, 400.0 + 5.0 * time];
                    tracker.step(&radar, &scan(time, &[place.into()], &scene)).unwrap();
                    let bearing = [place[1].atan2(place[0])].into();
                    tracker.step(&camera, &scan(time, &[bearing], &scene)).unwrap();
                }
                let tracks = tracker.tracks();
                assert_eq!(confirmed(tracks).len(), 1);
                assert!(confirmed(tracks)[0].hits >= 18);
            }
        }
    };
}

every_tracker!(
    nearest_neighbour,
    NearestNeighbour::<Gaussian<4>>::new(NearestNeighbourConfig::default()).unwrap()
);
every_tracker!(phd, Phd::<Gaussian<4>>::new(PhdConfig::default()).unwrap());
every_tracker!(multi_bernoulli, MultiBernoulli::<Gaussian<4>>::new(MultiBernoulliConfig::default()).unwrap());
every_tracker!(jpda, Jpda::<Gaussian<4>>::new(JpdaConfig::default()).unwrap());
every_tracker!(pmbm, Pmbm::<Gaussian<4>>::new(PmbmConfig::default()).unwrap());

#[test]
fn the_weights_of_the_phd_count_the_objects() {
    let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(6));
    let mut phd = Phd::<Gaussian<4>>::new(PhdConfig::default()).unwrap();
    let mut sum = 0.0;
    for step in 0..100 {
        let plots = plots(&CROSSING, f64::from(step) * 0.5, 0.95, 10, &mut random);
        phd.step(&filter, &scan(f64::from(step) * 0.5, &plots, &scene)).unwrap();
        if step >= 20 {
            sum += phd.expected_objects() / 80.0;
        }
    }
    // Three objects, and the births of ten unexplained measurements.
    assert!((sum - 3.5).abs() < 0.4, "{sum}");
}

#[test]
fn the_number_of_objects_of_the_multi_bernoulli_has_no_bias() {
    let (filter, scene) = (filter(), scene());
    // Births add their own expectation; these add a hundredth of an object.
    let config = MultiBernoulliConfig { birth: 1e-3, prune: 1e-5, ..MultiBernoulliConfig::default() };
    let (mut sum, mut count) = (0.0, 0.0);
    for run in 0..200 {
        let mut random = ChaCha8Rng::seed_from_u64(1000 + run);
        let mut tracker = MultiBernoulli::<Gaussian<4>>::new(config).unwrap();
        for step in 0..25 {
            let plots = plots(&CROSSING, f64::from(step), 0.95, 10, &mut random);
            tracker.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
            if step >= 15 {
                sum += tracker.expected_objects();
                count += 1.0;
            }
        }
    }
    let bias = sum / count - 3.0;
    assert!(bias.abs() < 0.1, "{bias}");
}

#[test]
fn an_outage_is_survived_by_memory_and_a_thousand_births_a_scan_by_the_caps() {
    let (filter, scene, mut random) = (filter(), scene(), ChaCha8Rng::seed_from_u64(8));
    let config = PmbmConfig { cap: 300, ..PmbmConfig::default() };
    let mut pmbm = Pmbm::<Gaussian<4>>::new(config).unwrap();
    let mut member =
        MultiBernoulli::<Gaussian<4>>::new(MultiBernoulliConfig { cap: 300, ..Default::default() }).unwrap();
    for step in 0..38 {
        let seen = !(4..34).contains(&step);
        let plots =
            if seen { plots(&CROSSING, f64::from(step), 0.95, 1000, &mut random) } else { Plots::new() };
        pmbm.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
        member.step(&filter, &scan(f64::from(step), &plots, &scene)).unwrap();
        let alive =
            |tracks: &[Track<Gaussian<4>>]| tracks.iter().filter(|t| t.status != Status::Deleted).count();
        assert!(alive(pmbm.tracks()) <= 300);
        // Those that this scan starts wait for the next one.
        assert!(alive(member.tracks()) <= 300 + 1003);
    }
}

#[test]
fn a_track_that_is_given_up_after_a_gap_is_reported_where_it_would_be_by_then() {
    fn check<T: Tracker<Belief = Gaussian<4>>>(name: &str, mut tracker: T) {
        let (filter, scene) = (filter(), scene());
        for second in 0..10 {
            let plots: Plots = vec![[10.0 * f64::from(second), 50.0].into()];
            tracker.step(&filter, &scan(f64::from(second), &plots, &scene)).unwrap();
        }
        let confirmed = tracker.tracks().iter().find(|track| track.status == Status::Confirmed);
        let id = confirmed.map(|track| track.id).unwrap_or_else(|| panic!("{name}: nothing is confirmed"));
        tracker.step(&filter, &scan(1009.0, &Plots::new(), &scene)).unwrap();
        for track in tracker.tracks().iter().filter(|track| track.id == id) {
            assert!((track.belief.mean[0] - 10_090.0).abs() < 1_000.0, "{name}: {}", track.belief.mean);
            assert!(track.existence.is_sign_positive(), "{name}");
        }
    }
    check("nearest neighbour", NearestNeighbour::new(NearestNeighbourConfig::default()).unwrap());
    check("jpda", Jpda::new(JpdaConfig::default()).unwrap());
    check("phd", Phd::new(PhdConfig::default()).unwrap());
    check("multi-Bernoulli", MultiBernoulli::new(MultiBernoulliConfig::default()).unwrap());
    check("pmbm", Pmbm::new(PmbmConfig::default()).unwrap());
}

proptest! {
    #[test]
    fn any_scans_leave_finite_tracks(
        scans in prop::collection::vec(
            (0.0..20.0f64, prop::collection::vec((-1e6..1e6f64, -1e6..1e6f64), 0..12)), 1..12),
    ) {
        let (filter, scene) = (filter(), scene());
        let mut nearest = NearestNeighbour::<Gaussian<4>>::new(NearestNeighbourConfig::default()).unwrap();
        let mut phd = Phd::<Gaussian<4>>::new(PhdConfig::default()).unwrap();
        let mut member = MultiBernoulli::<Gaussian<4>>::new(MultiBernoulliConfig::default()).unwrap();
        let mut jpda = Jpda::<Gaussian<4>>::new(JpdaConfig::default()).unwrap();
        let mut pmbm = Pmbm::<Gaussian<4>>::new(PmbmConfig::default()).unwrap();
        let mut time = 0.0;
        for (dt, places) in scans {
            time += dt;
            let plots: Plots = places.into_iter().map(|(x, y)| [x, y].into()).collect();
            nearest.step(&filter, &scan(time, &plots, &scene)).unwrap();
            phd.step(&filter, &scan(time, &plots, &scene)).unwrap();
            member.step(&filter, &scan(time, &plots, &scene)).unwrap();
            jpda.step(&filter, &scan(time, &plots, &scene)).unwrap();
            pmbm.step(&filter, &scan(time, &plots, &scene)).unwrap();
            let all = nearest.tracks().iter().chain(phd.tracks()).chain(member.tracks());
            let all = all.chain(jpda.tracks()).chain(pmbm.tracks());
            for track in all {
                prop_assert!(track.belief.mean.iter().all(|x| x.is_finite()));
                prop_assert!((0.0..=1.0).contains(&track.existence));
            }
        }
    }
}
