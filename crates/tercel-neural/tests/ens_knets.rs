//! What ensembles of KalmanNets promise beside what every filter does.

#![allow(clippy::unwrap_used)]

mod untrained;

use std::sync::Arc;

use tercel_core::filter::Filter;
use tercel_core::sensor::{ConvertedPolar, Measurement};
use tercel_neural::filter::{
    Architecture, Attention, BranchHyper, EnsKNets, EnsKNetsBelief, EnsKNetsHyper, EnsembleNetwork,
    GainNetwork, KalmanNetHyper, Normalisation, OfflineEnsKNets, Sign,
};
use tercel_neural::{Model, Tensor};
use untrained::{ensemble, ensemble_model, plots, radar, tiny_attention, tiny_ensemble};

fn followed(filter: &EnsKNets<ConvertedPolar>, rate: f64) -> [f64; 3] {
    let plots = plots(rate);
    let mut belief = filter.birth(&plots[0].unwrap()).unwrap();
    let mut sums = [0.0; 3];
    for plot in &plots[1..] {
        filter.predict(&mut belief, 1.0);
        if let Some(plot) = plot {
            filter.update(&mut belief, plot).unwrap();
        }
        sums.iter_mut().zip(belief.weights()).for_each(|(sum, weight)| *sum += weight / 49.0);
    }
    sums
}

#[test]
fn attention_goes_to_the_motion_that_is_flown_unless_its_sign_is_as_printed() {
    let net = KalmanNetHyper {
        gain_offset: Some([[0.5, 0.0], [0.0, 0.5], [0.2, 0.0], [0.0, 0.2]]),
        ..KalmanNetHyper::paper(Architecture::two())
    };
    let turn = 0.17;
    for (rate, flown, other) in [(turn, 1, 2), (-turn, 2, 1)] {
        for (sign, stay) in [(Sign::Minus, None), (Sign::Minus, Some(0.97)), (Sign::Plus, None)] {
            let attention = Some(Attention { sign, temperature: None, stay });
            let hyper = EnsKNetsHyper { attention, ..EnsKNetsHyper::att_ens_knets(vec![net.clone(); 3]) };
            let weights = followed(&EnsKNets::new(ensemble(&hyper, 0.0), radar()).unwrap(), rate);
            let right = weights[flown] > 0.5 && weights[other] < 0.2;
            assert_eq!(right, sign == Sign::Minus, "{rate} {sign:?} {stay:?}: {weights:?}");
        }
    }
}

#[test]
fn a_branch_whose_outputs_are_not_finite_is_not_heard() {
    let hyper = tiny_attention();
    let model = ensemble_model(&hyper, 0.1, 2);
    let mut tensors = model.tensors().clone();
    // Sums of these overflow, whatever their signs.
    tensors.get_mut("correction.head.weight").unwrap().values.fill(f32::MAX);
    tensors.get_mut("correction.head.bias").unwrap().values.fill(f32::MAX);
    tensors.get_mut("correction.lstm.1.bias").unwrap().values.fill(9.0);
    let model = Model::new(model.card().clone(), tensors).unwrap();
    let filter = EnsKNets::new(Arc::new(EnsembleNetwork::from_model(&model).unwrap()), radar()).unwrap();
    let plots = plots(0.0);
    let mut belief = filter.birth(&plots[0].unwrap()).unwrap();
    for plot in plots[1..].iter().flatten() {
        filter.predict(&mut belief, 1.0);
        filter.update(&mut belief, plot).unwrap();
        assert!(filter.state(&belief).mean.iter().all(|x| x.abs() < 1e6));
    }
}

#[test]
fn models_that_do_not_fit_are_refused_by_name() {
    let hyper = tiny_attention();
    let model = ensemble_model(&hyper, 0.1, 2);
    let without = |name: &str| {
        let mut tensors = model.tensors().clone();
        tensors.remove(name).unwrap();
        EnsembleNetwork::from_model(&Model::new(model.card().clone(), tensors).unwrap())
            .unwrap_err()
            .to_string()
    };
    for name in ["correction.head.bias", "classification.lstm.0.input"] {
        assert!(without(name).contains(name), "{}", without(name));
    }
    let error = without("net.1.gru_q.hidden");
    assert!(error.contains("net.1") && error.contains("gru_q.hidden"), "{error}");
    let mut tensors = model.tensors().clone();
    tensors.insert("net.7.gain.bias".into(), Tensor { shape: vec![1], values: vec![0.0] });
    let more = Model::new(model.card().clone(), tensors).unwrap();
    assert!(EnsembleNetwork::from_model(&more).unwrap_err().to_string().contains("net.7.gain.bias"));
    for (scale, key) in [("position", "position"), ("net.0.range", "range")] {
        let mut card = model.card().clone();
        card.scales.remove(scale).unwrap();
        let error = EnsembleNetwork::from_model(&Model::new(card, model.tensors().clone()).unwrap());
        assert!(error.unwrap_err().to_string().contains(key));
    }
    let attention = |stay, sign| Some(Attention { sign, temperature: None, stay });
    for (wrong, key) in [
        (EnsKNetsHyper { rates: vec![0.1], ..hyper.clone() }, "nets"),
        (EnsKNetsHyper { acceleration: -1.0, ..hyper.clone() }, "acceleration"),
        (EnsKNetsHyper { attention: attention(Some(0.4), Sign::Minus), ..hyper.clone() }, "attention.stay"),
        (EnsKNetsHyper { attention: attention(Some(0.9), Sign::Plus), ..hyper.clone() }, "sign"),
        (EnsKNetsHyper { correction: Some(BranchHyper { hidden: 0, layers: 1 }), ..hyper.clone() }, "hidden"),
    ] {
        let error = EnsembleNetwork::from_model(&ensemble_model(&wrong, 0.1, 2)).unwrap_err().to_string();
        assert!(error.contains(key), "{error}");
    }
    assert!(GainNetwork::from_model(&model).unwrap_err().to_string().contains("ens-knets"));
}

