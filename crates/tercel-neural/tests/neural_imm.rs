//! A neural IMM is its bank, but for what its network says.

#![allow(clippy::unwrap_used)]

mod untrained;

use tercel_core::filter::Filter;
use tercel_core::sensor::{Measurement, RangeBearing};
use tercel_neural::filter::{NeuralImm, NeuralImmHyper};
use untrained::neural_imm;

/// A target that turns, 60 km away; the radar misses every fourth plot.
fn plots() -> impl Iterator<Item = Option<Measurement<2>>> {
    (0..60).map(|second| {
        let angle = 0.05 * f64::from(second);
        let (x, y) = (60e3 + 4e3 * angle.cos(), 2e3 + 4e3 * angle.sin());
        let error = f64::from(second * 7 % 11 - 5);
        let plot = [x.hypot(y) + 20.0 * error, y.atan2(x) - 0.001 * error];
        (second % 4 != 3).then(|| plot.into())
    })
}

fn radars() -> [RangeBearing; 2] {
    [0.003, 0.01].map(|bearing| RangeBearing::new(50.0, bearing).unwrap())
}

#[test]
fn a_network_that_gives_zero_is_the_bank() {
    let hyper = NeuralImmHyper { hidden: 8, ..NeuralImmHyper::default() };
    let filter = NeuralImm::new(neural_imm(&hyper, 0.0, 1), &radars()).unwrap();
    let bank = hyper.bank().unwrap().estimating(&radars()).unwrap();
    let mut plots = plots();
    let first = plots.next().unwrap().unwrap();
    let (mut ours, mut theirs) = (filter.birth(&first).unwrap(), bank.birth(&first).unwrap());
    for plot in plots {
        filter.predict(&mut ours, 1.0);
        bank.predict(&mut theirs, 1.0);
        if let Some(plot) = plot {
            assert_eq!(filter.update(&mut ours, &plot).unwrap(), bank.update(&mut theirs, &plot).unwrap());
        }
        let (state, expected) = (filter.state(&ours), bank.state(&theirs));
        assert!((state.mean - expected.mean).norm() < 1e-6);
        assert!((state.covariance - expected.covariance).norm() < 1e-9 * expected.covariance.norm());
        let modes = filter.estimate(&ours).modes;
        assert!((modes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_network_changes_what_it_says_and_not_the_bank() {
    let filter = NeuralImm::new(neural_imm(&NeuralImmHyper::default(), 3.0, 1), &radars()).unwrap();
    let mut plots = plots();
    let mut belief = filter.birth(&plots.next().unwrap().unwrap()).unwrap();
    for plot in plots {
        filter.predict(&mut belief, 1.0);
        let Some(plot) = plot else { continue };
        filter.update(&mut belief, &plot).unwrap();
        let (state, bank) = (filter.state(&belief), belief.outlook().state());
        assert!((state.mean - bank.mean).norm() > 1e-3);
        assert!((bank.mean.xy() - nalgebra::Vector2::new(62e3, 4e3)).norm() < 10e3);
        let said = belief.outputs();
        let rates = filter.bank().rates().len();
        let scale = f64::from(said[rates + 4]).exp();
        let turned = |p: &nalgebra::Matrix4<f64>| p.fixed_view::<2, 2>(0, 0).determinant();
        let ratio = turned(&state.covariance) / turned(&bank.covariance);
        assert!((ratio - scale.powi(4)).abs() < 1e-6 * ratio, "{ratio} {scale}");
    }
}

#[test]
fn the_same_target_on_the_other_side_of_the_radar_is_seen_alike() {
    let filter = NeuralImm::new(neural_imm(&NeuralImmHyper::default(), 1.0, 1), &radars()).unwrap();
    let run = |turn: f64| {
        let turned = |plot: Measurement<2>| Measurement::from([plot.value[0], plot.value[1] + turn]);
        let mut plots = plots();
        let mut belief = filter.birth(&turned(plots.next().unwrap().unwrap())).unwrap();
        for plot in plots {
            filter.predict(&mut belief, 1.0);
            plot.map(|plot| filter.update(&mut belief, &turned(plot)).unwrap());
        }
        (belief.inputs().to_vec(), filter.directions(&belief))
    };
    let (here, there) = (run(0.0), run(2.0));
    for (a, b) in here.0.iter().zip(&there.0) {
        assert!((a - b).abs() < 1e-3, "{a} {b}");
    }
    assert!((here.1[0] - there.1[0]).abs() < 1e-3);
}
