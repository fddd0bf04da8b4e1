//! Neural IMM: a bank of turns whose mixture is corrected by a recurrent network.

mod hyper;
mod network;
mod outlook;

use std::sync::Arc;

use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use tercel_core::association::{Region, Search};
use tercel_core::belief::Gaussian;
use tercel_core::error::FilterError;
use tercel_core::filter::{Estimate, Extended, Filter, Imm, ImmBelief, Innovation, TurnBank};
use tercel_core::motion::{AccelerationNoise, Turn};
use tercel_core::sensor::{Measurement, Sensor};

use super::memory::{Memory, share};
use hyper::{CORRECTIONS, SCALES};

pub use hyper::{NeuralImmHyper, Recurrence};
pub use network::BankNetwork;
pub use outlook::Outlook;

/// The kind of these models in their cards.
const KIND: &str = "neural-imm";

/// The state for which they are made.
const LABELS: [&str; 4] = ["x", "y", "vx", "vy"];

/// Estimates position and velocity in the plane with a wide bank of turns, whose mode probabilities, mean and covariance a small
/// recurrent network corrects from what the bank says before and after each measurement.
///
/// ## Recursion
/// The bank of [`NeuralImmHyper::bank`] runs as it would alone. With its probabilities `μⱼ` of the turn rates and their states `xⱼ`,
/// its mean `x` and covariance `P = L Lᵀ` in the frame of the line of sight, and the network `g` with memory `m`:
/// ```text
/// predict   as the bank; the last a, d, s hold on
/// update    as the bank; then (a, d, s), m' = g(ln μ before and after, innovation, spread, range, ..; m)
/// estimate  μ'ⱼ = softmax(ln μⱼ + aⱼ)      x' = Σ μ'ⱼ xⱼ + L d      P' = D P D,  D = diag(e^s₁, e^s₁, e^s₂, e^s₂)
/// ```
/// The corrections do not flow back into the bank, so nothing that the network does can make it diverge, and a network that gives
/// zero is the bank. Where its outputs are not finite, the bank's estimate stands.
///
/// A missing measurement is a prediction: the network does not step, and learns at the next measurement how long it waited.
/// Mixing ([`set_state`](Filter::set_state)) gives every filter of the bank the state and forgets the corrections of mean and
/// covariance; merging takes the means of corrections and memories. Likelihoods and gates are those of the bank.
///
/// ## Use it when
/// there is a model trained for such targets, and about this time between scans. It tells how noisy the flight is, how far the
/// probabilities of the bank may be trusted, and what lies between its turn rates, all of which a bank alone must assume.
///
/// ## Reference
/// Ours. The bank is Blom and Bar-Shalom (1988). That a network corrects a mixture of model-based filters from their own evidence is the
/// idea of the AttEnsKNets paper.
///
/// ```
/// use std::sync::Arc;
/// use tercel_core::{filter::Filter, sensor::{Measurement, RangeBearing}};
/// use tercel_neural::filter::{BankNetwork, NeuralImm, NeuralImmHyper};
/// use tercel_neural::{Card, Model, Tensor};
///
/// // A network that gives zero: the bank alone. Others come from `Model::open`.
/// let hyper = NeuralImmHyper { hidden: 8, ..NeuralImmHyper::default() };
/// let mut card = Card::new("zero", "neural-imm", &["x", "y", "vx", "vy"]);
/// card.hyper = hyper.to_table().unwrap();
/// let zeros = |shape: Vec<usize>| Tensor { values: vec![0.0; shape.iter().product()], shape };
/// let tensors = hyper.tensors().into_iter().map(|(name, shape)| (name, zeros(shape))).collect();
/// let network = Arc::new(BankNetwork::from_model(&Model::new(card, tensors)?)?);
///
/// // The accuracy is one of three that the filter finds out; one sensor alone would be a stated accuracy.
/// let radars = [0.2, 0.5, 0.9].map(|bearing: f64| RangeBearing::new(50.0, bearing.to_radians()).unwrap());
/// let filter = NeuralImm::new(network, &radars)?;
/// let mut belief = filter.birth(&[80_000.0, 0.30].into())?;
/// filter.predict(&mut belief, 1.0);
/// filter.update(&mut belief, &[80_150.0, 0.301].into())?;
/// assert_eq!(filter.estimate(&belief).modes.len(), 21);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct NeuralImm<S, const M: usize = 2> {
    network: Arc<BankNetwork>,
    bank: TurnBank,
    filter: Imm<Extended<Turn, S, M>>,
    origin: Vector2<f64>,
}

