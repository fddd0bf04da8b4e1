//! The life of a track under every tracker: it starts, is missed, is seen again and ends by the rules that its management sets.

#![allow(clippy::unwrap_used)]

use tercel_core::belief::Gaussian;
use tercel_core::filter::Kalman;
use tercel_core::motion::ConstantVelocity;
use tercel_core::multi::{
    Clutter, Confirmation, Detection, Jpda, JpdaConfig, Management, MultiBernoulli, MultiBernoulliConfig,
    NearestNeighbour, NearestNeighbourConfig, Phd, PhdConfig, Pmbm, PmbmConfig, Scan, Status, Tracker,
};
use tercel_core::sensor::{Measurement, Position};

/// What is seen of an object that moves with 10 m/s.
struct Scene {
    speed: f64,
    clutter: f64,
    /// Seconds between scans.
    interval: f64,
    /// Whether each scan sees it.
    seen: Vec<bool>,
}

impl Scene {
    fn new(seen: Vec<bool>) -> Self {
        Scene { speed: 15.0, clutter: 1e-6, interval: 1.0, seen }
    }

    /// Number and status of the track that is most probable after each scan.
    fn follow<T: Tracker<Belief = Gaussian<4>>>(&self, mut tracker: T) -> Vec<Option<(u64, Status)>> {
        let motion = ConstantVelocity::new(0.1).with_speed(self.speed);
        let filter = Kalman::new(motion, Position::<2>::new(5.0).unwrap());
        let (detection, clutter) = (Detection::uniform(0.9).unwrap(), Clutter::Uniform(self.clutter));
        let mut lives = Vec::new();
        for (step, seen) in self.seen.iter().enumerate() {
            let time = step as f64 * self.interval;
            let place = [10.0 * time, if step % 2 == 0 { 4.0 } else { -4.0 }];
            let plots: Vec<Measurement<2>> = if *seen { vec![place.into()] } else { Vec::new() };
            let scan = Scan { time, measurements: &plots, detection: &detection, clutter: &clutter };
            tracker.step(&filter, &scan).unwrap();
            let best = tracker.tracks().iter().max_by(|a, b| a.existence.total_cmp(&b.existence));
            lives.push(best.map(|track| (track.id, track.status)));
        }
        lives
    }
}

fn believed(life: Option<(u64, Status)>) -> Option<u64> {
    let (id, status) = life?;
    matches!(status, Status::Confirmed | Status::Coasted).then_some(id)
}

/// Ten scans that see the object, so many that do not, and ten that do again.
fn outage(misses: usize) -> Vec<bool> {
    (0..20 + misses).map(|step| !(10..10 + misses).contains(&step)).collect()
}

