use super::*;
use crate::belief::Gaussian;
use crate::filter::Kalman;
use crate::motion::ConstantVelocity;
use crate::multi::{Clutter, Detection};
use crate::sensor::{Measurement, Position};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

type Plain = Kalman<ConstantVelocity, Position>;

fn filter() -> Plain {
    Kalman::new(ConstantVelocity::new(0.5).with_speed(10.0), Position::new(5.0).unwrap())
}

/// The Bernoulli filter of Ristic et al. (2013): one object at most, all histories kept.
struct Bernoulli {
    existence: f64,
    terms: Vec<(f64, Gaussian<4>)>,
}

impl Bernoulli {
    fn step(&mut self, filter: &Plain, plots: &[Measurement<2>], survival: f64, seen: f64, clutter: f64) {
        let mut next = Vec::new();
        for (weight, belief) in &mut self.terms {
            filter.predict(belief, 1.0);
            next.push((*weight * (1.0 - seen), *belief));
            for plot in plots {
                let mut updated = *belief;
                let innovation = filter.update(&mut updated, plot).unwrap();
                next.push((*weight * seen * innovation.log_likelihood.exp() / clutter, updated));
            }
        }
        let r = survival * self.existence;
        let sum: f64 = next.iter().map(|term| term.0).sum();
        self.existence = r * sum / (1.0 - r + r * sum);
        next.iter_mut().for_each(|term| term.0 /= sum);
        self.terms = next;
    }

    fn mean(&self) -> nalgebra::Vector4<f64> {
        self.terms.iter().map(|(weight, belief)| belief.mean * *weight).sum()
    }
}

#[test]
fn on_one_object_it_is_the_bernoulli_filter() {
    let (filter, mut random) = (filter(), ChaCha8Rng::seed_from_u64(5));
    let (seen, density, survival) = (0.8, 2e-4, 0.97);
    let scene = (Detection::uniform(seen).unwrap(), Clutter::Uniform(density));
    let config = PmbmConfig {
        gate: Gate::new(1.0 - 1e-12).unwrap(),
        survival,
        undetected: Some(1e-4),
        birth: Some(0.0),
        hypotheses: usize::MAX >> 20,
        prune: 1e-15,
        merge: 0.0,
        management: Management { min_existence: 1e-12, max_misses: 100, ..Management::default() },
        ..PmbmConfig::default()
    };
    let mut tracker = Pmbm::<Gaussian<4>>::new(config).unwrap();
    let mut bernoulli: Option<Bernoulli> = None;
    for step in 0..6 {
        let time = f64::from(step);
        let mut plots: Vec<Measurement<2>> = Vec::new();
        if step != 3 {
            plots.push([6.0 * time, 2.0 * time].into());
        }
        // Where an object could still begin would be a second object; the scan says that nothing undetected is left.
        if step > 0 {
            plots.push([0, 1].map(|_| random.random_range(-30.0..30.0)).into());
            tracker.undetected = Undetected::new(Some(0.0), Some(0.0), survival).unwrap();
        }
        let scan = Scan { time, measurements: &plots, detection: &scene.0, clutter: &scene.1 };
        tracker.step(&filter, &scan).unwrap();
        match &mut bernoulli {
            None => {
                let existence = seen * 1e-4 / (seen * 1e-4 + density);
                let belief = filter.birth(&plots[0]).unwrap();
                bernoulli = Some(Bernoulli { existence, terms: vec![(1.0, belief)] });
            }
            Some(bernoulli) => bernoulli.step(&filter, &plots, survival, seen, density),
        }
        let reference = bernoulli.as_ref().unwrap();
        assert_eq!(tracker.tracks().len(), 1);
        let track = &tracker.tracks()[0];
        assert!((track.existence - reference.existence).abs() < 1e-9, "{step}: {}", track.existence);
        // What is reported leaves out leaves of less than a thousandth.
        assert!((track.belief.mean - reference.mean()).norm() < 0.1, "{step}");
    }
}

#[test]
fn trees_that_have_nothing_to_do_with_each_other_are_in_clusters_of_their_own() {
    let (filter, mut random) = (filter(), ChaCha8Rng::seed_from_u64(6));
    let scene = (Detection::uniform(0.95).unwrap(), Clutter::per_scan(20.0, 1e6).unwrap());
    let mut tracker = Pmbm::<Gaussian<4>>::new(PmbmConfig::default()).unwrap();
    for step in 0..40 {
        let time = f64::from(step);
        let mut plots: Vec<Measurement<2>> =
            (0..9).map(|k| [100.0 * f64::from(k) + 3.0 * time, 500.0].into()).collect();
        plots.extend((0..20).map(|_| Measurement::from([0, 1].map(|_| random.random_range(0.0..1000.0)))));
        let scan = Scan { time, measurements: &plots, detection: &scene.0, clutter: &scene.1 };
        tracker.step(&filter, &scan).unwrap();
    }
    let confirmed = tracker.tracks().iter().filter(|track| track.status == Status::Confirmed).count();
    let all: Vec<_> = tracker.tracks().iter().map(|t| (t.id, t.existence, t.status, t.belief.mean)).collect();
    assert_eq!(confirmed, 9, "{all:?}");
    assert!(tracker.clusters.iter().all(|cluster| cluster.trees.len() < 6));
    assert!(tracker.hypotheses().sum::<usize>() < 200);
}

#[test]
fn weights_of_hypotheses_add_up_and_every_leaf_is_chosen() {
    let (filter, mut random) = (filter(), ChaCha8Rng::seed_from_u64(7));
    let scene = (Detection::uniform(0.9).unwrap(), Clutter::per_scan(10.0, 1e4).unwrap());
    let mut tracker = Pmbm::<Gaussian<4>>::new(PmbmConfig::default()).unwrap();
    for step in 0..30 {
        let plots: Vec<Measurement<2>> =
            (0..12).map(|_| Measurement::from([0, 1].map(|_| random.random_range(0.0..100.0)))).collect();
        let time = f64::from(step);
        tracker
            .step(&filter, &Scan { time, measurements: &plots, detection: &scene.0, clutter: &scene.1 })
            .unwrap();
        for cluster in &tracker.clusters {
            let sum: f64 = cluster.hypotheses.iter().map(|hypothesis| hypothesis.weight).sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
            assert!(cluster.hypotheses.len() <= 100);
            for tree in 0..cluster.trees.len() {
                assert!(cluster.shares(tree).iter().all(|share| *share > 0.0));
            }
        }
    }
}