/// What a [`NeuralImm`] knows of one object.
#[derive(Debug, PartialEq)]
pub struct NeuralImmBelief {
    bank: ImmBelief<Gaussian<4>, 4>,
    /// What the bank says now, and what it said before the last measurement.
    outlook: Outlook,
    before: Outlook,
    memory: Memory,
    inputs: Vec<f32>,
    outputs: Vec<f32>,
    /// Time since the last measurement, s.
    waited: f64,
}

impl Clone for NeuralImmBelief {
    fn clone(&self) -> Self {
        NeuralImmBelief {
            bank: self.bank.clone(),
            outlook: self.outlook.clone(),
            before: self.before.clone(),
            memory: self.memory.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            waited: self.waited,
        }
    }

    fn clone_from(&mut self, source: &Self) {
        self.bank.clone_from(&source.bank);
        self.outlook.copy(&source.outlook);
        self.before.copy(&source.before);
        self.memory.clone_from(&source.memory);
        self.inputs.clone_from(&source.inputs);
        self.outputs.clone_from(&source.outputs);
        self.waited = source.waited;
    }
}

impl NeuralImmBelief {
    /// What the bank says, without the network.
    pub fn outlook(&self) -> &Outlook {
        &self.outlook
    }

    /// What the network saw at the last measurement.
    pub fn inputs(&self) -> &[f32] {
        &self.inputs
    }

    /// What the network answered: a logit for each turn rate, four corrections, two logarithms of scales.
    pub fn outputs(&self) -> &[f32] {
        &self.outputs
    }
}

/// The standard deviation of a step's acceleration, m/s², that a noise stands for over a second.
fn deviation(noise: AccelerationNoise) -> f64 {
    match noise {
        AccelerationNoise::Piecewise(deviation) | AccelerationNoise::Jump(deviation) => deviation,
        AccelerationNoise::White(density) => density.sqrt(),
    }
}

impl<S: Clone, const M: usize> NeuralImm<S, M> {
    /// A filter of this network for a sensor at the origin, whose accuracy is one of those of `sensors`. Of measurements that
    /// state their accuracy, one sensor is enough.
    ///
    /// # Errors
    /// When there is no sensor.
    pub fn new(network: Arc<BankNetwork>, sensors: &[S]) -> Result<Self, FilterError> {
        let bank = network.hyper().bank()?;
        let filter = bank.estimating(sensors)?;
        Ok(NeuralImm { network, bank, filter, origin: Vector2::zeros() })
    }

    /// Sets the standard deviation of a new object's velocity, m/s per axis. That of the training is the default.
    ///
    /// # Errors
    /// Unless it is positive and finite.
    pub fn with_speed(self, speed: f64) -> Result<Self, FilterError> {
        let bank = self.bank.with_speed(FilterError::positive("speed of a new object", speed)?);
        let modes = bank.rates().len() * bank.noises().len();
        let sensors = self.filter.filters().iter().step_by(modes).map(|filter| filter.sensor.clone());
        let filter = bank.estimating(&sensors.collect::<Vec<S>>())?;
        Ok(NeuralImm { bank, filter, ..self })
    }
}

impl<S, const M: usize> NeuralImm<S, M> {
    /// Says where the sensor stands, m.
    pub fn seen_from(self, origin: Vector2<f64>) -> Self {
        NeuralImm { origin, ..self }
    }

    /// The network.
    pub fn network(&self) -> &Arc<BankNetwork> {
        &self.network
    }

    /// The bank of turns.
    pub fn bank(&self) -> &TurnBank {
        &self.bank
    }

    /// Probabilities of straight flight, left turns and right turns.
    pub fn directions(&self, belief: &NeuralImmBelief) -> [f64; 3] {
        let mut directions = [0.0; 3];
        for (probability, rate) in self.corrected(belief).zip(self.bank.rates()) {
            let direction = if *rate == 0.0 { 0 } else { 1 + usize::from(*rate < 0.0) };
            directions[direction] += probability;
        }
        directions
    }

    /// The corrected probabilities of the turn rates.
    fn corrected<'a>(&self, belief: &'a NeuralImmBelief) -> impl Iterator<Item = f64> + 'a {
        let probabilities = belief.outlook.probabilities();
        let logits = probabilities.iter().zip(&belief.outputs).map(|(p, a)| p.ln() + f64::from(*a));
        let top = logits.clone().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = logits.clone().map(|logit| (logit - top).exp()).sum();
        logits.map(move |logit| (logit - top).exp() / sum)
    }
}