/// The tests below, for a tracker made from its management.
macro_rules! every_tracker {
    ($name:ident, $tracker:ident, $config:ident, $densest:expr) => {
        mod $name {
            use super::*;

            fn with(change: impl Fn(&mut Management)) -> $tracker<Gaussian<4>> {
                let mut config = $config::default();
                change(&mut config.management);
                $tracker::new(config).unwrap()
            }

            #[test]
            fn a_track_lives_through_the_misses_that_it_is_allowed_and_takes_its_plot_again() {
                for misses in [8, 19] {
                    let tracker = with(|management| {
                        (management.max_misses, management.max_coast) = (20, Some(60.0));
                    });
                    let lives = Scene::new(outage(misses)).follow(tracker);
                    let last = *lives.last().unwrap();
                    assert_eq!(last, Some((1, Status::Confirmed)), "{misses} misses: {lives:?}");
                }
            }

            #[test]
            fn a_track_ends_after_one_miss_more_than_it_is_allowed() {
                let tracker = with(|management| management.max_misses = 6);
                let lives = Scene::new(outage(9)).follow(tracker);
                assert_eq!(lives[15], Some((1, Status::Coasted)), "{lives:?}");
                assert_eq!(lives[16], Some((1, Status::Deleted)), "{lives:?}");
            }

            #[test]
            fn a_track_ends_when_it_coasts_for_longer_than_it_may() {
                let tracker = with(|management| {
                    (management.max_misses, management.max_coast) = (20, Some(7.0));
                });
                let lives = Scene::new(outage(9)).follow(tracker);
                assert_eq!(lives[16], Some((1, Status::Coasted)), "{lives:?}");
                assert_eq!(lives[17], Some((1, Status::Deleted)), "{lives:?}");
            }

            #[test]
            fn slow_scans_are_tracked_as_fast_ones_are() {
                let scene = Scene { interval: 20.0, ..Scene::new(outage(1)) };
                let lives = scene.follow(with(|_| ()));
                assert!(believed(lives[9]).is_some(), "{lives:?}");
                assert_eq!(believed(lives[9]), believed(lives[20]), "{lives:?}");
            }

            #[test]
            fn an_object_is_found_where_clutter_is_as_dense_as_a_new_track_is_wide() {
                for (speed, clutter, interval) in $densest {
                    let scene = Scene { speed, clutter, interval, seen: vec![true; 20] };
                    let lives = scene.follow(with(|_| ()));
                    assert!(believed(lives[19]).is_some(), "{speed} m/s, {clutter} per m²: {lives:?}");
                }
            }
        }
    };
}

// Speed (m/s per axis), clutter (per m²) and interval (s) in which tracks start.
every_tracker!(
    nearest_neighbour,
    NearestNeighbour,
    NearestNeighbourConfig,
    [(15.0, 6e-5, 1.0), (150.0, 2e-7, 4.0), (30.0, 1e-6, 20.0)]
);
every_tracker!(jpda, Jpda, JpdaConfig, [(15.0, 2e-4, 1.0), (150.0, 2e-7, 4.0), (30.0, 5e-7, 20.0)]);
every_tracker!(pmbm, Pmbm, PmbmConfig, [(15.0, 2e-4, 1.0), (150.0, 2e-7, 4.0), (30.0, 1e-6, 20.0)]);
// These confirm by counting, and count only scans that leave an object more probable than not.
every_tracker!(phd, Phd, PhdConfig, [(15.0, 6e-5, 1.0), (150.0, 1e-7, 4.0), (30.0, 5e-7, 20.0)]);
every_tracker!(
    multi_bernoulli,
    MultiBernoulli,
    MultiBernoulliConfig,
    [(15.0, 6e-5, 1.0), (150.0, 2e-8, 4.0), (30.0, 2e-7, 20.0)]
);

/// For trackers that count what the most likely assignment says.
macro_rules! counting {
    ($name:ident, $tracker:ident, $config:ident) => {
        #[test]
        fn $name() {
            let confirm = Confirmation::Hits { hits: 3, scans: 5 };
            for seen in [
                [true, false, true, true, true],
                [true, true, false, false, true],
                [true, false, false, true, true],
            ] {
                let mut config = $config::default();
                config.management.confirm = confirm;
                let lives = Scene::new(seen.to_vec()).follow($tracker::<Gaussian<4>>::new(config).unwrap());
                let third = seen
                    .iter()
                    .scan(0, |hits, seen| {
                        *hits += u32::from(*seen);
                        Some(*hits)
                    })
                    .position(|hits| hits == 3);
                assert_eq!(lives[third.unwrap()], Some((1, Status::Confirmed)), "{seen:?}: {lives:?}");
                assert!(
                    lives[..third.unwrap()].iter().all(|life| *life == Some((1, Status::Tentative))),
                    "{lives:?}"
                );
            }
        }
    };
}

counting!(nearest_neighbour_gives_a_track_its_five_scans, NearestNeighbour, NearestNeighbourConfig);
counting!(jpda_gives_a_track_its_five_scans, Jpda, JpdaConfig);
counting!(pmbm_gives_a_track_its_five_scans, Pmbm, PmbmConfig);
