//! Ensembles of KalmanNets: states of several motions, corrected and weighed by two recurrent branches.

mod attention;
mod belief;
mod features;
mod hyper;
mod network;
mod offline;

use std::sync::Arc;

use nalgebra::{Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Estimate, Extended, Filter, Innovation};
use tercel_core::motion::{Motion, Turn};
use tercel_core::sensor::{Aged, LinearSensor, Measurement, Sensor};

use super::kalman_net::{KalmanNet, LABELS};
use super::present;
use crate::error::ModelError;
use belief::Mode;
use features::{Scene, Sight};
use hyper::STATE;

pub use belief::{EnsKNetsBelief, Evidence};
pub use hyper::{Attention, BranchHyper, EnsKNetsHyper, Normalisation, Sign};
pub use network::EnsembleNetwork;
pub use offline::OfflineEnsKNets;

/// The kind of these models in their cards.
const KIND: &str = "ens-knets";

/// Estimates position and velocity in the plane with several [`KalmanNet`]s, each for a turn rate of its own,
/// whose states a recurrent branch corrects and another one weighs. With attention to innovations it is
/// AttEnsKNets, without it EnsKNets.
///
/// ## Recursion
/// With the states `xᵐ`, innovations `νᵐ` and their covariances `Sᵐ` of the KalmanNets, and the branches `c`
/// and `p`:
/// ```text
/// predict   each KalmanNet; the correction δᵐ ← Fᵐ δᵐ; weights w ← w Π if they go on
/// update    each KalmanNet
///           NISᵐ = νᵐᵀ (Sᵐ)⁻¹ νᵐ                        w = softmaxₘ(-NISᵐ/2 - ln|Sᵐ|/2)          xᶜ = Σ wᵐ xᵐ
///           attention       δ = c(xᶜ),  p = softmax p(xᶜ)
///           no attention    δ = c(x¹, .., xᴹ),  p = softmax p(z)
/// estimate  x = Σ pᵐ (xᵐ + δᵐ)                          P = Σ pᵐ (Pᵐ + (xᵐ + δᵐ - x)(xᵐ + δᵐ - x)ᵀ)
/// ```
/// [`EnsKNetsHyper`] says whether there is attention and of which form, which branches there are, and what
/// they see: with [`Normalisation::Relative`], in the place of `xᶜ`, the differences between the KalmanNets,
/// their innovations, the weights, and how far and how accurately the object is seen. Without a correction
/// branch `δ` is zero, without a classification branch all `p` are alike. What flows into the KalmanNets are
/// measurements alone, so no branch can make them diverge; a branch whose outputs are not finite is not
/// heard.
///
/// A missing measurement is a prediction: the branches do not step, weights and probabilities hold on, and a
/// corrected state is predicted as any other. Two measurements at one time are two steps of the branches.
/// Likelihoods and gates are those of the mixture of the corrected states. Mixing
/// ([`set_state`](Filter::set_state)) gives every KalmanNet the state and forgets the corrections; merging
/// keeps the moments and takes the means of corrections and memories.
///
/// ## Use it when
/// there is a model trained for such objects, and about this time between measurements. The covariance says
/// how far the KalmanNets are apart; it does not know how good the branches are.
/// [`NeuralImm`](super::NeuralImm) corrects a bank of Kalman filters in the place of KalmanNets, and is the
/// better choice where noises are known.
///
/// ## Reference
/// "Ensemble of KalmanNets with innovation-based attention for robust target tracking", equations 10 to 14.
/// Deviations: the sign of equation 13, which as printed prefers the worst motion ([`Sign`]); a factor of one
/// half, and the determinants; normalisation that knows the past alone; relative inputs, temperature and
/// weights that go on are ours. Models choose.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, sensor::ConvertedPolar};
/// use tercel_neural::filter::{Architecture, EnsKNets, EnsKNetsHyper, EnsembleNetwork, KalmanNetHyper};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // Branches and nets that give zero, beside the gain of an alpha-beta filter. Others come from `Model::open`.
/// let mut net = KalmanNetHyper::paper(Architecture::two());
/// net.gain_offset = Some([[0.5, 0.0], [0.0, 0.5], [0.2, 0.0], [0.0, 0.2]]);
/// let hyper = EnsKNetsHyper::att_ens_knets(vec![net; 3]);
/// let mut card = Card::new("zero", "ens-knets", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// card.scales = EnsKNetsHyper::default_scales();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(EnsembleNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// let filter = EnsKNets::new(network, ConvertedPolar::new(50.0, 0.0005)?)?;
/// let mut belief = filter.birth(&[80_000.0, 0.30].into())?;
/// for second in 1..=20 {
///     filter.predict(&mut belief, 1.0);
///     filter.update(&mut belief, &[80_000.0 + 250.0 * f64::from(second), 0.30].into())?;
/// }
/// assert_eq!(filter.estimate(&belief).modes, [1.0 / 3.0; 3]);
/// // It flies straight away from the radar, so straight flight explains it best.
/// let weights: Vec<f64> = belief.weights().collect();
/// assert!(weights[0] > weights[1] && weights[0] > weights[2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct EnsKNets<S> {
    network: Arc<EnsembleNetwork>,
    motions: Vec<Turn>,
    nets: Vec<KalmanNet<Turn, S>>,
    sensor: S,
    origin: Vector2<f64>,
}

