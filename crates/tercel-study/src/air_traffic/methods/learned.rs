//! Learned filters, with the models that come with Tercel.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Vector2, Vector4};
use tercel_core::error::FilterError;
use tercel_core::filter::Filter;
use tercel_core::motion::{AccelerationNoise, Turn};
use tercel_core::sensor::{ConvertedPolar, Measurement, RangeBearing, Sensor};
use tercel_neural::Model;
use tercel_neural::filter::{
    BankNetwork, DeepMtt, EnsKNets, EnsKNetsHyper, EnsembleNetwork, GainNetwork, KalmanNet, MnemonicKalman,
    MnemonicNetwork, NeuralImm, OfflineEnsKNets, ResidualNetwork, TrMtt, TransformerNetwork,
};
use tercel_neural::shipped::Models;

use super::bank::{ADAPTIVE_BEARINGS, Bank, NOMINAL};
use super::{Plot, follow, stated};
use crate::air_traffic::{Method, Recording, StepEstimate};
use crate::error::StudyError;

/// Deviation of positions along each axis that the AttEnsKNets paper assumes, m: the root of 1250 m².
const PUBLISHED_DEVIATION: f64 = 35.355_339_059_327_38;

/// A filter, how it is told of a plot, and how it is asked.
struct Learned<F, M, R> {
    filter: F,
    measure: M,
    read: R,
}

impl<F, M, R> Method for Learned<F, M, R>
where
    F: Filter<4> + Sync,
    M: Fn(&Plot, &Recording) -> F::Measurement + Sync,
    R: Fn(&F, &F::Belief) -> StepEstimate + Sync,
{
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let measure = |plot: &Plot| (self.measure)(plot, recording);
        follow(recording, &self.filter, measure, measure, |belief| (self.read)(&self.filter, belief))
    }
}

/// The moments of a filter that does not tell manoeuvres.
fn moments<F: Filter<4>>(filter: &F, belief: &F::Belief) -> StepEstimate {
    let state = filter.state(belief);
    StepEstimate { mean: state.mean, covariance: Some(state.covariance), manoeuvres: None }
}

/// The mean alone, of a filter whose covariance says nothing of its errors.
fn mean<F: Filter<4>>(filter: &F, belief: &F::Belief) -> StepEstimate {
    StepEstimate { covariance: None, ..moments(filter, belief) }
}

/// A radar for plots that state their accuracy, or have the usual one.
fn radar() -> Result<RangeBearing, FilterError> {
    RangeBearing::new(NOMINAL.0, NOMINAL.1)
}

/// The published way to look at a plot: its position by plain trigonometry, with an error of 35 m.
fn published_position(plot: &Plot) -> Measurement<2> {
    let (sine, cosine) = plot.y.sin_cos();
    Measurement::from([plot.x * cosine, plot.x * sine])
}

fn published_sensor() -> Result<tercel_core::sensor::Position, FilterError> {
    tercel_core::sensor::Position::new(PUBLISHED_DEVIATION)
}

/// `imm-wide`: the bank of `neural-imm` without its network, which tells what the network adds.
pub(super) fn wide_bank(models: &Models) -> Result<Bank, StudyError> {
    let network = BankNetwork::from_model(&models.get("neural-imm")?)?;
    Ok(Bank::new(network.hyper().bank()?)?)
}

/// `neural-imm`: told the accuracy of the radar.
pub(super) fn neural_imm(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(BankNetwork::from_model(&models.get("neural-imm")?)?);
    let filter = NeuralImm::new(network, &[radar()?])?;
    Ok(Box::new(Learned { filter, measure: stated, read: read_bank }))
}

/// `neural-imm-adaptive`: told nothing, it chooses among the accuracies of `imm-adaptive`.
pub(super) fn neural_imm_adaptive(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(BankNetwork::from_model(&models.get("neural-imm")?)?);
    let radars = ADAPTIVE_BEARINGS.map(|degrees| RangeBearing::new(NOMINAL.0, degrees.to_radians()));
    let radars = radars.into_iter().collect::<Result<Vec<_>, _>>()?;
    let filter = NeuralImm::new(network, &radars)?;
    Ok(Box::new(Learned { filter, measure: |plot: &Plot, _: &Recording| (*plot).into(), read: read_bank }))
}

fn read_bank<S>(filter: &NeuralImm<S>, belief: &<NeuralImm<S> as Filter<4>>::Belief) -> StepEstimate
where
    S: Sensor<4, 2>,
    NeuralImm<S>: Filter<4, Belief = tercel_neural::filter::NeuralImmBelief>,
{
    StepEstimate { manoeuvres: Some(filter.directions(belief)), ..moments(filter, belief) }
}

fn straight() -> Turn {
    Turn::with_noise(0.0, AccelerationNoise::Piecewise(10.0)).with_speed(300.0)
}

/// `kalman-net`: architecture #2, with converted plots of stated accuracy.
pub(super) fn kalman_net(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(GainNetwork::from_model(&models.get("kalman-net-straight")?)?);
    let filter = KalmanNet::new(network, straight(), ConvertedPolar::new(NOMINAL.0, NOMINAL.1)?);
    Ok(Box::new(Learned { filter, measure: stated, read: moments }))
}

/// `kalman-net-paper`: architecture #1 as published.
pub(super) fn kalman_net_paper(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(GainNetwork::from_model(&models.get("kalman-net-straight-paper")?)?);
    let filter = KalmanNet::new(network, straight(), published_sensor()?);
    let measure = |plot: &Plot, _: &Recording| published_position(plot);
    Ok(Box::new(Learned { filter, measure, read: mean }))
}

