//! Filters that learn the prediction or see windows: what they do beside their networks, and what they refuse.

#![allow(clippy::unwrap_used)]

mod untrained;

use nalgebra::{Vector2, Vector4};
use tercel_core::filter::Filter;
use tercel_core::sensor::{ConvertedPolar, Measurement, RangeBearing};
use tercel_neural::Model;
use tercel_neural::filter::{
    DeepMtt, DeepMttHyper, MnemonicHyper, MnemonicKalman, Sight, TrMtt, TrMttHyper, check,
};
use untrained::{deep_mtt, mnemonic, small_deep_mtt, small_mnemonic, small_tr_mtt, tr_mtt};

/// A target that turns, 60 km away; the radar misses every fourth plot.
fn plots() -> Vec<Option<Measurement<2>>> {
    let plot = |second: i32| {
        let angle = 0.05 * f64::from(second);
        let (x, y) = (60e3 + 4e3 * angle.cos(), 2e3 + 4e3 * angle.sin());
        let error = f64::from(second * 7 % 11 - 5);
        let plot = [x.hypot(y) + 20.0 * error, y.atan2(x) - 0.001 * error];
        (second % 4 != 3).then(|| plot.into())
    };
    (0..60).map(plot).collect()
}

fn turned(plot: &Measurement<2>, by: f64) -> Measurement<2> {
    [plot.value[0], plot.value[1] + by].into()
}

/// The state after all plots, seen from a radar that is turned.
fn last<F: Filter<4, Measurement = Measurement<2>>>(filter: &F, turn: f64) -> Vector4<f64> {
    let plots = plots();
    let mut belief = filter.birth(&turned(plots[0].as_ref().unwrap(), turn)).unwrap();
    for plot in &plots[1..] {
        filter.predict(&mut belief, 1.0);
        plot.as_ref().map(|plot| filter.update(&mut belief, &turned(plot, turn)).unwrap());
    }
    filter.state(&belief).mean
}

#[test]
fn in_the_frame_of_the_sensor_a_turned_scene_gives_the_turned_estimate() {
    let radar = RangeBearing::new(50.0, 0.005).unwrap();
    let converted = ConvertedPolar::new(50.0, 0.005).unwrap();
    let back =
        |state: Vector4<f64>| Sight::new(Vector2::new(2.0_f64.cos(), 2.0_f64.sin()), true).matrix() * state;
    let near = |a: Vector4<f64>, b: Vector4<f64>| assert!((a - b).norm() < 0.5, "{a} {b}");
    let filter = MnemonicKalman::new(
        mnemonic(&MnemonicHyper { hidden: 9, ..MnemonicHyper::default() }, 1.0),
        converted,
    );
    near(last(&filter, 0.0), back(last(&filter, 2.0)));
    let filter = DeepMtt::new(deep_mtt(&small_deep_mtt(), 1.0), radar);
    near(last(&filter, 0.0), back(last(&filter, 2.0)));
    let filter = TrMtt::new(tr_mtt(&small_tr_mtt(), 0.3), converted);
    near(last(&filter, 0.0), back(last(&filter, 2.0)));
}

#[test]
fn a_correction_waits_for_a_full_window_and_moves_on_through_gaps() {
    let filter = DeepMtt::new(deep_mtt(&small_deep_mtt(), 1.0), RangeBearing::new(50.0, 0.005).unwrap());
    let plots = plots();
    let mut belief = filter.birth(plots[0].as_ref().unwrap()).unwrap();
    for (step, plot) in plots.iter().enumerate().skip(1) {
        let before = filter.state(&belief).mean - belief.front().mean;
        filter.predict(&mut belief, 1.0);
        let moved = filter.state(&belief).mean - belief.front().mean;
        assert!((moved - before - Vector4::new(before[2], before[3], 0.0, 0.0)).norm() < 1e-6);
        let Some(plot) = plot else { continue };
        filter.update(&mut belief, plot).unwrap();
        let full = step + 1 >= 5;
        assert_eq!(belief.window().is_some(), full);
        assert_eq!((filter.state(&belief).mean - belief.front().mean).norm() > 0.0, full, "step {step}");
    }
}

#[test]
fn without_a_delay_smoothing_is_filtering_and_with_one_it_is_the_mean_of_windows() {
    let filter = DeepMtt::new(deep_mtt(&small_deep_mtt(), 1.0), RangeBearing::new(50.0, 0.005).unwrap());
    let scans: Vec<_> = plots().into_iter().map(|plot| (1.0, plot)).collect();
    let (none, some) = (filter.smoothed(&scans, 0).unwrap(), filter.smoothed(&scans, 4).unwrap());
    let mut belief = filter.birth(scans[0].1.as_ref().unwrap()).unwrap();
    let mut changed = 0;
    for (step, (dt, plot)) in scans.iter().enumerate().skip(1) {
        filter.predict(&mut belief, *dt);
        plot.as_ref().map(|plot| filter.update(&mut belief, plot).unwrap());
        assert!((none[step].mean - filter.state(&belief).mean).norm() < 1e-6, "step {step}");
        changed += usize::from((none[step].mean - some[step].mean).norm() > 1e-3);
    }
    assert!(changed > 40, "{changed}");
    assert!(filter.smoothed(&scans[3..], 0).is_err(), "the first scan has no measurement");
}

