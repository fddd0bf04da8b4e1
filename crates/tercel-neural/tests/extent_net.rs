//! ExtentNet: what its networks see and remember, and what no sensor should give.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Matrix2, Vector2, vector};
use tercel_core::extended::{InverseWishart, Points, Scattering};
use tercel_core::filter::{Estimate, Filter};
use tercel_neural::filter::extent_net::{Architecture, Frame};
use tercel_neural::filter::{ExtentNet, ExtentNetBelief, ExtentNetHyper, ExtentNetwork};
use tercel_neural::{Model, ModelError, Tensor};
use untrained::{extent_net, small_extent_nets};

fn scattering() -> Scattering {
    Scattering::uniform(Matrix2::identity() * 0.5).unwrap()
}

fn filters(frame: Frame, size: f32) -> [ExtentNet; 2] {
    small_extent_nets(frame).map(|hyper| ExtentNet::new(extent_net(&hyper, size), scattering()))
}

/// Where a vehicle that turns is after some time, and its points.
fn centre(time: f64) -> Vector2<f64> {
    vector![40.0 * (0.1 * time).sin(), 40.0 - 40.0 * (0.1 * time).cos()]
}

fn scan(time: f64, origin: Vector2<f64>) -> Points {
    let own = [[5.0, 1.0], [-4.0, 0.5], [3.0, -1.0], [-2.0, 0.3], [0.5, -0.4]];
    own.into_iter().map(|point| origin + centre(time) + Vector2::from(point)).collect()
}

/// The belief after some seconds of that vehicle.
fn tracked(filter: &ExtentNet, seconds: u32, origin: Vector2<f64>) -> ExtentNetBelief {
    let mut belief = filter.birth(&scan(0.0, origin)).unwrap();
    for second in 1..=seconds {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, &scan(f64::from(second), origin)).unwrap();
    }
    belief
}

fn apart(a: &Estimate<4>, b: &Estimate<4>) -> f64 {
    (a.mean - b.mean).norm() + (a.extent.unwrap() - b.extent.unwrap()).norm()
}

#[test]
fn relative_to_the_centroid_an_object_elsewhere_is_followed_alike_and_as_published_it_is_not() {
    let origin = vector![3e5, -2e5];
    for (frame, alike) in [(Frame::Residual, true), (Frame::Absolute, false)] {
        for filter in filters(frame, 1.0) {
            let here = filter.estimate(&tracked(&filter, 40, vector![0.0, 0.0]));
            let mut there = filter.estimate(&tracked(&filter, 40, origin));
            (there.mean.x, there.mean.y) = (there.mean.x - origin.x, there.mean.y - origin.y);
            assert_eq!(apart(&here, &there) < 1e-3, alike, "{}", apart(&here, &there));
        }
    }
}

#[test]
fn a_network_that_says_nothing_gives_the_centroid_and_its_way() {
    for filter in filters(Frame::Residual, 0.0) {
        let estimate = filter.estimate(&tracked(&filter, 30, vector![100.0, 200.0]));
        let seen = [29.0, 30.0].map(|time| scan(time, vector![100.0, 200.0]).mean());
        assert!((estimate.mean.xy() - seen[1]).norm() < 1e-9);
        assert!((vector![estimate.mean.z, estimate.mean.w] - (seen[1] - seen[0])).norm() < 1e-9);
    }
}

#[test]
fn what_was_seen_before_counts_and_what_is_older_than_the_window_does_not() {
    let [lstm, transformer] = filters(Frame::Residual, 1.0);
    // Two pasts of the same last estimate.
    let pasts = |filter: &ExtentNet, same: u32| {
        let [short, long] = [5, 15].map(|seconds| tracked(filter, seconds, vector![0.0, 0.0]));
        let mut beliefs = [short.clone(), long];
        let first = filter.state(&short);
        let extent = filter.extent(&short).unwrap();
        for belief in &mut beliefs {
            filter.predict(belief, 1.0);
            filter.update(belief, &scan(20.0, vector![0.0, 0.0])).unwrap();
            for second in 0..same {
                filter.set_state(belief, &first);
                filter.set_extent(belief, &extent);
                filter.predict(belief, 1.0);
                filter.update(belief, &scan(f64::from(second), vector![0.0, 0.0])).unwrap();
            }
        }
        apart(&filter.estimate(&beliefs[0]), &filter.estimate(&beliefs[1]))
    };
    assert!(pasts(&lstm, 1) > 1e-3 && pasts(&transformer, 1) > 1e-3);
    // Two layers look back over twice a window of seven.
    assert!(pasts(&transformer, 6) > 1e-6);
    assert!(pasts(&transformer, 14) < 1e-4, "{}", pasts(&transformer, 14));
}