#[test]
fn a_network_for_whole_tracks_is_no_filter_and_a_filter_needs_none() {
    let whole = EnsKNetsHyper { normalisation: Normalisation::Sequence, ..tiny_ensemble() };
    let error = EnsKNets::new(ensemble(&whole, 0.1), radar()).unwrap_err().to_string();
    assert!(error.contains("whole track"), "{error}");
    assert!(OfflineEnsKNets::new(ensemble(&tiny_ensemble(), 0.1), radar()).is_err());
}

#[test]
fn an_offline_ensemble_without_branches_is_the_filter_and_with_them_it_sees_the_future() {
    let estimates = |hyper: &EnsKNetsHyper, plots: &[Option<Measurement<2>>]| {
        let offline = OfflineEnsKNets::new(ensemble(hyper, 0.5), radar()).unwrap();
        offline.estimates(&plots[0].unwrap(), plots[1..].iter().map(|plot| (1.0, *plot))).unwrap()
    };
    let whole = EnsKNetsHyper { normalisation: Normalisation::Sequence, ..tiny_ensemble() };
    let average = EnsKNetsHyper { correction: None, classification: None, ..whole.clone() };
    let plots = plots(0.03);
    let running = EnsKNetsHyper { normalisation: Normalisation::Running, ..average.clone() };
    let filter = EnsKNets::new(ensemble(&running, 0.5), radar()).unwrap();
    let mut belief = filter.birth(&plots[0].unwrap()).unwrap();
    for (plot, offline) in plots[1..].iter().zip(&estimates(&average, &plots)[1..]) {
        filter.predict(&mut belief, 1.0);
        if let Some(plot) = plot {
            filter.update(&mut belief, plot).unwrap();
        }
        assert_eq!(filter.estimate(&belief), *offline);
    }
    let mut later = plots.clone();
    later[49] = Some([30_000.0, 0.4].into());
    let (early, late) = (&estimates(&whole, &plots)[5], &estimates(&whole, &later)[5]);
    assert!((early.mean - late.mean).norm() > 1e-3);
    let mut rows = vec![1.0, 10.0, 3.0, 10.0, 5.0, 10.0];
    EnsembleNetwork::normalise_sequence(&mut rows, 2);
    let scale = (8.0_f32 / 3.0).sqrt();
    for (found, expected) in rows.iter().zip([-2.0 / scale, 0.0, 0.0, 0.0, 2.0 / scale, 0.0]) {
        assert!((found - expected).abs() < 1e-5, "{rows:?}");
    }
}

#[test]
fn the_place_of_birth_does_not_matter_to_a_merged_object() {
    let filter = EnsKNets::new(ensemble(&tiny_ensemble(), 0.7), radar()).unwrap();
    let plots = plots(0.05);
    let born = |start: usize| {
        let mut belief = filter.birth(&plots[start].unwrap()).unwrap();
        for plot in &plots[start + 1..30] {
            filter.predict(&mut belief, 1.0);
            if let Some(plot) = plot {
                filter.update(&mut belief, plot).unwrap();
            }
        }
        belief
    };
    let (early, late) = (born(0), born(12));
    let merged = |mut first: EnsKNetsBelief, weight: f64, other, other_weight| {
        filter.merge(&mut first, weight, other, other_weight);
        filter.predict(&mut first, 1.0);
        filter.update(&mut first, &plots[30].unwrap()).unwrap();
        first.inputs().to_vec()
    };
    let (one, two) = (merged(early.clone(), 0.3, &late, 0.7), merged(late.clone(), 0.7, &early, 0.3));
    for (a, b) in one.iter().zip(&two) {
        assert!((a - b).abs() < 1e-3 && a.abs() < 10.0, "{one:?} {two:?}");
    }
}