impl<S: Clone> EnsKNets<S> {
    /// A filter of these networks for this sensor, which stands at the origin.
    ///
    /// # Errors
    /// When the network needs the whole track ([`Normalisation::Sequence`]).
    pub fn new(network: Arc<EnsembleNetwork>, sensor: S) -> Result<Self, ModelError> {
        if network.hyper().normalisation == Normalisation::Sequence {
            let reason = "`normalisation` is `sequence`, which needs the whole track; a filter needs `running` or \
                          `relative`, and `OfflineEnsKNets` judges recorded tracks";
            return Err(ModelError::Hyper { file: network.file().clone(), reason: reason.into() });
        }
        Ok(EnsKNets::unchecked(network, sensor))
    }

    fn unchecked(network: Arc<EnsembleNetwork>, sensor: S) -> Self {
        let hyper = network.hyper();
        let motions: Vec<Turn> = hyper.rates.iter().map(|rate| hyper.motion(*rate)).collect();
        let nets = motions.iter().zip(network.nets());
        let nets = nets.map(|(motion, net)| KalmanNet::new(net.clone(), *motion, sensor.clone())).collect();
        EnsKNets { network, motions, nets, sensor, origin: Vector2::zeros() }
    }

    /// Says where the sensor stands, m.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        let nets = self.nets.into_iter().map(|net| net.seen_from(origin)).collect();
        EnsKNets { nets, origin, ..self }
    }
}

impl<S> EnsKNets<S> {
    /// The networks.
    pub fn network(&self) -> &Arc<EnsembleNetwork> {
        &self.network
    }

    /// Probabilities of straight flight, left turns and right turns.
    pub fn directions(&self, belief: &EnsKNetsBelief) -> [f64; 3] {
        let mut directions = [0.0; 3];
        for (probability, motion) in belief.probabilities().zip(&self.motions) {
            let direction = if motion.rate() == 0.0 { 0 } else { 1 + usize::from(motion.rate() < 0.0) };
            directions[direction] += probability;
        }
        directions
    }
}

impl<S: LinearSensor<4, 2>> EnsKNets<S> {
    /// The state of each KalmanNet, without correction.
    pub fn net_states(&self, belief: &EnsKNetsBelief) -> impl ExactSizeIterator<Item = Gaussian<4>> {
        belief.modes.iter().zip(&self.nets).map(|(mode, net)| net.state(&mode.net))
    }

    /// The corrected state of each KalmanNet, with its probability.
    fn corrected(&self, belief: &EnsKNetsBelief) -> impl ExactSizeIterator<Item = (f64, Gaussian<4>)> {
        belief.modes.iter().zip(&self.nets).map(|(mode, net)| {
            let Gaussian { mean, covariance } = net.state(&mode.net);
            (mode.probability, Gaussian { mean: mean + mode.correction, covariance })
        })
    }

    fn classical(&self, mode: usize) -> Extended<&Turn, &S> {
        Extended::new(&self.motions[mode], &self.sensor)
    }