#[test]
fn a_scan_without_points_is_not_seen_and_the_time_to_the_next_is() {
    for filter in filters(Frame::Residual, 1.0) {
        let mut belief = tracked(&filter, 12, vector![0.0, 0.0]);
        let before = filter.estimate(&belief);
        let mut silent = belief.clone();
        for _ in 0..3 {
            filter.predict(&mut belief, 1.0);
            filter.update(&mut belief, &Points::default()).unwrap();
        }
        filter.predict(&mut silent, 3.0);
        let after = filter.estimate(&belief);
        let moved = before.mean.xy() + vector![before.mean.z, before.mean.w] * 3.0;
        assert!((after.mean.xy() - moved).norm() < 1e-9 && after.extent == before.extent);
        assert!((filter.state(&silent).mean - filter.state(&belief).mean).norm() < 1e-9);
        // The same way in more time is a slower one.
        let next = |dt: f64| {
            let mut belief = tracked(&filter, 12, vector![0.0, 0.0]);
            filter.predict(&mut belief, dt);
            filter.update(&mut belief, &scan(14.0, vector![0.0, 0.0])).unwrap();
            filter.state(&belief).mean
        };
        let [fast, slow] = [1.0, 4.0].map(next);
        assert!(fast.z.hypot(fast.w) > slow.z.hypot(slow.w) + 1.0, "{fast} {slow}");
    }
}

#[test]
fn two_scans_at_one_time_are_no_infinite_velocity() {
    for filter in filters(Frame::Residual, 1.0) {
        let mut belief = tracked(&filter, 12, vector![0.0, 0.0]);
        for time in [12.1, 12.2, 12.3] {
            filter.update(&mut belief, &scan(time, vector![0.0, 0.0])).unwrap();
            let mean = filter.state(&belief).mean;
            assert!(mean.z.hypot(mean.w) < 40.0, "{mean}");
        }
    }
}

#[test]
fn twenty_thousand_steps_stay_finite_with_and_without_points() {
    for filter in [Frame::Absolute, Frame::Residual].into_iter().flat_map(|frame| filters(frame, 3.0)) {
        let mut belief = tracked(&filter, 3, vector![0.0, 0.0]);
        for step in 0..20_000_u32 {
            filter.predict(&mut belief, if step % 3 == 0 { 0.5 } else { 1.0 });
            if step < 10_000 || step % 1000 == 0 {
                filter.update(&mut belief, &scan(f64::from(step), vector![0.0, 0.0])).unwrap();
            }
        }
        let estimate = filter.estimate(&belief);
        assert!(estimate.mean.iter().chain(estimate.covariance.iter()).all(|value| value.is_finite()));
        assert!(estimate.covariance.cholesky().is_some());
        assert!(estimate.extent.unwrap().cholesky().is_some());
    }
}