impl<S: Sensor<4, M>, const M: usize> NeuralImm<S, M> {
    fn look(&self, belief: &mut NeuralImmBelief) {
        let (modes, state) = (self.filter.mode_probabilities(&belief.bank), self.filter.state(&belief.bank));
        let origin = (!self.network.hyper().heading).then_some(&self.origin);
        belief.outlook.look(&self.bank, &belief.bank, modes, state, origin);
    }

    /// Where a measurement puts the object at the time when it was taken, the covariance of its error, and how unsure the bank is of the latter: the standard
    /// deviation of the logarithm of its trace.
    fn placed(
        &self,
        belief: &ImmBelief<Gaussian<4>, 4>,
        measurement: &Measurement<M>,
    ) -> Result<(Vector2<f64>, Matrix2<f64>, f64), FilterError> {
        let modes = self.filter.mode_probabilities(belief);
        let each = self.bank.rates().len() * self.bank.noises().len();
        let (mut place, mut noise) = (Vector2::zeros(), Matrix2::zeros());
        let (mut first, mut second) = (0.0, 0.0);
        let fresh = measurement.with_age(0.0);
        for (modes, filters) in modes.chunks(each).zip(self.filter.filters().chunks(each)) {
            let weight: f64 = modes.iter().sum();
            let born = filters[0].birth(&fresh)?;
            let own: Matrix2<f64> = born.covariance.fixed_view::<2, 2>(0, 0).into_owned();
            let size = own.trace().max(f64::MIN_POSITIVE).ln();
            place += born.mean.fixed_rows::<2>(0) * weight;
            noise += own * weight;
            first += weight * size;
            second += weight * size * size;
        }
        Ok((place, noise, (second - first * first).max(0.0).sqrt()))
    }

    /// Writes what the network sees of an update.
    fn see(
        &self,
        belief: &mut NeuralImmBelief,
        measurement: &Measurement<M>,
        nis: f64,
    ) -> Result<(), FilterError> {
        let (place, noise, unsure) = self.placed(&belief.bank, measurement)?;
        let NeuralImmBelief { outlook, before, inputs, waited, .. } = belief;
        let seen = before.state().moved_on(2, -measurement.age).mean;
        let off = place - seen.fixed_rows::<2>(0);
        let off = before.turned(&Vector4::new(off.x, off.y, 0.0, 0.0));
        let turn = outlook.turn();
        let sight = turn.fixed_view::<2, 2>(0, 0);
        let noise = sight * noise * sight.transpose();
        let (prior, posterior) = (before.root(), outlook.root());
        let spread = |root: &Matrix4<f64>, row: usize| root.row(row).norm().max(1e-9);
        let expected = |row: usize| spread(prior, row).hypot(noise[(row, row)].max(0.0).sqrt());
        let velocity = outlook.turned(&outlook.state().mean);
        let metre = self.network.hyper().unit;
        let ln = |value: f64, unit: f64| (value.max(1e-9 * unit) / unit).ln();
        let length = |value: f64, unit: f64| ln(value, unit * metre);
        let features = [
            (off[0] / expected(0)).asinh(),
            (off[1] / expected(1)).asinh(),
            nis.max(0.0).ln_1p(),
            length(noise[(0, 0)].max(0.0).sqrt(), 50.0),
            length(noise[(1, 1)].max(0.0).sqrt(), 1e3),
            length(spread(posterior, 0), 100.0),
            length(spread(posterior, 1), 300.0),
            length(spread(posterior, 2), 50.0),
            length(spread(posterior, 3), 50.0),
            length(spread(prior, 1), 300.0),
            velocity[2] / (300.0 * metre),
            velocity[3] / (300.0 * metre),
            length(velocity[2].hypot(velocity[3]), 300.0),
            length(outlook.range(), 100e3),
            ln(*waited, 1.0),
            unsure,
            outlook.acceleration() / (10.0 * metre) - 1.0,
        ];
        let shares = before.probabilities().iter().chain(outlook.probabilities());
        let shares = shares.map(|share| (share.ln().max(-12.0) + 4.0) / 4.0);
        for (input, value) in inputs.iter_mut().zip(shares.chain(features)) {
            *input = value as f32;
        }
        Ok(())
    }
}