    /// Lets a copy of each KalmanNet take the measurement.
    fn follow(&self, belief: &mut EnsKNetsBelief, measurement: &Measurement<2>) -> Result<(), FilterError> {
        let sensor = Aged::new(&self.sensor, measurement.age);
        for ((next, mode), net) in belief.next.iter_mut().zip(&belief.modes).zip(&self.nets) {
            next.copy(mode);
            let before = net.state(&next.net);
            let innovation = net.update(&mut next.net, measurement)?;
            let jacobian = sensor.jacobian(&before.mean);
            let noise = sensor.read(measurement, Some(&sensor.expected(&before.mean)))?.noise;
            next.evidence = Evidence {
                state: net.state(&next.net).mean,
                residual: Vector2::new(innovation.residual()[0], innovation.residual()[1]),
                spread: jacobian * before.covariance * jacobian.transpose() + noise,
                nis: innovation.nis,
                log_likelihood: innovation.log_likelihood,
            };
        }
        Ok(())
    }

    /// Lets the branches see what the copies of the KalmanNets made of the measurement.
    fn think(&self, belief: &mut EnsKNetsBelief, measurement: &Measurement<2>) -> Result<(), FilterError> {
        let EnsKNetsBelief { next: modes, memory, features, inputs, outputs, waited, anchor, .. } = belief;
        let (mut mean, mut attended, mut total) = (Vector4::zeros(), Vector4::zeros(), 0.0);
        for mode in modes.iter() {
            mean += mode.evidence.state / modes.len() as f64;
            attended += mode.evidence.state * mode.weight;
            total += mode.weight;
        }
        let scene = Scene {
            modes,
            mean,
            attended: attended / total,
            reading: present(&self.sensor, measurement, &mean)?,
            noise: self.sensor.read(measurement, Some(&self.sensor.expected(&mean)))?.noise,
            origin: self.origin,
            anchor: *anchor,
            waited: *waited,
            scales: self.network.scales(),
        };
        let (hyper, sight) = (self.network.hyper(), scene.sight());
        scene.features(hyper, features);
        let (next, scratch) = memory.stage();
        self.network.step(features, next, scratch, inputs, outputs);
        if outputs.iter().all(|value| value.is_finite()) {
            memory.commit();
        } else {
            outputs.fill(0.0);
        }
        self.answer(outputs, &sight, modes);
        Ok(())
    }

    /// Turns outputs of the branches into corrections and probabilities.
    fn answer(&self, outputs: &[f32], sight: &Sight, modes: &mut [Mode]) {
        let hyper = self.network.hyper();
        let corrections = if hyper.correction.is_some() { STATE * modes.len() } else { 0 };
        let (corrections, logits) = outputs.split_at(corrections);
        let [position, velocity] = self.network.scales();
        for (mode, row) in modes.iter_mut().zip(corrections.as_chunks::<STATE>().0) {
            let [x, y, vx, vy] = row.map(f64::from);
            let correction = Vector4::new(x * position, y * position, vx * velocity, vy * velocity);
            let relative = hyper.normalisation == Normalisation::Relative;
            mode.correction = if relative { sight.turned_back(&correction) } else { correction };
        }
        let top = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let share = |logit: &f32| f64::from(logit - top).exp();
        let sum: f64 = logits.iter().map(share).sum();
        for (mode, logit) in modes.iter_mut().zip(logits) {
            mode.probability = share(logit) / sum;
        }
    }
}

impl<S: LinearSensor<4, 2>> Filter<4> for EnsKNets<S> {
    type Belief = EnsKNetsBelief;
    type Measurement = Measurement<2>;

    fn birth(&self, measurement: &Measurement<2>) -> Result<EnsKNetsBelief, FilterError> {
        let modes: Result<Vec<Mode>, FilterError> = self
            .nets
            .iter()
            .map(|net| {
                let born = net.birth(measurement)?;
                let state = net.state(&born).mean;
                Ok(Mode::new(born, state, self.nets.len()))
            })
            .collect();
        let place = self.sensor.read(measurement, None)?.value;
        Ok(EnsKNetsBelief::new(&self.network, modes?, place))
    }

    fn predict(&self, belief: &mut EnsKNetsBelief, dt: f64) {
        if dt == 0.0 {
            return;
        }
        for ((mode, net), motion) in belief.modes.iter_mut().zip(&self.nets).zip(&self.motions) {
            net.predict(&mut mode.net, dt);
            // The motion is linear: the prediction of a corrected state is that of the state and that of the
            // correction.
            mode.correction = motion.transition(&mode.correction, dt);
        }
        if let Some(attention) = &self.network.hyper().attention {
            attention.wait(&mut belief.modes, dt);
        }
        belief.waited += dt;
    }