#[test]
fn where_a_network_overflows_the_centroid_is_the_estimate_and_the_next_scan_starts_afresh() {
    for hyper in small_extent_nets(Frame::Residual) {
        let mut own = untrained::tensors(hyper.tensors());
        for (name, tensor) in &mut own {
            match name.as_str() {
                "memory.bias" | "embed.bias" => tensor.values.fill(10.0),
                "norm.weight" => tensor.values.fill(1.0),
                "output.weight" => tensor.values.fill(3e38),
                _ => {}
            }
        }
        let network = ExtentNetwork::from_model(&model(&hyper, own)).unwrap();
        let filter = ExtentNet::new(Arc::new(network), scattering());
        let mut belief = filter.birth(&scan(0.0, vector![0.0, 0.0])).unwrap();
        for second in 1..20 {
            filter.predict(&mut belief, 1.0);
            let points = scan(f64::from(second), vector![0.0, 0.0]);
            filter.update(&mut belief, &points).unwrap();
            let estimate = filter.estimate(&belief);
            assert!((estimate.mean.xy() - points.mean()).norm() < 1e-9, "{}", estimate.mean);
            assert!(estimate.covariance.cholesky().is_some() && estimate.extent.is_some());
        }
        assert_eq!(belief, belief.clone());
    }
}

#[test]
fn an_extent_that_is_set_is_the_extent_and_none_is_made_of_what_is_no_matrix() {
    let [filter, _] = filters(Frame::Residual, 1.0);
    let mut belief = tracked(&filter, 5, vector![0.0, 0.0]);
    let extent = InverseWishart::new(Matrix2::new(9.0, 2.0, 2.0, 4.0), 17.0).unwrap();
    filter.set_extent(&mut belief, &extent);
    let found = filter.extent(&belief).unwrap();
    assert!((found.mean() - extent.mean()).norm() < 1e-9 && (found.weight() - 17.0).abs() < 1e-9);
    let mut merged = belief.clone();
    let other = tracked(&filter, 9, vector![1.0, 0.0]);
    filter.merge(&mut merged, 1.0, &other, 3.0);
    let mean = extent.mean() * 0.25 + filter.estimate(&other).extent.unwrap() * 0.75;
    assert!((filter.estimate(&merged).extent.unwrap() - mean).norm() < 1e-9);
}

fn model(hyper: &ExtentNetHyper, tensors: BTreeMap<String, Tensor>) -> Model {
    untrained::of_tensors("extent-net", hyper.to_table(), tensors)
}

fn refusal(model: &Model) -> String {
    ExtentNetwork::from_model(model).unwrap_err().to_string()
}

#[test]
fn models_that_do_not_fit_are_refused_by_name() {
    for hyper in small_extent_nets(Frame::Residual) {
        untrained::refuses_other_tensors(&hyper.tensors(), |tensors| {
            ExtentNetwork::from_model(&model(&hyper, tensors))
        });
    }
}

#[test]
fn impossible_options_are_refused_by_name() {
    let [_, hyper] = small_extent_nets(Frame::Residual);
    let with = |change: &dyn Fn(&mut ExtentNetHyper)| {
        let mut hyper = hyper.clone();
        change(&mut hyper);
        refusal(&model(&hyper, BTreeMap::new()))
    };
    let transformer =
        |heads, window| Architecture::Transformer { size: 12, heads, layers: 1, feed: 4, window };
    assert!(with(&|h| h.interval = 0.0).contains("`interval` is 0"));
    assert!(with(&|h| h.position = f64::NAN).contains("`position` is NaN"));
    assert!(with(&|h| h.axes[1] = -1.0).contains("`axes[1]` is -1"));
    assert!(with(&|h| h.origin[0] = f64::INFINITY).contains("`origin` has inf"));
    assert!(
        with(&|h| h.architecture = Architecture::Lstm { units: 0 }).contains("`architecture.units` is 0")
    );
    assert!(with(&|h| h.architecture = transformer(4, 5)).contains("`architecture.heads` is 4"));
    assert!(with(&|h| h.architecture = transformer(3, 0)).contains("`architecture.window` is 0"));
    let mut unknown = model(&hyper, BTreeMap::new()).card().clone();
    unknown.hyper.insert("colour".into(), "red".into());
    assert!(refusal(&Model::new(unknown, BTreeMap::new()).unwrap()).contains("colour"));
    let mut kind = model(&hyper, BTreeMap::new()).card().clone();
    kind.kind = "rmmnet".into();
    let kind = Model::new(kind, BTreeMap::new()).unwrap();
    assert!(matches!(ExtentNetwork::from_model(&kind), Err(ModelError::Kind { .. })));
}