#[test]
fn windows_that_move_by_one_step_end_with_the_estimates_of_the_filter() {
    let filter = TrMtt::new(tr_mtt(&small_tr_mtt(), 0.3), ConvertedPolar::new(50.0, 0.005).unwrap());
    let plots = plots();
    let mut belief = filter.birth(plots[0].as_ref().unwrap()).unwrap();
    for plot in &plots[1..] {
        filter.predict(&mut belief, 1.0);
        plot.as_ref().map(|plot| filter.update(&mut belief, plot).unwrap());
    }
    let readings: Vec<_> =
        plots.iter().map(|plot| plot.as_ref().and_then(|plot| filter.place(plot))).collect();
    // The last step of a recording is covered by the last window alone.
    let cut = &readings[..59];
    let states = filter.windowed(cut, 1);
    assert_eq!(states.len(), 59);
    assert!(states.iter().all(Option::is_some));
    let strided = filter.windowed(cut, 4);
    assert!((states[58].unwrap() - strided[58].unwrap()).norm() < 1e-9);
    let mut again = filter.birth(plots[0].as_ref().unwrap()).unwrap();
    for plot in &plots[1..59] {
        filter.predict(&mut again, 1.0);
        plot.as_ref().map(|plot| filter.update(&mut again, plot).unwrap());
    }
    assert!((states[58].unwrap() - filter.state(&again).mean).norm() < 1e-6);
    assert_eq!(filter.windowed(&[None, None, Some(Vector2::zeros())], 1), [None; 3]);
    assert!(filter.windowed(&[], 1).is_empty());
}

#[test]
fn impossible_options_are_refused_by_name() {
    let refused = |kind: &str, hyper: toml::Table, tensors| {
        check(&untrained::model(kind, hyper, tensors, 0.1)).unwrap_err().to_string()
    };
    let good = MnemonicHyper { hidden: 3, ..small_mnemonic() };
    for (hyper, name) in [
        (MnemonicHyper { hidden: 0, ..good.clone() }, "`hidden` is 0"),
        (MnemonicHyper { layers: 1 << 20, ..good.clone() }, "`layers`"),
        (MnemonicHyper { interval: 0.0, ..good.clone() }, "`interval` is 0"),
        (MnemonicHyper { layers: 3, ..good.clone() }, "`lstm.2.input` is missing"),
        (MnemonicHyper { corrections: false, ..good.clone() }, "`lstm.0.input` has shape"),
    ] {
        let error = refused("mnemonic", hyper.to_table().unwrap(), good.tensors());
        assert!(error.contains(name), "{error}");
    }
    let good = small_deep_mtt();
    for (hyper, name) in [
        (DeepMttHyper { layers: vec![], ..good.clone() }, "`layers` is empty"),
        (DeepMttHyper { window: 0, ..good.clone() }, "`window` is 0"),
        (DeepMttHyper { dense: 0, ..good.clone() }, "`output.weight` has shape"),
        (DeepMttHyper { speed: f64::NAN, ..good.clone() }, "`speed`"),
    ] {
        let error = refused("deep-mtt", hyper.to_table().unwrap(), good.tensors());
        assert!(error.contains(name), "{error}");
    }
    let good = small_tr_mtt();
    for (hyper, name) in [
        (TrMttHyper { heads: 3, ..good.clone() }, "`heads` is 3; expected a divisor of `size`, 8"),
        (TrMttHyper { window: 1, ..good.clone() }, "`window` is 1"),
        (TrMttHyper { decoder: 2, ..good.clone() }, "`decoder.1."),
        (TrMttHyper { encoder: 0, ..good.clone() }, "`encoder` is 0"),
    ] {
        let error = refused("tr-mtt", hyper.to_table().unwrap(), good.tensors());
        assert!(error.contains(name), "{error}");
    }
}

#[test]
fn models_of_other_kinds_and_states_are_refused_by_name() {
    let hyper = small_tr_mtt();
    let model = untrained::model("tr-mtt", hyper.to_table().unwrap(), hyper.tensors(), 0.1);
    check(&model).unwrap();
    let changed = |change: &dyn Fn(&mut tercel_neural::Card)| {
        let mut card = model.card().clone();
        change(&mut card);
        check(&Model::new(card, model.tensors().clone()).unwrap()).unwrap_err().to_string()
    };
    assert!(changed(&|card| card.kind = "oracle".into()).contains("`oracle`; expected `deep-mtt`"));
    assert!(changed(&|card| card.kind = "mnemonic".into()).contains("unknown field"));
    assert!(changed(&|card| card.state.reverse()).contains("made for the state [vy, vx, y, x]"));
}