/// `att-ens-kalmannets`: our default of the ensemble, with converted plots of stated accuracy.
pub(super) fn ensemble(models: &Models, model: &str) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(EnsembleNetwork::from_model(&models.get(model)?)?);
    let filter = EnsKNets::new(network, ConvertedPolar::new(NOMINAL.0, NOMINAL.1)?)?;
    Ok(Box::new(Learned { filter, measure: stated, read: read_ensemble }))
}

fn read_ensemble<S>(filter: &EnsKNets<S>, belief: &tercel_neural::filter::EnsKNetsBelief) -> StepEstimate
where
    EnsKNets<S>: Filter<4, Belief = tercel_neural::filter::EnsKNetsBelief>,
{
    StepEstimate { manoeuvres: Some(filter.directions(belief)), ..moments(filter, belief) }
}

/// An ensemble as published, which normalises over the whole flight and is no filter.
pub(super) struct PublishedEnsemble {
    filter: OfflineEnsKNets<tercel_core::sensor::Position>,
}

impl PublishedEnsemble {
    pub fn new(models: &Models, model: &str) -> Result<Self, StudyError> {
        let network = Arc::new(EnsembleNetwork::from_model(&models.get(model)?)?);
        Ok(PublishedEnsemble { filter: OfflineEnsKNets::new(network, published_sensor()?)? })
    }

    /// The KalmanNets of the published ensembles without their branches: the mean of their states.
    pub fn average(models: &Models) -> Result<Self, StudyError> {
        let whole = models.get("att-ens-kalmannets-paper")?;
        let network = EnsembleNetwork::from_model(&whole)?;
        let hyper = EnsKNetsHyper {
            attention: None,
            correction: None,
            classification: None,
            ..network.hyper().clone()
        };
        let names: BTreeSet<String> = hyper.tensors().into_iter().map(|(name, _)| name).collect();
        let tensors = whole.tensors().iter().filter(|(name, _)| names.contains(*name));
        let tensors = tensors.map(|(name, tensor)| (name.clone(), tensor.clone())).collect();
        let mut card = whole.card().clone();
        card.hyper = hyper.to_table().map_err(StudyError::Option)?;
        let network = Arc::new(EnsembleNetwork::from_model(&Model::new(card, tensors)?)?);
        Ok(PublishedEnsemble { filter: OfflineEnsKNets::new(network, published_sensor()?)? })
    }
}

impl Method for PublishedEnsemble {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let Some((Some(first), rest)) = recording.plots.split_first() else { return Ok(Vec::new()) };
        let dt = recording.flight.interval();
        let steps = rest.iter().map(|plot| (dt, plot.as_ref().map(published_position)));
        let estimates = self.filter.estimates(&published_position(first), steps)?;
        let directions = |modes: &[f64]| <[f64; 3]>::try_from(modes).ok();
        let read = |estimate: tercel_core::filter::Estimate<4>| StepEstimate {
            mean: estimate.mean,
            covariance: None,
            // The nets are those of straight flight, left turns and right turns, in this order.
            manoeuvres: directions(&estimate.modes),
        };
        Ok(estimates.into_iter().map(read).collect())
    }
}

/// `mnemonic`.
pub(super) fn mnemonic(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(MnemonicNetwork::from_model(&models.get("mnemonic")?)?);
    Ok(Box::new(Learned { filter: MnemonicKalman::new(network, radar()?), measure: stated, read: moments }))
}

/// `deep-mtt`: the last estimate of each window.
pub(super) fn deep_mtt(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(ResidualNetwork::from_model(&models.get("deep-mtt")?)?);
    Ok(Box::new(Learned { filter: DeepMtt::new(network, radar()?), measure: stated, read: moments }))
}

/// `tr-mtt`: the last estimate of each window.
pub(super) fn tr_mtt(models: &Models) -> Result<Box<dyn Method>, StudyError> {
    let network = Arc::new(TransformerNetwork::from_model(&models.get("tr-mtt")?)?);
    Ok(Box::new(Learned { filter: TrMtt::new(network, radar()?), measure: stated, read: moments }))
}

/// `tr-mtt-window`: each step is the mean over the windows that cover it, and comes later than its plot.
pub(super) struct Windowed {
    filter: TrMtt<RangeBearing>,
}

/// Steps between windows, as published.
const STRIDE: usize = 5;

impl Windowed {
    pub fn new(models: &Models) -> Result<Self, StudyError> {
        let network = Arc::new(TransformerNetwork::from_model(&models.get("tr-mtt")?)?);
        Ok(Windowed { filter: TrMtt::new(network, radar()?) })
    }
}

impl Method for Windowed {
    fn follow(&self, recording: &Recording) -> Result<Vec<StepEstimate>, FilterError> {
        let place = |plot: &Plot| Vector2::new(plot.x * plot.y.cos(), plot.x * plot.y.sin());
        let readings: Vec<_> = recording.plots.iter().map(|plot| plot.as_ref().map(place)).collect();
        let states = self.filter.windowed(&readings, STRIDE);
        let read = |state: Option<Vector4<f64>>| StepEstimate {
            mean: state.unwrap_or(Vector4::repeat(f64::NAN)),
            covariance: None,
            manoeuvres: None,
        };
        Ok(states.into_iter().map(read).collect())
    }
}