impl<S: Sensor<4, M> + Clone, const M: usize> Filter<4> for NeuralImm<S, M> {
    type Belief = NeuralImmBelief;
    type Measurement = Measurement<M>;

    fn birth(&self, measurement: &Measurement<M>) -> Result<NeuralImmBelief, FilterError> {
        let hyper = self.network.hyper();
        let outlook = Outlook::new(hyper.rates.len());
        let mut belief = NeuralImmBelief {
            bank: self.filter.birth(measurement)?,
            before: outlook.clone(),
            outlook,
            memory: Memory::new(&vec![0.0; self.network.memory()], self.network.scratch()),
            inputs: vec![0.0; hyper.inputs()],
            outputs: vec![0.0; hyper.outputs()],
            waited: 0.0,
        };
        self.look(&mut belief);
        Ok(belief)
    }

    fn predict(&self, belief: &mut NeuralImmBelief, dt: f64) {
        self.filter.predict(&mut belief.bank, dt);
        belief.waited += dt;
        self.look(belief);
    }

    fn update(
        &self,
        belief: &mut NeuralImmBelief,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        let innovation = self.filter.update(&mut belief.bank, measurement)?;
        let NeuralImmBelief { outlook, before, .. } = belief;
        before.copy(outlook);
        self.look(belief);
        // The bank has taken the measurement, so it says where it is.
        if self.see(belief, measurement, innovation.nis).is_ok() {
            let (memory, scratch) = belief.memory.stage();
            self.network.step(&belief.inputs, memory, scratch, &mut belief.outputs);
            if belief.outputs.iter().all(|value| value.is_finite()) {
                belief.memory.commit();
            } else {
                belief.outputs.fill(0.0);
            }
        }
        belief.waited = 0.0;
        Ok(innovation)
    }

    fn innovation(
        &self,
        belief: &NeuralImmBelief,
        measurement: &Measurement<M>,
    ) -> Result<Innovation, FilterError> {
        self.filter.innovation(&belief.bank, measurement)
    }

    fn state(&self, belief: &NeuralImmBelief) -> Gaussian<4> {
        let outlook = &belief.outlook;
        let rest = &belief.outputs[outlook.probabilities().len()..];
        let correction = Vector4::from_fn(|i, _| f64::from(rest[i]));
        let mut offset = outlook.root() * correction;
        for (probability, own) in self.corrected(belief).zip(outlook.offsets()) {
            offset += own * probability;
        }
        let scale = |i: usize| f64::from(rest[CORRECTIONS + i * SCALES / 4]).exp();
        let root = Matrix4::from_diagonal(&Vector4::from_fn(|i, _| scale(i))) * outlook.root();
        let root = outlook.turn().transpose() * root;
        let covariance = root * root.transpose();
        Gaussian {
            mean: outlook.state().mean + outlook.turned_back(&offset),
            covariance: 0.5 * (covariance + covariance.transpose()),
        }
    }

    fn set_state(&self, belief: &mut NeuralImmBelief, state: &Gaussian<4>) {
        self.filter.set_state(&mut belief.bank, state);
        let rates = belief.outlook.probabilities().len();
        belief.outputs[rates..].fill(0.0);
        self.look(belief);
    }

    fn merge(&self, belief: &mut NeuralImmBelief, weight: f64, other: &NeuralImmBelief, other_weight: f64) {
        self.filter.merge(&mut belief.bank, weight, &other.bank, other_weight);
        belief.memory.merge(weight, &other.memory, other_weight);
        let share = share(weight, other_weight);
        for (ours, theirs) in belief.outputs.iter_mut().zip(&other.outputs) {
            *ours += (theirs - *ours) * share as f32;
        }
        belief.waited += (other.waited - belief.waited) * share;
        self.look(belief);
    }

    fn estimate(&self, belief: &NeuralImmBelief) -> Estimate<4> {
        let Gaussian { mean, covariance } = self.state(belief);
        Estimate { mean, covariance, modes: self.corrected(belief).collect(), extent: None }
    }

    fn reach(&self, belief: &NeuralImmBelief, search: &Search) -> Option<Region> {
        self.filter.reach(&belief.bank, search)
    }

    fn widen(&self, search: &mut Search, measurement: &Measurement<M>) {
        search.widen(measurement);
    }

    fn place(&self, measurement: &Measurement<M>) -> Option<Vector2<f64>> {
        self.filter.place(measurement)
    }

    fn area(&self, measurement: &Measurement<M>) -> f64 {
        self.filter.area(measurement)
    }
}