    fn update(
        &self,
        belief: &mut EnsKNetsBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        let innovation = self.innovation(belief, measurement)?;
        self.follow(belief, measurement)?;
        if let Some(attention) = &self.network.hyper().attention {
            attention.weigh(&mut belief.next, &mut belief.level);
        }
        self.think(belief, measurement)?;
        std::mem::swap(&mut belief.modes, &mut belief.next);
        belief.waited = 0.0;
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &EnsKNetsBelief,
        measurement: &Measurement<2>,
    ) -> Result<Innovation, FilterError> {
        let mut residual = Vector2::zeros();
        // Likelihoods are held relative to the largest so far, so that none of the relevant ones underflows.
        let (mut top, mut likelihood, mut nis) = (f64::NEG_INFINITY, 0.0, 0.0);
        for (index, (probability, state)) in self.corrected(belief).enumerate() {
            let own = self.classical(index).innovation(&state, measurement)?;
            residual += Vector2::new(own.residual()[0], own.residual()[1]) * probability;
            let weight = probability.ln() + own.log_likelihood;
            if weight > top {
                let shrink = (top - weight).exp();
                (likelihood, nis) = (likelihood * shrink + 1.0, nis * shrink + own.nis);
                top = weight;
            } else if top > f64::NEG_INFINITY && (weight - top).exp() > 0.0 {
                let share = (weight - top).exp();
                (likelihood, nis) = (likelihood + share, nis + share * own.nis);
            }
        }
        if top == f64::NEG_INFINITY {
            return Ok(Innovation::new(&residual, f64::INFINITY, top));
        }
        Ok(Innovation::new(&residual, nis / likelihood, top + likelihood.ln()))
    }

    fn state(&self, belief: &EnsKNetsBelief) -> Gaussian<4> {
        let mut merged: Option<(f64, Gaussian<4>)> = None;
        for (probability, state) in self.corrected(belief) {
            match &mut merged {
                None => merged = Some((probability, state)),
                Some((weight, merged)) => {
                    merged.merge(*weight, &state, probability);
                    *weight += probability;
                }
            }
        }
        // There is always a mode; without one nothing would be known.
        merged.map_or_else(|| self.motions[0].prior(), |(_, state)| state)
    }

    fn set_state(&self, belief: &mut EnsKNetsBelief, state: &Gaussian<4>) {
        for (mode, net) in belief.modes.iter_mut().zip(&self.nets) {
            net.set_state(&mut mode.net, state);
            mode.correction = Vector4::zeros();
        }
    }

    fn merge(&self, belief: &mut EnsKNetsBelief, weight: f64, other: &EnsKNetsBelief, other_weight: f64) {
        for (index, net) in self.nets.iter().enumerate() {
            let (ours, theirs) = (&mut belief.modes[index], &other.modes[index]);
            let shares = [weight * ours.probability, other_weight * theirs.probability];
            let corrected = |mode: &Mode| {
                let Gaussian { mean, covariance } = net.state(&mode.net);
                Gaussian { mean: mean + mode.correction, covariance }
            };
            // The moments to keep are those of the corrected states.
            let mut merged = corrected(ours);
            merged.merge(shares[0], &corrected(theirs), shares[1]);
            net.merge(&mut ours.net, shares[0], &theirs.net, shares[1]);
            let mean = net.state(&ours.net).mean;
            net.set_state(&mut ours.net, &Gaussian { mean, covariance: merged.covariance });
        }
        belief.merge_thoughts(&self.network, weight, other, other_weight);
    }

    fn estimate(&self, belief: &EnsKNetsBelief) -> Estimate<4> {
        let Gaussian { mean, covariance } = self.state(belief);
        Estimate { mean, covariance, modes: belief.probabilities().collect(), extent: None }
    }

    fn reach(&self, belief: &EnsKNetsBelief, search: &Search) -> Option<Region> {
        self.classical(0).reach(&self.state(belief), search)
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<2>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<2>) -> Option<Vector2<f64>> {
        self.sensor.place(measurement)
    }

    fn area(&self, measurement: &Measurement<2>) -> f64 {
        self.sensor.area(measurement)
    }
}
